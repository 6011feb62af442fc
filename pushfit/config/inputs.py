"""How recordings are laid out and how pushes are found in them."""

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from pushfit.config.section import Number, Positive, Probability, Section

SensorUnit = Literal["n", "kpa", "counts", "au"]


class CalibrationSection(Section):
    """How the samples of one channel convert, and who says so."""

    name: Literal["biotac_pdc"] | None = Field(
        default=None, description="a calibration that pushfit knows"
    )
    source_unit: SensorUnit | None = Field(
        default=None, description="unit of the samples"
    )
    target_unit: SensorUnit | None = Field(default=None, description="unit wanted")
    factor: Positive | None = Field(
        default=None, description="target units for one source unit"
    )
    provenance: str | None = Field(
        default=None, min_length=1, description="where the factor comes from"
    )

    @model_validator(mode="after")
    def check_whole(self) -> "CalibrationSection":
        """Refuse a conversion that is not said, or said by nobody."""
        own = self.model_dump(exclude={"name"})
        lacking = [key for key, value in own.items() if value is None]
        if self.name is None and lacking:
            raise ValueError(f"needs a name, or also {', '.join(lacking)}")
        if self.factor is not None and self.provenance is None:
            raise ValueError("a factor of your own needs its provenance")
        return self


class RecordingSection(Section):
    """How recordings are laid out, where the file itself does not say."""

    format: Literal[
        "auto", "native", "rostopic", "plotjuggler", "mcapcsv", "ros2csv", "bag"
    ] = Field(
        default="auto", description="dialect; `pushfit validate` names the one found"
    )
    columns: tuple[str, ...] = Field(
        default=(),
        description="column names in order, for files without a header",
        examples=[["time_s", "pressure_counts"]],
    )
    rate: Positive | None = Field(
        default=None,
        description="samples per second, for recordings without a time [Hz]",
        examples=[125.0],
    )
    map: dict[str, str] = Field(
        default={},
        description="column of each channel, and of time, theta and alpha",
        examples=[{"pressure": "pdc"}],
    )
    unit: dict[str, str] = Field(
        default={},
        description="unit of each channel or column whose name states none",
        examples=[{"pressure": "counts"}],
    )
    calibration: dict[str, CalibrationSection] = Field(
        default={},
        description='conversion of a channel: "biotac_pdc" is 0.0365 kPa per count, by '
        "SynTouch's manual; factor, source_unit and target_unit override it if "
        "provenance is stated",
        examples=[{"pressure": {"name": "biotac_pdc"}}],
    )
    definitions: str | None = Field(
        default=None,
        description="folder of .msg files, for ROS 2 bags that carry no definitions",
        examples=["src/biotac_sensors"],
    )
    theta_from: Literal["tangential", "normal"] = Field(
        default="tangential",
        description='what a recorded theta is measured from; "normal": 90 deg - it',
    )
    gaps: Literal["error", "split", "interpolate"] = Field(
        default="error", description="what to do where samples are missing"
    )
    tail: Literal["drop", "keep", "error", "salvage"] = Field(
        default="drop",
        description="what to do with a last line that may have been cut off; salvage "
        "also drops zero bytes, and reads what there is of a cut .mcap file",
    )
    missing: tuple[str, ...] = Field(
        default=(),
        description="texts that stand for a missing sample",
        examples=[["-3.697314E28"]],
    )
    encoding: str | None = Field(
        default=None, description="text encoding; absent: UTF-8", examples=["latin-1"]
    )
    trust_units: bool = Field(
        default=False, description="true: accept units that look implausible"
    )
    max_bytes: Annotated[int, Field(strict=True, gt=0)] = Field(
        default=1 << 30, description="most memory that the samples may take [bytes]"
    )


class PeakSettings(Section):
    """How the height of each push is taken from a recording."""

    channel: str | None = Field(
        default=None,
        description="channel that shows the pushes; absent: the only one",
        examples=["pressure"],
    )
    normal: str | None = Field(
        default=None,
        description='force channel along the contact normal, "-fz" where pushing '
        "lowers it; heights are then normal and tangential ones of all channels",
        examples=["-fz"],
    )
    invert: bool = Field(default=False, description="true: pushes go downwards")
    signed: Annotated[bool, Field(strict=True)] | None = Field(
        default=None,
        description="whether pushes may go either way from rest; absent: only where "
        "the schedule has theta < 0 and no hump answers to it",
        examples=[True],
    )
    height: Literal["auto", "apex", "plateau"] = Field(
        default="auto",
        description='"apex" (pointed), "plateau" (held) or "auto" (by the shape)',
    )
    min_height: Positive | None = Field(
        default=None,
        description="smallest height of a push [unit of the channel]; absent: judged "
        "by the noise and the other pushes",
        examples=[5.0],
    )
    split: Probability = Field(
        default=0.4,
        description="two humps are two pushes if the signal falls between them below "
        "this share of the lower one",
    )
    smoothing: Positive | None = Field(
        default=None,
        description="averaging time for finding humps [s]; absent: a tenth of a push",
        examples=[0.1],
    )
    limit: Number | None = Field(
        default=None,
        description="reading at which the sensor ends [unit of the channel]; absent: "
        "recognised by samples that pile up there",
        examples=[4095],
    )
    exclude: tuple[tuple[Number, Number], ...] = Field(
        default=(),
        description="windows of time whose humps are no pushes [s]",
        examples=[[[12.0, 13.5]]],
    )
    include: tuple[tuple[Number, Number], ...] = Field(
        default=(),
        description="windows of time whose humps are pushes, however small [s]",
        examples=[[[40.0, 42.0]]],
    )
    begin: Number | None = Field(
        default=None, description="time to begin at [s]", examples=[2.0]
    )
    end: Number | None = Field(
        default=None, description="time to end at [s]", examples=[118.0]
    )
    use_missing: bool = Field(
        default=False,
        description="true: a planned push without a hump goes into the fit with the "
        "height at its moment",
    )
    allow_missing: bool = Field(
        default=False,
        description="true: go on with the likeliest assignment to the schedule where "
        "another is nearly as likely",
    )

    @field_validator("exclude", "include")
    @classmethod
    def _ends_after_it_begins(
        cls, windows: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        for first, last in windows:
            if not first < last:
                raise ValueError(
                    f"[{first:g}, {last:g}] ends before it begins; give the earlier "
                    "time first"
                )
        return windows
