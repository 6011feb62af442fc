"""Settings of peak extraction, by what they do to a picture of the signal."""

from dataclasses import dataclass

from pushfit.config.inputs import PeaksSection
from pushfit.data.peaks.heights import Definition
from pushfit.errors import ConfigError


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakSettings:
    """How pushes are found and measured; the defaults suit most recordings.

    Args:
        channel: Channel that shows the pushes; None takes the only one there is.
        normal: Force channel along the contact normal ("-fz" where pushing makes it
            fall). Heights are then normal and tangential ones, of all channels.
        invert: Turns the picture upside down: pushes that dip are found as humps.
        signed: Whether pushes may go either way from rest; heights of dips are
            negative. None looks for dips only where a schedule has pushes with
            theta < 0 that no hump answers to.
        height: `apex` takes the top of each hump, `plateau` the level that is held;
            `auto` takes what most pushes of the recording look like.
        min_height: Humps lower than this are not pushes, all others are; None leaves
            out what noise, or a brush far smaller than the other pushes, explains
            [unit of the channel].
        split: Two humps are two pushes if the signal falls between them below this
            share of the lower one; at 0 every return to rest is needed, towards 1
            each hump is a push.
        smoothing: Time over which the signal is averaged to look for humps, not to
            measure them; None takes a tenth of a push [s].
        limit: Reading at which the sensor ends: pushes that reach it are saturated;
            None recognises a limit by samples that pile up at the largest reading
            [unit of the channel].
        exclude: Windows of time whose humps are no pushes [s].
        include: Windows of time whose humps are pushes, however small [s].
        begin: Time before which samples are left out; None takes them from the first
            [s].
        end: Time after which samples are left out [s].
        use_missing: Whether heights at the moments of missing pushes go into a fit.
        allow_missing: Whether to go on with the likeliest assignment to the schedule
            where another is nearly as likely.
    """

    channel: str | None = None
    normal: str | None = None
    invert: bool = False
    signed: bool | None = None
    height: Definition = "auto"
    min_height: float | None = None
    split: float = 0.41
    smoothing: float | None = None
    limit: float | None = None
    exclude: tuple[tuple[float, float], ...] = ()
    include: tuple[tuple[float, float], ...] = ()
    begin: float | None = None
    end: float | None = None
    use_missing: bool = False
    allow_missing: bool = False

    def __post_init__(self) -> None:
        """Refuse settings outside their range."""
        if not 0.0 < self.split < 1.0:
            raise ConfigError(
                f"peaks.split = {self.split:g} is outside (0, 1); 0.41 is usual",
                code="peak_settings",
            )
        for name in ("exclude", "include"):
            for first, last in getattr(self, name):
                if not first < last:
                    raise ConfigError(
                        f"peaks.{name} = [[{first:g}, {last:g}]] ends before it "
                        "begins; give the earlier time first",
                        code="peak_settings",
                    )
        for name in ("min_height", "smoothing"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise ConfigError(
                    f"peaks.{name} = {value:g} must be above 0; leave it out to have "
                    "it judged by the recording",
                    code="peak_settings",
                )

    @classmethod
    def of(cls, stated: "PeakSettings | PeaksSection") -> "PeakSettings":
        """Settings as they are, or as `[peaks]` of a configuration states them."""
        if isinstance(stated, PeakSettings):
            return stated
        return cls(**stated.model_dump())
