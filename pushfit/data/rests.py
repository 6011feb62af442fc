"""The rests between pushes: their level, their drift and their noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Real
from numpy.lib.stride_tricks import sliding_window_view

from pushfit.data.detection import Extent, Noise

# The foot of a push is found at 5 % of its height: this share of its width before it,
# the signal may already be on its way.
_GUARD = 0.15
_MAX_GUARD = 0.25
# After a release sensors recover; the later part of a rest is the better one.
_SETTLED = 0.5
# Rests on either side that the drift under a push is judged by.
_NEIGHBOURS = 3
_MIN_RESTS = 3
# Long enough for several pushes, short enough for drift [s].
_STRETCH = 30.0
_BLOCK = 16
_MAX_SAMPLES = 1024
# Sensors undershoot after a release by a few percent of a push; what falls below rest
# by more than this share of the highest push is no undershoot.
_DIP = 0.25
# Time at either end of a recording that stands for rest, too short for a push [s].
_END = 0.2
# Noise of the ends of a recording that is no difference of level [sigma].
_SLACK = 4.0
_ROUNDING = 1e-9
_MAX_BLOCKS = 1 << 14


@dataclass(frozen=True, slots=True, kw_only=True)
class Rest:
    """The settled part of a rest.

    Args:
        start: First sample.
        end: One past the last sample.
        level: Mean of the middle half of the samples [unit]; NaN without samples.
        time: Middle of the samples [s].
    """

    start: int
    end: int
    level: float
    time: float

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return self.end - self.start


@dataclass(frozen=True, slots=True, kw_only=True)
class RestNoise:
    """Noise of samples at rest.

    Args:
        sigma: Standard deviation of a sample [unit].
        correlation: Variance of a mean over that of independent samples.
        quantum: Resolution [unit].
    """

    sigma: float
    correlation: float
    quantum: float

    def of_mean(self, n_samples: Real[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Standard deviations of means of so many samples [unit]."""
        variance = self.correlation * self.sigma**2 / np.maximum(n_samples, 1.0)
        # Rounding is not averaged out where the noise does not reach the next count.
        if self.sigma < self.quantum / 2:
            variance = variance + self.quantum**2 / 12
        return np.sqrt(variance)

    def of_rest(self, rest: Rest) -> float:
        """Standard deviation of the level of a rest [unit]."""
        # The mean of the middle half scatters by 9 % more than the mean.
        return 1.09 * float(self.of_mean(np.array([rest.n_samples]))[0])


def find_rests(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> tuple[Rest, ...]:
    """Settled parts of the rests before, between and after pushes.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Pushes in order.

    Returns:
        One rest more than pushes.
    """
    ends = [0, *(e.end for e in extents)]
    starts = [*(e.start for e in extents), len(time)]
    guards = [*(_GUARD * e.width for e in extents), 0.0]
    # No longer than the push: an old baseline is no better than a fresh one.
    spans = [*(max(e.width, 0.2) for e in extents), np.inf]
    rests = []
    for k, (end, start) in enumerate(zip(ends, starts, strict=True)):
        if start <= end:
            rests.append(
                Rest(start=end, end=end, level=np.nan, time=float(time[end - 1]))
            )
            continue
        # In a short rest a part of it has to do.
        guard = min(guards[k], _MAX_GUARD * (time[start - 1] - time[end]))
        t_last = time[start - 1] - guard
        settled = time[end] + (_SETTLED * (t_last - time[end]) if k else 0.0)
        first, last = np.searchsorted(time, [max(settled, t_last - spans[k]), t_last])
        first, last = min(int(first), start - 1), max(int(last), int(first) + 1)
        last = min(last, start)
        rests.append(
            Rest(
                start=first,
                end=last,
                level=_middle_mean(signal[first:last]),
                time=float(time[first:last].mean()),
            )
        )
    return tuple(rests)


def rest_curve(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Rest level of a signal that pushes may raise or lower.

    The middle of the densest quarter of the readings, in stretches of half a minute:
    rest is what a signal that goes both ways has in common with itself.

    Args:
        time: Sample times [s].
        signal: Samples.

    Returns:
        Level at every sample.
    """
    return np.interp(time, *_rest_knots(time, signal))


def _rest_knots(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Middles of stretches and their rest levels."""
    n_stretches = max(1, round((time[-1] - time[0]) / _STRETCH))
    edges = np.linspace(time[0], time[-1], n_stretches + 1)
    index = np.searchsorted(time, edges)
    index[-1] = len(time)
    middles, levels = [], []
    for first, last in pairwise(index):
        # A sample of the samples is enough for a level.
        ordered = np.sort(signal[first : last : max(1, (last - first) // 4096)])
        if len(ordered) == 0:
            continue
        n = max(1, len(ordered) // 4)
        widths = ordered[n - 1 :] - ordered[: len(ordered) - n + 1]
        # Of counts many stretches are equally dense; rounding must not choose.
        narrow = widths.min() + _ROUNDING * (ordered[-1] - ordered[0])
        ties = np.flatnonzero(widths <= narrow)
        start = int(ties[len(ties) // 2])
        levels.append(np.median(ordered[start : start + n]))
        middles.append((time[first] + time[last - 1]) / 2)
    return np.array(middles), np.array(levels)


def without_dips(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents_of: Callable[[Float[np.ndarray, " n"]], tuple[Extent, ...]],
) -> tuple[Float[np.ndarray, " n"], tuple[Extent, ...]]:
    """Fill what falls far below rest up to it.

    Rest is the level that most readings have in common. That may be one of long
    plateaus: where it lies clearly above the line between both ends of the recording,
    rest is that line. Should an end lie inside a push, the line is too high to matter.

    Args:
        time: Sample times [s].
        signal: Samples.
        extents_of: Finds the humps of a picture.

    Returns:
        The signal with the dips filled, itself if there are none; and the dips.
    """
    n_first, n_last = np.searchsorted(time, [time[0] + _END, time[-1] - _END])
    n_last = min(int(n_last), len(time) - 5)
    ends = (np.median(signal[: max(5, n_first)]), np.median(signal[n_last:]))
    knots = _rest_knots(time, signal)
    slack = _SLACK * Noise.of(signal).sigma

    def rest_at(when: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        line = np.interp(when, time[[0, -1]], ends)
        usual = np.interp(when, *knots)
        return np.where(usual > line + slack, line, usual)

    # Nearly all recordings end here, so this looks at the extremes of short blocks.
    blocks = np.arange(0, len(time), 1 + len(time) // _MAX_BLOCKS)
    rest = rest_at(time[blocks])
    least = _DIP * float((np.maximum.reduceat(signal, blocks) - rest).max())
    if (rest - np.minimum.reduceat(signal, blocks)).max() <= max(0.0, least):
        return signal, ()
    rest = rest_at(time)
    depth = np.maximum(rest - signal, 0.0)
    dips = tuple(dip for dip in extents_of(depth) if dip.height > least)
    filled = signal.copy() if dips else signal
    for dip in dips:
        # With its fringe, which would be the foot of whatever comes next.
        edges = [dip.t_start - dip.width / 2, dip.t_end + dip.width / 2]
        part = slice(*np.searchsorted(time, edges))
        filled[part] = np.maximum(signal[part], rest[part])
    return filled, dips


def slopes(rests: Sequence[Rest]) -> Float[np.ndarray, " p"]:
    """Drift under each push: median slope between the rests around it [unit/s].

    A median, because a grasp that settles shifts one rest against the next by more than
    any drift. Two rests cannot tell the one from the other: no drift is assumed then.
    """
    outside = np.full(_NEIGHBOURS - 1, np.nan)
    level = np.concatenate([outside, [r.level for r in rests], outside])
    when = np.concatenate([outside, [r.time for r in rests], outside])
    y, t = (sliding_window_view(a, 2 * _NEIGHBOURS) for a in (level, when))
    i, j = np.triu_indices(2 * _NEIGHBOURS, 1)
    slope = (y[:, j] - y[:, i]) / np.maximum(t[:, j] - t[:, i], 1e-12)
    is_enough = np.isfinite(y).sum(axis=1) >= _MIN_RESTS
    result = np.zeros(len(rests) - 1)
    result[is_enough] = np.nanmedian(slope[is_enough], axis=1)
    return result


def rest_noise(
    signal: Float[np.ndarray, " n"], rests: Sequence[Rest], fallback: Noise
) -> RestNoise:
    """Noise of the samples at rest, and how far it averages out.

    Args:
        signal: Samples [unit].
        rests: Where the signal rests.
        fallback: Noise of all samples, where the rests are too short.

    Returns:
        The noise.
    """
    blocks = []
    for rest in rests:
        n_blocks = min(rest.n_samples, _MAX_SAMPLES) // _BLOCK
        samples = signal[rest.end - n_blocks * _BLOCK : rest.end]
        if n_blocks > 1:
            blocks.append(samples.reshape(n_blocks, _BLOCK))
    steps = [np.diff(b.mean(axis=1)) for b in blocks]
    n_steps = sum(map(len, steps))
    if n_steps < 4:
        return RestNoise(
            sigma=fallback.sigma, correlation=1.0, quantum=fallback.quantum
        )
    within = float(np.mean(np.concatenate(blocks).var(axis=1, ddof=1)))
    between = float(np.mean(np.concatenate(steps) ** 2)) / 2
    floor = fallback.quantum**2 / 12
    correlation = between * _BLOCK / max(within, floor, 1e-300)
    # Beyond chance only: the ratio itself scatters by sqrt(2/n).
    if correlation < 1 + 3 * np.sqrt(2 / n_steps):
        correlation = 1.0
    return RestNoise(
        sigma=float(np.sqrt(max(within, floor))),
        correlation=correlation,
        quantum=fallback.quantum,
    )


def _middle_mean(samples: Float[np.ndarray, " n"]) -> float:
    """Mean of the middle half: robust, and finer than a median of counts."""
    ordered = np.sort(samples)
    cut = len(ordered) // 4
    return float(ordered[cut : len(ordered) - cut].mean())
