"""Ways of pairing humps with planned pushes in order, and what each costs.

At one scale of time a cost is minus a log likelihood: of the times between paired
humps, of the heights of those of one direction, of pushes left missing and humps left
over, and of the time before and after. The cheapest pairings come by dynamic
programming from both ends. Excluded: choosing among scales, and whether the best one
counts (`pushfit.data.plans.alignment`).
Constants were tried in the cases of `benchmarks.recordings.plan_alignment`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pushfit.data.plans.case import IN_TIME, Case, cost_of_heights
from pushfit.data.plans.rhythm import LEAD, MISSING_COST, SLACK

# Minus log probability of a hump without a push: rarer than a missing push.
_EXTRA = 2.5
# A brush is most often none, and is then no news. One that keeps the rhythm is paired
# all the same, since a missing push costs more than both differ by.
_EXTRA_BRUSH, _PAIR_BRUSH = 0.2, 1.0
# A push cannot be planned before the recording begins, or after it ends: it costs as
# much as 15 missing ones. Half or twice changes no case.
_OUTSIDE = 30.0
# A recording is more often ended late than begun early, which tells what is shown first
# where nothing else does. At 1.001 and 1.1 no other case is paired.
_LATE = 1.01
# Pairings that are compared by their repeats as well.
_MOST_PAIRINGS = 40
# Humps in a row that may be left over: more take longer, in proportion. Half changes
# none of the cases, which have up to five.
_MAX_EXTRA_RUN = 6


def cheapest_pairings(
    case: Case, scale: float, scatter: float
) -> list[tuple[float, Int[np.ndarray, " n"]]]:
    """The cheapest pairings at one scale, each the cheapest that has another pair.

    Returns:
        What each costs [nats], and the hump of each planned push.
    """
    counted = case.in_periods(scale)
    steady = _Steady(counted, scatter)
    cost, back = steady.forward()
    after, ahead = (a[::-1, ::-1] for a in steady.turned().forward())
    # Counted from the other end.
    ahead = np.where(ahead < 0, -1, np.array(cost.shape) - 1 - ahead)
    own = np.where(case.brush, _PAIR_BRUSH, 0.0)
    # A pair belongs to the way to it and to the way from it.
    total = cost + after - own
    most = _MOST_PAIRINGS if case.is_repeated else 2
    pairings, rest = [], total.copy()
    while len(pairings) < most and np.isfinite(rest.min()):
        hump = _traced(total, back, ahead, int(np.argmin(rest)))
        cost = float(rest.min()) + counted.cost_of_other_repeats(hump)
        pairings.append((cost, hump))
        rows = np.flatnonzero(hump >= 0)
        rest[rows, hump[rows]] = np.inf
    _, taken = min(pairings, key=lambda pairing: pairing[0])
    rows = np.flatnonzero(taken >= 0)
    # What shares no other pair may still leave one of these out.
    for row in rows if rows.size > 1 else ():
        others = rows[rows != row]
        k = int(np.argmin(np.abs(others - row)))
        step = counted.planned[row] - counted.planned[others[k]]
        gap = counted.times[taken[row]] - counted.times[taken[others[k]]]
        if abs(gap - step) < IN_TIME:
            continue  # what comes in time is the push
        fewer = taken.copy()
        fewer[row] = -1
        pairings.append((steady.cost(fewer), fewer))
    return pairings


def cost_in_order(case: Case, scale: float, scatter: float) -> float:
    """Cost of as many humps as planned in order, whether in rhythm or not."""
    counted = case.in_periods(scale)
    in_order = np.flatnonzero(~case.brush)
    gaps = counted.cost_of_all_gaps(scatter)
    return _Steady(counted, scatter).cost(in_order, gaps)


def _traced(
    total: Float[np.ndarray, "n m"],
    back: Int[np.ndarray, "n m 2"],
    ahead: Int[np.ndarray, "n m 2"],
    through: int,
) -> Int[np.ndarray, " n"]:
    """The cheapest pairing that has a given pair."""
    start = divmod(through, total.shape[1])
    hump = np.full(len(total), -1)
    for links in (back, ahead):
        i, j = start
        while i >= 0:
            hump[i] = j
            i, j = (int(k) for k in links[i, j])
    return hump


@dataclass(frozen=True, slots=True)
class _Steady:
    """A case in periods, with the scatter of times without a jump."""

    case: Case
    scatter: float
    lead: float = LEAD

    def turned(self) -> "_Steady":
        """The case with time running backwards."""
        return _Steady(self.case.turned(), self.scatter, LEAD * _LATE)

    def forward(self) -> tuple[Float[np.ndarray, "n m"], Int[np.ndarray, "n m 2"]]:
        """Least cost of everything up to each pair, and the pair before it."""
        case = self.case
        n, m = len(case.planned), len(case.times)
        extra = np.where(case.brush, _EXTRA_BRUSH, _EXTRA)
        humps = np.append(0.0, np.cumsum(extra))
        own = np.where(case.brush, _PAIR_BRUSH, 0.0)
        cost = MISSING_COST * np.arange(n)[:, None] + humps[:-1] + self._lead() + own
        back = np.full((n, m, 2), -1)
        j, run = np.arange(m), np.arange(1, _MAX_EXTRA_RUN + 1)[:, None]
        before = np.maximum(j - run, 0)
        gap = case.times - case.times[before]
        between = np.where(j < run, np.inf, humps[:-1] - humps[before + 1])
        unlike = cost_of_heights(case.heights, case.heights[before])
        for i in range(1, n):
            k = np.arange(i)[:, None]
            # By humps left over, then by the pair before, then by the hump.
            off = case.cost_of_gaps(gap[:, None], k, np.array(i), scatter=self.scatter)
            is_repeat = case.direction[i] == case.direction[k]
            off = off + np.where(is_repeat, unlike[:, None], 0.0)
            way = cost[:i, before].swapaxes(0, 1) + off + MISSING_COST * (i - 1 - k)
            way = (way + between[:, None]).reshape(run.size * i, m)
            least = way.argmin(axis=0)
            value = way[least, j] + own
            better = value < cost[i]
            cost[i] = np.where(better, value, cost[i])
            skipped, pair = np.divmod(least, i)
            links = np.stack([pair, j - 1 - skipped], axis=1)
            back[i] = np.where(better[:, None], links, back[i])
        return cost, back

    def cost(self, hump: Int[np.ndarray, " n"], gaps: float | None = None) -> float:
        """What one assignment costs.

        Args:
            gaps: What its gaps do; None if they are those of the rhythm.
        """
        case, there = self.case, np.flatnonzero(hump >= 0)
        taken, first, last = hump[there], there[:-1], there[1:]
        own = np.where(case.brush, _PAIR_BRUSH, 0.0)[taken].sum()
        left = np.ones(len(case.times), dtype=bool)
        left[taken] = False
        extra = np.where(case.brush, _EXTRA_BRUSH, _EXTRA)[left].sum()
        missing = MISSING_COST * (len(hump) - len(there))
        off = gaps
        if off is None:
            times = np.diff(case.times[taken])
            off = case.cost_of_gaps(times, first, last, scatter=self.scatter).sum()
        is_same = case.direction[first] == case.direction[last]
        off = off + case.cost_of_repeats(taken[:-1][is_same], taken[1:][is_same])
        off = off + case.cost_of_other_repeats(hump)
        lead = self._lead()[there[0], taken[0]]
        out = self.turned()._lead()[::-1, ::-1][there[-1], taken[-1]]
        return float(own + extra + missing + off + lead + out)

    def _lead(self) -> Float[np.ndarray, "n m"]:
        """Cost of the time before the first planned push, by its pair."""
        case, begin = self.case, self.case.span[0]
        if not np.isfinite(self.scatter):
            return np.zeros((len(case.planned), len(case.times)))
        first = case.times - (case.planned - case.planned[0])[:, None]
        lead = first - begin
        return np.where(lead < -SLACK, _OUTSIDE, np.maximum(lead, 0.0) / self.lead)
