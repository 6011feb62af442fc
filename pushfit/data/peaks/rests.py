"""The rests between pushes: their level, their drift and their noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int, Real

from pushfit.data.peaks.blocks import MAX_SAMPLES, correlation_of, scatter
from pushfit.data.pushes.detection import Extent
from pushfit.data.pushes.feet import FOOT, LEAST, SHIFT, Feet, likeness
from pushfit.data.pushes.noise import Noise

# A rest of fewer samples shows no level.
_FEWEST = 3
# Share of the height by which a rest may lie above the one after the push, if it is
# short: the signal had not come to rest.
_MAX_UNREST = 0.1
# Share of half of a rest that a sensor may take to recover, if the rest is short.
_WAITED = 2 / 3
# How many sd a rest may move that has settled.
_UNSETTLED = 4.0
# So many sd may parts of a rest differ by.
_UNLIKE = 3.0
# The mean of the middle half scatters by 9 % more than the mean.
_MIDDLE = 1.09


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
        own = {"sigma": self.sigma[rows], "correlation": self.correlation[rows]}
        return replace(self, **own)

    def of_mean(self, n_samples: Real[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of so many samples beside each push [unit]."""
        variance = self.correlation * self.sigma**2 / np.maximum(n_samples, 1.0)
        # It is not averaged out where noise does not reach a count.
        is_fine = self.sigma < self.quantum / 2
        return np.sqrt(variance + np.where(is_fine, self.quantum**2 / 12, 0.0))

    def of_part(self, n_samples: Real[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of neighbouring samples [unit].

        Without correlation, which a few rests show badly: what is slower than a part of
        a push has to show in the push itself.
        """
        alone = replace(self, correlation=np.ones_like(self.correlation))
        return alone.of_mean(n_samples)


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
    lowest, highest = feet.room(time)
    before = np.stack(feet.before(lowest), axis=1)
    after = np.stack(feet.after(highest, waited=_WAITED), axis=1)
    if is_long:
        reach = MAX_SAMPLES * feet.step
        before[:, 0] = np.maximum(before[:, 0] - reach, lowest)
        after[:, 1] = np.minimum(after[:, 1] + reach, highest)
        after = np.maximum(after, after[:, :1])
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
    """
    windows = rest_windows(time, extents)
    height = np.array([max(e.height, 1e-300) for e in extents])
    # Levels, middles and numbers of samples of the rests.
    level, when, n = _levels(time, signal, windows[0], -1, height, noise)
    level_after, when_after, n_after = _levels(
        time, signal, windows[1], 1, height, noise
    )
    sd, sd_after = (_MIDDLE * noise.of_mean(count) for count in (n, n_after))
    feet = Feet.together([extent.feet for extent in extents])
    # A rest that is hardly there may be the flank of a push.
    is_scanty = (n < LEAST * feet.span / feet.step) & (n_after > n)
    only_after = np.isnan(level) | is_scanty
    only_after |= _is_unrest(extents, level - level_after, height)
    rate = (level_after - level) / np.maximum(when_after - when, 1e-9)
    first = time[np.minimum(windows[1][:, 0], len(time) - 1)]
    early = np.maximum(feet.settling - (first - feet.end), 0.0)
    waited = likeness(early, feet.settling / 2)
    small = likeness(level_after - level, SHIFT * height)
    calm = likeness(_unsettled(signal, time, windows[1], rate, noise), _UNSETTLED)
    trust = waited * small * calm
    # A sensor that had no time to recover tells of shifts that are large.
    doubt = 1 - small * (waited * calm + 1 - waited)
    has_both = np.isfinite(rate) & ~only_after
    starts = np.array([e.t_start for e in extents])
    return Baselines(
        level=_filled(np.where(only_after, level_after, level), signal),
        time=np.nan_to_num(np.where(only_after, when_after, when), nan=0.0)
        + np.where(only_after & np.isnan(when_after), starts, 0.0),
        slope=np.where(has_both, trust * rate, 0.0),
        doubt=np.where(has_both, doubt * np.abs(rate) / 2, 0.0),
        sd=np.where(only_after, sd_after, sd),
        sd_after=sd_after,
        time_after=when_after,
    )


def _levels(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "p 2"],
    side: int,
    height: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> Float[np.ndarray, "3 p"]:
    """Levels, middles and samples of rests; NaN where there is next to nothing of one.

    Those of the part beside the push where the rest has another level: it has stepped.
    """
    first, last = windows.T
    n = np.minimum(np.maximum((last - first) // 4, _FEWEST), last - first)
    begin = first if side > 0 else last - n
    whole = [_rest(time, signal, own, _middle_mean) for own in windows]
    near = [
        _rest(time, signal, own, np.mean) for own in np.stack([begin, begin + n], 1)
    ]
    whole, near = np.array(whole).T, np.array(near).T
    far = np.maximum(FOOT * height, _UNLIKE * noise.of_mean(n))
    level, when, n = near + likeness(whole[0] - near[0], far) * (whole - near)
    return np.stack([level, when, np.nan_to_num(n)])


def _rest(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    window: Int[np.ndarray, " 2"],
    mean: Callable[[Float[np.ndarray, " m"]], float],
) -> tuple[float, float, int]:
    """Level, middle and number of samples of a rest."""
    first, last = window.tolist()
    if last - first < _FEWEST:
        return np.nan, np.nan, 0
    middle = (time[first] + time[last - 1]) / 2
    return float(mean(signal[first:last])), float(middle), last - first


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
    sigma = scatter(signal, near, n, floor)
    if np.isnan(sigma).any():
        sigma = np.where(np.isnan(sigma), scatter(signal, far, n, floor), sigma)
    return RestNoise(
        sigma=np.nan_to_num(sigma, nan=general.sigma),
        correlation=correlation_of(signal, far, n, floor),
        quantum=general.quantum,
    )


def _middle_mean(samples: Float[np.ndarray, " n"]) -> float:
    """Mean of the middle half: robust, and finer than a median of counts."""
    cut = len(samples) // 4
    ends = (cut, len(samples) - cut - 1)
    return float(np.partition(samples, ends)[cut : len(samples) - cut].mean())
