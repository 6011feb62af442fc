"""The rests between pushes: where they are, their level, their drift and their noise.

Valleys between pushes are no rests, as between the halves of a double push. Excluded:
noise within blocks of samples (`pushfit.data.peaks.blocks`), how far rests wave
(`pushfit.data.peaks.baselines`), and parting a push in two
(`pushfit.data.pushes.doubles`). What constants do was seen in the recordings of
`benchmarks.recordings.real_recordings`, and in pushes of
`benchmarks.recordings.peak_accuracy`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.peaks.baselines import Baselines, Parts, with_waves
from pushfit.data.peaks.blocks import (
    MAX_SAMPLES,
    RestNoise,
    correlation_of,
    scatter,
)
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
# The mean of the middle half scatters by 9 % more than the mean.
_MIDDLE = 1.09
# Standard deviation over the median size of normal values.
_OF_MEDIAN = 1.4826


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
        sigma = scatter(self.signal, near, n, floor=floor)
        if np.isnan(sigma).any():
            whole = scatter(self.signal, far, n, floor=floor)
            sigma = np.where(np.isnan(sigma), whole, sigma)
        return RestNoise(
            sigma=np.nan_to_num(sigma, nan=general.sigma),
            correlation=correlation_of(self.signal, far, n, floor=floor),
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
        rests = [
            Parts.of(self.time, self.signal, own) for own in self.windows(feet.span)
        ]
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
        begin, end = _ends_of_chains(self.is_valley)
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
        return with_waves(base, before, after, own=own, trust=np.nan_to_num(trust))

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
    """Noise and rest levels beside humps, which are in any order."""
    order = np.argsort([hump.t_peak for hump in extents], kind="stable")
    rows = np.argsort(order)
    feet = Feet.together([extents[k].feet for k in order])
    is_brush = np.array([extents[k].is_brush for k in order])
    usual = np.median(feet.width[~is_brush]) if not is_brush.all() else 0.0
    is_ringing = is_brush & (BRIEFER * feet.width < usual)
    beside = _Beside(time, signal, feet, is_ringing, _are_valleys(feet))
    noise = beside.noise()
    return rows_of(noise, rows), rows_of(beside.baselines(noise), rows)


def _are_valleys(feet: Feet[np.ndarray]) -> Bool[np.ndarray, " q"]:
    """Whether between each push and the next there is a valley, but no rest.

    Next to nothing of a level is held there, or it is more than half way up to both,
    and held for less than either; and the first or the last of all pushes that follow
    each other so leads from a rest to another level than drift does. Where neither
    does, valleys are the rests of pushes that go on without any other.

    Args:
        feet: All pushes, in order.
    """
    least = LEAST * feet.span
    (first, last), (first_after, last_after) = feet.before, feet.after()
    is_short = (last_after - first_after < least)[:-1] & (last - first < least)[1:]
    is_high = (feet.moved > feet.height)[:-1] & (-feet.moved > feet.height)[1:]
    gap, width = feet.start[1:] - feet.end[:-1], feet.width
    is_short |= is_high & (gap < np.minimum(width[:-1], width[1:]))
    is_off = np.abs(feet.moved) > SHIFT * feet.height
    ends = _ends_of_chains(is_short)
    return is_short & (is_off[ends[0]] | is_off[ends[1]])[:-1]


def _ends_of_chains(
    is_joint: Bool[np.ndarray, " q"],
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """The first and the last of all pushes that each is joint with.

    Args:
        is_joint: Whether each push is so with the next.
    """
    chain = np.append(0, np.cumsum(~is_joint))
    first, after = (np.searchsorted(chain, chain, side=s) for s in ("left", "right"))
    return first, after - 1


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
