"""Humps of a smoothed signal, the valleys between them, and which belong together.

Several humps without a rest between them are one push. A valley is a rest if it is
deep, or if the signal stays at its level for long, on both sides of a hump: so the
pushes that follow a step of the rest level are as many as those before it. Constants
were tried at half and at twice, in the recordings of
`benchmarks.recordings.real_recordings`, whole and cut at six places, and in the tests.
Excluded: the smoothing (`pushfit.data.pushes.hump_search`).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.tracing import ON_STEP
from pushfit.parameters import TINY

# A dip is briefer than the smoothing, which is so many bins (`_reduce` of the search);
# a rest is not.
_DIP_BINS = 3
# A first or last reading that is higher than this share of its hump shows no foot: four
# feet. Half or twice changes nothing.
_FOOTLESS = 0.2
# A level is held if the signal stays within the first share of the smaller hump of it
# for the second share of that hump's width. A sine does so for 0.41 of it only.
_LEVEL, _HELD = 0.15, 0.6
# From the first to the last third of that time it moves by less than this share; a
# flank passes through two thirds of twice `_LEVEL`, which is 0.2.
_FLAT = 0.1
# A step that a hump is on is held for so many times as long as the hump, or is a part
# of a push. At half as long a cut push of `trial2` is not told from one on a step.
_SHELF = 1.5
# A step is short beside the time that its level is held, by this share; a flank is not.
_WAY = 0.3
# A rest level that is never left is one that is come back to so many times: without it
# pushes beyond a step of the rest level are lost; with six, brief ones.
_RETURNS = 3
# Humps lower than this share of the whole are wiggles of a plateau. At half one of the
# 12 holds of `force_N` is lost; at twice pushes beyond a step are.
_ON_TOP = 0.2


@dataclass(slots=True)
class Humps:
    """Peaks with the valleys before, between and after them.

    Args:
        y: Means of the signal in short bins, the grid [unit].
        peaks: Grid positions of the tops.
        valleys: Grid positions of the lowest points beside them.
    """

    y: Float[np.ndarray, " m"]
    peaks: Int[np.ndarray, " k"]
    valleys: Int[np.ndarray, " k1"]

    @classmethod
    def between(
        cls, y: Float[np.ndarray, " m"], peaks: Int[np.ndarray, " k"]
    ) -> "Humps":
        """Find the valleys that belong to peaks."""
        bounds = [0, *peaks, len(y) - 1]
        spans = pairwise(bounds)
        valleys = np.array([a + int(np.argmin(y[a : b + 1])) for a, b in spans])
        return cls(y, peaks, valleys)

    @property
    def heights(self) -> Float[np.ndarray, " k"]:
        """Tops over the higher foot; where the signal begins or ends, over the inner.

        A signal that begins half way up a push shows no foot there.
        """
        lows = self.y[self.valleys]
        left, right = lows[:-1].copy(), lows[1:].copy()
        if len(left) == 0:
            return left
        if self.valleys[0] == self.peaks[0] or self._is_cut_off(0, right[0]):
            left[0] = -np.inf
        if self.valleys[-1] == self.peaks[-1] or self._is_cut_off(-1, left[-1]):
            right[-1] = -np.inf
        return self.y[self.peaks] - np.maximum(left, right)

    def _is_cut_off(self, end: int, inner: float) -> bool:
        """Whether the signal begins or ends in a push, not at a new rest level.

        What sags a little from its top is a plateau; a hump that is high over a level
        that is held long, before it or after it, and falls back from there, stands on
        a step.
        """
        peak, edge = int(self.peaks[end]), 0 if end == 0 else len(self.y) - 1
        outer, top = float(self.y[self.valleys[end]]), float(self.y[peak])
        if outer - inner <= _FOOTLESS * (top - inner):
            return False
        foot = int(self.valleys[1 if end == 0 else -2])
        part = self.y[min(foot, edge) : max(foot, edge) + 1]
        shelf = np.median(part[part - inner > _FOOTLESS * (top - inner)])

        def is_step(level: float) -> bool:
            near = _LEVEL * (top - level)
            held, _ = longest_run(np.abs(part - level) <= near)
            between = np.count_nonzero((part > inner + near) & (part < level - near))
            return bool(
                top - level >= ON_STEP * (level - inner)
                and held >= max(_SHELF * self._width(end), between / _WAY)
            )

        return not (is_step(outer) or is_step(float(shelf)))

    def _width(self, k: int) -> int:
        """Bins of a hump above half of its height over the higher valley."""
        k %= len(self.peaks)
        left, right = int(self.valleys[k]), int(self.valleys[k + 1])
        top = self.y[self.peaks[k]]
        low = max(self.y[left], self.y[right])
        return max(1, longest_run(self.y[left : right + 1] >= (low + top) / 2)[0])

    def drop(self, peak: int) -> None:
        """Remove a peak; the valleys beside it become one."""
        pair = self.valleys[peak : peak + 2]
        lower = int(pair[np.argmin(self.y[pair])])
        self.peaks = np.delete(self.peaks, peak)
        self.valleys = np.delete(self.valleys, peak)
        self.valleys[peak] = lower

    def join(self, split: float) -> set[int]:
        """Join neighbours whose valley is too high for a rest between two pushes.

        The highest valley goes first. It is compared with the lower of the rests beside
        the pair, which is the true one once the inner humps are joined: no rest level
        over the whole recording is needed, whatever its drift.

        Args:
            split: Two humps are two pushes if the valley between them is lower than
                this share of the lower hump.

        Returns:
            Valleys that are higher than that, but rests.
        """
        kept: set[int] = set()
        every = self.peaks
        # What a brief dip does not lower.
        spans = pairwise([0, *every, len(self.y) - 1])
        rests = np.array([_low(self.y[a : b + 1]) for a, b in spans])
        while len(self.peaks) > 1:
            tops, lows = self.y[self.peaks], self.y[self.valleys]
            rest = np.minimum(rests[:-2], rests[2:])
            smaller = np.minimum(tops[:-1], tops[1:])
            ratio = (lows[1:-1] - rest) / np.maximum(smaller - rest, TINY)
            ratio[[int(v) in kept for v in self.valleys[1:-1]]] = -np.inf
            worst = int(np.argmax(ratio))
            if ratio[worst] <= split:
                break
            if self._is_new_rest(worst) or (
                ratio[worst] < 1 - _ON_TOP and self._is_level(worst, every)
            ):
                kept.add(int(self.valleys[worst + 1]))
                continue
            lower = worst + int(tops[worst] >= tops[worst + 1])
            self.peaks = np.delete(self.peaks, lower)
            self.valleys = np.delete(self.valleys, worst + 1)
            rests = np.delete(rests, worst + 1)
        return kept

    def _is_new_rest(self, pair: int) -> bool:
        """Whether the signal returns to a valley and, on one side, never falls below.

        So it does after a step of the rest level, and before one. It returns from
        pushes: wiggles of a plateau, which an end of the signal may cut, are lower.
        """
        lows, tops = self.y[self.valleys], self.y[self.peaks]
        low = lows[pair + 1]
        near = _LEVEL * (min(tops[pair : pair + 2]) - low)
        is_large = tops - low >= _ON_TOP * (tops.max() - lows.min())
        for side, passed in (
            (lows[pair + 2 :], is_large[pair + 1 :]),
            (lows[pair::-1], is_large[pair::-1]),
        ):
            n_passed = np.cumsum(passed)[np.abs(side - low) <= near]
            if side.min() >= low - near and len(np.unique(n_passed)) >= _RETURNS:
                return True
        return False

    def _is_level(self, pair: int, every: Int[np.ndarray, " t"]) -> bool:
        """Whether the signal rests between two humps, and beside one of them as well.

        One flat valley may be that of a push with two tops; a level that is come back
        to, outside of the humps that are one by now, is a rest.

        Args:
            every: Tops of all humps before any were joined.
        """
        a, b = (int(k) for k in self.peaks[pair : pair + 2])
        low = float(self.y[self.valleys[pair + 1]])
        height = min(self.y[a], self.y[b]) - low
        width = min(self._width_over(pair, low), self._width_over(pair + 1, low))

        def held(first: int, last: int) -> bool:
            part = self.y[first : last + 1]
            n, begin = longest_run(np.abs(part - low) <= _LEVEL * height)
            if n < max(_HELD * width, 2):
                return False
            third, run = max(1, n // 3), part[begin : begin + n]
            return bool(abs(run[:third].mean() - run[-third:].mean()) <= _FLAT * height)

        tops = np.union1d(self.peaks, every[self.y[every] > low + _LEVEL * height])
        bounds = np.concatenate([[0], tops, [len(self.y) - 1]])
        before = int(np.searchsorted(tops, self.valleys[pair]))
        after = int(np.searchsorted(tops, self.valleys[pair + 2], side="right"))
        sides = (bounds[k : k + 2].tolist() for k in (before, after))
        return held(a, b) and any(held(*side) for side in sides)

    def _width_over(self, k: int, low: float) -> float:
        """Bins around a top that stay above half of its height over a level.

        A hump that an end of the signal cuts is wider than what is seen of it.
        """
        y, peak = self.y, int(self.peaks[k])
        below = np.flatnonzero(y < (low + y[peak]) / 2)
        after = int(np.searchsorted(below, peak))
        if after in {0, len(below)}:
            return np.inf
        return float(below[after] - below[after - 1] - 1)

    def drop_below(self, least: float) -> None:
        """Remove humps that are too low, the lowest first."""
        while len(self.peaks):
            heights = self.heights
            smallest = int(np.argmin(heights))
            if heights[smallest] >= least:
                return
            self.drop(smallest)


def _low(y: Float[np.ndarray, " m"]) -> float:
    """Lowest level that is kept for longer than a dip."""
    n = min(_DIP_BINS, len(y) - 1)
    return float(np.partition(y, n)[n])


def longest_run(inside: Bool[np.ndarray, " m"]) -> tuple[int, int]:
    """Length of the longest stretch of True, and where it begins."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
    if edges.size == 0:
        return 0, 0
    lengths = edges[1::2] - edges[::2]
    k = int(lengths.argmax())
    return int(lengths[k]), int(edges[2 * k])
