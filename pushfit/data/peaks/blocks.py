"""Noise of rests, by the scatter within blocks of their samples and between them.

Excluded: which samples are a rest, and its level (`pushfit.data.peaks.rests`). What
constants do was seen in the recordings of `benchmarks.recordings.real_recordings`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int, Real

# Variances of eight normal samples exceed so many times their median once in 1500
# blocks (chi-square of 7 degrees); twice is exceeded in 8 of 100.
_HIGHEST = 4.0
# Samples of a block by whose means noise shows that it is slow, and of one by which its
# size is judged: short, since drift within it counts as noise, as for the soft skin.
_BLOCK, _SMALL_BLOCK = 16, 8
# Of a rest that are looked at, counted from the push: 16 large blocks. The sds of
# `force_N`, whose noise is slow, change with it.
MAX_SAMPLES = 256
# Parts of a rest whose means show that its level is not steady. With half of them
# errors of triangles on short waves grow from 1.5 to 3.0 sd, with twice as many to 2.1.
N_PARTS = 8
# A variance from fewer is off by a quarter and more. With two, 9 of 12 heights of
# `p2_Pa` move, by up to 0.9 sd; with eight few rests suffice.
_FEWEST_BLOCKS = 4
# Where there is no noise, steps of single counts are judged to be one of 0.59 counts
# (`SignalNoise`). With 0.5 a height of `trial2` is 4.7 sd off in coarser counts.
_COUNTS = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class RestNoise:
    """Noise of samples at rest beside each push.

    Args:
        sigma: Standard deviation of a sample [unit].
        correlation: Variance of a mean over that of independent samples.
        quantum: Resolution [unit].
    """

    sigma: Float[np.ndarray, " p"]
    correlation: Float[np.ndarray, " p"]
    quantum: float

    def of_mean(self, n_samples: Real[np.ndarray, "*m p"]) -> Float[np.ndarray, "*m p"]:
        """Standard deviations of means of so many samples beside each push [unit]."""
        variance = self.correlation * self.sigma**2 / np.maximum(n_samples, 1.0)
        # It is not averaged out where noise does not reach a count.
        is_fine = self.sigma < _COUNTS * self.quantum
        return np.sqrt(variance + np.where(is_fine, self.quantum**2 / 12, 0.0))

    def of_part(self, n_samples: Real[np.ndarray, "*m p"]) -> Float[np.ndarray, "*m p"]:
        """Standard deviations of means of neighbouring samples [unit].

        Without correlation, which a few rests show badly: what is slower than a part of
        a push has to show in the push itself.
        """
        alone = replace(self, correlation=np.ones_like(self.correlation))
        return alone.of_mean(n_samples)


def _blocks(
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "w 2"],
    *,
    length: int,
    n_pushes: int,
) -> tuple[Float[np.ndarray, "m b"], Int[np.ndarray, " b"]]:
    """Samples of rests in blocks, counted from the pushes outward; whose they are."""
    first, last = windows.T
    n_blocks = np.clip(last - first, 0, MAX_SAMPLES) // length
    whose = np.repeat(np.arange(len(windows)), n_blocks)
    place = np.arange(n_blocks.sum()) - np.repeat(
        np.cumsum(n_blocks) - n_blocks, n_blocks
    )
    is_before = whose < n_pushes
    begin = np.where(
        is_before, last[whose] - length * (place + 1), first[whose] + length * place
    )
    return signal[begin + np.arange(length)[:, None]], whose


def scatter(
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "w 2"],
    n_pushes: int,
    *,
    floor: float,
) -> Float[np.ndarray, " p"]:
    """Standard deviations of a sample within blocks; NaN from too few of them.

    Args:
        signal: Samples [unit].
        windows: Rests, first and one past the last sample: those before all pushes,
            then those after them.
        n_pushes: Number of pushes.
        floor: Smallest variance [unit²].
    """
    blocks, whose = _blocks(signal, windows, length=_SMALL_BLOCK, n_pushes=n_pushes)
    variance, _ = _means(blocks.var(axis=0, ddof=1), whose % n_pushes, n_pushes)
    return np.sqrt(np.maximum(variance, floor))


def correlation_of(
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "w 2"],
    n_pushes: int,
    *,
    floor: float,
) -> Float[np.ndarray, " p"]:
    """Variances of means over those of independent samples; 1 where too few tell.

    Of the same rests as `scatter`.
    """
    blocks, whose = _blocks(signal, windows, length=_BLOCK, n_pushes=n_pushes)
    variance, push = blocks.var(axis=0, ddof=1), whose % n_pushes
    steps, is_step = np.diff(blocks.mean(axis=0)) ** 2 / 2, np.diff(whose) == 0
    between, n_steps = _means(steps[is_step], push[1:][is_step], n_pushes)
    within, _ = _means(variance, push, n_pushes)
    correlation = between * _BLOCK / np.maximum(within, floor)
    # Beyond chance only: the ratio itself scatters by sqrt(2/n).
    by_chance = 1 + 3 * np.sqrt(2 / np.maximum(n_steps, 1))
    return np.where(correlation >= by_chance, correlation, 1.0)


def part_means(
    samples: Float[np.ndarray, " n"], windows: Int[np.ndarray, "p 2"]
) -> tuple[Float[np.ndarray, "m p"], Int[np.ndarray, "m p"]]:
    """Means of equal parts of rests, and their numbers of samples.

    Those of rests with fewer samples than parts are 0.

    Args:
        samples: Of a signal, or of its times.
        windows: Rests, first and one past the last sample.
    """
    first, last = windows.T
    edges = first + (last - first) * np.arange(N_PARTS + 1)[:, None] // N_PARTS
    n = np.diff(edges, axis=0)
    means = np.zeros(n.shape)
    # Of each by itself: sums over a whole recording take longer.
    for k in np.flatnonzero(last - first >= N_PARTS).tolist():
        begin, level = first[k], samples[first[k]]
        sums = np.add.reduceat(samples[begin : last[k]] - level, edges[:-1, k] - begin)
        means[:, k] = level + sums / n[:, k]
    return means, n


def _means(
    values: Float[np.ndarray, " b"], whose: Int[np.ndarray, " b"], n: int
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Means and numbers of the values of each; NaN for the mean of too few.

    A value far above the others, as of a block that a rest steps in, counts as one of
    the highest that chance gives.
    """
    counts = np.bincount(whose, minlength=n)
    order = np.lexsort((values, whose))
    first = np.cumsum(counts) - counts
    middle = np.minimum(first + counts // 2, max(len(values) - 1, 0))
    usual = values[order][middle] if len(values) else np.zeros(n)
    values = np.minimum(values, _HIGHEST * usual[whose])
    sums = np.bincount(whose, values, minlength=n)
    means = sums / np.maximum(counts, 1)
    return np.where(counts >= _FEWEST_BLOCKS, means, np.nan), counts
