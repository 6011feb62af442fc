"""Where each push begins, is half up, and ends, by its own course alone.

The search sees a recording as a whole. What is measured afterwards must not: a push has
the same feet whatever else the file holds. So each is traced again on its own samples,
smoothed by a share of its own width, over its own rests. Excluded: finding the pushes
(`pushfit.data.pushes.hump_search`) and the levels of their rests
(`pushfit.data.peaks.rests`). What constants do at half and at twice was seen in the
recordings of `benchmarks.recordings.real_recordings`.
"""

import functools
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.feet import (
    CLEAR,
    FOOT,
    LEAST,
    LONGEST,
    SEEN,
    SIGMAS,
    WIDTH_PER_SMOOTHING,
    Feet,
    PerPush,
    likeness,
)
from pushfit.data.pushes.running_means import RunningMeans, View
from pushfit.parameters import TINY

# A hump that is lower than this share of the step below it is an overshoot. At twice so
# is a push on a grip; half changes no test and no real recording.
ON_STEP = 0.33
# Points of a course, and of a step of it, in which levels are passed: between two fine
# ones the course is straight. Half or twice as many move no real height by 0.07 sd.
_GRID, _FINE = 120, 17
# Most rounds of feet and levels, and what is no move any more, in sampling steps. With
# six, two presses too many are found in `p0_Pa`; moves a hundredth of that move no
# height by 0.02 sd.
_ROUNDS, _SAME = 12, 1e-3
# Widths around a push that are looked at: its rests take about one to either side.
_REACH = 2.0
# Times that the integral is kept at, for each smoothing time; and steps that the usual
# one is judged by. More would only cost time.
_TIMES, _STEPS = 16, 250
# The points of a step.
_UNIT = np.linspace(0.0, 1.0, _FINE)
# Noise is of no effect on the feet of a push that is so many times as high: half of
# that moves three heights of `short_dropouts` by up to 2.6 sd, twice none. What moves
# for less than a share of its time tells nothing of it; half or twice moves nothing.
_ANY_NOISE, _LEAST_MOVING = 400.0, 0.1
# Standard deviation of a normal distribution over the mean size of its values.
_OF_MEAN = 1.2533

Smooth = Callable[[Float[np.ndarray, "p m"]], Float[np.ndarray, "p m"]]


def trace_feet(view: View, coarse: Feet[np.ndarray]) -> Feet[np.ndarray]:
    """Trace the feet of pushes from their own samples.

    Feet depend on the levels of the rests, and rests lie beyond the feet: both are
    found in turns, until nothing changes: where the search began must not matter.

    Args:
        coarse: Where all of the pushes are, in order, roughly.
    """
    time, noise_of = view.time, _noise_by_feet(view, coarse)
    ends = np.searchsorted(time, [coarse.start, coarse.end])
    feet = replace(coarse, step=_usual_steps(time, ends))
    view = replace(view, course=thinned_course(feet, view))
    for _ in range(_ROUNDS):
        was = feet
        feet = replace(feet, sigma=noise_of(feet)).alone(view)
        tau = feet.averaging(view)
        seen = _trace(view.course, feet, tau=tau)
        noise = feet.noise(tau)
        # A clear push is not left where it still is, or is again, half as high.
        is_clear = seen.height > CLEAR * noise
        seen = replace(
            seen,
            start=np.minimum(seen.start, np.where(is_clear, coarse.half_up, np.inf)),
            end=np.maximum(seen.end, np.where(is_clear, coarse.half_down, -np.inf)),
        )
        # What shrinks until it is as low as noise is held where it was more.
        feet = seen.where(seen.height >= SEEN * noise, feet)
        off = np.maximum(np.abs(feet.start - was.start), np.abs(feet.end - was.end))
        if np.all(off <= _SAME * feet.step):
            break
    return feet


def thinned_course(feet: Feet[np.ndarray], view: View) -> RunningMeans:
    """A course, known no finer than it takes to average over pushes."""
    finest = view.smoothing or feet.width.min() / WIDTH_PER_SMOOTHING
    return view.course.thinned(max(1, int(finest / _TIMES / feet.step.max())))


def _noise_by_feet(
    view: View, feet: Feet[np.ndarray]
) -> Callable[[Feet[np.ndarray]], PerPush]:
    """Noise within pushes by their feet; of the file where it has no effect on them.

        σ = 1.253 mean|bend|

    over the samples between the feet: those of one push and of no other.
    """
    whole = view.noise.sigma
    is_clear = feet.height > _ANY_NOISE * whole
    if is_clear.all():
        return lambda feet: np.full(len(feet.start), whole)
    over, count = view.bends

    def noise(feet: Feet[np.ndarray]) -> PerPush:
        share = count.mean(feet.start, feet.end)
        own = _OF_MEAN * over.mean(feet.start, feet.end) / np.maximum(share, TINY)
        return np.where(~is_clear & (share > _LEAST_MOVING), own, whole)

    return noise


def _usual_steps(
    time: Float[np.ndarray, " n"], ends: Int[np.ndarray, "2 p"]
) -> PerPush:
    """Median sampling steps of stretches, by the first of their steps [s]."""
    if np.diff(ends, axis=0).min() >= _STEPS:
        return np.median(np.diff(time[ends[0][:, None] + np.arange(_STEPS)]), axis=1)
    # A stretch may be shorter than a step.
    ends[0] = np.minimum(ends[0], len(time) - 2)
    ends[1] = np.maximum(ends[1], ends[0] + 1)
    return np.array([np.median(np.diff(time[a : b + 1][:_STEPS])) for a, b in ends.T])


def _reach(feet: Feet[np.ndarray]) -> PerPush:
    """Time around pushes that their rests lie in [s]."""
    width = np.maximum(np.minimum(feet.width, 2 * LONGEST), 4 * feet.step)
    return _REACH * width + feet.half_up - feet.start + feet.end - feet.half_down


def _trace(
    course: RunningMeans, feet: Feet[np.ndarray], *, tau: PerPush
) -> Feet[np.ndarray]:
    """One round: levels of the rests by the feet, then the feet by the levels."""
    reach, ends = _reach(feet), (feet.lowest, feet.highest)
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
    before, after = _rests(course, feet, y=y, peak=peak, top=top)
    rises = [np.maximum(top - rest, TINY) for rest in (before, after)]
    noise = SIGMAS * feet.noise(tau)
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
    return replace(
        feet,
        start=start,
        half_up=half_up,
        peak=t_peak,
        half_down=half_down,
        end=end,
        height=np.minimum(*rises),
        moved=after - before,
    )


def _rests(
    course: RunningMeans,
    feet: Feet[np.ndarray],
    *,
    y: Float[np.ndarray, "p m"],
    peak: Int[np.ndarray, " p"],
    top: PerPush,
) -> tuple[PerPush, PerPush]:
    """Levels before and after pushes, each in place of the other if that is unseen."""
    first, last = feet.before
    part = np.minimum(LEAST * feet.span, last - first)
    noise = feet.noise(np.maximum(part, feet.step))
    far = np.maximum(FOOT * feet.height, SIGMAS * noise)
    before, after = (_level(course, feet, sign, far=far) for sign in (-1, 1))
    # What the samples begin or end with is a rest only if a push stands on it.
    is_first, is_last = feet.lowest <= course.time[0], feet.highest >= course.time[-1]
    before, after = (
        np.where(is_end & _is_top(own, other, top), np.nan, own)
        for own, other, is_end in ((before, after, is_first), (after, before, is_last))
    )
    # Beside a neighbour the course goes down as far as it ever does.
    index, ends = np.arange(_GRID), np.minimum(y[:, 0], y[:, -1])
    levels = []
    for own, other, is_end, is_beside in (
        (before, after, is_first, index <= peak[:, None]),
        (after, before, is_last, index >= peak[:, None]),
    ):
        low = np.where(is_beside, y, np.inf).min(axis=1)
        low = np.where(is_end, np.where(np.isnan(other), ends, -np.inf), low)
        levels.append(np.where(np.isnan(own), np.fmax(other, low), own))
    return levels[0], levels[1]


def _is_top(level: PerPush, other: PerPush, top: PerPush) -> Bool[np.ndarray, " p"]:
    """Whether a level at an end of the samples is that of the push itself."""
    return top - level < ON_STEP * (level - other)


def _tops(
    smooth: Smooth, when: Float[np.ndarray, "p m"], peak: Int[np.ndarray, " p"]
) -> tuple[PerPush, PerPush]:
    """Times and heights of the highest running means beside points of a grid."""
    rows = np.arange(len(peak))
    first = when[rows, np.maximum(peak - 1, 0)]
    last = when[rows, np.minimum(peak + 1, _GRID - 1)]
    fine = first[:, None] + (last - first)[:, None] * _UNIT
    own = smooth(fine)
    k = np.argmax(own, axis=1)
    return fine[rows, k], own[rows, k]


def _level(
    course: RunningMeans, feet: Feet[np.ndarray], sign: int, *, far: PerPush
) -> PerPush:
    """Means of rests before pushes (-1) or after them (1), NaN where too short.

    That of the part beside the push where the rest has another level: it has stepped.
    """
    first, last = feet.before if sign < 0 else feet.after()
    least = LEAST * feet.span
    part = np.minimum(least, last - first)
    near = course.mean(*((last - part, last) if sign < 0 else (first, first + part)))
    off = course.mean(first, last) - near
    level = near + likeness(off, far) * off
    return np.where(last - first >= least, level, np.nan)


def _falls(
    smooth: Smooth,
    when: Float[np.ndarray, "p m"],
    y: Float[np.ndarray, "p m"],
    searched: Bool[np.ndarray, "p m"],
    level: PerPush,
    sign: int = 1,
) -> PerPush:
    """Where courses first fall below levels, or the last times if they never do.

    Args:
        when: Times, in either direction [s].
        y: Running means at `when`, times `sign`.
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
    share = np.clip(high / np.maximum(high - low, TINY), 0.0, 1.0)
    passed = fine[rows, j - 1] + share * (fine[rows, j] - fine[rows, j - 1])
    return np.where(below.any(axis=1) & (k > first), passed, b)
