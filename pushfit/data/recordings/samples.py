"""From columns of samples to a recording: clock, gaps, plausibility.

The rules that any recording keeps, whether it came as text or as a bag. All problems
of one recording are found before any is raised, also numbers that stand for samples
which a sensor did not give. Excluded: which column is which
(`pushfit.data.recordings.roles`) and what is wrong with a clock
(`pushfit.data.recordings.clock`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Shaped

from pushfit.config.inputs import Gaps, ThetaFrom
from pushfit.data.recordings.clock import Findings, Lines, check_clock
from pushfit.data.recordings.recognise import DIRECTION_COLUMNS
from pushfit.data.recordings.records import Recording
from pushfit.data.text.faults import data_error
from pushfit.data.text.files import Source
from pushfit.data.units import UNITS, Unit, implausible_angles, implausible_signal
from pushfit.errors import stated

# Between neighbours further apart than this many usual steps a push may hide.
_MAX_FILLED_STEPS = 5.0
# Angles are recorded with few decimals, so a right angle may be passed by rounding.
_ANGLE_SLACK = np.deg2rad(0.01)
# What is larger is no reading of any unit, but what stands for one.
_NO_READING = 1e20
# From 999 on, nines and the ends of whole numbers are codes where all other samples are
# further off than they lie apart; a number of no form, given twice or more, where they
# are so many times as far off: a push is up to some hundred times as high as its noise.
_ENDS = frozenset({2.0**15, 2.0**16 - 1, 2.0**15 - 1, 2.0**31, 2.0**31 - 1})
_NINES, _FAR = frozenset(10.0**k - 1 for k in range(3, 11)), 1000.0
# Fewer samples do not show how far apart they lie; so many are looked at before all.
_FEWEST, _SOME = 8, 1 << 14


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """Columns of one recording as read, in the units of the file.

    Args:
        path: File as the user named it.
        time: Sample times, in `time_unit`; whole numbers if that is nanoseconds.
        time_unit: Unit of the times.
        series: Samples and unit by channel, and of `theta` and `alpha` as far as
            recorded, in this order; NaN where missing.
        is_union: Whether the rows are those of several topics, so that a channel has
            no sample in the rows of another.
        lines: Gives the line in the file of each row, counted from 0.
        sources: Files behind the samples.
        notes: What the reader said so far.
        cautions: Of that, what the user should not overlook.
        ignored: Names of columns that are no channels.
    """

    path: str
    time: Shaped[np.ndarray, " n"]
    time_unit: Unit
    series: dict[str, tuple[Float[np.ndarray, " n"], Unit]]
    is_union: bool = False
    lines: Lines | None = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()

    @property
    def channels(self) -> dict[str, tuple[Float[np.ndarray, " n"], Unit]]:
        """Those of the series that are no angles."""
        return {k: own for k, own in self.series.items() if k not in DIRECTION_COLUMNS}


def build_recording(
    samples: Samples, *, theta_from: ThetaFrom, gaps: Gaps, trust_units: bool
) -> Recording:
    """Check samples, apply the gap policy, and convert to canonical units.

    The options are those of `pushfit.data.recordings.recording.read_recording`.

    Raises:
        DataError: If any rule is broken; `.problems` lists all.
    """
    if samples.is_union:
        samples = _without_empty_rows(samples)
    findings = Findings(
        path=samples.path,
        lines=samples.lines,
        notes=list(samples.notes),
        cautions=list(samples.cautions),
    )
    findings.notes += [
        f"{name}: 1 {unit.volts} is {unit.times / unit.per:g} {unit.canonical}"
        for name, (_, unit) in samples.channels.items()
        if unit.volts
    ]
    time = _seconds(samples.time, samples.time_unit)
    check_clock(time, samples.time_unit.name, findings)
    _check_values(samples, findings, trust_units, gaps)
    if findings.problems:
        raise data_error(findings.problems)
    series = {
        name: unit.to_canonical(values)
        for name, (values, unit) in samples.series.items()
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
        ignored=samples.ignored,
        # Volts with a gain are read as what it leads to.
        stated={
            name: unit
            for name, (_, unit) in samples.channels.items()
            if unit.name in UNITS
        },
    )


def _seconds(time: Shaped[np.ndarray, " n"], unit: Unit) -> Float[np.ndarray, " n"]:
    """Convert times to seconds; whole nanoseconds without losing digits first."""
    if time.dtype.kind == "i":
        whole, rest = np.divmod(time, 1_000_000_000)
        return whole + rest / 1e9
    return unit.to_canonical(time)


def _check_values(
    samples: Samples, findings: Findings, trust_units: bool, gaps: Gaps
) -> None:
    """Find sentinels, and samples that cannot be in their unit."""
    for name, (values, unit) in samples.channels.items():
        code = _sentinel_of(values)
        if code is not None:
            rows = np.flatnonzero(values == code)
            found = f"{code:g}" if float(f"{code:g}") == code else repr(code)
            text = (
                f"{rows.size} samples of {found} ({findings.places(rows)}), far from "
                "all others, stand for missing ones"
            )
            may_be = abs(code) <= _NO_READING
            if may_be and trust_units:
                findings.notes.append(f"{name}: {text}; taken as readings as told")
                continue
            told = f"state {stated(missing=[found])}"
            if gaps == "error":
                told += f" and {stated(gaps='split')} to keep the gaps"
            if may_be:
                told += f", or {stated(trust_units=True)} if they are readings"
            findings.add(
                "sentinel", f"{text}; {told}", at=int(rows[0]), column=name, value=found
            )
            continue
        clause = implausible_signal(values, unit)
        if clause and trust_units:
            findings.notes.append(f"{name}: {clause}; taken as {unit.name} as told")
        elif clause:
            findings.add("implausible_unit", clause, column=name)
        if values.size > 1 and np.all(values == values[0]):
            findings.notes.append(f"{name} does not vary: always {values[0]:g}")
    angles = {k: own for k, own in samples.series.items() if k in DIRECTION_COLUMNS}
    clause = implausible_angles(angles)
    if clause and trust_units:
        findings.notes.append(f"{clause}; taken as told")
    elif clause:
        findings.add("implausible_unit", clause)


def _sentinel_of(values: Float[np.ndarray, " n"]) -> float | None:
    """Find the number that stands for missing samples of one channel.

    Args:
        values: Samples in the unit of the file, NaN where missing.

    Returns:
        The number farthest from 0 if it is beyond any unit, or the least or largest if
        it is far from all others and has the form of a code, or comes twice; None where
        neither is so.
    """
    ends = float(np.fmin.reduce(values)), float(np.fmax.reduce(values))
    # Few first: a copy of every channel would cost more than reading it.
    some = values[:: 1 + len(values) // _SOME]
    for end in sorted(ends, key=abs, reverse=True):
        if abs(end) > _NO_READING:
            return end
        has_form = abs(end) in _NINES | _ENDS
        far = 1.0 if has_form else _FAR
        if _keeps_off(end, some, ends, far) and _keeps_off(end, values, ends, far):
            if has_form or np.count_nonzero(values == end) > 1:
                return end
    return None


def _keeps_off(
    end: float, values: Float[np.ndarray, " n"], ends: tuple[float, float], far: float
) -> bool:
    """Whether an end of samples is so many times as far off as those between reach."""
    others = values[(values > ends[0]) & (values < ends[1])]
    if others.size < _FEWEST or abs(end) < min(_NINES):
        return False
    span = float(np.ptp(others))
    return 0 < far * span < float(np.abs(others - end).min())


def _check_elevation(
    theta: Float[np.ndarray, " n"] | None, theta_from: ThetaFrom, findings: Findings
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
    for values, _ in samples.series.values():
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
        series={k: (v[rows], unit) for k, (v, unit) in samples.series.items()},
        lines=None if lines is None else lambda at: lines(rows[at]),
        notes=(*samples.notes, note),
    )


def _fill_gaps(
    name: str,
    time: Float[np.ndarray, " n"],
    values: Float[np.ndarray, " n"],
    gaps: Gaps,
    findings: Findings,
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
