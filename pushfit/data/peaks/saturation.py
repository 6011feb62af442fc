"""Which pushes reach the end of the sensor's range, so that their tops are cut.

A limit shows by readings that pile up at one value; by noise that it cuts as well, so
that tops are far calmer than rests and lower pushes; or by a flat top that ends where
others end, among pushes that are pointed. A hold at the noise of its rest is as flat
where nothing cuts it: by itself it is no limit. Excluded: which pushes are held at a
level (`pushfit.data.peaks.apex_or_plateau`). What constants do was seen in the
recordings of `benchmarks.recordings.real_recordings`, and in 120 to 800 simulated ones.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.found_humps import Extent

# Two readings are alike at many a natural top.
_MIN_SAMPLES = 3
# A sensor at its limit may be noisy there: readings within this many sigma of the
# largest, which holds all but one in 16 000 of a level's, count as the largest, if that
# is a small share of the height. Half of the sigmas misses pushes cut at a noise of
# 0.6 % of the height, twice changes flags of the real recordings; half of the share
# misses 42 of 274 more at a ceiling that keeps all noise.
_BAND_SIGMAS, _MAX_BAND = 4.0, 0.04
# Of the lower pushes.
_MOST = 0.5
# So much calmer than rests and lower pushes tops at a limit are. Eight normal samples
# are by chance once in 300 (chi-square, 7 degrees). Half of the first flags 7 of 211
# whole pushes, twice misses holds that keep 0.2 of their noise; half of the second
# flags 2 whole ones, twice changes none.
_CALMER, _MIN_CALM = 3.0, 8
# Share of the time near the largest reading that is left out at either end of it, as
# the way in and out. Half finds 2 more of 215 cut pushes, twice 5 less.
_EDGE = 0.2
# Readings that flip between two counts scatter by up to half a step without any noise
# to be cut, so that steps of resolution alone are never calm. Half changes no flag,
# twice one of 215.
_FLIPS = 0.5
# Share of the time above half its height for which a held push is at a level: an
# overshoot that looks flat is briefer, 0.1 where holds of 2 s begin with one.
_LEAST_LEVEL = 0.25
# Its limit may also creep. Several pointed pushes that end within one of these shares
# of the height, each with so many readings there, end at a limit.
_BANDS, _MIN_NEAR, _MIN_PUSHES = (0.001, 0.002, 0.004, 0.008), 6, 2


def saturated_pushes(
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    *,
    signs: Sequence[int],
    limit: float | None,
    sigma: Float[np.ndarray, " p"],
    held: Bool[np.ndarray, " p"] | None = None,
    quantum: float = 0.0,
    is_symmetric: bool = False,
) -> Bool[np.ndarray, " p"]:
    """Find the pushes that reach the end of the range.

    Args:
        signal: Samples [unit].
        signs: 1 for a push that goes up, -1 for one that goes down.
        limit: Largest reading of the sensor; None to recognise it. Where a push goes
            down, it is that of the reversed signal, and recognised as well unless
            `is_symmetric` [unit].
        sigma: Noise of a sample at rest beside each push; 0 where it is not known, so
            that only equal readings show a limit [unit].
        held: Whether each is held at a level; None if none is.
        quantum: Resolution [unit].
        is_symmetric: Whether the range is as wide below zero as above, as of a force.
    """
    held = np.zeros(len(extents), dtype=bool) if held is None else held
    is_push = np.array([not extent.is_brush for extent in extents])
    # Where most are held, pushes end at levels by themselves; among pointed ones a
    # level that several end at is that of the limit.
    is_usual = held & (held[is_push].sum() > _MOST * is_push.sum())
    is_cut = np.zeros(len(extents), dtype=bool)
    for sign in set(signs):
        rows = [k for k, own in enumerate(signs) if own == sign]
        tops = [sign * signal[extents[k].start : extents[k].end] for k in rows]
        end = np.inf if limit is None else limit
        if limit is None or (sign < 0 and not is_symmetric):
            found = _Tops(
                readings=tops,
                highest=np.array([float(top.max()) for top in tops]),
                height=np.array([extents[k].height for k in rows]),
                sigma=sigma[rows],
                held=held[rows],
                is_usual=is_usual[rows],
                is_part=np.array([extents[k].is_cut for k in rows]),
                quantum=quantum,
            )
            end = min(end, found.ceiling())
        if np.isfinite(end):
            is_cut[rows] = [bool(np.any(top >= end)) for top in tops]
    return is_cut


@dataclass(frozen=True, kw_only=True)
class _Tops:
    """Pushes that go one way.

    Args:
        readings: Of each push [unit].
        highest: The largest of each [unit].
        height: [unit].
        sigma: Noise of a sample at rest [unit].
        held: Whether each is held at a level.
        is_usual: Whether it is held where most are.
        is_part: Whether the recording cuts it, which leaves a hold no way in or out.
        quantum: Resolution [unit].
    """

    readings: Sequence[Float[np.ndarray, " _"]]
    highest: Float[np.ndarray, " q"]
    height: Float[np.ndarray, " q"]
    sigma: Float[np.ndarray, " q"]
    held: Bool[np.ndarray, " q"]
    is_usual: Bool[np.ndarray, " q"]
    is_part: Bool[np.ndarray, " q"]
    quantum: float

    def ceiling(self) -> float:
        """Level at which readings pile up, infinite if they do nowhere.

        What one push shows holds for all.
        """
        for find in (self._of_equal, self._of_calm, self._of_flat, self._of_creeping):
            end = find()
            if np.isfinite(end):
                return end
        return np.inf

    @functools.cached_property
    def largest(self) -> float:
        """Largest of all readings [unit]."""
        return float(self.highest.max())

    @functools.cached_property
    def band(self) -> Float[np.ndarray, " q"]:
        """Below the largest reading of a level, where its noise or a count takes it."""
        return np.maximum(_BAND_SIGMAS * self.sigma, self.quantum)

    @functools.cached_property
    def at_end(self) -> Bool[np.ndarray, " q"]:
        """Whether each comes as near to the largest reading as noise does."""
        return self.highest >= self.largest - self.band

    def _of_equal(self) -> float:
        """Where readings are equal, and not by the resolution alone."""
        near = np.flatnonzero(self.highest == self.largest).tolist()
        ends = [k for k in near if _is_at_one(self.readings[k])]
        is_cut = len(ends) > 1
        if len(ends) == 1:
            at_one = np.array([_is_at_one(top) for top in self.readings])
            alike = np.flatnonzero((at_one | self._are_flat()) & ~self.at_end).tolist()
            usual = min([float(self._middle(k).std()) for k in alike], default=np.inf)
            is_cut = self._is_calm(0.0, usual)
        return self.largest if is_cut else np.inf

    def _of_calm(self) -> float:
        """Where tops are far calmer than their rests and than lower ones.

        Rests of a robot that is on its way may be noisier than all of its holds.
        """
        parts = [self._middle(k) for k in range(len(self.highest))]
        own = [
            float(part.std()) if part.size >= _MIN_CALM else np.inf for part in parts
        ]
        lower = np.flatnonzero(~self.at_end).tolist()
        usual = min([own[k] for k in lower], default=np.inf)
        ends = [
            float(np.median(parts[k])) - max(_BAND_SIGMAS * own[k], self.quantum)
            for k in np.flatnonzero(self.at_end).tolist()
            if self._is_calm(own[k], min(usual, float(self.sigma[k])))
        ]
        return min(ends, default=np.inf)

    def _of_flat(self) -> float:
        """Where flat tops end at one level among pushes that have none.

        A single hold has one by itself. Where most pushes are held, lower ones show
        that it is no habit: they tremble.
        """
        near = np.flatnonzero(self.at_end & ~self.is_part).tolist()
        cut = [k for k in near if self._ends_flat(k)]
        is_narrow = self.band[cut] <= _MAX_BAND * self.height[cut]
        lower = self._are_flat()[~self.at_end]
        if len(cut) == 1:
            is_shape = bool(self.held[cut[0]] or lower.any())
        elif self.is_usual.any():
            is_shape = not lower.size or bool(lower.any())
        else:
            is_shape = bool(lower.size and lower.mean() > _MOST)
        is_shape |= not self._is_one_level(cut) or len(cut) <= _MOST * len(near)
        if is_shape or not is_narrow.any():
            return np.inf
        return self.largest - float(self.band[cut[0]])

    def _of_creeping(self) -> float:
        """Where several pointed pushes end close together."""
        pointed = (self.sigma > 0) & ~self.is_usual & ~self.is_part
        for share in _BANDS:
            # A band of less than a count has no reading beneath it.
            band = max(share * float(self.height.max()), self.quantum)
            is_near = pointed & (self.highest > self.largest - band)
            near = np.flatnonzero(is_near).tolist()
            tops = [self.readings[k] for k in near]
            at_end = [_piles_up(top, self.largest, band, _MIN_NEAR) for top in tops]
            if sum(at_end) >= max(_MIN_PUSHES, _MOST * len(near)):
                return self.largest - band
        return np.inf

    def _is_calm(self, own: float, usual: float) -> bool:
        """Whether scatter is so small that noise is cut, beside what is usual."""
        return max(_CALMER * own, _FLIPS * self.quantum) < usual

    def _is_flat(self, k: int, level: float) -> bool:
        """Whether readings of a push pile up in the band below a level."""
        return _piles_up(self.readings[k], level, float(self.band[k]), _MIN_SAMPLES)

    def _ends_flat(self, k: int) -> bool:
        """Whether a push ends in a level, which of a held one is no overshoot."""
        top = self.readings[k]
        n_high = np.count_nonzero(top > self.highest[k] - self.height[k] / 2)
        n_at = np.count_nonzero(top > self.largest - self.band[k])
        is_long = not self.held[k] or bool(n_at > _LEAST_LEVEL * n_high)
        return is_long and self._is_flat(k, self.largest)

    def _are_flat(self) -> Bool[np.ndarray, " q"]:
        """Whether readings of each push pile up at its own largest."""
        return np.array([self._is_flat(k, end) for k, end in enumerate(self.highest)])

    def _is_one_level(self, rows: Sequence[int]) -> bool:
        """Whether medians at the top agree as those of one level do."""
        parts = [self._middle(k) for k in rows]
        levels = [float(np.median(part)) for part in parts]
        sd = [
            float(self.sigma[k]) / part.size**0.5
            for k, part in zip(rows, parts, strict=True)
        ]
        reach = max(_BAND_SIGMAS * 2**0.5 * max(sd, default=0.0), self.quantum)
        return float(np.ptp(levels or [0.0])) <= reach

    def _middle(self, k: int) -> Float[np.ndarray, " m"]:
        """Readings from the first to the last in the band, without its edges."""
        top = self.readings[k]
        inside = np.flatnonzero(top >= self.highest[k] - self.band[k])
        first, end = int(inside[0]), int(inside[-1]) + 1
        margin = int(_EDGE * (end - first))
        return top[first + margin : end - margin]


def _is_at_one(top: Float[np.ndarray, " n"]) -> bool:
    """Whether far more readings are the largest than the three next to it.

    A natural top has about as many samples just below its highest value as at it; a cut
    one has them all at it.
    """
    n_at = np.count_nonzero(top >= top.max())
    if n_at < _MIN_SAMPLES:
        return False
    just_below = np.isin(top, np.unique(top)[-4:-1])
    return bool(n_at > 2 * np.count_nonzero(just_below))


def _piles_up(
    top: Float[np.ndarray, " n"], largest: float, band: float, least: int
) -> bool:
    """Whether far more readings lie in a band below a level than in those beneath."""
    n_at = int(np.count_nonzero(top > largest - band))
    if n_at < least:
        return False
    n_below = int(np.count_nonzero(top > largest - 4 * band)) - n_at
    return n_at > 2 * n_below
