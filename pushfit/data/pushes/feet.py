"""Where one push begins, is half up, and ends, by its own course alone.

The coarse search sees a recording as a whole. What is measured afterwards must not: a
push has the same feet whatever else the file holds. So each is traced again on its own
samples, smoothed by a share of its own width, over its own rests. Excluded: finding the
pushes (`pushfit.data.pushes.detection`) and the levels of their rests
(`pushfit.data.peaks.rests`).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

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
# Times that the integral is kept at, for each smoothing time; and steps that the usual
# one is judged by. More would only cost time.
_KNOTS, _STEPS = 16, 250
_UNIT = np.linspace(0.0, 1.0, _FINE)
_SIGMAS = 3.0
# Height over the noise that makes feet clear, and the share of the width that may be
# smoothed over to get there.
_CLEAR, _MOST_SMOOTHING = 30.0, 3.0


Number = TypeVar("Number", float, np.ndarray)
Numbers = Float[np.ndarray, " p"]
Smooth = Callable[[Float[np.ndarray, "p m"]], Float[np.ndarray, "p m"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feet(Generic[Number]):
    """The course of one push in time, or of many at once [s].

    Args:
        start: Passes the foot on the way up.
        half_up: Passes half of the height on the way up.
        peak: Is highest, smoothed.
        half_down: Passes half of the height on the way down.
        end: Passes the foot on the way down.
        height: Smoothed top over the higher of the two rests [unit].
        step: Usual sampling step around it [s].
    """

    start: Number
    half_up: Number
    peak: Number
    half_down: Number
    end: Number
    height: Number
    step: Number

    @staticmethod
    def together(feet: "Sequence[Feet[float]]") -> "Feet[np.ndarray]":
        """Courses of several pushes as arrays.

        Args:
            feet: One by one.
        """
        return Feet(**{n: np.array([getattr(own, n) for own in feet]) for n in _NAMES})

    def apart(self: "Feet[np.ndarray]") -> "tuple[Feet[float], ...]":
        """Courses of several pushes one by one."""
        rows = zip(*(getattr(self, n).tolist() for n in _NAMES), strict=True)
        return tuple(Feet(**dict(zip(_NAMES, row, strict=True))) for row in rows)

    @property
    def width(self) -> Number:
        """Time above half of the height [s]."""
        return self.half_down - self.half_up

    @property
    def before(self: "Feet[np.ndarray]") -> tuple[Numbers, Numbers]:
        """Stretches whose level is the rest before the pushes [s]."""
        last = self.start - _GUARD * (self.half_up - self.start)
        return last - self._span, last

    @property
    def after(self: "Feet[np.ndarray]") -> tuple[Numbers, Numbers]:
        """Stretches whose level is the rest after the pushes [s]."""
        settling = _SETTLING * np.minimum(self.width, _LONGEST)
        first = self.end + np.maximum(_GUARD * (self.end - self.half_down), settling)
        return first, first + self._span

    @property
    def _span(self: "Feet[np.ndarray]") -> Numbers:
        return np.maximum(_SPAN * np.minimum(self.width, _LONGEST), _FEWEST * self.step)


_NAMES = tuple(field.name for field in fields(Feet))


def trace_feet(
    time: Float[np.ndarray, " n"],
    course: Course,
    coarse: Feet[np.ndarray],
    *,
    sigma: float,
    smoothing: float | None,
) -> Feet[np.ndarray]:
    """Trace the feet of pushes from their own samples.

    Feet depend on the levels of the rests, and rests lie beyond the feet: both are
    found in turns, which changes next to nothing after the second. Their number is
    fixed, because rounding must not decide when to stop.

    Args:
        time: Sample times [s].
        course: Running means of the samples [unit].
        coarse: Where all of their pushes are, in order, roughly.
        sigma: Noise of a sample [unit].
        smoothing: Averaging time; None takes a share of each width [s].

    Returns:
        The feet.
    """
    lowest = np.minimum(np.append(time[0], coarse.end[:-1]), coarse.start)
    highest = np.maximum(np.append(coarse.start[1:], time[-1]), coarse.end)
    reach = 2 * _reach(coarse)
    lowest = np.maximum(np.maximum(lowest, coarse.start - reach), time[0])
    highest = np.minimum(np.minimum(highest, coarse.end + reach), time[-1])
    ends = np.searchsorted(time, [lowest, highest])
    feet = replace(coarse, step=_usual_steps(time, ends))
    finest = smoothing or coarse.width.min() / WIDTH_PER_SMOOTHING
    stride = int(finest / _KNOTS / feet.step.max())
    course = course.thinned(max(1, stride))
    for _ in range(_ROUNDS):
        tau = _smoothing(feet, sigma) if smoothing is None else smoothing
        tau = np.broadcast_to(tau, feet.start.shape)
        feet = _trace(course, feet, (lowest, highest), tau=tau, sigma=sigma)
    return feet


def _usual_steps(
    time: Float[np.ndarray, " n"], ends: Int[np.ndarray, "2 p"]
) -> Numbers:
    """Median sampling steps of stretches, by the first of their steps [s]."""
    if np.diff(ends, axis=0).min() + 1 >= _STEPS:
        return np.median(np.diff(time[ends[0][:, None] + np.arange(_STEPS)]), axis=1)
    return np.array([np.median(np.diff(time[a : b + 1][:_STEPS])) for a, b in ends.T])


def are_cut(
    time: Float[np.ndarray, " n"], feet: Feet[np.ndarray]
) -> Bool[np.ndarray, " p"]:
    """Whether the samples begin or end before a rest is seen beside each push.

    Args:
        time: Sample times [s].
        feet: All pushes in order.
    """
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    shown = np.searchsorted(time, [early, late])
    is_cut = np.zeros(len(early), dtype=bool)
    is_cut[0] |= shown[0, 0] < _SHOWN
    is_cut[-1] |= len(time) - shown[1, -1] < _SHOWN
    return is_cut


def _reach(feet: Feet[np.ndarray]) -> Numbers:
    """Time around pushes that their rests lie in [s]."""
    width = np.maximum(np.minimum(feet.width, 2 * _LONGEST), 4 * feet.step)
    return _REACH * width + feet.half_up - feet.start + feet.end - feet.half_down


def _smoothing(feet: Feet[np.ndarray], sigma: float) -> Numbers:
    """A share of the width, and more where the noise would hide the feet [s]."""
    blurred = np.minimum(_CLEAR * sigma / np.maximum(feet.height, 1e-300), 1e6)
    least = np.minimum(feet.step * blurred**2, feet.width / _MOST_SMOOTHING)
    return np.maximum(np.maximum(feet.width / WIDTH_PER_SMOOTHING, least), feet.step)


def _trace(
    course: Course,
    feet: Feet[np.ndarray],
    ends: tuple[Numbers, Numbers],
    *,
    tau: Numbers,
    sigma: float,
) -> Feet[np.ndarray]:
    """One round: levels of the rests by the feet, then the feet by the levels."""
    reach = _reach(feet)
    lowest = np.maximum(ends[0], feet.start - reach)
    highest = np.minimum(ends[1], feet.end + reach)
    # Not beyond the room of each push: a neighbour is no part of its course.
    smooth = functools.partial(
        course.smooth, tau=tau[:, None], ends=(ends[0][:, None], ends[1][:, None])
    )
    spacing = (highest - lowest) / (_GRID - 1)
    index = np.arange(_GRID)
    when = lowest[:, None] + spacing[:, None] * index
    y = smooth(when)
    off = np.abs(when - (feet.start + feet.end)[:, None] / 2)
    # At least one point, the nearest, is inside.
    inside = off <= np.maximum((feet.end - feet.start) / 2, off.min(axis=1))[:, None]
    peak = np.argmax(np.where(inside, y, -np.inf), axis=1)
    t_peak, top = _tops(smooth, when, peak)
    before, after = _rests(course, feet, lowest, highest, top, y)
    rises = [np.maximum(top - rest, 1e-300) for rest in (before, after)]
    noise = _SIGMAS * sigma * np.minimum(1.0, (feet.step / tau) ** 0.5)
    feet_up, feet_down = (np.maximum(FOOT * rise, noise) for rise in rises)
    is_up, is_down = index <= peak[:, None], index >= peak[:, None]
    back = when[:, ::-1], y[:, ::-1]

    start = _falls(smooth, *back, is_up[:, ::-1], before + feet_up)
    end = _falls(smooth, when, y, is_down, after + feet_down)
    # The last times below half of the height are the first ones from the foot.
    is_up &= when >= start[:, None]
    is_down &= when <= end[:, None]
    half_up = _falls(smooth, when, -y, is_up, -before - rises[0] / 2, -1)
    half_down = _falls(
        smooth, back[0], -back[1], is_down[:, ::-1], -after - rises[1] / 2, -1
    )
    return Feet(
        start=start,
        half_up=half_up,
        peak=t_peak,
        half_down=half_down,
        end=end,
        height=np.minimum(*rises),
        step=feet.step,
    )


def _rests(
    course: Course,
    feet: Feet[np.ndarray],
    lowest: Numbers,
    highest: Numbers,
    top: Numbers,
    y: Float[np.ndarray, "p m"],
) -> tuple[Numbers, Numbers]:
    """Levels before and after pushes, each in place of the other if that is unseen."""
    has_before = np.arange(len(top)) > 0
    # Beside a neighbour the signal may still be, or already be, on its way.
    first = lowest + _TAIL * (feet.start - lowest) * has_before
    last = highest - _TAIL * (highest - feet.end) * has_before[::-1]
    before = _level(course, feet.before, first, highest)
    after = _level(course, feet.after, lowest, last)
    # What the samples begin or end with is a rest only if a push stands on it.
    no_before = ~has_before & _is_top(before, after, top)
    no_after = ~has_before[::-1] & _is_top(after, before, top)
    before = np.where(no_before, np.nan, before)
    after = np.where(no_after, np.nan, after)
    other = np.minimum(y[:, 0], y[:, -1])
    before, after = (
        np.where(np.isnan(before), after, before),
        np.where(np.isnan(after), before, after),
    )
    return (
        np.where(np.isnan(before), other, before),
        np.where(np.isnan(after), other, after),
    )


def _is_top(level: Numbers, other: Numbers, top: Numbers) -> Bool[np.ndarray, " p"]:
    """Whether a level at an end of the samples is that of the push itself."""
    return top - level < ON_STEP * (level - other)


def _tops(
    smooth: Smooth, when: Float[np.ndarray, "p m"], peak: Int[np.ndarray, " p"]
) -> tuple[Numbers, Numbers]:
    """Times and heights of the highest running means beside points of a grid."""
    rows = np.arange(len(peak))
    first = when[rows, np.maximum(peak - 1, 0)]
    last = when[rows, np.minimum(peak + 1, _GRID - 1)]
    fine = first[:, None] + (last - first)[:, None] * _UNIT
    own = smooth(fine)
    k = np.argmax(own, axis=1)
    return fine[rows, k], own[rows, k]


def _level(
    course: Course,
    window: tuple[Numbers, Numbers],
    lowest: Numbers,
    highest: Numbers,
) -> Numbers:
    """Means of rests; NaN where the samples end too soon to show them."""
    first, last = np.maximum(window[0], lowest), np.minimum(window[1], highest)
    is_shown = last - first >= _LEAST * (window[1] - window[0])
    return np.where(is_shown, course.mean(first, last), np.nan)


def _falls(
    smooth: Smooth,
    when: Float[np.ndarray, "p m"],
    y: Float[np.ndarray, "p m"],
    searched: Bool[np.ndarray, "p m"],
    level: Numbers,
    sign: int = 1,
) -> Numbers:
    """Where courses first fall below levels, or the last times if they never do.

    Args:
        smooth: Running means.
        when: Times, in either direction [s].
        y: Running means at `when`, times `sign`.
        searched: Where to look.
        level: Levels to pass, times `sign`.
        sign: -1 to see courses upside down.
    """
    rows = np.arange(len(level))
    below = searched & (y < level[:, None])
    first = np.argmax(searched, axis=1)
    final = len(y[0]) - 1 - np.argmax(searched[:, ::-1], axis=1)
    k = np.where(below.any(axis=1), np.argmax(below, axis=1), final)
    # Between two points of the grid, so that the grid itself does not matter.
    a, b = when[rows, np.maximum(k - 1, first)], when[rows, k]
    fine = a[:, None] + (b - a)[:, None] * _UNIT
    off = sign * smooth(fine) - level[:, None]
    j = np.maximum(np.argmax(off < 0, axis=1), 1)
    high, low = off[rows, j - 1], off[rows, j]
    share = np.clip(high / np.maximum(high - low, 1e-300), 0.0, 1.0)
    passed = fine[rows, j - 1] + share * (fine[rows, j] - fine[rows, j - 1])
    return np.where(below.any(axis=1) & (k > first), passed, b)
