"""From columns of samples to a recording: clock, gaps, plausibility.

The rules that any recording keeps, whether it came as text or as a bag. All problems
of one recording are found before any is raised.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float, Int, Shaped

from pushfit.data.faults import data_error, problem
from pushfit.data.gaps import MAX_FILLED_STEPS, fill_short_gaps
from pushfit.data.records import Recording, Source
from pushfit.data.units import Unit, implausible_angles, implausible_signal
from pushfit.errors import Problem

Gaps = Literal["error", "split", "interpolate"]
ThetaFrom = Literal["tangential", "normal"]

_MAX_LISTED = 10
# Tactile sensors sample at 10 Hz to 10 kHz.
_MAX_STEP_S, _MIN_STEP_S = 1e3, 1e-6
# A step is irregular when it is off the median by more than half of it.
_IRREGULAR_SHARE = 0.05
_LONG_STEP = 10.0
_SENTINEL = 1e20
# Angles are recorded with few decimals, so a right angle may be passed by rounding.
_ANGLE_SLACK = np.deg2rad(0.01)


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Columns of one recording as read, in the units of the file.

    Args:
        path: File as the user named it.
        time: Sample times, in `time_unit`; whole numbers if that is nanoseconds.
        time_unit: Unit of the times.
        channels: Samples and unit by channel; NaN where missing.
        angles: Samples and unit of `theta` and `alpha`, as far as recorded.
        is_union: Whether the rows are those of several topics, so that a channel has
            no sample in the rows of another.
        lines: Gives the line in the file of each row, counted from 0.
        sources: Files behind the samples.
        notes: What the reader said so far.
    """

    path: str
    time: Shaped[np.ndarray, " n"]
    time_unit: Unit
    channels: dict[str, tuple[Float[np.ndarray, " n"], Unit]]
    angles: dict[str, tuple[Float[np.ndarray, " n"], Unit]]
    is_union: bool = False
    lines: Callable[[Int[np.ndarray, " m"]], Int[np.ndarray, " m"]] | None = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(slots=True, kw_only=True)
class _Findings:
    """Problems and notes about one recording.

    Args:
        samples: The recording as read.
        rows: Row of the file behind each sample, once rows were dropped.
    """

    samples: Samples
    rows: Int[np.ndarray, " n"] | None = None
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def lines(self, at: Int[np.ndarray, " m"]) -> Int[np.ndarray, " m"] | None:
        """Give the lines of samples in the file, if it has lines."""
        if self.samples.lines is None:
            return None
        return self.samples.lines(at if self.rows is None else self.rows[at])

    def add(
        self,
        code: str,
        text: str,
        *,
        at: int | None = None,
        column: str | None = None,
        value: str | None = None,
    ) -> None:
        """Note a problem, perhaps at one sample."""
        lines = None if at is None else self.lines(np.array([at]))
        line = None if lines is None else int(lines[0])
        path = self.samples.path
        self.problems.append(
            problem(code, text, path=path, line=line, column=column, value=value)
        )

    def places(self, at: Int[np.ndarray, " m"]) -> str:
        """Name the first of several samples."""
        lines = self.lines(at[:_MAX_LISTED])
        numbers = at[:_MAX_LISTED] + 1 if lines is None else lines
        word = "samples" if lines is None else "lines"
        more = ", …" if at.size > _MAX_LISTED else ""
        return f"{word} {', '.join(map(str, numbers))}{more}"


def build_recording(
    samples: Samples,
    *,
    theta_from: ThetaFrom,
    gaps: Gaps,
    trust_units: bool,
) -> Recording:
    """Check samples, apply the gap policy, and convert to canonical units.

    Args:
        samples: Columns as read.
        theta_from: What the recorded theta is measured from: the tangential plane, or
            the contact normal (elevation = 90° minus it).
        gaps: What to do about missing samples: call them an `error`, leave them NaN
            for peaks to be `split` there, or `interpolate` short ones.
        trust_units: Accept units that the samples make implausible.

    Returns:
        The recording.

    Raises:
        DataError: If any rule is broken; `.problems` lists all.
    """
    findings = _Findings(samples=samples, notes=list(samples.notes))
    time = _seconds(samples.time, samples.time_unit)
    _check_clock(time, samples, findings)
    _check_values(findings, trust_units)
    if findings.problems:
        raise data_error(findings.problems)
    series = {
        name: unit.to_canonical(values)
        for name, (values, unit) in (samples.channels | samples.angles).items()
    }
    if "theta" in series and theta_from == "normal":
        series["theta"] = np.pi / 2 - series["theta"]
        findings.notes.append(
            "theta was recorded from the contact normal: took 90° - it"
        )
    if samples.is_union:
        time, series = _without_empty_rows(time, series, findings)
    _check_elevation(series.get("theta"), theta_from, findings)
    for name in series:
        series[name] = _fill_gaps(name, time, series[name], gaps, findings)
    if findings.problems:
        raise data_error(findings.problems)
    _note_irregular_steps(time, findings)
    return Recording(
        time=time,
        channels={name: series[name] for name in samples.channels},
        units={name: unit.canonical for name, (_, unit) in samples.channels.items()},
        theta=series.get("theta"),
        alpha=series.get("alpha"),
        sources=samples.sources,
        notes=tuple(findings.notes),
    )


def _seconds(time: Shaped[np.ndarray, " n"], unit: Unit) -> Float[np.ndarray, " n"]:
    """Convert times to seconds; whole nanoseconds without losing digits first."""
    if time.dtype.kind == "i":
        whole, rest = np.divmod(time, 1_000_000_000)
        return whole + rest / 1e9
    return unit.to_canonical(time)


def _check_clock(
    time: Float[np.ndarray, " n"], samples: Samples, findings: _Findings
) -> None:
    """Find missing times, and times that do not increase or have another unit."""
    missing = np.flatnonzero(np.isnan(time))
    if missing.size:
        findings.add(
            "missing_time",
            f"{missing.size} of {time.size} times are missing "
            f"({findings.places(missing)}); remove these rows",
            at=int(missing[0]),
        )
        return
    step = np.diff(time)
    unit = samples.time_unit.name
    usual = float(np.median(step)) if step.size else 0.01
    if usual > _MAX_STEP_S or 0 < usual < _MIN_STEP_S:
        other = "ns" if usual > _MAX_STEP_S else "s"
        findings.add(
            "implausible_time",
            f"the usual step of {usual:g} s does not fit a tactile sensor if times are "
            f"in {unit}; state their true unit, perhaps {other}",
        )
    wrong = np.flatnonzero(step <= 0)
    back = wrong[step[wrong] < 0]
    for k, row in enumerate(wrong[:_MAX_LISTED]):
        now, before = float(time[row + 1]), float(time[row])
        if now == before:
            text = f"the time {now!r} s comes twice; remove one of the two rows"
        else:
            text = (
                f"the time goes back from {before!r} to {now!r} s; split the file here"
            )
        n_more = wrong.size - _MAX_LISTED
        if k == _MAX_LISTED - 1 and n_more > 0:
            text += f" ({n_more} more such rows, {back.size} of all go back)"
        findings.add("time_not_increasing", text, at=int(row) + 1, value=repr(now))


def _check_values(findings: _Findings, trust_units: bool) -> None:
    """Find sentinels, and samples that cannot be in their unit."""
    for name, (values, unit) in findings.samples.channels.items():
        rows = np.flatnonzero(np.abs(values) > _SENTINEL)
        if rows.size:
            found = f"{values[rows[0]]:g}"
            findings.add(
                "sentinel",
                f"{rows.size} samples such as {found} ({findings.places(rows)}) stand "
                f"for missing ones; state missing=[...] with their text",
                at=int(rows[0]),
                column=name,
                value=found,
            )
            continue
        clause = implausible_signal(values, unit)
        if clause and trust_units:
            findings.notes.append(f"{name}: {clause}; taken as {unit.name} as told")
        elif clause:
            findings.add("implausible_unit", clause, column=name)
        if values.size > 1 and np.all(values == values[0]):
            findings.notes.append(f"{name} does not vary: always {values[0]:g}")
    clause = implausible_angles(findings.samples.angles)
    if clause and trust_units:
        findings.notes.append(f"{clause}; taken as told")
    elif clause:
        findings.add("implausible_unit", clause)


def _check_elevation(
    theta: Float[np.ndarray, " n"] | None, theta_from: ThetaFrom, findings: _Findings
) -> None:
    """Find elevations beyond a right angle."""
    if theta is None:
        return
    rows = np.flatnonzero(np.abs(theta) > np.pi / 2 + _ANGLE_SLACK)
    if not rows.size:
        return
    found = f"{np.rad2deg(theta[rows[0]]):.6g}"
    hint = ', or state theta_from="normal"' if theta_from == "tangential" else ""
    findings.add(
        "angle_out_of_range",
        f"the elevation {found}° is outside [-90°, 90°] in {rows.size} samples "
        f"({findings.places(rows)}); mend the cells{hint}",
        at=int(rows[0]),
        column="theta",
        value=found,
    )


def _without_empty_rows(
    time: Float[np.ndarray, " n"],
    series: dict[str, Float[np.ndarray, " n"]],
    findings: _Findings,
) -> tuple[Float[np.ndarray, " m"], dict[str, Float[np.ndarray, " m"]]]:
    """Drop the rows of other topics, in which nothing that was asked for is sampled."""
    is_sampled = np.zeros(time.size, dtype=bool)
    for values in series.values():
        is_sampled |= ~np.isnan(values)
    n_empty = int(np.count_nonzero(~is_sampled))
    if n_empty in (0, time.size):
        return time, series
    findings.notes.append(
        f"dropped {n_empty} of {time.size} rows: they hold samples of other topics only"
    )
    findings.rows = np.flatnonzero(is_sampled)
    return time[is_sampled], {name: v[is_sampled] for name, v in series.items()}


def _fill_gaps(
    name: str,
    time: Float[np.ndarray, " n"],
    values: Float[np.ndarray, " n"],
    gaps: Gaps,
    findings: _Findings,
) -> Float[np.ndarray, " n"]:
    """Apply the gap policy to one series."""
    rows = np.flatnonzero(np.isnan(values))
    if not rows.size:
        return values
    found = (
        f"{rows.size} of {values.size} samples are missing ({findings.places(rows)})"
    )
    if rows.size == values.size:
        text = "all samples are missing; drop the column"
        findings.add("no_samples", text, column=name)
    elif gaps == "error":
        findings.add(
            "missing_samples",
            f'{found}; state gaps="split" to keep the gaps, or gaps="interpolate" to '
            "fill short ones",
            at=int(rows[0]),
            column=name,
        )
    elif gaps == "split":
        findings.notes.append(f"{name}: {found}; left as gaps")
    else:
        values = fill_short_gaps(time, values, is_azimuth=name == "alpha")
        n_left = int(np.count_nonzero(np.isnan(values)))
        findings.notes.append(
            f"{name}: {found}; filled {rows.size - n_left} by interpolation, left "
            f"{n_left} in gaps over {MAX_FILLED_STEPS:g} usual steps or at an end"
        )
    return values


def _note_irregular_steps(time: Float[np.ndarray, " n"], findings: _Findings) -> None:
    """Describe the steps if many are off the median, or some are very long."""
    if time.size < 3:
        return
    step = np.diff(time)
    usual = np.median(step)
    share = float(np.mean(np.abs(step - usual) > usual / 2))
    n_long = int(np.count_nonzero(step > _LONG_STEP * usual))
    if share <= _IRREGULAR_SHARE and not n_long:
        return
    low, high = np.quantile(step, [0.05, 0.95])
    longest = int(np.argmax(step))
    findings.notes.append(
        f"irregular sampling: usual step {usual * 1e3:.3g} ms, 5 to 95 % within "
        f"{low * 1e3:.3g} to {high * 1e3:.3g} ms; {n_long} gaps over {_LONG_STEP:g} "
        f"steps, the longest {step[longest]:.3g} s at {time[longest]:.6g} s"
    )
