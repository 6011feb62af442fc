"""What the clock of a recording may do: times that are there, increase, are in seconds.

Excluded: the samples at these times (`pushfit.data.recordings.samples`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float, Int

from pushfit.data.text.faults import MAX_LISTED, problem
from pushfit.errors import InputProblem, stated

# Tactile sensors sample at 10 Hz to 10 kHz: a step a hundred times shorter, or ten
# thousand times longer, is in another unit.
_MAX_STEP_S, _MIN_STEP_S = 1e3, 1e-6
# One ten times longer, or three times shorter, may be, if there are so many.
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


Lines = Callable[[Int[np.ndarray, " m"]], Int[np.ndarray, " m"]]


@dataclass(slots=True, kw_only=True)
class Findings:
    """Problems, notes and cautions about one recording, before any of it is raised.

    Args:
        path: File as the user named it.
        lines: Gives the line in the file of each sample, counted from 0.
        problems: What it is refused for.
        notes: What is told of it.
        cautions: Of that, what the user should not overlook.
    """

    path: str
    lines: Lines | None
    problems: list[InputProblem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cautions: list[str] = field(default_factory=list)

    def add(self, code: str, text: str, *, at: int | None = None, **cell: str) -> None:
        """Note a problem, perhaps at one sample."""
        line = None
        if at is not None and self.lines:
            line = int(self.lines(np.array([at]))[0])
        self.problems.append(problem(code, text, path=self.path, line=line, **cell))

    def places(self, at: Int[np.ndarray, " m"]) -> str:
        """Name the first of several samples."""
        first, word = at[:MAX_LISTED], "samples"
        numbers = first + 1
        if self.lines:
            numbers, word = self.lines(first), "lines"
        more = ", …" if at.size > MAX_LISTED else ""
        return f"{word} {', '.join(map(str, numbers))}{more}"


def check_clock(time: Float[np.ndarray, " n"], unit: str, findings: Findings) -> None:
    """Find missing times, and times that do not increase or have another unit.

    Args:
        time: Sample times [s].
        unit: Name of the unit that they had.
        findings: Where it is noted.
    """
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
    every = 1 + len(after) // _SOME_STEPS
    usual = float(np.median(after[::every] - before[::every]))
    _check_unit(time, usual, unit, findings)
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
    for k, row in enumerate(wrong[:MAX_LISTED]):
        now, before = float(time[row + 1]), float(time[row])
        if now == before:
            text = f"the time {now!r} s comes twice; remove one of the two rows"
        else:
            text = (
                f"the time goes back from {before!r} to {now!r} s; split the file here"
            )
        n_more = wrong.size - MAX_LISTED
        if k == MAX_LISTED - 1 and n_more > 0:
            text += f" ({n_more} more such rows, {back.size} of all go back)"
        findings.add("time_not_increasing", text, at=int(row) + 1, value=repr(now))
    if not findings.problems:
        _note_irregular_steps(time, step, usual, findings)


def _check_unit(
    time: Float[np.ndarray, " n"], usual: float, unit: str, findings: Findings
) -> None:
    """Find times that cannot be, or may not be, in their unit."""
    if usual > _MAX_STEP_S or 0 < usual < _MIN_STEP_S:
        other = "ns" if usual > _MAX_STEP_S else "s"
        findings.add(
            "implausible_time",
            f"the usual step of {usual:g} s does not fit a tactile sensor if times are "
            f"in {unit}; state their true unit, perhaps {other}",
        )
    elif time[0] > _LATEST_S:
        findings.add(
            "implausible_time",
            f"times of {time[0]:.3g} s are of no date if they are in {unit}; state "
            "their true unit, perhaps ms",
        )
    elif len(time) >= _MANY and not _FAST_S <= usual < _SLOW_S and usual > 0:
        other = "ms" if usual >= _SLOW_S else "s"
        findings.cautions.append(
            f"the usual step of {usual:g} s is that of no tactile sensor; if times are "
            f"in {other} and not in {unit}, name their column so, as time_{other}"
        )


def _note_irregular_steps(
    time: Float[np.ndarray, " n"],
    step: Float[np.ndarray, " m"],
    usual: float,
    findings: Findings,
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
        f"steps, the longest {step[longest]:.3g} s at {time[longest]:.2f} s"
    )
