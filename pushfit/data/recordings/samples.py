"""From columns of samples to a recording: clock, gaps, plausibility.

The rules that any recording keeps, whether it came as text or as a bag. All problems
of one recording are found before any is raised. Excluded: which column is which
(`pushfit.data.recordings.roles`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int, Shaped

from pushfit.config.inputs import Gaps, ThetaFrom
from pushfit.data.recordings.records import Recording
from pushfit.data.recordings.sentinels import NO_READING, sentinel_of
from pushfit.data.text.faults import data_error, problem
from pushfit.data.text.files import Source
from pushfit.data.units import Unit, implausible_angles, implausible_signal
from pushfit.errors import InputProblem, stated

# Faults of one kind that are listed; the others are counted.
_MAX_LISTED = 10
# Tactile sensors sample at 10 Hz to 10 kHz: a step a hundred times shorter, or ten
# thousand times longer, is in another unit; one three, or ten, may be, if of many.
_MAX_STEP_S, _MIN_STEP_S = 1e3, 1e-6
_SLOW_S, _FAST_S, _MANY = 1.0, 3e-5, 100
# Since 1970: the year 5138. Of milliseconds that are taken for seconds it is 1973.
_LATEST_S = 1e11
# A step is irregular when it is off the median by more than this share of it: rounded
# to whole usual steps it is not one. More of them than the second share are told of.
_IRREGULAR, _IRREGULAR_SHARE = 0.5, 0.05
# A step of so many usual ones is a gap, and told of by itself.
_LONG_STEP = 10.0
# Steps that are looked at at once, half a megabyte; and as many that show the usual
# one.
_SOME_STEPS = 1 << 16
# Between neighbours further apart than this many usual steps a push may hide.
_MAX_FILLED_STEPS = 5.0
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
        cautions: Of that, what the user should not overlook.
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
    cautions: tuple[str, ...] = ()


@dataclass(slots=True, kw_only=True)
class _Findings:
    """Problems, notes and cautions about one recording."""

    samples: Samples
    problems: list[InputProblem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)

    def add(self, code: str, text: str, *, at: int | None = None, **cell: str) -> None:
        """Note a problem, perhaps at one sample."""
        line = None
        if at is not None and self.samples.lines:
            line = int(self.samples.lines(np.array([at]))[0])
        path = self.samples.path
        self.problems.append(problem(code, text, path=path, line=line, **cell))

    def places(self, at: Int[np.ndarray, " m"]) -> str:
        """Name the first of several samples."""
        first, word = at[:_MAX_LISTED], "samples"
        numbers = first + 1
        if self.samples.lines:
            numbers, word = self.samples.lines(first), "lines"
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

    The options are those of `pushfit.data.recordings.recording.read_recording`.

    Raises:
        DataError: If any rule is broken; `.problems` lists all.
    """
    if samples.is_union:
        samples = _without_empty_rows(samples)
    findings = _Findings(
        samples=samples, notes=list(samples.notes), cautions=list(samples.cautions)
    )
    time = _seconds(samples.time, samples.time_unit)
    _check_clock(time, findings)
    _check_values(findings, trust_units, gaps)
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
    _check_elevation(series.get("theta"), theta_from, findings)
    for name in series:
        series[name] = _fill_gaps(name, time, series[name], gaps, findings)
    if findings.problems:
        raise data_error(findings.problems)
    return Recording(
        time=time,
        channels={name: series[name] for name in samples.channels},
        units={name: unit.canonical for name, (_, unit) in samples.channels.items()},
        theta=series.get("theta"),
        alpha=series.get("alpha"),
        sources=samples.sources,
        notes=tuple(findings.notes),
        cautions=tuple(findings.cautions),
    )


def _seconds(time: Shaped[np.ndarray, " n"], unit: Unit) -> Float[np.ndarray, " n"]:
    """Convert times to seconds; whole nanoseconds without losing digits first."""
    if time.dtype.kind == "i":
        whole, rest = np.divmod(time, 1_000_000_000)
        return whole + rest / 1e9
    return unit.to_canonical(time)


def _check_clock(time: Float[np.ndarray, " n"], findings: _Findings) -> None:
    """Find missing times, and times that do not increase or have another unit."""
    if np.isnan(time.min(initial=0.0)):
        missing = np.flatnonzero(np.isnan(time))
        findings.add(
            "missing_time",
            f"{missing.size} of {time.size} times are missing "
            f"({findings.places(missing)}); remove these rows",
            at=int(missing[0]),
        )
        return
    before, after = time[:-1], time[1:]
    if not len(after):
        return
    unit = findings.samples.time_unit.name
    every = 1 + len(after) // _SOME_STEPS
    usual = float(np.median(after[::every] - before[::every]))
    if usual > _MAX_STEP_S or 0 < usual < _MIN_STEP_S:
        other = "ns" if usual > _MAX_STEP_S else "s"
        findings.add(
            "implausible_time",
            f"the usual step of {usual:g} s does not fit a tactile sensor if times are "
            f"in {unit}; state their true unit, perhaps {other}",
        )
    elif before[0] > _LATEST_S:
        findings.add(
            "implausible_time",
            f"times of {before[0]:.3g} s are of no date if they are in {unit}; state "
            "their true unit, perhaps ms",
        )
    elif len(time) >= _MANY and not _FAST_S <= usual < _SLOW_S and usual > 0:
        other = "ms" if usual >= _SLOW_S else "s"
        findings.cautions.append(
            f"the usual step of {usual:g} s is that of no tactile sensor; if times are "
            f"in {other} and not in {unit}, name their column so, as time_{other}"
        )
    # Some at a time: to copy all steps costs more than to see that they are even.
    parts = [time[k : k + _SOME_STEPS + 1] for k in range(0, len(after), _SOME_STEPS)]
    ends = [(s.min(), s.max()) for s in map(np.diff, parts)]
    least, most = min(ends)[0], max(high for _, high in ends)
    low, high = (1 - _IRREGULAR) * usual, (1 + _IRREGULAR) * usual
    if least > 0 and low <= least and most <= high:
        return
    step = np.diff(time)
    wrong = np.flatnonzero(step <= 0)
    back = wrong[step[wrong] < 0]
    if not back.size and wrong.size > len(step) / 2:
        findings.add(
            "coarse_clock",
            f"{wrong.size} of {time.size} times are those of the row before: the clock "
            f"is coarser than the samples; state {stated(rate=100)}, with your rate",
            at=int(wrong[0]) + 1,
        )
        return
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
    if not findings.problems:
        _note_irregular_steps(time, step, usual, findings)


def _check_values(findings: _Findings, trust_units: bool, gaps: Gaps) -> None:
    """Find sentinels, and samples that cannot be in their unit."""
    for name, (values, unit) in findings.samples.channels.items():
        code = sentinel_of(values)
        if code is not None:
            rows = np.flatnonzero(values == code)
            found = f"{code:g}" if float(f"{code:g}") == code else repr(code)
            text = (
                f"{rows.size} samples of {found} ({findings.places(rows)}), far from "
                "all others, stand for missing ones"
            )
            may_be = abs(code) <= NO_READING
            if may_be and trust_units:
                findings.notes.append(f"{name}: {text}; taken as readings as told")
                continue
            told = f"state {stated(missing=[found])}"
            if gaps == "error":
                told += f" and {stated(gaps='split')} to keep the gaps"
            if may_be:
                told += f", or {stated(trust_units=True)} if they are readings"
            findings.add(
                "sentinel",
                f"{text}; {told}",
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
    is_open = theta_from == "tangential"
    hint = f", or state {stated(theta_from='normal')}" if is_open else ""
    findings.add(
        "angle_out_of_range",
        f"the elevation {found}° is outside [-90°, 90°] in {rows.size} samples "
        f"({findings.places(rows)}); mend the cells{hint}",
        at=int(rows[0]),
        column="theta",
        value=found,
    )


def _without_empty_rows(samples: Samples) -> Samples:
    """Drop the rows of other topics, in which nothing that was asked for is sampled."""
    is_sampled = np.zeros(samples.time.size, dtype=bool)
    for values, _ in (*samples.channels.values(), *samples.angles.values()):
        is_sampled |= ~np.isnan(values)
    rows = np.flatnonzero(is_sampled)
    if rows.size in (0, is_sampled.size):
        return samples
    lines = samples.lines
    n_empty = is_sampled.size - rows.size
    note = f"dropped {n_empty} of {is_sampled.size} rows: only other topics are in them"
    return replace(
        samples,
        time=samples.time[rows],
        channels={k: (v[rows], unit) for k, (v, unit) in samples.channels.items()},
        angles={k: (v[rows], unit) for k, (v, unit) in samples.angles.items()},
        lines=None if lines is None else lambda at: lines(rows[at]),
        notes=(*samples.notes, note),
    )


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
            f"{found}; state {stated(gaps='split')} to keep the gaps, or "
            f"{stated(gaps='interpolate')} to fill short ones",
            at=int(rows[0]),
            column=name,
        )
    elif gaps == "split":
        findings.notes.append(f"{name}: {found}; left as gaps")
    else:
        values = _fill_short_gaps(time, values, is_azimuth=name == "alpha")
        n_left = int(np.count_nonzero(np.isnan(values)))
        findings.notes.append(
            f"{name}: {found}; filled {rows.size - n_left} by interpolation, left "
            f"{n_left} in gaps over {_MAX_FILLED_STEPS:g} usual steps or at an end"
        )
    return values


def _fill_short_gaps(
    time: Float[np.ndarray, " n"],
    values: Float[np.ndarray, " n"],
    *,
    is_azimuth: bool = False,
) -> Float[np.ndarray, " n"]:
    """Interpolate missing samples between neighbours that are close in time.

    Args:
        time: Sample times [s].
        values: Samples, NaN where missing.
        is_azimuth: Whether the samples are angles through 360°, of which the shorter
            way round is meant [rad].

    Returns:
        The samples, still NaN in gaps longer than `_MAX_FILLED_STEPS` usual steps of
        this series, and before its first and after its last sample.
    """
    known = np.flatnonzero(~np.isnan(values))
    if known.size < 2:
        return values
    rows = np.flatnonzero(np.isnan(values))
    after = np.searchsorted(known, rows)
    inside = (after > 0) & (after < known.size)
    rows, after = rows[inside], after[inside]
    step = np.diff(time[known])
    is_short = step[after - 1] <= _MAX_FILLED_STEPS * np.median(step)
    rows = rows[is_short]
    samples = values[known]
    if is_azimuth:
        samples = np.unwrap(samples)
    filled = values.copy()
    filled[rows] = np.interp(time[rows], time[known], samples)
    if is_azimuth:
        filled[rows] = np.angle(np.exp(1j * filled[rows]))
    return filled


def _note_irregular_steps(
    time: Float[np.ndarray, " n"],
    step: Float[np.ndarray, " m"],
    usual: float,
    findings: _Findings,
) -> None:
    """Describe the steps if many are off the median, or some are very long."""
    low, high = (1 - _IRREGULAR) * usual, (1 + _IRREGULAR) * usual
    n_irregular = np.count_nonzero((step < low) | (step > high))
    n_long = int(np.count_nonzero(step > _LONG_STEP * usual))
    if n_irregular <= _IRREGULAR_SHARE * step.size and not n_long:
        return
    low, high = np.quantile(step, [0.05, 0.95])
    longest = int(np.argmax(step))
    findings.notes.append(
        f"irregular sampling: usual step {usual * 1e3:.3g} ms, 5 to 95 % within "
        f"{low * 1e3:.3g} to {high * 1e3:.3g} ms; {n_long} gaps over {_LONG_STEP:g} "
        f"steps, the longest {step[longest]:.3g} s at {time[longest]:.6g} s"
    )
