"""Where one push begins, is half up, and ends, by its own course alone.

The coarse search sees a recording as a whole. What is measured afterwards must not: a
push has the same feet whatever else the file holds. So each is traced again on its own
samples, smoothed by a share of its own width, over its own rests. Excluded: finding the
pushes (`pushfit.data.detection`) and the levels of their rests (`pushfit.data.rests`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

# Level of the foot, where a push begins and ends, as a share of its height.
FOOT = 0.05
# Smoothing by a tenth of the width at half height lowers the top of a triangle by 2 %.
WIDTH_PER_SMOOTHING = 10.0
# The signal is on its way before it passes the foot: by a ninth of the way to half
# height on a straight flank, by more on a curved one.
_BEGINS, _GUARD = 0.11, 0.35
# A rest is looked at for this share of the width, at most for so long [s]: an old
# baseline is no better than a fresh one, and the next push may be near.
_SPAN, _LONGEST = 0.6, 1.5
_FEWEST = 8
# Sensors recover after a release.
_SETTLING = 0.4
# Less of a rest than this share of what is wanted shows no level.
_LEAST = 0.25
# Share of the time to a neighbour in which the signal comes to rest.
_TAIL = 0.3
# Samples of rest that show that a push had not begun.
_SHOWN = 3
_GRID = 400
_ROUNDS = 4
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
        cut_start: Whether the samples begin before a rest is seen.
        cut_end: Whether they end before one is.
    """

    start: float
    half_up: float
    peak: float
    half_down: float
    end: float
    height: float
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

    def before(self, step: float) -> tuple[float, float]:
        """Stretch whose level is the rest before the push [s].

        Args:
            step: Usual sampling step [s].
        """
        last = self.start - self.guards[0]
        return last - self._span(step), last

    def after(self, step: float) -> tuple[float, float]:
        """Stretch whose level is the rest after the push [s].

        Args:
            step: Usual sampling step [s].
        """
        settling = _SETTLING * min(self.width, _LONGEST)
        first = self.end + max(self.guards[1], settling)
        return first, first + self._span(step)

    def _span(self, step: float) -> float:
        return max(_SPAN * min(self.width, _LONGEST), _FEWEST * step)


@dataclass(frozen=True, slots=True)
class _Course:
    """Samples around a push, with their integral: any running mean is a difference."""

    time: Float[np.ndarray, " n"]
    integral: Float[np.ndarray, " n"]

    @classmethod
    def of(
        cls, time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
    ) -> "_Course":
        areas = np.diff(time) * (signal[1:] + signal[:-1]) / 2
        return cls(time, np.append(0.0, np.cumsum(areas)))

    def mean(self, first: float, last: float) -> float:
        """Mean between two times."""
        return float(self._means(np.array([first]), np.array([last]))[0])

    def smooth(
        self, when: Float[np.ndarray, " m"], tau: float
    ) -> Float[np.ndarray, " m"]:
        """Running mean over `tau`; over what there is of it at the ends."""
        return self._means(when - tau / 2, when + tau / 2)

    def _means(
        self, first: Float[np.ndarray, " m"], last: Float[np.ndarray, " m"]
    ) -> Float[np.ndarray, " m"]:
        first = np.maximum(first, self.time[0])
        last = np.minimum(last, self.time[-1])
        area = np.interp(last, self.time, self.integral)
        area -= np.interp(first, self.time, self.integral)
        return area / np.maximum(last - first, 1e-12)


def trace_feet(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    coarse: Feet,
    *,
    room: tuple[float | None, float | None],
    sigma: float,
    step: float,
    smoothing: float | None,
) -> Feet:
    """Trace the feet of a push from its own samples.

    Feet depend on the levels of the rests, and rests lie beyond the feet: both are
    found in turns, which changes next to nothing after the second.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        coarse: Where the push is, roughly.
        room: End of the push before and start of the next one; None where the samples
            begin or end first [s].
        sigma: Noise of a sample [unit].
        step: Usual sampling step [s].
        smoothing: Averaging time; None takes a share of the width [s].

    Returns:
        The feet.
    """
    reach = 2 * max(min(coarse.width, 2 * _LONGEST), 4 * step)
    reach += coarse.half_up - coarse.start + coarse.end - coarse.half_down
    lowest = time[0] if room[0] is None else min(room[0], coarse.start)
    highest = time[-1] if room[1] is None else max(room[1], coarse.end)
    ends = (
        float(max(lowest, coarse.start - reach)),
        float(min(highest, coarse.end + reach)),
    )
    first, last = np.searchsorted(time, ends)
    part = slice(max(0, int(first) - 1), int(last) + 1)
    course = _Course.of(time[part], signal[part])
    has_neighbours = (room[0] is not None, room[1] is not None)
    feet = coarse
    for _ in range(_ROUNDS):
        tau = smoothing or _smoothing(feet, sigma, step)
        feet = _trace(
            course,
            feet,
            ends,
            has_neighbours=has_neighbours,
            tau=tau,
            sigma=sigma,
            step=step,
        )
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    return replace(
        feet,
        cut_start=feet.cut_start or np.searchsorted(time, early) < _SHOWN,
        cut_end=feet.cut_end or len(time) - np.searchsorted(time, late) < _SHOWN,
    )


def _smoothing(feet: Feet, sigma: float, step: float) -> float:
    """A share of the width, and more where the noise would hide the feet [s]."""
    blurred = min(_CLEAR * sigma / max(feet.height, 1e-300), 1e6)
    least = min(step * blurred**2, feet.width / _MOST_SMOOTHING)
    return max(feet.width / WIDTH_PER_SMOOTHING, least, step)


def _trace(
    course: _Course,
    feet: Feet,
    ends: tuple[float, float],
    *,
    has_neighbours: tuple[bool, bool],
    tau: float,
    sigma: float,
    step: float,
) -> Feet:
    """One round: levels of the rests by the feet, then the feet by the levels."""
    lowest, highest = ends
    # Beside a neighbour the signal may still be, or already be, on its way.
    first = lowest + _TAIL * (feet.start - lowest) * has_neighbours[0]
    last = highest - _TAIL * (highest - feet.end) * has_neighbours[1]
    before = _level(course, feet.before(step), (first, highest))
    after = _level(course, feet.after(step), (lowest, last))
    when = np.linspace(*ends, _GRID)
    y = course.smooth(when, tau)
    inside = np.flatnonzero((when >= feet.start) & (when <= feet.end))
    if inside.size == 0:
        return feet
    peak = int(inside[np.argmax(y[inside])])
    if np.isnan(before) and np.isnan(after):
        before = after = float(min(y[0], y[-1]))
    rests = (
        after if np.isnan(before) else before,
        before if np.isnan(after) else after,
    )
    rises = [max(y[peak] - rest, 1e-300) for rest in rests]
    noise = _SIGMAS * sigma * min(1.0, (step / tau) ** 0.5)
    foot = [
        rest + max(FOOT * rise, noise) for rest, rise in zip(rests, rises, strict=True)
    ]
    start, cut_start = _crossing(when[peak::-1], y[peak::-1], foot[0])
    end, cut_end = _crossing(when[peak:], y[peak:], foot[1])
    half_up, _ = _crossing(
        when[peak::-1], y[peak::-1], rests[0] + rises[0] / 2, is_last=start
    )
    half_down, _ = _crossing(
        when[peak:], y[peak:], rests[1] + rises[1] / 2, is_last=end
    )
    return Feet(
        start=start,
        half_up=half_up,
        peak=float(when[peak]),
        half_down=half_down,
        end=end,
        height=float(min(rises)),
        cut_start=cut_start,
        cut_end=cut_end,
    )


def _level(
    course: _Course, window: tuple[float, float], ends: tuple[float, float]
) -> float:
    """Mean of a rest; NaN where the samples end too soon to show it."""
    first, last = max(window[0], ends[0]), min(window[1], ends[1])
    if last - first < _LEAST * (window[1] - window[0]):
        return np.nan
    return course.mean(first, last)


def _crossing(
    when: Float[np.ndarray, " m"],
    y: Float[np.ndarray, " m"],
    level: float,
    *,
    is_last: float | None = None,
) -> tuple[float, bool]:
    """Where a course that starts above a level first falls below it.

    Args:
        when: Times, in either direction [s].
        y: Course.
        level: Level to pass.
        is_last: Time of the foot: then the last passing before it counts.

    Returns:
        Time, and whether the course never falls so low.
    """
    below = y < level
    if is_last is not None:
        beyond = np.abs(when - when[0]) > abs(is_last - when[0]) + 1e-12
        below |= beyond
        above = np.flatnonzero(~below)
        k = int(above[-1]) + 1 if above.size else 0
        if k >= len(y):
            return float(when[-1]), True
    else:
        passed = np.flatnonzero(below)
        if passed.size == 0:
            return float(when[-1]), True
        k = int(passed[0])
    if k == 0:
        return float(when[0]), False
    share = np.clip((y[k - 1] - level) / max(y[k - 1] - y[k], 1e-300), 0.0, 1.0)
    return float(when[k - 1] + share * (when[k] - when[k - 1])), False
