"""Ways of pairing humps with planned pushes in order, and what each costs.

At one scale of time a cost is minus a log likelihood: of the times between paired
humps, of pushes left missing and humps left over, and of the time before and after.
The cheapest pairings come by dynamic programming from both ends. Excluded: choosing
among scales, and whether the best one counts (`pushfit.data.plans.alignment`).
Constants were tried in the cases of `benchmarks.recordings.plan_alignment`.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.plans.rhythm import LEAD, MISSING, SLACK

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
# A robot may pause between two pushes: as rare as five missing ones. At 9 three more of
# 2000 regular plans are refused; at 12 three times as many with a pause are wrong.
_PAUSE = 10.0
# Humps in a row that may be left over: more take longer, in proportion. Half changes
# none of the cases, which have up to five.
_MAX_EXTRA_RUN = 6
# Gaps off by less than this are in time without a search, in periods: five times the
# least scatter. At half 2 cases more are refused; twice changes none.
IN_TIME = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class PossiblePairing:
    """One pairing of humps with planned pushes, and what it costs [nats]."""

    hump: Int[np.ndarray, " n"]
    cost: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Humps and plan, with the time that the recording covers.

    Args:
        times: Middles of the humps [s].
        brush: Whether each is a brush.
        planned: Planned times, in any unit.
        is_timed: Whether those are stated, and not only the order.
        span: Begin and end of the recording [s].
        stretch: Which part of the plan each push is of; a pause is between two.
    """

    times: Float[np.ndarray, " m"]
    brush: Bool[np.ndarray, " m"]
    planned: Float[np.ndarray, " n"]
    is_timed: bool
    span: tuple[float, float]
    stretch: Int[np.ndarray, " n"]


def cheapest_pairings(
    case: Case, scale: float, scatter: float
) -> list[PossiblePairing]:
    """The cheapest pairing at one scale, and the cheapest that has another pair."""
    period = float(np.median(np.diff(case.planned))) if len(case.planned) > 1 else 1.0
    clock = case.times / scale / period
    planned = case.planned / period
    steady = _Steady(clock, case.brush, planned, scatter, case.stretch)
    begin, end = (t / scale / period for t in case.span)
    cost, back = steady.forward(begin)
    turned = steady.turned()
    after, ahead = (a[::-1, ::-1] for a in turned.forward(-end))
    # Counted from the other end.
    ahead = np.where(ahead < 0, -1, np.array(cost.shape) - 1 - ahead)
    own = np.where(case.brush, _PAIR_BRUSH, 0.0)
    # A pair belongs to the way to it and to the way from it.
    total = cost + after - own
    best = int(np.argmin(total))
    pairings = [_traced(total, back, ahead, best)]
    taken = pairings[0].hump
    rows = np.flatnonzero(taken >= 0)
    rest = total.copy()
    rest[rows, taken[rows]] = np.inf
    if np.isfinite(rest).any():
        pairings.append(_traced(total, back, ahead, int(np.argmin(rest))))
    # What shares no other pair may still leave one of these out.
    for row in rows if rows.size > 1 else ():
        others = rows[rows != row]
        k = int(np.argmin(np.abs(others - row)))
        step = steady.planned[row] - steady.planned[others[k]]
        gap = steady.clock[taken[row]] - steady.clock[taken[others[k]]]
        if abs(gap - step) < IN_TIME:
            continue  # what comes in time is the push
        fewer = taken.copy()
        fewer[row] = -1
        pairings.append(
            PossiblePairing(hump=fewer, cost=steady.cost(fewer, begin, end))
        )
    return pairings


def _traced(
    total: Float[np.ndarray, "n m"],
    back: Int[np.ndarray, "n m 2"],
    ahead: Int[np.ndarray, "n m 2"],
    through: int,
) -> PossiblePairing:
    """The cheapest pairing that has a given pair."""
    start = divmod(through, total.shape[1])
    hump = np.full(len(total), -1)
    for links in (back, ahead):
        i, j = start
        while i >= 0:
            hump[i] = j
            i, j = (int(k) for k in links[i, j])
    return PossiblePairing(hump=hump, cost=float(total[start]))


@dataclass(frozen=True, slots=True)
class _Steady:
    """Humps and plan on one clock, counted in periods."""

    clock: Float[np.ndarray, " m"]
    brush: Bool[np.ndarray, " m"]
    planned: Float[np.ndarray, " n"]
    scatter: float
    stretch: Int[np.ndarray, " n"]
    lead: float = LEAD

    def turned(self) -> "_Steady":
        """The same from the end."""
        return _Steady(
            -self.clock[::-1],
            self.brush[::-1],
            -self.planned[::-1],
            self.scatter,
            -self.stretch[::-1],
            LEAD * _LATE,
        )

    def forward(
        self, begin: float
    ) -> tuple[Float[np.ndarray, "n m"], Int[np.ndarray, "n m 2"]]:
        """Least cost of everything up to each pair, and the pair before it."""
        n, m = len(self.planned), len(self.clock)
        extra = np.where(self.brush, _EXTRA_BRUSH, _EXTRA)
        humps = np.append(0.0, np.cumsum(extra))
        own = np.where(self.brush, _PAIR_BRUSH, 0.0)
        cost = MISSING * np.arange(n)[:, None] + humps[:-1] + self._lead(begin) + own
        back = np.full((n, m, 2), -1)
        j, run = np.arange(m), np.arange(1, _MAX_EXTRA_RUN + 1)[:, None]
        before = np.maximum(j - run, 0)
        gap = self.clock - self.clock[before]
        between = np.where(j < run, np.inf, humps[:-1] - humps[before + 1])
        for i in range(1, n):
            k = np.arange(i)[:, None]
            # By humps left over, then by the pair before, then by the hump.
            steps = self.planned[i] - self.planned[k]
            may_pause = self.stretch[i] != self.stretch[k]
            off = cost_of_gaps(gap[:, None], steps, self.scatter, may_pause)
            way = cost[:i, before].swapaxes(0, 1) + off + MISSING * (i - 1 - k)
            way = (way + between[:, None]).reshape(run.size * i, m)
            least = way.argmin(axis=0)
            value = way[least, j] + own
            better = value < cost[i]
            cost[i] = np.where(better, value, cost[i])
            skipped, pair = np.divmod(least, i)
            links = np.stack([pair, j - 1 - skipped], axis=1)
            back[i] = np.where(better[:, None], links, back[i])
        return cost, back

    def cost(self, hump: Int[np.ndarray, " n"], begin: float, end: float) -> float:
        """What one assignment costs."""
        there = np.flatnonzero(hump >= 0)
        taken = hump[there]
        own = np.where(self.brush, _PAIR_BRUSH, 0.0)[taken].sum()
        left = np.ones(len(self.clock), dtype=bool)
        left[taken] = False
        extra = np.where(self.brush, _EXTRA_BRUSH, _EXTRA)[left].sum()
        missing = MISSING * (len(hump) - len(there))
        gaps, steps = np.diff(self.clock[taken]), np.diff(self.planned[there])
        may_pause = np.diff(self.stretch[there]) > 0
        off = cost_of_gaps(gaps, steps, self.scatter, may_pause).sum()
        lead = self._lead(begin)[there[0], taken[0]]
        out = self.turned()._lead(-end)[::-1, ::-1][there[-1], taken[-1]]
        return float(own + extra + missing + off + lead + out)

    def _lead(self, begin: float) -> Float[np.ndarray, "n m"]:
        """Cost of the time before the first planned push, by its pair."""
        if not (np.isfinite(begin) and np.isfinite(self.scatter)):
            return np.zeros((len(self.planned), len(self.clock)))
        first = self.clock - (self.planned - self.planned[0])[:, None]
        lead = first - begin
        return np.where(lead < -SLACK, _OUTSIDE, np.maximum(lead, 0.0) / self.lead)


def cost_of_gaps(
    gap: Float[np.ndarray, "*#s"],
    steps: Float[np.ndarray, "*#s"],
    scatter: float,
    may_pause: Bool[np.ndarray, "*#s"],
) -> Float[np.ndarray, "*#s"]:
    """Cost of times between humps: a normal density about those between pushes.

    Its height counts, because what is no push may come at any time. Beyond it is a
    pause, which may last for any time.
    """
    if not np.isfinite(scatter):
        return np.zeros(np.broadcast_shapes(gap.shape, steps.shape))
    wide = scatter * np.sqrt(steps)
    cost = ((gap - steps) / wide) ** 2 / 2 + np.log(math.sqrt(2 * math.pi) * wide)
    return np.where(may_pause & (gap > steps), np.minimum(cost, _PAUSE), cost)
