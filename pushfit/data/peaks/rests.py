"""The rests between pushes: their level, their drift and their noise."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int, Real

from pushfit.data.pushes.detection import Extent
from pushfit.data.pushes.feet import Feet
from pushfit.data.pushes.noise import Noise

# Share of the time between two pushes in which the signal comes to rest.
_TAIL = 0.5
# A rest of fewer samples shows no level.
_FEWEST = 3
_FEWEST_BLOCKS = 4
# Share of the height by which a rest may lie above the one after the push, if it is
# short: the signal had not come to rest.
_MAX_UNREST = 0.1
# Share of the height by which drift may move the rest under a push; sensors and grasps
# are shifted by more. And how many sd a rest may move that has settled.
_SHIFT, _UNSETTLED = 0.08, 4.0
# The mean of the middle half scatters by 9 % more than the mean.
_MIDDLE = 1.09
_ALL = slice(None)
_BLOCK, _SMALL_BLOCK = 16, 8
_MAX_SAMPLES = 1024


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

    def of(self, rows: Int[np.ndarray, " r"]) -> "RestNoise":
        """Noise beside some of the pushes."""
        return RestNoise(
            sigma=self.sigma[rows],
            correlation=self.correlation[rows],
            quantum=self.quantum,
        )

    def of_mean(
        self,
        n_samples: Real[np.ndarray, " p"],
        rows: Int[np.ndarray, " p"] | slice = _ALL,
    ) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of so many samples beside some pushes [unit]."""
        sigma = self.sigma[rows]
        variance = self.correlation[rows] * sigma**2 / np.maximum(n_samples, 1.0)
        return np.sqrt(variance + self._rounding(sigma))

    def of_part(
        self,
        n_samples: Real[np.ndarray, " p"],
        rows: Int[np.ndarray, " p"] | slice = _ALL,
    ) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of neighbouring samples [unit].

        Without correlation, which a few rests show badly: what is slower than a part of
        a push has to show in the push itself.
        """
        sigma = self.sigma[rows]
        variance = sigma**2 / np.maximum(n_samples, 1.0)
        return np.sqrt(variance + self._rounding(sigma))

    def _rounding(self, sigma: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Variance that is not averaged out where noise does not reach a count."""
        return np.where(sigma < self.quantum / 2, self.quantum**2 / 12, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Rest level under each push, from the rests beside it and from nothing else.

        level(t) = level + slope (t - time)

    Args:
        level: Mean of the rest before the push; of that after it where the samples
            show none before, NaN where they show neither [unit].
        time: Middle of that rest [s].
        slope: Drift to the rest after the push [unit/s].
        doubt: Drift that may be a shift instead [unit/s].
        sd: Standard deviation of `level` [unit].
        sd_after: Standard deviation of the level that `slope` leads to [unit].
        time_after: Its time; NaN where there is none [s].
    """

    level: Float[np.ndarray, " p"]
    time: Float[np.ndarray, " p"]
    slope: Float[np.ndarray, " p"]
    doubt: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]
    sd_after: Float[np.ndarray, " p"]
    time_after: Float[np.ndarray, " p"]

    def of(self, rows: Int[np.ndarray, " r"]) -> "Baselines":
        """Baselines under some of the pushes."""
        return Baselines(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def drift(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Change of the level since `time` [unit].

        Args:
            when: A time for each push [s].
        """
        return self.slope * (when - self.time)

    def sd_at(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviation of the level [unit].

        Args:
            when: A time for each push [s].
        """
        since = when - self.time
        share = np.where(
            self.slope == 0.0,
            0.0,
            since / np.maximum(self.time_after - self.time, 1e-9),
        )
        share = np.nan_to_num(share)
        own, after = (1 - share) * self.sd, share * np.nan_to_num(self.sd_after)
        return np.sqrt(own**2 + after**2 + (self.doubt * since) ** 2)


def rests_of(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> tuple[RestNoise, Baselines]:
    """Noise and rest levels beside humps.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: All humps of the signal, in any order; one may be there twice.

    Returns:
        Noise and baselines of the humps.
    """
    humps = sorted(set(extents), key=lambda hump: hump.t_peak)
    place = {hump: k for k, hump in enumerate(humps)}
    rows = np.array([place[extent] for extent in extents])
    noise = rest_noise(time, signal, humps)
    return noise.of(rows), baselines(time, signal, humps, noise).of(rows)


def rest_windows(
    time: Float[np.ndarray, " n"], extents: Sequence[Extent], *, is_long: bool = False
) -> tuple[Int[np.ndarray, "p 2"], Int[np.ndarray, "p 2"]]:
    """Samples of the rests before and after each push, first and one past the last.

    They are measured from the feet of the push, so that a neighbour or an end of the
    recording can only cut them short, never move them.

    Args:
        time: Sample times [s].
        extents: Pushes in order.
        is_long: Whether to take all that is settled, to judge the noise.

    Returns:
        Rests before and after; empty where there is none.
    """
    feet = Feet.together([extent.feet for extent in extents])
    before, after = np.stack(feet.before, axis=1), np.stack(feet.after, axis=1)
    if is_long:
        before[:, 0] -= _MAX_SAMPLES * feet.step
        after[:, 1] += _MAX_SAMPLES * feet.step
    room = feet.start[1:] - feet.end[:-1]
    before[1:, 0] = np.maximum(before[1:, 0], feet.end[:-1] + _TAIL * room)
    # In a short rest a part of it has to do.
    before[1:, 1] = np.maximum(before[1:, 1], feet.start[1:] - _TAIL * room / 2)
    middle = feet.end[:-1] + room / 2
    after[:-1, 1] = np.maximum(np.minimum(after[:-1, 1], middle), after[:-1, 0])
    return np.searchsorted(time, before), np.searchsorted(time, after)


def baselines(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    noise: RestNoise,
) -> Baselines:
    """Rest levels under pushes, each by its own rests.

    The rest before a push is its baseline. That after it tells of drift, unless it is
    off by more than drift can be, or has not settled: then the grasp or the sensor has
    changed under the push, and what lies between is doubt.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Pushes in order.
        noise: Noise beside each push.

    Returns:
        The baselines.
    """
    windows = rest_windows(time, extents)
    # Rests before and after, by level, middle and number of samples.
    parts = [np.array([_rest(time, signal, w) for w in own]) for own in windows]
    (level, when, n), (level_after, when_after, n_after) = (p.T for p in parts)
    sd, sd_after = (_MIDDLE * noise.of_mean(count) for count in (n, n_after))
    height = np.array([max(e.height, 1e-300) for e in extents])
    only_after = np.isnan(level) | _is_unrest(extents, level - level_after, height)
    rate = (level_after - level) / np.maximum(when_after - when, 1e-9)
    shift = np.clip((level_after - level) / height, -1e3, 1e3)
    unsettled = np.clip(_unsettled(signal, time, windows[1], rate, noise), -1e3, 1e3)
    trust = 1 / (1 + (shift / _SHIFT) ** 4) / (1 + (unsettled / _UNSETTLED) ** 4)
    has_both = np.isfinite(rate) & ~only_after
    starts = np.array([e.t_start for e in extents])
    return Baselines(
        level=_filled(np.where(only_after, level_after, level), signal),
        time=np.nan_to_num(np.where(only_after, when_after, when), nan=0.0)
        + np.where(only_after & np.isnan(when_after), starts, 0.0),
        slope=np.where(has_both, trust * rate, 0.0),
        doubt=np.where(has_both, (1 - trust) * np.abs(rate) / 2, 0.0),
        sd=np.where(only_after, sd_after, sd),
        sd_after=sd_after,
        time_after=when_after,
    )


def _rest(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    window: Int[np.ndarray, " 2"],
) -> tuple[float, float, int]:
    """Level, middle and samples of a rest; NaN where there is next to nothing of it."""
    first, last = (int(k) for k in window)
    if last - first < _FEWEST:
        return np.nan, np.nan, 0
    part = slice(first, last)
    return _middle_mean(signal[part]), float(time[part].mean()), last - first


def _filled(
    level: Float[np.ndarray, " p"], signal: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " p"]:
    """Levels, those of pushes without any rest beside them from the nearest others."""
    known = np.flatnonzero(np.isfinite(level))
    if known.size == 0:
        return np.full(len(level), float(signal.min()))
    return np.interp(np.arange(len(level)), known, level[known])


def _is_unrest(
    extents: Sequence[Extent],
    excess: Float[np.ndarray, " p"],
    height: Float[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """Whether the signal did not come to rest before a push, but did so after it."""
    is_short = np.array(
        [False, *(b.t_start - a.t_end < b.width / 2 for a, b in pairwise(extents))]
    )
    return is_short & (np.nan_to_num(excess) > _MAX_UNREST * height)


def _unsettled(
    signal: Float[np.ndarray, " n"],
    time: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "p 2"],
    rate: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> Float[np.ndarray, " p"]:
    """How far the rests after pushes move besides their drift [sd]."""
    moved, expected, n = np.zeros((3, len(windows)))
    for k, (first, last) in enumerate(windows.tolist()):
        half = (last - first) // 2
        if half < _FEWEST:
            continue
        early, late = slice(first, first + half), slice(last - half, last)
        moved[k] = signal[late].mean() - signal[early].mean()
        expected[k] = np.nan_to_num(rate[k]) * (time[late].mean() - time[early].mean())
        n[k] = half
    return np.where(n > 0, (moved - expected) / (2**0.5 * noise.of_part(n) + 1e-300), 0)


def rest_noise(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> RestNoise:
    """Noise of the samples at rest beside each push, and how far it averages out.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Pushes in order.

    Returns:
        The noise; that of all rests beside a push whose own are too short.
    """
    general = Noise.of(time, signal)
    floor = max(general.quantum**2 / 12, 1e-300)
    n = len(extents)
    near, far = (
        np.concatenate(rest_windows(time, extents, is_long=is_long))
        for is_long in (False, True)
    )
    sigma = _scatter(signal, near, n, floor)
    if np.isnan(sigma).any():
        sigma = np.where(np.isnan(sigma), _scatter(signal, far, n, floor), sigma)
    return RestNoise(
        sigma=np.nan_to_num(sigma, nan=general.sigma),
        correlation=_correlation(signal, far, n, floor),
        quantum=general.quantum,
    )


def _blocks(
    signal: Float[np.ndarray, " n"], windows: Int[np.ndarray, "w 2"], length: int
) -> tuple[Float[np.ndarray, "m b"], Int[np.ndarray, " b"]]:
    """Samples of rests in blocks, those nearest to their ends; and whose they are."""
    first, last = windows.T
    n_blocks = np.clip(last - first, 0, _MAX_SAMPLES) // length
    # Blocks of a window are counted from its end.
    back = np.repeat(np.cumsum(n_blocks), n_blocks) - np.arange(n_blocks.sum())
    begin = np.repeat(last, n_blocks) - length * back
    whose = np.repeat(np.arange(len(windows)), n_blocks)
    return signal[begin + np.arange(length)[:, None]], whose


def _scatter(
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "w 2"],
    n_pushes: int,
    floor: float,
) -> Float[np.ndarray, " p"]:
    """Standard deviations of a sample within blocks; NaN from too few of them."""
    blocks, whose = _blocks(signal, windows, _SMALL_BLOCK)
    variance, _ = _means(blocks.var(axis=0, ddof=1), whose % n_pushes, n_pushes)
    return np.sqrt(np.maximum(variance, floor))


def _correlation(
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "w 2"],
    n_pushes: int,
    floor: float,
) -> Float[np.ndarray, " p"]:
    """Variances of means over those of independent samples; of all for too few."""
    blocks, whose = _blocks(signal, windows, _BLOCK)
    variance, push = blocks.var(axis=0, ddof=1), whose % n_pushes
    steps, is_step = np.diff(blocks.mean(axis=0)) ** 2 / 2, np.diff(whose) == 0

    def beside(push: Int[np.ndarray, " b"], n: int) -> Float[np.ndarray, " n"]:
        between, n_steps = _means(steps[is_step], push[1:][is_step], n)
        within, _ = _means(variance, push, n)
        correlation = between * _BLOCK / np.maximum(within, floor)
        # Beyond chance only: the ratio itself scatters by sqrt(2/n).
        by_chance = 1 + 3 * np.sqrt(2 / np.maximum(n_steps, 1))
        return np.where(correlation < by_chance, 1.0, correlation)

    own, everywhere = beside(push, n_pushes), beside(np.zeros_like(push), 1)
    return np.where(np.isnan(own), np.nan_to_num(everywhere, nan=1.0), own)


def _means(
    values: Float[np.ndarray, " b"], whose: Int[np.ndarray, " b"], n: int
) -> tuple[Float[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Means and numbers of the values of each; NaN for the mean of too few."""
    counts = np.bincount(whose, minlength=n)
    sums = np.bincount(whose, values, minlength=n)
    means = sums / np.maximum(counts, 1)
    return np.where(counts >= _FEWEST_BLOCKS, means, np.nan), counts


def _middle_mean(samples: Float[np.ndarray, " n"]) -> float:
    """Mean of the middle half: robust, and finer than a median of counts."""
    cut = len(samples) // 4
    ends = (cut, len(samples) - cut - 1)
    return float(np.partition(samples, ends)[cut : len(samples) - cut].mean())
