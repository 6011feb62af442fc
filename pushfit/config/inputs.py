"""How recordings are laid out and how pushes are found in them."""

from typing import Literal

from pydantic import Field

from pushfit.config.section import Section


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
        "also drops zero bytes",
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


class PeaksSection(Section):
    """How the height of each push is taken from a recording."""

    channel: str | None = Field(
        default=None,
        description="channel that shows the pushes; absent: the only one",
        examples=["pressure"],
    )
    invert: bool = Field(default=False, description="true: pushes go downwards")
    height: Literal["auto", "apex", "plateau"] = Field(
        default="auto",
        description='"apex" (pointed), "plateau" (held) or "auto" (by the shape)',
    )
