"""Where one push begins, is half up, and ends, by its own course alone.

The coarse search sees a recording as a whole. What is measured afterwards must not: a
push has the same feet whatever else the file holds. So each is traced again on its own
samples, smoothed by a share of its own width, over its own rests. Excluded: finding the
pushes (`pushfit.data.pushes.detection`) and the levels of their rests
(`pushfit.data.peaks.rests`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pushfit.data.pushes.course import Course

# Level of the foot, where a push begins and ends, as a share of its height.
FOOT = 0.05
# Smoothing by a tenth of the width at half height lowers the top of a triangle by 2 %.
WIDTH_PER_SMOOTHING = 10.0
# The signal is on its way before it passes the foot: by a ninth of the way to half
# height on a straight flank, by more on a curved one.
_BEGINS, _GUARD = 0.11, 0.35
# A rest is looked at for this share of the width, at most for so long [s]: an old
# baseline is no better than a fresh one, and the next push may be near.
_SPAN, _LONGEST = 0.6, 1.0
_FEWEST = 8
# Sensors recover after a release.
_SETTLING = 0.4
# Less of a rest than this share of what is wanted shows no level.
_LEAST = 0.25
# A hump that is lower than this share of the step below it is an overshoot.
ON_STEP = 0.33
# Share of the time from a neighbour in which the signal comes to rest.
_TAIL = 0.5
# Samples of rest that show that a push had not begun.
_SHOWN = 3
_GRID, _FINE = 240, 17
_ROUNDS, _REACH = 4, 2.0
_UNIT = np.linspace(0.0, 1.0, _FINE)
_SIGMAS = 3.0
# Height over the noise that makes feet clear, and the share of the width that may be
# smoothed over to get there.
_CLEAR, _MOST_SMOOTHING = 30.0, 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Feet:
    """The course of one push in time [s].

    Args:
        start: Passes the foot on the way up.
        half_up: Passes half of the height on the way up.
        peak: Is highest, smoothed.
        half_down: Passes half of the height on the way down.
        end: Passes the foot on the way down.
        height: Smoothed top over the higher of the two rests [unit].
        step: Usual sampling step around it [s].
        cut_start: Whether the samples begin before a rest is seen.
        cut_end: Whether they end before one is.
    """

    start: float
    half_up: float
    peak: float
    half_down: float
    end: float
    height: float
    step: float
    cut_start: bool
    cut_end: bool

    @property
    def width(self) -> float:
        """Time above half of the height [s]."""
        return self.half_down - self.half_up

    @property
    def guards(self) -> tuple[float, float]:
        """Time before the start and after the end that is not yet at rest [s]."""
        return (
            _GUARD * (self.half_up - self.start),
            _GUARD * (self.end - self.half_down),
        )

    @property
    def before(self) -> tuple[float, float]:
        """Stretch whose level is the rest before the push [s]."""
        last = self.start - self.guards[0]
        return last - self._span, last

    @property
    def after(self) -> tuple[float, float]:
        """Stretch whose level is the rest after the push [s]."""
        settling = _SETTLING * min(self.width, _LONGEST)
        first = self.end + max(self.guards[1], settling)
        return first, first + self._span

    @property
    def _span(self) -> float:
        return max(_SPAN * min(self.width, _LONGEST), _FEWEST * self.step)


def trace_feet(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    coarse: Feet,
    *,
    room: tuple[float | None, float | None],
    sigma: float,
    smoothing: float | None,
) -> Feet:
    """Trace the feet of a push from its own samples.

    Feet depend on the levels of the rests, and rests lie beyond the feet: both are
    found in turns, which changes next to nothing after the second. Their number is
    fixed, because rounding must not decide when to stop.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        coarse: Where the push is, roughly.
        room: End of the push before and start of the next one; None where the samples
            begin or end first [s].
        sigma: Noise of a sample [unit].
        smoothing: Averaging time; None takes a share of the width [s].

    Returns:
        The feet.
    """
    has_neighbours = (room[0] is not None, room[1] is not None)
    lowest = time[0] if room[0] is None else min(room[0], coarse.start)
    highest = time[-1] if room[1] is None else max(room[1], coarse.end)
    reach = 2 * _reach(coarse)
    course = Course.of(
        time,
        signal,
        float(max(lowest, coarse.start - reach)),
        float(min(highest, coarse.end + reach)),
    )
    feet = replace(coarse, step=float(np.median(np.diff(course.time))))
    for _ in range(_ROUNDS):
        reach = _reach(feet)
        ends = (
            float(max(lowest, course.time[0], feet.start - reach)),
            float(min(highest, course.time[-1], feet.end + reach)),
        )
        feet = _trace(
            course,
            feet,
            ends,
            has_neighbours=has_neighbours,
            tau=smoothing or _smoothing(feet, sigma),
            sigma=sigma,
        )
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    return replace(
        feet,
        cut_start=room[0] is None and bool(np.searchsorted(time, early) < _SHOWN),
        cut_end=room[1] is None
        and bool(len(time) - np.searchsorted(time, late) < _SHOWN),
    )


def _reach(feet: Feet) -> float:
    """Time around a push that its rests lie in [s]."""
    width = max(min(feet.width, 2 * _LONGEST), 4 * feet.step)
    return _REACH * width + feet.half_up - feet.start + feet.end - feet.half_down


def _smoothing(feet: Feet, sigma: float) -> float:
    """A share of the width, and more where the noise would hide the feet [s]."""
    blurred = min(_CLEAR * sigma / max(feet.height, 1e-300), 1e6)
    least = min(feet.step * blurred**2, feet.width / _MOST_SMOOTHING)
    return max(feet.width / WIDTH_PER_SMOOTHING, least, feet.step)


def _trace(
    course: Course,
    feet: Feet,
    ends: tuple[float, float],
    *,
    has_neighbours: tuple[bool, bool],
    tau: float,
    sigma: float,
) -> Feet:
    """One round: levels of the rests by the feet, then the feet by the levels."""
    lowest, highest = ends
    # Beside a neighbour the signal may still be, or already be, on its way.
    first = lowest + _TAIL * (feet.start - lowest) * has_neighbours[0]
    last = highest - _TAIL * (highest - feet.end) * has_neighbours[1]
    before = _level(course, feet.before, (first, highest))
    after = _level(course, feet.after, (lowest, last))
    when = np.linspace(*ends, _GRID)
    y = course.smooth(when, tau)
    inside = np.flatnonzero((when >= feet.start) & (when <= feet.end))
    if inside.size == 0:
        return feet
    peak = int(inside[np.argmax(y[inside])])
    t_peak, top = _top(course, when, peak, tau)
    # What the samples begin or end with is a rest only if a push stands on it.
    if not has_neighbours[0] and _is_top(before, after, top):
        before = np.nan
    if not has_neighbours[1] and _is_top(after, before, top):
        after = np.nan
    if np.isnan(before) and np.isnan(after):
        before = after = float(min(y[0], y[-1]))
    rests = (
        after if np.isnan(before) else before,
        before if np.isnan(after) else after,
    )
    rises = [max(top - rest, 1e-300) for rest in rests]
    noise = _SIGMAS * sigma * min(1.0, (feet.step / tau) ** 0.5)
    foot = [
        rest + max(FOOT * rise, noise) for rest, rise in zip(rests, rises, strict=True)
    ]
    start = _crossing(course, when[peak::-1], y[peak::-1], foot[0], tau)
    end = _crossing(course, when[peak:], y[peak:], foot[1], tau)
    half = [rest + rise / 2 for rest, rise in zip(rests, rises, strict=True)]
    up, down = when[: peak + 1] >= start, when[peak:] <= end
    half_up = _crossing(
        course, when[: peak + 1][up], half[0] - y[: peak + 1][up], 0.0, tau, half[0]
    )
    half_down = _crossing(
        course,
        when[peak:][down][::-1],
        half[1] - y[peak:][down][::-1],
        0.0,
        tau,
        half[1],
    )
    return Feet(
        start=start,
        half_up=half_up,
        peak=t_peak,
        half_down=half_down,
        end=end,
        height=float(min(rises)),
        step=feet.step,
        cut_start=False,
        cut_end=False,
    )


def _is_top(level: float, other: float, top: float) -> bool:
    """Whether a level at an end of the samples is that of the push itself."""
    return top - level < ON_STEP * (level - other)


def _top(
    course: Course, when: Float[np.ndarray, " m"], peak: int, tau: float
) -> tuple[float, float]:
    """Time and height of the highest running mean beside a point of the grid."""
    first, last = when[max(peak - 1, 0)], when[min(peak + 1, len(when) - 1)]
    fine = first + (last - first) * _UNIT
    own = course.smooth(fine, tau)
    k = int(np.argmax(own))
    return float(fine[k]), float(own[k])


def _level(
    course: Course, window: tuple[float, float], ends: tuple[float, float]
) -> float:
    """Mean of a rest; NaN where the samples end too soon to show it."""
    first, last = max(window[0], ends[0]), min(window[1], ends[1])
    if last - first < _LEAST * (window[1] - window[0]):
        return np.nan
    return course.mean(first, last)


def _crossing(
    course: Course,
    when: Float[np.ndarray, " m"],
    y: Float[np.ndarray, " m"],
    level: float,
    tau: float,
    mirror: float | None = None,
) -> float:
    """Where a course first falls below a level, or the last time if it never does.

    Args:
        course: What `y` is the running mean of.
        when: Times, in either direction [s].
        y: Running mean; subtracted from `mirror` if that is given.
        level: Level to pass.
        tau: Averaging time [s].
        mirror: Level that the running mean is subtracted from.
    """
    below = np.flatnonzero(y < level)
    if below.size == 0:
        return float(when[-1]) if when.size else float(course.time[0])
    if below[0] == 0:
        return float(when[0])
    # Between two points of the grid, so that the grid itself does not matter.
    first, last = when[below[0] - 1], when[below[0]]
    fine = first + (last - first) * _UNIT
    own = course.smooth(fine, tau)
    own = own if mirror is None else mirror - own
    k = int(np.argmax(own < level))
    if k == 0:
        return float(fine[0])
    share = np.clip((own[k - 1] - level) / max(own[k - 1] - own[k], 1e-300), 0.0, 1.0)
    return float(fine[k - 1] + share * (fine[k] - fine[k - 1]))
