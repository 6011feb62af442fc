"""How recordings are laid out and how pushes are found in them.

Excluded: the readers and the search that it steers (`pushfit.data`).
"""

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from pushfit.config.section import Number, Positive, Probability, Section, setting
from pushfit.parameters import SensorUnit

Format = Literal[
    "auto", "native", "rostopic", "plotjuggler", "mcapcsv", "ros2csv", "bag"
]
ThetaFrom = Literal["tangential", "normal"]
Gaps = Literal["error", "split", "interpolate"]
Tail = Literal["drop", "keep", "error", "salvage"]
Definition = Literal["auto", "apex", "plateau"]


class CalibrationSection(Section):
    """How the samples of one channel convert, and who says so."""

    name: Literal["biotac_pdc"] | None = setting("a calibration that pushfit knows")
    source_unit: SensorUnit | None = setting("unit of the samples")
    target_unit: SensorUnit | None = setting("unit wanted")
    factor: Positive | None = setting("target units for one source unit")
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
            raise ValueError(
                "a factor of your own needs its provenance; say where it comes from, "
                'as in provenance = "data sheet"'
            )
        return self


class RecordingSection(Section):
    """How recordings are laid out, where the file itself does not say."""

    format: Format = setting(
        "dialect; `pushfit validate` names the one found", default="auto"
    )
    columns: tuple[str, ...] = setting(
        "column names in order, for files without a header",
        default=(),
        example=["time_s", "pressure_counts"],
    )
    rate: Positive | None = setting(
        "samples per second, in place of a column of times [Hz]", example=125.0
    )
    map: dict[str, str] = setting(
        "column of each channel, and of time, theta and alpha",
        default={},
        example={"pressure": "pdc"},
    )
    unit: dict[str, str] = setting(
        "unit of each channel or column whose name states none",
        default={},
        example={"pressure": "counts"},
    )
    calibration: dict[str, CalibrationSection] = setting(
        'conversion of a channel: "biotac_pdc" is 0.0365 kPa per count, by '
        "SynTouch's manual; factor, source_unit and target_unit override it if "
        "provenance is stated",
        default={},
        example={"pressure": {"name": "biotac_pdc"}},
    )
    definitions: str | None = setting(
        "folder of .msg files, for ROS 2 bags that carry no definitions",
        example="src/biotac_sensors",
    )
    theta_from: ThetaFrom = setting(
        'what a recorded theta is measured from; "normal": 90 deg - it',
        default="tangential",
    )
    gaps: Gaps = setting("what to do where samples are missing", default="error")
    tail: Tail = setting(
        "what to do with a last line that may have been cut off; salvage "
        "also drops zero bytes, and reads what there is of a cut .mcap file",
        default="drop",
    )
    missing: tuple[str, ...] = setting(
        "texts that stand for a missing sample", default=(), example=["-3.697314E28"]
    )
    encoding: str | None = setting("text encoding; absent: UTF-8", example="latin-1")
    trust_units: bool = setting(
        "true: accept units that look implausible", default=False
    )
    max_bytes: Annotated[int, Field(strict=True, gt=0)] = setting(
        "most memory that the samples may take [bytes]", default=1 << 30
    )


class PeakSettings(Section):
    """How the height of each push is taken from a recording."""

    channel: str | None = setting(
        "channel that shows the pushes; absent: the only one", example="pressure"
    )
    normal: str | None = setting(
        'force channel along the contact normal, "-fz" where pushing '
        "lowers it; heights are then normal and tangential ones of all channels",
        example="-fz",
    )
    invert: bool = setting("true: pushes go downwards", default=False)
    signed: Annotated[bool, Field(strict=True)] | None = setting(
        "whether pushes may go either way from rest; absent: only where "
        "the schedule has theta < 0 and no hump answers to it",
        example=True,
    )
    height: Definition = setting(
        '"apex" (pointed), "plateau" (held) or "auto" (by the shape)', default="auto"
    )
    min_height: Positive | None = setting(
        "smallest height of a push [unit of the column]; absent: judged "
        "by the noise and the other pushes",
        example=5.0,
    )
    split: Probability = setting(
        "two humps are two pushes if the signal falls between them below "
        "this share of the lower one",
        default=0.4,
    )
    smoothing: Positive | None = setting(
        "averaging time for finding humps [s]; absent: a tenth of a push", example=0.1
    )
    limit: Number | None = setting(
        "reading at which the sensor ends [unit of the column]; absent: "
        "recognised by samples that pile up there",
        example=4095,
    )
    exclude: tuple[tuple[Number, Number], ...] = setting(
        "windows of time whose humps are no pushes [s]",
        default=(),
        example=[[12.0, 13.5]],
    )
    include: tuple[tuple[Number, Number], ...] = setting(
        "windows of time whose humps are pushes, however small [s]",
        default=(),
        example=[[40.0, 42.0]],
    )
    begin: Number | None = setting("time to begin at [s]", example=2.0)
    end: Number | None = setting("time to end at [s]", example=118.0)
    use_missing: bool = setting(
        "true: a planned push without a hump goes into the fit with the "
        "height at its moment",
        default=False,
    )
    allow_missing: bool = setting(
        "true: go on with the likeliest assignment to the schedule where "
        "another is nearly as likely",
        default=False,
    )

    @field_validator("exclude", "include")
    @classmethod
    def _ends_after_it_begins(
        cls, windows: tuple[tuple[float, float], ...]
    ) -> tuple[tuple[float, float], ...]:
        for first, last in windows:
            if not first < last:
                raise ValueError(
                    f"[{first:.15g}, {last:.15g}] ends before it begins; give the "
                    "earlier time first"
                )
        return windows
