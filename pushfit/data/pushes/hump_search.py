"""A search for humps in a signal as a whole: roughly where they are, and how high.

The signal is averaged in short bins, so that cost and noise fall together and uneven
steps become even. Humps between valleys are then joined into pushes. Excluded: the
course of each by itself (`pushfit.data.pushes.tracing`). What constants do at half and
at twice was seen in the recordings of `benchmarks.recordings.real_recordings`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int, Real

from pushfit.data.pushes.feet import FOOT, SIGMAS, Feet
from pushfit.data.pushes.humps import Humps
from pushfit.data.pushes.noise import SignalNoise
from pushfit.data.pushes.running_means import View

# Smoothing leaves this share of a push, where the least height is asked for: it takes
# 2.5 % from a triangle, and more where noise asks for more of it.
_SMOOTHED = 0.8
# Of 10^5 independent samples the largest is 4.3 sigma; a maximum needs more.
_SIGNIFICANT = 6.0
# The smallest is as far below; a push, from foot to top, needs more than both. Half is
# reached by noise of `p0_Pa`; twice loses 6 of its 15 presses.
_BEYOND_NOISE = 9.0
# A rest of fewer bins of the trace shows no wander; at the ends it may be but the edge
# of one. With twelve inside one of 5 pushes of `short_dropouts` is lost.
_FEWEST_BINS, _FEWEST_AT_ENDS = 6, 15
# Bins that are averaged, and of a rest that shows how their means scatter. At 42 a
# press of `p0_Pa` that is cut is lost; at 84 noise is one where it is interpolated.
_MEAN, _LONG = 3, 60
# Humps of this share of the largest are pushes beyond doubt.
_LARGE = 0.25
# Width of the densest third of a normal distribution [σ].
_NORMAL_THIRD = 0.861
# Means of counts are often equal on paper. Rounding them to this share of the noise
# keeps an offset or a unit, which round otherwise, from breaking the ties.
_GRAIN = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trace:
    """A signal averaged on an even grid."""

    t0: float
    step: float
    y: Float[np.ndarray, " m"]
    noise: float

    def at(self, index: Real[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
        """Times of grid positions."""
        return self.t0 + self.step * index


def search_humps(
    view: View, *, tau: float, wander: float = np.inf
) -> tuple[Feet[np.ndarray], Bool[np.ndarray, " p"], Bool[np.ndarray, " p"], float]:
    """One pass at one smoothing time.

    Args:
        tau: Smoothing time [s].
        wander: Slow noise at rest with less smoothing, which is no less [unit].

    Returns:
        The humps, roughly; which are too low for a push, but no rest of the others
        either; which are followed by a level that is a rest however high it is; and
        the slow noise at rest.
    """
    trace = _reduce(view, tau)
    significant = _SIGNIFICANT * trace.noise
    tops = _maxima(trace.y, significant)
    humps = Humps.between(trace.y, tops)
    rests = humps.join(view.split)
    humps = _regained(humps, tops, trace)
    large = _LARGE * float(humps.heights.max(initial=0.0))
    slow, fast = _noise_at_rest(humps, trace, large)
    wander = min(wander, slow)
    by_noise = max(_BEYOND_NOISE * max(trace.noise, fast), _SIGNIFICANT * wander)
    smallest = by_noise if view.min_height is None else _SMOOTHED * view.min_height
    humps.drop_below(min(by_noise, smallest))
    pushes = replace(humps)
    pushes.drop_below(smallest)
    return (
        _coarse(humps, trace, view.noise.sigma),
        ~np.isin(humps.peaks, pushes.peaks),
        np.isin(humps.valleys[1:], list(rests)),
        wander,
    )


def _regained(humps: Humps, tops: Int[np.ndarray, " t"], trace: _Trace) -> Humps:
    """Give back tops that were joined with a hump though they lie beyond its feet.

    Below a step of the rest level a rest looks too high for one.
    """
    while len(humps.peaks) and (tops := np.setdiff1d(tops, humps.peaks)).size:
        k = np.searchsorted(humps.valleys, tops) - 1
        kept = np.clip(k, 0, len(humps.peaks) - 1) == k
        k, tops = k[kept], tops[kept]
        rest = trace.y[humps.peaks] - humps.heights
        own = np.unique(k)
        feet = [_feet(humps, int(j), trace, rest=float(rest[j])) for j in own]
        first, last = np.array(feet).reshape(-1, 2)[np.searchsorted(own, k)].T
        heights = trace.y[humps.peaks[k]] - rest[k]
        rise = trace.y[tops] - rest[k]
        is_lost = ((tops < first) | (tops > last)) & (rise >= _LARGE * heights)
        lost = tops[is_lost]
        if lost.size == 0:
            break
        highest = lost[np.argmax(trace.y[lost])]
        humps = Humps.between(trace.y, np.sort(np.append(humps.peaks, highest)))
    return humps


def _reduce(view: View, tau: float) -> _Trace:
    """Average in bins of a third of the smoothing time, then over three bins."""
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to load

    time, signal, noise = view.time, view.signal, view.noise
    step = max(tau / _MEAN, view.course.step)
    n_bins = max(3, int(np.ceil((time[-1] - time[0]) / step)) + 1)
    edges = time[0] + step * (np.arange(n_bins) - 0.5)
    first = np.searchsorted(time, edges)
    counts = np.diff(np.append(first, len(time)))
    filled = counts > 0
    sums = np.add.reduceat(signal, first[filled])
    centres = np.arange(n_bins, dtype=float)
    y = np.interp(centres, centres[filled], sums / counts[filled])
    smooth = uniform_filter1d(y - signal[0], _MEAN, mode="nearest")
    grain = _GRAIN * noise.sigma
    return _Trace(
        t0=float(time[0]),
        step=step,
        y=grain * np.round(smooth / grain),
        noise=noise.of_mean(_MEAN * float(np.median(counts[filled]))),
    )


def _maxima(y: Float[np.ndarray, " m"], significant: float) -> Int[np.ndarray, " k"]:
    """Significant local maxima, those at the ends included."""
    from scipy.signal import find_peaks  # noqa: PLC0415 - slow to load

    # Walls below everything make a maximum at the end of the signal a peak.
    wall = y.min() - 2 * significant
    padded = np.concatenate([[wall], y, [wall]])
    return find_peaks(padded, prominence=significant)[0] - 1


def _noise_at_rest(humps: Humps, trace: _Trace, large: float) -> tuple[float, float]:
    """Typical slow and fast noise of the smoothed signal between large humps.

    Of slow noise it is the scatter; of fast noise that of means from each to the next,
    which where neighbouring samples are alike, as interpolated ones, is more than the
    samples show.

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
        rest = trace.y[start:first]
        ordered, n_third = np.sort(rest), len(rest) // 3
        is_inner = start > 0 and k is not None
        if n_third >= (_FEWEST_BINS if is_inner else _FEWEST_AT_ENDS) // 3:
            densest = np.min(ordered[n_third:] - ordered[: len(ordered) - n_third])
            fast = 0.0
            if len(rest) >= _LONG:
                means = rest[::_MEAN]
                fast = SignalNoise.of(np.arange(0.0, len(means)), means).sigma
            scatters.append((float(densest) / _NORMAL_THIRD, fast))
        start = last + 1
    if not scatters:
        return 0.0, 0.0
    slow, fast = (sorted(own) for own in zip(*scatters, strict=True))
    return slow[(len(slow) - 1) // 3], fast[(len(fast) - 1) // 2]


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
    noise = SIGMAS * trace.noise
    feet = [low + max(FOOT * (y[peak] - low), noise) for low in rests]
    below = np.flatnonzero(y[left:peak] < feet[0])
    after = np.flatnonzero(y[peak + 1 : right + 1] < feet[1])
    start = left + 1 + below.max(initial=-1)
    return int(start), int(peak + after.min(initial=right - peak))


def _coarse(humps: Humps, trace: _Trace, sigma: float) -> Feet[np.ndarray]:
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
        # Rooms come with the tracing.
        lowest=trace.at(start),
        highest=trace.at(end),
        height=heights,
        moved=np.zeros(len(heights)),
        step=np.full(len(heights), trace.step),
        sigma=np.full(len(heights), sigma),
    )
