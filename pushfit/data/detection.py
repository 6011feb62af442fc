"""Where in a signal the pushes are: their extent and their order, not their height.

The signal is averaged in short bins, so that cost and noise fall together and uneven
steps become even. Humps between valleys are then joined into pushes. Excluded:
baselines and heights (`pushfit.data.heights`) and which push is which
(`pushfit.data.alignment`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

# A push narrower than this is not one of a robot's; it is where smoothing starts [s].
_FIRST_SMOOTHING = 0.1
# Smoothing by a tenth of the width at half height lowers the top of a triangle by 2 %.
_WIDTH_PER_SMOOTHING = 10.0
# Of 10^5 independent samples the largest is 4.3 sigma; a maximum needs more.
_SIGNIFICANT = 6.0
# The smallest is as far below; a push, from foot to top, needs more than both.
_BEYOND_NOISE = 9.0
# Level of the foot, where a push begins and ends, as a share of its height.
_FOOT = 0.05
# A hump below the first share of the largest is a brush; below the second it is one if
# the next larger hump is so many times higher.
_BRUSH, _SMALL, _GAP_RATIO = 0.03, 0.15, 4.0
# Humps of this share of the largest are pushes beyond doubt.
_LARGE = 0.25
# Width of the densest third of a normal distribution [σ].
_NORMAL_THIRD = 0.861
# A dip is shorter than this share of the time between two tops, a rest is not.
_REST_QUANTILE = 0.2
# A hump that an end of the signal cuts off, and that is longer than this share of the
# signal, is a trend.
_MAX_CUT = 0.5
# Samples that the noise is judged by; more would only cost time.
_NOISE_SAMPLES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Where one push lies.

    Args:
        start: First sample above the foot.
        end: One past the last sample above the foot.
        t_start: Start [s].
        t_end: End [s].
        t_peak: Time of the highest smoothed reading [s].
        width: Time above half of the height [s].
        height: Top over the higher of the two feet, smoothed [unit].
        cut_start: Whether the signal begins inside the push.
        cut_end: Whether the signal ends inside the push.
        is_brush: Whether it is so small among the others that it may be no push.
    """

    start: int
    end: int
    t_start: float
    t_end: float
    t_peak: float
    width: float
    height: float
    cut_start: bool
    cut_end: bool
    is_brush: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """How samples scatter about the course of the signal.

        σ = 1.4826 median|y_{i+1} - y_i| / √2, over the steps that are not 0

    Steps of 0 come from a resolution coarser than the noise or from a sensor at its
    limit, and tell nothing of the noise elsewhere.

    Args:
        sigma: σ; 0 for a constant signal [unit].
        quantum: Smallest step between readings; 0 for a constant signal [unit].
    """

    sigma: float
    quantum: float

    @classmethod
    def of(cls, signal: Float[np.ndarray, " n"]) -> "Noise":
        """Judge a signal by its steps from sample to sample."""
        stride = max(1, (len(signal) - 1) // _NOISE_SAMPLES)
        first = np.arange(0, len(signal) - 1, stride)
        steps = np.abs(signal[first + 1] - signal[first])
        moving = steps[steps > 0]
        if moving.size == 0:
            return cls(sigma=0.0, quantum=0.0)
        quantum = float(moving.min())
        sigma = 1.4826 * float(np.median(moving)) / np.sqrt(2)
        return cls(sigma=float(sigma), quantum=quantum)

    def of_mean(self, n_samples: float) -> float:
        """Standard deviation of a mean; what lies below the resolution stays."""
        return max(self.sigma / max(1.0, n_samples) ** 0.5, self.quantum / 2)


def find_extents(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    *,
    split: float,
    min_height: float | None,
    smoothing: float | None,
) -> tuple[Extent, ...]:
    """Find all humps that rise from rest and return to it.

    Args:
        time: Sample times [s].
        signal: Samples without gaps in value; pushes go up.
        split: Two humps are two pushes if the valley between them is lower than this
            share of the lower hump.
        min_height: Smallest height of a push; None judges by the noise, and by the
            other pushes what is a brush [unit].
        smoothing: Averaging time; None takes it from the pushes [s].

    Returns:
        Extents in order of time.
    """
    noise = Noise.of(signal)
    if noise.sigma == 0.0 or len(signal) < 5:
        return ()
    tau = smoothing or _FIRST_SMOOTHING
    found = _detect(time, signal, noise, tau, split, min_height)
    if smoothing is None and found:
        wider = float(np.median([e.width for e in found])) / _WIDTH_PER_SMOOTHING
        if wider > 1.5 * tau:
            found = _detect(time, signal, noise, wider, split, min_height)
    return found


@dataclass(frozen=True, slots=True)
class _Trace:
    """A signal averaged on an even grid."""

    t0: float
    step: float
    y: Float[np.ndarray, " m"]
    noise: float

    def at(self, index: int) -> float:
        """Time of a grid position."""
        return self.t0 + self.step * index


@dataclass(slots=True)
class _Humps:
    """Peaks with the valleys before, between and after them.

    Args:
        y: Smoothed signal.
        peaks: Grid positions of the tops.
        valleys: Grid positions of the lowest points beside them.
        rests: Rest level at each valley, which a brief dip does not lower.
    """

    y: Float[np.ndarray, " m"]
    peaks: Int[np.ndarray, " k"]
    valleys: Int[np.ndarray, " k1"]
    rests: Float[np.ndarray, " k1"]

    @classmethod
    def between(
        cls, y: Float[np.ndarray, " m"], peaks: Int[np.ndarray, " k"]
    ) -> "_Humps":
        """Find the valleys that belong to peaks."""
        bounds = [0, *peaks, len(y) - 1]
        spans = list(pairwise(bounds))
        valleys = np.array([a + int(np.argmin(y[a : b + 1])) for a, b in spans])
        rests = np.array([np.quantile(y[a : b + 1], _REST_QUANTILE) for a, b in spans])
        return cls(y, peaks, valleys, rests)

    @property
    def heights(self) -> Float[np.ndarray, " k"]:
        """Tops over the higher foot; at the ends of the signal over the inner one."""
        lows = self.y[self.valleys]
        left, right = lows[:-1].copy(), lows[1:].copy()
        if len(left) == 0:
            return left
        if self.valleys[0] == self.peaks[0]:
            left[0] = -np.inf
        if self.valleys[-1] == self.peaks[-1]:
            right[-1] = -np.inf
        return self.y[self.peaks] - np.maximum(left, right)

    def drop(self, peak: int) -> None:
        """Remove a peak; the valleys beside it become one."""
        pair = self.valleys[peak : peak + 2]
        lower = int(pair[np.argmin(self.y[pair])])
        self.peaks = np.delete(self.peaks, peak)
        self.valleys = np.delete(self.valleys, peak)
        self.rests = np.delete(self.rests, peak)
        self.valleys[peak] = lower
        first = self.peaks[peak - 1] if peak > 0 else 0
        last = self.peaks[peak] if peak < len(self.peaks) else len(self.y) - 1
        self.rests[peak] = np.quantile(self.y[first : last + 1], _REST_QUANTILE)

    def join(self, split: float) -> None:
        """Join neighbours whose valley is too high for a rest between two pushes.

        The highest valley goes first. It is compared with the lower of the rests beside
        the pair, which is the true one once the inner humps are joined: no rest level
        over the whole recording is needed, whatever its drift.
        """
        while len(self.peaks) > 1:
            tops, lows = self.y[self.peaks], self.y[self.valleys]
            rest = np.minimum(self.rests[:-2], self.rests[2:])
            smaller = np.minimum(tops[:-1], tops[1:])
            ratio = (lows[1:-1] - rest) / np.maximum(smaller - rest, 1e-300)
            worst = int(np.argmax(ratio))
            if ratio[worst] <= split:
                return
            self._merge(worst, worst + int(tops[worst] >= tops[worst + 1]))

    def _merge(self, pair: int, lower: int) -> None:
        """Make one hump of two: the valley between goes, with the lower top."""
        self.peaks = np.delete(self.peaks, lower)
        self.valleys = np.delete(self.valleys, pair + 1)
        self.rests = np.delete(self.rests, pair + 1)

    def drop_below(self, least: float) -> None:
        """Remove humps lower than `least`, smallest first."""
        while len(self.peaks):
            heights = self.heights
            smallest = int(np.argmin(heights))
            if heights[smallest] >= least:
                return
            self.drop(smallest)


def _detect(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    noise: Noise,
    tau: float,
    split: float,
    min_height: float | None,
) -> tuple[Extent, ...]:
    """One pass at one smoothing time."""
    trace = _reduce(time, signal, noise, tau)
    significant = _SIGNIFICANT * trace.noise
    humps = _Humps.between(trace.y, _maxima(trace.y, significant))
    humps.join(split)
    least, is_stated = min_height, min_height is not None
    if least is None:
        large = _LARGE * float(humps.heights.max(initial=0.0))
        noise_alone = _BEYOND_NOISE * trace.noise
        least = max(noise_alone, _SIGNIFICANT * _rest_wander(humps, trace, large))
    humps.drop_below(least)
    heights = humps.heights
    smallest_push = 0.0 if is_stated else _smallest_push(heights)
    extents = (
        _extent(humps, k, trace, time, height=float(height), smallest=smallest_push)
        for k, height in enumerate(heights)
    )
    return tuple(extent for extent in extents if extent is not None)


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
) -> _Trace:
    """Average in bins of a third of the smoothing time, then over three bins."""
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to load

    step = max(tau / 3, float(np.median(np.diff(time[: 1 + _NOISE_SAMPLES]))))
    n_bins = max(3, int(np.ceil((time[-1] - time[0]) / step)) + 1)
    edges = time[0] + step * (np.arange(n_bins) - 0.5)
    first = np.searchsorted(time, edges)
    counts = np.diff(np.append(first, len(time)))
    filled = counts > 0
    sums = np.add.reduceat(signal, first[filled])
    centres = np.arange(n_bins, dtype=float)
    y = np.interp(centres, centres[filled], sums / counts[filled])
    return _Trace(
        float(time[0]),
        step,
        uniform_filter1d(y, 3, mode="nearest"),
        noise.of_mean(3 * float(np.median(counts[filled]))),
    )


def _maxima(y: Float[np.ndarray, " m"], significant: float) -> Int[np.ndarray, " k"]:
    """Significant local maxima, those at the ends included."""
    from scipy.signal import find_peaks  # noqa: PLC0415 - slow to load

    # Walls below everything make a maximum at the end of the signal a peak.
    wall = y.min() - 2 * significant
    padded = np.concatenate([[wall], y, [wall]])
    return find_peaks(padded, prominence=significant)[0] - 1


def _rest_wander(humps: _Humps, trace: _Trace, large: float) -> float:
    """Slow noise at rest: typical scatter of the smoothed signal between large humps.

    Small humps count as rest here, because they may be nothing else. If they are pushes
    after all, they do not widen the densest third of a rest.
    """
    scatters = []
    start = 0
    for k in [*np.flatnonzero(humps.heights >= large), None]:
        first, last = (len(trace.y), 0) if k is None else _feet(humps, int(k), trace)
        ordered = np.sort(trace.y[start:first])
        n_third = len(ordered) // 3
        if n_third > 1:
            densest = np.min(ordered[n_third:] - ordered[: len(ordered) - n_third])
            scatters.append(float(densest) / _NORMAL_THIRD)
        start = last + 1
    return float(np.median(scatters)) if scatters else 0.0


def _feet(humps: _Humps, k: int, trace: _Trace) -> tuple[int, int]:
    """First and last grid position of a push above its feet."""
    y, peak = trace.y, int(humps.peaks[k])
    left, right = int(humps.valleys[k]), int(humps.valleys[k + 1])
    noise = 3 * trace.noise

    def foot(valley: int) -> float:
        return y[valley] + max(_FOOT * (y[peak] - y[valley]), noise)

    below = np.flatnonzero(y[left:peak] < foot(left))
    start = left + below[-1] + 1 if below.size else left
    below = np.flatnonzero(y[peak + 1 : right + 1] < foot(right))
    end = peak + below[0] if below.size else right
    return int(start), int(end)


def _extent(
    humps: _Humps,
    k: int,
    trace: _Trace,
    time: Float[np.ndarray, " n"],
    *,
    height: float,
    smallest: float,
) -> Extent | None:
    """Extent of a push in samples; None for a mere trend."""
    y, peak = trace.y, int(humps.peaks[k])
    start, end = _feet(humps, k, trace)
    cut_start, cut_end = start <= 1, end >= len(y) - 2
    if (cut_start and cut_end) or (
        (cut_start or cut_end) and end - start > _MAX_CUT * len(y)
    ):
        return None
    above = np.flatnonzero(y[start : end + 1] >= y[peak] - height / 2)
    t_start, t_end = trace.at(start), trace.at(end)
    first, last = np.searchsorted(time, [t_start, t_end + trace.step / 2])
    return Extent(
        start=int(first),
        end=int(last),
        t_start=t_start,
        t_end=t_end,
        t_peak=trace.at(peak),
        width=float((above[-1] - above[0] + 1) * trace.step),
        height=height,
        cut_start=cut_start,
        cut_end=cut_end,
        is_brush=height < smallest,
    )
