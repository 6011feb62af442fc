"""Where in a signal the pushes are: their extent and their order, not their height.

The signal is averaged in short bins, so that cost and noise fall together and uneven
steps become even. Humps between valleys are then joined into pushes. Excluded:
baselines and heights (`pushfit.data.peaks.heights`) and which push is which
(`pushfit.data.plans.alignment`).
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Real

from pushfit.data.pushes.course import Course
from pushfit.data.pushes.doubles import join_one, part_doubles
from pushfit.data.pushes.ends import are_cut
from pushfit.data.pushes.feet import (
    FOOT,
    ON_STEP,
    WIDTH_PER_SMOOTHING,
    Feet,
    trace_feet,
)
from pushfit.data.pushes.humps import Humps
from pushfit.data.pushes.noise import Noise

# Smoothing lowers a push by less than this share.
_SMOOTHED = 0.8
# A push narrower than this is not one of a robot's; it is where smoothing starts [s].
_FIRST_SMOOTHING = 0.1
# Of 10^5 independent samples the largest is 4.3 sigma; a maximum needs more.
_SIGNIFICANT = 6.0
# The smallest is as far below; a push, from foot to top, needs more than both.
_BEYOND_NOISE = 9.0
# A hump below the first share of the largest is a brush; below the second it is one if
# the next larger hump is so many times higher.
_BRUSH, _SMALL, _GAP_RATIO = 0.03, 0.15, 5.0
# A rest of fewer bins of the trace shows no wander; at the ends it may be but the edge
# of one.
_FEWEST_BINS, _FEWEST_AT_ENDS = 6, 15
# Humps of this share of the largest are pushes beyond doubt.
_LARGE = 0.25
# Width of the densest third of a normal distribution [σ].
_NORMAL_THIRD = 0.861
# A hump that an end of the signal cuts off, and that is longer than this share of the
# signal, or than so many whole pushes, is a trend.
_MAX_CUT, _CUT_LENGTHS = 0.5, 3.0
# Means of counts are often equal on paper. Rounding them to this share of the noise
# keeps an offset or a unit, which round otherwise, from breaking the ties.
_GRAIN = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Where one push lies.

    Args:
        start: First sample above the foot.
        end: One past the last sample above the foot.
        feet: Its course in time.
        is_brush: Whether it is so small among the others that it may be no push.
        is_cut: Whether the signal begins or ends inside the push.
        is_low: Whether it is lower than the smallest push asked for.
        sign: 1 where the signal rises from rest, -1 where it falls.
    """

    start: int
    end: int
    feet: Feet[float]
    is_brush: bool
    is_cut: bool
    is_low: bool = False
    sign: int = 1

    @property
    def t_start(self) -> float:
        """Start [s]."""
        return self.feet.start

    @property
    def t_end(self) -> float:
        """End [s]."""
        return self.feet.end

    @property
    def t_peak(self) -> float:
        """Time of the highest smoothed reading [s]."""
        return self.feet.peak

    @property
    def width(self) -> float:
        """Time above half of the height [s]."""
        return self.feet.width

    @property
    def height(self) -> float:
        """Top over the higher of the two feet, smoothed [unit]."""
        return self.feet.height


def find_extents(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    *,
    course: Course,
    noise: Noise,
    split: float,
    min_height: float | None,
    smoothing: float | None,
) -> tuple[Extent, ...]:
    """Find all humps that rise from rest and return to it.

    Args:
        time: Sample times [s].
        signal: Samples without gaps in value; pushes go up.
        course: Running means of the samples.
        noise: How the samples scatter.
        split: Two humps are two pushes if the valley between them is lower than this
            share of the lower hump.
        min_height: Smallest height of a push, lower humps are marked; None judges by
            the noise, and by the other pushes what is a brush [unit].
        smoothing: Averaging time; None takes it from the pushes [s].

    Returns:
        Extents in order of time.
    """
    if noise.sigma == 0.0 or len(signal) < 5:
        return ()
    tau = smoothing or _FIRST_SMOOTHING
    rules = (split, min_height, course.step)
    found, is_low, is_rest = _detect(time, signal, noise, tau, *rules)
    if smoothing is None and not is_low.all():
        wider = float(np.median(found.width[~is_low])) / WIDTH_PER_SMOOTHING
        if wider > 1.5 * tau:
            found, is_low, is_rest = _detect(time, signal, noise, wider, *rules)
    if found.start.size == 0:
        return ()
    feet, whose = _resolved(
        time,
        course,
        found,
        # A hump that is too low is no part of a push.
        is_rest=is_rest | is_low | np.append(is_low[1:], True),
        sigma=noise.sigma,
        smoothing=smoothing,
        split=split,
    )
    is_low = is_low[whose]
    is_cut = are_cut(time, feet)
    is_push = ~_are_trends(feet, is_cut, time, is_low)
    smallest = 0.0 if min_height is not None else _smallest_push(feet.height[is_push])
    first, last = np.searchsorted(time, [feet.start, feet.end])
    first = np.minimum(first, len(time) - 1)
    last = np.maximum(last, first + 1)
    return tuple(
        Extent(
            start=int(first[k]),
            end=int(last[k]),
            feet=own,
            is_brush=own.height < smallest,
            is_cut=bool(is_cut[k]),
            is_low=bool(is_low[k]),
        )
        for k, own in enumerate(feet.apart())
        if is_push[k]
    )


def _resolved(
    time: Float[np.ndarray, " n"],
    course: Course,
    found: Feet[np.ndarray],
    *,
    is_rest: Bool[np.ndarray, " p"],
    sigma: float,
    smoothing: float | None,
    split: float,
) -> tuple[Feet[np.ndarray], Int[np.ndarray, " q"]]:
    """Feet of pushes that are one and no more, each by its own course; and whose."""
    whose = np.arange(len(is_rest))

    def traced(coarse: Feet[np.ndarray]) -> Feet[np.ndarray]:
        return trace_feet(time, course, coarse, sigma=sigma, smoothing=smoothing)

    by = {"sigma": sigma, "smoothing": smoothing, "split": split}
    feet = traced(found)
    # First all that is one is joined, then all that is two is parted, so that it ends.
    while True:
        found, own = join_one(time, course, feet, is_rest=is_rest[whose], **by)
        if len(own) == len(whose):
            break
        whose, feet = whose[own], traced(found)
    while True:
        found, own = part_doubles(time, course, feet, **by)
        if len(own) == len(whose):
            break
        whose, feet = whose[own], traced(found)
    return feet, whose


def _are_trends(
    feet: Feet[np.ndarray],
    is_cut: Bool[np.ndarray, " p"],
    time: Float[np.ndarray, " n"],
    is_low: Bool[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """What begins before the signal or never ends, unless it is as short as a push."""
    length = feet.end - feet.start
    whole = length[~is_cut & ~is_low]
    duration = float(time[-1] - time[0])
    longest = _CUT_LENGTHS * whole.max() if whole.size else _MAX_CUT * duration
    slack = 2 * float(np.median(feet.step))
    # What is left of it in its own smoothing is one reading.
    is_reading = (feet.width < slack) & ~is_cut
    # Of what does both, more than half is there on either side.
    rises = feet.half_up > time[0] + slack
    falls = feet.half_down < time[-1] - slack
    is_long = is_cut & (length > longest)
    return is_reading | ~(rises | falls) | (is_long & ~(rises & falls))


@dataclass(frozen=True, slots=True)
class _Trace:
    """A signal averaged on an even grid."""

    t0: float
    step: float
    y: Float[np.ndarray, " m"]
    noise: float

    def at(self, index: Real[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
        """Times of grid positions."""
        return self.t0 + self.step * index


def _detect(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    noise: Noise,
    tau: float,
    split: float,
    min_height: float | None,
    usual_step: float,
) -> tuple[Feet[np.ndarray], Bool[np.ndarray, " p"], Bool[np.ndarray, " p"]]:
    """One pass at one smoothing time: the humps, roughly, and which are low.

    And which are followed by a level that is a rest however high it is.

    A hump that is too low for a push stays one, so that it is no rest of the others.
    """
    trace = _reduce(time, signal, noise, tau, usual_step)
    significant = _SIGNIFICANT * trace.noise
    tops = _maxima(trace.y, significant)
    humps = Humps.between(trace.y, tops)
    rests = humps.join(split)
    humps = _regained(humps, tops, trace)
    large = _LARGE * float(humps.heights.max(initial=0.0))
    wander = _SIGNIFICANT * _rest_wander(humps, trace, large)
    by_noise = max(_BEYOND_NOISE * trace.noise, wander)
    smallest = by_noise if min_height is None else _SMOOTHED * min_height
    humps.drop_below(min(by_noise, smallest))
    pushes = replace(humps)
    pushes.drop_below(smallest)
    return (
        _coarse(humps, trace),
        ~np.isin(humps.peaks, pushes.peaks),
        np.isin(humps.valleys[1:], list(rests)),
    )


def _regained(humps: Humps, tops: Int[np.ndarray, " t"], trace: _Trace) -> Humps:
    """Give back tops that were joined with a hump though they lie beyond its feet.

    Below a step of the rest level a rest looks too high for one.
    """
    while len(humps.peaks) and (tops := np.setdiff1d(tops, humps.peaks)).size:
        k = np.searchsorted(humps.valleys, tops) - 1
        kept = np.clip(k, 0, len(humps.peaks) - 1) == k
        k, tops = k[kept], tops[kept]
        low = trace.y[humps.valleys]
        rest = np.maximum(low[:-1], low[1:])
        own = np.unique(k)
        feet = [_feet(humps, int(j), trace, rest=float(rest[j])) for j in own]
        first, last = np.array(feet).reshape(-1, 2)[np.searchsorted(own, k)].T
        heights = trace.y[humps.peaks[k]] - rest[k]
        rise = trace.y[tops] - rest[k]
        is_lost = ((tops < first) | (tops > last)) & (rise >= _LARGE * heights)
        # A push that an end cuts may have wiggles there, which do not go back far.
        is_lost &= heights >= ON_STEP * np.abs(low[k] - low[k + 1])
        lost = tops[is_lost]
        if lost.size == 0:
            break
        highest = lost[np.argmax(trace.y[lost])]
        humps = Humps.between(trace.y, np.sort(np.append(humps.peaks, highest)))
    return humps


def _smallest_push(heights: Float[np.ndarray, " k"]) -> float:
    """Height below which humps are brushes: far below the largest, beyond a gap."""
    ordered = np.sort(heights)[::-1]
    if len(ordered) == 0:
        return 0.0
    largest = float(ordered[0])
    small = ordered < _SMALL * largest
    after_gap = np.append(False, ordered[1:] * _GAP_RATIO < ordered[:-1])
    beyond = np.flatnonzero((small & after_gap) | (ordered < _BRUSH * largest))
    return float(ordered[beyond[0] - 1]) if beyond.size else 0.0


def _reduce(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    noise: Noise,
    tau: float,
    usual_step: float,
) -> _Trace:
    """Average in bins of a third of the smoothing time, then over three bins."""
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to load

    step = max(tau / 3, usual_step)
    n_bins = max(3, int(np.ceil((time[-1] - time[0]) / step)) + 1)
    edges = time[0] + step * (np.arange(n_bins) - 0.5)
    first = np.searchsorted(time, edges)
    counts = np.diff(np.append(first, len(time)))
    filled = counts > 0
    sums = np.add.reduceat(signal, first[filled])
    centres = np.arange(n_bins, dtype=float)
    y = np.interp(centres, centres[filled], sums / counts[filled])
    smooth = uniform_filter1d(y - signal[0], 3, mode="nearest")
    grain = _GRAIN * noise.sigma
    return _Trace(
        float(time[0]),
        step,
        grain * np.round(smooth / grain),
        noise.of_mean(3 * float(np.median(counts[filled]))),
    )


def _maxima(y: Float[np.ndarray, " m"], significant: float) -> Int[np.ndarray, " k"]:
    """Significant local maxima, those at the ends included."""
    from scipy.signal import find_peaks  # noqa: PLC0415 - slow to load

    # Walls below everything make a maximum at the end of the signal a peak.
    wall = y.min() - 2 * significant
    padded = np.concatenate([[wall], y, [wall]])
    return find_peaks(padded, prominence=significant)[0] - 1


def _rest_wander(humps: Humps, trace: _Trace, large: float) -> float:
    """Slow noise at rest: typical scatter of the smoothed signal between large humps.

    Small humps count as rest here, because they may be nothing else. If they are pushes
    after all, they do not widen the densest third of a rest, but for a short one: of
    a few rests the calmer count. One that the signal begins or ends in may be large.
    """
    may_be_large = humps.heights >= large
    may_be_large |= np.isin(humps.peaks, (0, len(trace.y) - 1))
    scatters = []
    start = 0
    for k in [*np.flatnonzero(may_be_large), None]:
        first, last = (len(trace.y), 0) if k is None else _feet(humps, int(k), trace)
        ordered = np.sort(trace.y[start:first])
        n_third = len(ordered) // 3
        is_inner = start > 0 and k is not None
        if n_third >= (_FEWEST_BINS if is_inner else _FEWEST_AT_ENDS) // 3:
            densest = np.min(ordered[n_third:] - ordered[: len(ordered) - n_third])
            scatters.append(float(densest) / _NORMAL_THIRD)
        start = last + 1
    return sorted(scatters)[(len(scatters) - 1) // 3] if scatters else 0.0


def _feet(
    humps: Humps, k: int, trace: _Trace, *, rest: float | None = None
) -> tuple[int, int]:
    """First and last grid position of a push above its feet.

    Both feet are those over one rest, such as that of the higher valley, because the
    other one may lie beyond a step of the rest level; or each that over its own.
    """
    y, peak = trace.y, int(humps.peaks[k])
    left, right = int(humps.valleys[k]), int(humps.valleys[k + 1])
    rests = (y[left], y[right]) if rest is None else (rest, rest)
    feet = [low + max(FOOT * (y[peak] - low), 3 * trace.noise) for low in rests]
    below = np.flatnonzero(y[left:peak] < feet[0])
    start = left + below[-1] + 1 if below.size else left
    below = np.flatnonzero(y[peak + 1 : right + 1] < feet[1])
    end = peak + below[0] if below.size else right
    return int(start), int(end)


def _coarse(humps: Humps, trace: _Trace) -> Feet[np.ndarray]:
    """Feet of humps on the grid, each over the higher of its valleys."""
    y, heights = trace.y, humps.heights
    rests = (y[humps.peaks] - np.maximum(heights, 0.0)).tolist()
    feet = np.array([_feet(humps, k, trace, rest=low) for k, low in enumerate(rests)])
    start, end = feet.reshape(-1, 2).T
    half = y[humps.peaks] - heights / 2
    above = np.array(
        [
            a + np.flatnonzero(y[a : b + 1] >= level)[[0, -1]]
            for a, b, level in zip(start, end, half, strict=True)
        ]
    )
    half_up, half_down = above.reshape(-1, 2).T + np.array([[-0.5], [0.5]])
    return Feet(
        start=trace.at(start),
        half_up=trace.at(half_up),
        peak=trace.at(humps.peaks),
        half_down=trace.at(half_down),
        end=trace.at(end),
        height=heights,
        moved=np.zeros(len(heights)),
        step=np.full(len(heights), trace.step),
    )
