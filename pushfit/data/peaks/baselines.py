"""The rests between pushes: their level, their drift and their noise.

Excluded: noise within blocks of samples (`pushfit.data.peaks.blocks`). What constants
do was seen in the recordings of `benchmarks.recordings.real_recordings`, and in pushes
of `benchmarks.recordings.peak_accuracy`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.peaks.blocks import (
    MAX_SAMPLES,
    N_PARTS,
    RestNoise,
    correlation_of,
    part_means,
    scatter,
)
from pushfit.data.peaks.valleys import are_valleys, ends_of_chains
from pushfit.data.pushes.detection import BRIEFER
from pushfit.data.pushes.feet import (
    FOOT,
    LEAST,
    SHIFT,
    SHORTEST,
    Feet,
    PerPush,
    likeness,
)
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.pushes.noise import SignalNoise
from pushfit.data.rows import rows_of
from pushfit.parameters import TINY

# A rest of fewer samples shows no level. With two, heights of `short_dropouts`, whose
# rests have gaps, move by up to 15 sd, with six by up to 34.
_FEWEST = 3
# Share of a short rest that a sensor may take to recover. With half of it held pushes
# of fifty times their noise are read too high by 0.19 instead of 0.08 σ.
_WAITED = 2 / 3
# How many sd rests may move besides drift. At half two heights of `trial2` move by up
# to 1.4 sd; at twice holds on touches of 1.2 s and 2 to 6 % are off by up to 23 sd.
_UNSETTLED = 4.0
# So many sd may parts of a rest differ by. At half chance makes steps.
_UNLIKE = 3.0
# Noise is judged by as much more than a rest as a push is wide, and by this share of
# `MAX_SAMPLES` in all at least, four small blocks: a cut further off takes nothing.
_LEAST_JUDGED = 1 / 8
# What parts of a rest do by more than so many sd is no chance. At two thirds chance
# makes sds of a few pushes of fifty times their noise ten times too large.
_BEYOND = 3.0
# Mean square of so many parts over that of noise.
_BY_CHANCE = 1 + _BEYOND * (2 / N_PARTS) ** 0.5
# The farthest of a wave is so many times as far off as the half beside the push. At two
# thirds, pulls on slow waves grow from 1.9 to 2.3. Of the smaller half of all parts
# they were 13 where four lay on the line by chance.
_FARTHEST = 3.0
# A cubic between two levels keeps off the line by this share of the time between them,
# times the difference of its slopes there.
_CUBIC = 8.0
# The mean of the middle half scatters by 9 % more than the mean.
_MIDDLE = 1.09
# Standard deviation over the median size of normal values.
_OF_MEDIAN = 1.4826


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
        bend: Standard deviation of what the level does under the push besides [unit].
        step: Level after the push, or all pushes without a rest between them, over that
            before [unit].
    """

    level: Float[np.ndarray, " p"]
    time: Float[np.ndarray, " p"]
    slope: Float[np.ndarray, " p"]
    doubt: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]
    sd_after: Float[np.ndarray, " p"]
    time_after: Float[np.ndarray, " p"]
    bend: Float[np.ndarray, " p"]
    step: Float[np.ndarray, " p"]

    def drift(self, when: Float[np.ndarray, "*m p"]) -> Float[np.ndarray, "*m p"]:
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
        return np.sqrt(own**2 + after**2 + (self.doubt * since) ** 2 + self.bend**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Off:
    """How far parts of the rests beside pushes keep off their lines.

    Args:
        square: Mean square [unit²].
        chance: That by noise [unit²].
        seen: Length of the rest [s].
        tilt: As far as they lie on another line, its slope against theirs [unit/s].
        tilt_variance: By noise; infinite where there are too few samples.
        weight: 1, or 0 there.
    """

    square: PerPush
    chance: PerPush
    seen: PerPush
    tilt: PerPush
    tilt_variance: PerPush
    weight: PerPush


@dataclass(frozen=True, slots=True)
class _Parts:
    """Means of equal parts of rests, their times [s] and their numbers of samples."""

    level: Float[np.ndarray, "m p"]
    time: Float[np.ndarray, "m p"]
    n: Int[np.ndarray, "m p"]

    @property
    def are_shown(self) -> Bool[np.ndarray, " p"]:
        """Whether there are as many samples as parts: fewer show nothing."""
        return self.n.min(axis=0) > 0

    def unsettled(self, rate: PerPush, noise: RestNoise) -> PerPush:
        """How far rests move, from half to half, besides their drift [sd]."""
        halves = 2, N_PARTS // 2, -1
        n = self.n.reshape(halves).sum(axis=1)
        level, when = (
            (self.n * own).reshape(halves).sum(axis=1) / np.maximum(n, 1)
            for own in (self.level, self.time)
        )
        moved = level[1] - level[0] - np.nan_to_num(rate) * (when[1] - when[0])
        chance = np.sqrt(2.0) * noise.of_part(n.min(axis=0))
        return np.where(self.are_shown, moved / (chance + TINY), 0.0)

    def off(self, base: Baselines, noise: RestNoise, side: int) -> _Off:
        """How far the rests before (-1) or after pushes (1) keep off their lines."""
        is_shown, when = self.are_shown, self.time
        off = np.where(is_shown, self.level - base.level - base.drift(when), 0.0)
        # What is beyond the half beside the push may be something else, as a dip.
        near = off[N_PARTS // 2 :] if side < 0 else off[: N_PARTS // 2]
        farthest = _FARTHEST * np.sqrt((near**2).mean(axis=0))
        off = np.clip(off, -farthest, farthest)
        # Without correlation, which would hold the waves themselves.
        chance = noise.of_part(self.n) ** 2
        since = when - when.mean(axis=0)
        squares = np.maximum((since**2).sum(axis=0), SHORTEST**2)
        slopes = since / squares
        tilt = (slopes * off).sum(axis=0)
        # A wave is no tilt: what leads to another level lies on a line.
        line = tilt**2 * squares / np.maximum(off.var(axis=0) * N_PARTS, TINY)
        return _Off(
            square=(off**2).mean(axis=0),
            chance=chance.mean(axis=0),
            seen=np.ptp(when, axis=0) * N_PARTS / (N_PARTS - 1),
            tilt=tilt * np.sqrt(np.minimum(line, 1.0)),
            tilt_variance=np.where(is_shown, (slopes**2 * chance).sum(axis=0), np.inf),
            weight=is_shown.astype(float),
        )


@dataclass(frozen=True, slots=True)
class _Beside:
    """Samples, and feet of humps in order.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        feet: Feet of the humps.
        is_ringing: Which are brushes far briefer than the pushes.
        is_valley: Which have a valley after them, no rest.
    """

    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    feet: Feet[np.ndarray]
    is_ringing: Bool[np.ndarray, " p"]
    is_valley: Bool[np.ndarray, " q"]

    def windows(
        self, more: PerPush | float = 0.0
    ) -> tuple[Int[np.ndarray, "p 2"], Int[np.ndarray, "p 2"]]:
        """Samples of the rests before and after pushes, first and one past the last.

        They are measured from the feet of the push, so that a neighbour or an end of
        the recording can only cut them short, never move them. `more` of what is
        settled is taken to judge the noise [s]. None is in a valley.
        """
        feet = self.feet
        before = np.stack(feet.before, axis=1)
        after = np.stack(feet.after(waited=_WAITED), axis=1)
        first, last = before[:, 0], after[:, 1]
        before[:, 0] = np.minimum(first, np.maximum(first - more, feet.lowest))
        after[:, 1] = np.maximum(last, np.minimum(last + more, feet.highest))
        before[1:][self.is_valley] = feet.start[1:][self.is_valley, None]
        after[:-1][self.is_valley] = feet.end[:-1][self.is_valley, None]
        return np.searchsorted(self.time, before), np.searchsorted(self.time, after)

    def noise(self) -> RestNoise:
        """Noise at rest, and how far it averages out; of all rests if few samples."""
        general = SignalNoise.of(self.time, self.signal)
        floor = max(general.quantum**2 / 12, TINY)
        n, most = len(self.feet.start), MAX_SAMPLES * self.feet.step
        least = np.maximum(_LEAST_JUDGED * most - self.feet.span, 0.0)
        reach = np.clip(self.feet.width, least, most)
        near, far = (np.concatenate(self.windows(more)) for more in (0.0, reach))
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
        is off by more, or either moves otherwise: then grasp or sensor have changed, or
        a finger that touched has left, and what lies between is doubt.
        """
        feet, (windows, windows_after) = self.feet, self.windows()
        height = np.maximum(feet.height, TINY)
        # Levels, middles and numbers of samples of the rests.
        level, when, n = self._levels(windows, -1, noise)
        level_after, when_after, n_after = self._levels(windows_after, 1, noise)
        sd, sd_after = (_MIDDLE * noise.of_mean(count) for count in (n, n_after))
        # A rest that is hardly there may be the flank of a push.
        few = LEAST * feet.span / feet.step
        only_after = np.isnan(level) | ((n < few) & (n_after > n))
        rate = (level_after - level) / np.maximum(when_after - when, SHORTEST)
        first = self.time[np.minimum(windows_after[:, 0], len(self.time) - 1)]
        early = np.maximum(feet.settling - (first - feet.end), 0.0)
        waited = likeness(early, feet.settling / 2)
        small = likeness(level_after - level, SHIFT * height)
        rests = [self._parts(own) for own in self.windows(feet.span)]
        moves = np.hypot(*(own.unsettled(rate, noise) for own in rests))
        calm = likeness(moves, _UNSETTLED)
        # A larger drift goes on in both rests, where a shift leaves them level.
        alone = [np.abs(own.unsettled(np.zeros_like(rate), noise)) for own in rests]
        goes_on = 1 - likeness(np.minimum(*alone), _UNSETTLED)
        trust = np.where(only_after, 0.0, waited * calm * np.maximum(small, goes_on))
        # One rest alone shows no drift; it may be as usual beside other pushes, but not
        # as beside what rings after them.
        is_alone = only_after | (n_after < few)
        usual = _usual_rate(rate[~is_alone & ~self.is_ringing])
        doubt = (1 - trust) * np.abs(rate) / 2
        begin, end = ends_of_chains(self.is_valley)
        steps = level_after[end] - level[begin]
        own_when = np.where(only_after, when_after, when)
        unseen = only_after & np.isnan(when_after)
        base = Baselines(
            level=_filled(np.where(only_after, level_after, level), self.signal),
            time=np.nan_to_num(own_when, nan=0.0) + np.where(unseen, feet.start, 0.0),
            slope=np.nan_to_num(trust * rate),
            doubt=np.where(is_alone, np.fmax(usual, doubt), np.nan_to_num(doubt)),
            sd=np.where(only_after, sd_after, sd),
            sd_after=sd_after,
            time_after=when_after,
            bend=np.zeros_like(sd),
            step=np.where((begin < end) & np.isfinite(steps), steps, feet.moved),
        )
        before, after = (
            own.off(base, noise, side) for own, side in zip(rests, (-1, 1), strict=True)
        )
        own = np.where(only_after, 0.0, 1.0)
        return _with_waves(base, before, after, own=own, trust=np.nan_to_num(trust))

    def _parts(self, windows: Int[np.ndarray, "p 2"]) -> _Parts:
        """Parts of the rests before or after pushes."""
        level, n = part_means(self.signal, windows)
        return _Parts(level, part_means(self.time, windows)[0], n)

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
    feet = Feet.together([extents[k].feet for k in order])
    is_brush = np.array([extents[k].is_brush for k in order])
    usual = np.median(feet.width[~is_brush]) if not is_brush.all() else 0.0
    is_ringing = is_brush & (BRIEFER * feet.width < usual)
    beside = _Beside(time, signal, feet, is_ringing, are_valleys(feet))
    noise = beside.noise()
    return rows_of(noise, rows), rows_of(beside.baselines(noise), rows)


def _with_waves(
    base: Baselines, before: _Off, after: _Off, *, own: PerPush, trust: PerPush
) -> Baselines:
    """Rest levels whose sd hold that rests wave, and bend under the pushes.

    As far as means of their parts are off the line by more than noise, and farther
    between rests that are far apart. Rests that are tilted against it bend between
    them, as a cubic would.

    Args:
        before: How far the rests before pushes keep off their lines.
        after: Those after them.
        own: 1 where the level is that of the rest before the push, else 0.
        trust: How far the rest after it shows a drift.
    """
    weights = before.weight * own, after.weight * np.where(own > 0, trust, 1.0)
    n_rests = weights[0] + weights[1]
    sums = sum(
        weight * np.stack([rest.square, rest.chance, rest.seen])
        for weight, rest in zip(weights, (before, after), strict=True)
    )
    square, chance, seen = sums / np.maximum(n_rests, TINY)
    waves = np.minimum(n_rests, 1.0) * np.maximum(square - _BY_CHANCE * chance, 0.0)
    tilt = (after.tilt - before.tilt) ** 2
    tilt -= _BEYOND**2 * (after.tilt_variance + before.tilt_variance)
    between = np.nan_to_num(own * (base.time_after - base.time))
    bend = np.maximum(tilt, 0.0) * (between / _CUBIC) ** 2
    # By the time itself as a walk, and not at all as short waves: between the two.
    longer = np.sqrt(np.maximum(between / np.maximum(seen, SHORTEST), 1.0))
    return replace(
        base,
        sd=np.sqrt(base.sd**2 + waves),
        sd_after=np.sqrt(base.sd_after**2 + waves),
        bend=np.sqrt(waves * longer + bend),
    )


def _usual_rate(rates: Float[np.ndarray, " q"]) -> float:
    """Standard deviation of drifts, a robust one; 0 where none is seen [unit/s]."""
    return _OF_MEDIAN * float(np.median(np.abs(rates))) if rates.size else 0.0


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
