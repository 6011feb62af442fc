"""The rests between pushes: their level, their drift and their noise.

Excluded: noise within blocks of samples (`pushfit.data.peaks.blocks`). What constants
do was seen in the recordings of `benchmarks.recordings.real_recordings`, and in pushes
of `benchmarks.recordings.peak_accuracy`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Float, Int, Real

from pushfit.data.peaks.blocks import MAX_SAMPLES, correlation_of, scatter
from pushfit.data.pushes.detection import Extent
from pushfit.data.pushes.feet import FOOT, LEAST, SHIFT, SHORTEST, Feet, likeness
from pushfit.data.pushes.noise import SignalNoise
from pushfit.parameters import TINY

# A rest of fewer samples shows no level. With two, heights of `short_dropouts`, whose
# rests have gaps, move by up to 15 sd, with six by up to 34.
_FEWEST = 3
# Share of a short rest that a sensor may take to recover. With half of it held pushes
# of fifty times their noise are read too high by 0.19 instead of 0.08 σ.
_WAITED = 2 / 3
# How many sd a rest may move that has settled. At half 5 of 6 heights of `p1_Pa` move,
# by up to 1.1 sd; at twice all of `p1_Pa` and `p3_Pa`, by up to 0.8.
_UNSETTLED = 4.0
# So many sd may parts of a rest differ by. At half chance makes steps: errors of half
# sines of five times their noise grow from 0.21 to 0.24 σ. Twice changes no height.
_UNLIKE = 3.0
# Noise is judged by as much of a rest as a push is wide, and by this share of
# `MAX_SAMPLES` at least, four small blocks: a cut further off takes nothing.
_LEAST_JUDGED = 1 / 8
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
        """Change of the level since `time`, at a time [s] for each push [unit]."""
        return self.slope * (when - self.time)

    def sd_at(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviation of the level at a time [s] for each push [unit]."""
        since = when - self.time
        share = np.where(
            self.slope == 0.0,
            0.0,
            since / np.maximum(self.time_after - self.time, SHORTEST),
        )
        share = np.nan_to_num(share)
        own, after = (1 - share) * self.sd, share * np.nan_to_num(self.sd_after)
        return np.sqrt(own**2 + after**2 + (self.doubt * since) ** 2)


@dataclass(frozen=True, slots=True)
class _Beside:
    """Samples, and the feet of pushes in order, beside which the rests are."""

    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    feet: Feet[np.ndarray]

    def windows(
        self, *, is_long: bool = False
    ) -> tuple[Int[np.ndarray, "p 2"], Int[np.ndarray, "p 2"]]:
        """Samples of the rests before and after pushes, first and one past the last.

        They are measured from the feet of the push, so that a neighbour or an end of
        the recording can only cut them short, never move them. `is_long` takes more of
        what is settled, to judge the noise.
        """
        feet = self.feet
        before = np.stack(feet.before, axis=1)
        after = np.stack(feet.after(waited=_WAITED), axis=1)
        if is_long:
            most = MAX_SAMPLES * feet.step
            reach = np.clip(feet.width, _LEAST_JUDGED * most, most)
            before[:, 0] = np.maximum(before[:, 0] - reach, feet.lowest)
            after[:, 1] = np.minimum(after[:, 1] + reach, feet.highest)
            after = np.maximum(after, after[:, :1])
        return np.searchsorted(self.time, before), np.searchsorted(self.time, after)

    def noise(self) -> RestNoise:
        """Noise at rest, and how far it averages out; of all rests if few samples."""
        general = SignalNoise.of(self.time, self.signal)
        floor = max(general.quantum**2 / 12, TINY)
        n = len(self.feet.start)
        near, far = (
            np.concatenate(self.windows(is_long=is_long)) for is_long in (False, True)
        )
        sigma = scatter(self.signal, near, n, floor)
        if np.isnan(sigma).any():
            whole = scatter(self.signal, far, n, floor)
            sigma = np.where(np.isnan(sigma), whole, sigma)
        return RestNoise(
            sigma=np.nan_to_num(sigma, nan=general.sigma),
            correlation=correlation_of(self.signal, far, n, floor),
            quantum=general.quantum,
        )

    def baselines(self, noise: RestNoise) -> Baselines:
        """Rest levels under pushes, each by its own rests.

        The rest before a push is its baseline. That after it tells of drift, unless it
        is off by more than drift can be, or has not settled: then the grasp or the
        sensor has changed under the push, and what lies between is doubt.
        """
        feet, (windows, windows_after) = self.feet, self.windows()
        height = np.maximum(feet.height, TINY)
        # Levels, middles and numbers of samples of the rests.
        level, when, n = self._levels(windows, -1, noise)
        level_after, when_after, n_after = self._levels(windows_after, 1, noise)
        sd, sd_after = (_MIDDLE * noise.of_mean(count) for count in (n, n_after))
        # A rest that is hardly there may be the flank of a push.
        is_scanty = (n < LEAST * feet.span / feet.step) & (n_after > n)
        only_after = np.isnan(level) | is_scanty
        rate = (level_after - level) / np.maximum(when_after - when, SHORTEST)
        first = self.time[np.minimum(windows_after[:, 0], len(self.time) - 1)]
        early = np.maximum(feet.settling - (first - feet.end), 0.0)
        waited = likeness(early, feet.settling / 2)
        small = likeness(level_after - level, SHIFT * height)
        calm = likeness(self._unsettled(windows_after, rate, noise), _UNSETTLED)
        trust = np.where(only_after, 0.0, waited * small * calm)
        own_when = np.where(only_after, when_after, when)
        unseen = only_after & np.isnan(when_after)
        return Baselines(
            level=_filled(np.where(only_after, level_after, level), self.signal),
            time=np.nan_to_num(own_when, nan=0.0) + np.where(unseen, feet.start, 0.0),
            slope=np.nan_to_num(trust * rate),
            doubt=np.nan_to_num((1 - trust) * np.abs(rate) / 2),
            sd=np.where(only_after, sd_after, sd),
            sd_after=sd_after,
            time_after=when_after,
        )

    def _levels(
        self, windows: Int[np.ndarray, "p 2"], side: int, noise: RestNoise
    ) -> Float[np.ndarray, "3 p"]:
        """Levels, middles and samples of rests; NaN where there is next to nothing.

        Those of the part beside the push where the rest has another level: it has
        stepped.
        """
        first, last = windows.T
        n = np.minimum(np.maximum((last - first) // 4, _FEWEST), last - first)
        begin = first if side > 0 else last - n
        parts = np.stack([begin, begin + n], axis=1)
        whole = np.array([self._rest(own, _middle_mean) for own in windows]).T
        near = np.array([self._rest(own, np.mean) for own in parts]).T
        height = np.maximum(self.feet.height, TINY)
        far = np.maximum(FOOT * height, _UNLIKE * noise.of_part(n))
        level, when, n = near + likeness(whole[0] - near[0], far) * (whole - near)
        return np.stack([level, when, np.nan_to_num(n)])

    def _rest(
        self,
        window: Int[np.ndarray, " 2"],
        mean: Callable[[Float[np.ndarray, " m"]], float],
    ) -> tuple[float, float, int]:
        """Level, middle and number of samples of a rest."""
        first, last = window.tolist()
        if last - first < _FEWEST:
            return np.nan, np.nan, 0
        middle = (self.time[first] + self.time[last - 1]) / 2
        return float(mean(self.signal[first:last])), float(middle), last - first

    def _unsettled(
        self,
        windows: Int[np.ndarray, "p 2"],
        rate: Float[np.ndarray, " p"],
        noise: RestNoise,
    ) -> Float[np.ndarray, " p"]:
        """How far the rests after pushes move besides their drift [sd]."""
        time, signal = self.time, self.signal
        moved, n = np.zeros((2, len(windows)))
        for k, (first, last) in enumerate(windows.tolist()):
            half = (last - first) // 2
            if half < _FEWEST:
                continue
            early, late = slice(first, first + half), slice(last - half, last)
            drift = np.nan_to_num(rate[k]) * (time[late].mean() - time[early].mean())
            moved[k] = signal[late].mean() - signal[early].mean() - drift
            n[k] = half
        return np.where(n > 0, moved / (2**0.5 * noise.of_part(n) + TINY), 0)


def rests_of(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> tuple[RestNoise, Baselines]:
    """Noise and rest levels beside humps.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Humps, in any order.
    """
    order = np.argsort([hump.t_peak for hump in extents], kind="stable")
    rows = np.argsort(order)
    beside = _Beside(time, signal, Feet.together([extents[k].feet for k in order]))
    noise = beside.noise()
    return noise.of(rows), beside.baselines(noise).of(rows)


def _filled(
    level: Float[np.ndarray, " p"], signal: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " p"]:
    """Levels, those of pushes without any rest beside them from the nearest others."""
    known = np.flatnonzero(np.isfinite(level))
    if known.size == 0:
        return np.full(len(level), float(signal.min()))
    return np.interp(np.arange(len(level)), known, level[known])


def _middle_mean(samples: Float[np.ndarray, " n"]) -> float:
    """Mean of the middle half: robust, and finer than a median of counts."""
    cut = len(samples) // 4
    ends = (cut, len(samples) - cut - 1)
    return float(np.partition(samples, ends)[cut : len(samples) - cut].mean())
