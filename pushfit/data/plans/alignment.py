"""Which recorded hump is which planned push.

Counting does not tell where a push is missing. The rhythm does: pushes of a schedule
follow each other in regular time, from soon after the recording begins until shortly
before it ends. Every way of pairing in order has a likelihood by the times between its
humps, the pushes it leaves missing, the humps it leaves over and the time before and
after; the best one counts if no other comes near. Excluded: the
rhythms that humps may have (`pushfit.data.plans.rhythm`), finding and measuring them.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.plans.rhythm import LEAD, MISSING, SLACK, rhythms

# Minus log probability of a hump without a push.
_EXTRA = 2.5
# A brush is most often none, and is then no news.
_EXTRA_BRUSH, _PAIR_BRUSH = 0.2, 1.0
# A push cannot be planned before the recording begins, or after it ends.
_OUTSIDE = 30.0
# Scatter of a time between two pushes that keep to a plan, in periods.
_TIMED_SCATTER = 0.05
# Gaps off by less than this are in time without a search.
_IN_TIME = 0.15
# Humps on time that show that plan and recording have one clock; share of all humps.
_FEWEST, _ON_CLOCK = 3, 0.75
# How much likelier the best way must be: this many nats.
_CLEAR = 4.0
# Nats of rhythm that an assignment with missing or extra pushes needs: some four pairs.
_EVIDENCE = 8.0
_MAX_EXTRA_RUN = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Pairs of recorded humps and planned pushes.

    Args:
        hump: For each planned push its hump, -1 where it is missing.
        extra: Humps that are no planned push.
        other: Another assignment that is nearly as good; None where there is none.
        n_cycles: How often the recording runs through the schedule.
        expected: When each planned push was to be [s].
    """

    hump: Int[np.ndarray, " n"]
    extra: tuple[int, ...]
    other: Int[np.ndarray, " n"] | None
    n_cycles: int
    expected: Float[np.ndarray, " n"]

    @property
    def is_ambiguous(self) -> bool:
        """Whether another alignment fits nearly as well."""
        return self.other is not None

    @property
    def missing(self) -> tuple[int, ...]:
        """Planned pushes without a hump, as positions in the repeated schedule."""
        return tuple(np.flatnonzero(self.hump < 0).tolist())

    @property
    def n_odd(self) -> int:
        """Number of pushes missing or too many."""
        return len(self.missing) + len(self.extra)

    @property
    def is_complete(self) -> bool:
        """Whether every planned push has its hump and no hump is left."""
        return self.n_odd == 0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Way:
    """One way of pairing, with what it costs [nats]."""

    hump: Int[np.ndarray, " n"]
    cost: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Case:
    """Humps and plan, with the time that the recording covers.

    Args:
        times: Middles of the humps [s].
        brush: Whether each is a brush.
        planned: Planned times, in any unit.
        is_timed: Whether those are stated, and not only the order.
        span: Begin and end of the recording [s].
    """

    times: Float[np.ndarray, " m"]
    brush: Bool[np.ndarray, " m"]
    planned: Float[np.ndarray, " n"]
    is_timed: bool
    span: tuple[float, float]


def align(
    times: Float[np.ndarray, " m"],
    is_brush: Sequence[bool],
    *,
    n_planned: int,
    planned_times: Float[np.ndarray, " n"] | None,
    span: tuple[float, float] = (-np.inf, np.inf),
) -> Alignment:
    """Pair humps with planned pushes, in order and in rhythm.

    Args:
        times: Middle of every hump, brushes included [s].
        is_brush: Whether a hump is so small that it may be no push.
        planned_times: Their times, from any origin, that of the recording where they
            agree with it; None for a steady rhythm [s].
        span: Begin and end of the recording; unbounded where unknown [s].
    """
    brush = np.asarray(is_brush, dtype=bool)
    n_pushes = int(np.count_nonzero(~brush))
    n_cycles = max(1, round(n_pushes / n_planned))
    planned = _planned(n_planned, n_cycles, planned_times)
    case = _Case(
        times=times,
        brush=brush,
        planned=planned,
        is_timed=planned_times is not None,
        span=span,
    )
    in_order = np.flatnonzero(~brush)
    if n_pushes == len(planned) and _is_in_rhythm(case):
        return _alignment(case, in_order, None, n_cycles)
    if planned_times is not None:
        hump = _on_the_clock(case, float(planned_times[0]))
        if hump is not None:
            return _alignment(case, hump, None, n_cycles)
        scales = [(1.0, _TIMED_SCATTER)]
    else:
        certain = times[~brush] if n_pushes > 1 else times
        scales = rhythms(certain, len(planned), span[1] - span[0])
    if n_pushes == len(planned) and not np.isfinite(scales[0][1]):
        # A hand has no rhythm that could tell otherwise.
        return _alignment(case, in_order, None, n_cycles)
    ways = [way for scale, scatter in scales for way in _pair(case, scale, scatter)]
    ways.sort(key=lambda way: way.cost)
    best, clear = ways[0].hump, ways[0].cost + _CLEAR
    if n_pushes == len(planned) and not np.array_equal(best, in_order):
        return _alignment(case, best, None if case.is_timed else in_order, n_cycles)
    others = [way.hump for way in ways[1:] if way.cost < clear]
    if _rhythm_shown(case, best, scales) < _EVIDENCE or _skips_beats(case, best):
        # Too few to keep a rhythm, or one that the plan has no room for, as where a
        # recording was stopped early: it does not speak against mere order.
        others = [*_in_order(case), *others]
    others = [other for other in others if _differs(case, best, other)]
    return _alignment(case, best, others[0] if others else None, n_cycles)


def _in_order(case: _Case) -> list[Int[np.ndarray, " n"]]:
    """Humps as the first planned pushes, and as the last ones."""
    humps = np.flatnonzero(~case.brush)
    n = min(len(humps), len(case.planned))
    none = np.full(len(case.planned) - n, -1)
    return [np.append(humps[:n], none), np.append(none, humps[len(humps) - n :])]


def _skips_beats(case: _Case, hump: Int[np.ndarray, " n"]) -> bool:
    """Whether humps that follow each other evenly are no neighbours in the plan."""
    gaps = np.diff(case.times[~case.brush])
    is_even = np.abs(gaps / np.median(gaps) - 1) < _IN_TIME if len(gaps) else gaps > 0
    skips = np.any(np.diff(np.flatnonzero(hump >= 0)) > 1)
    return bool(skips and is_even.all() and not case.is_timed)


def _on_the_clock(case: _Case, first: float) -> Int[np.ndarray, " n"] | None:
    """Humps at the stated times as they are; None if the clock is another.

    What begins before the recording, such as at 0, is no time of its clock.
    """
    if len(case.planned) < _FEWEST or not case.span[0] < first < case.span[1]:
        return None
    off = np.abs(case.times - first - case.planned[:, None])
    late = _IN_TIME * float(np.median(np.diff(case.planned)))
    hump = np.where(off.min(axis=1) < late, off.argmin(axis=1), -1)
    taken = np.unique(hump[hump >= 0])
    if len(taken) < np.count_nonzero(hump >= 0):
        return None
    n_on, n_pushes = np.count_nonzero(~case.brush[taken]), np.sum(~case.brush)
    return hump if n_on >= max(_FEWEST, _ON_CLOCK * n_pushes) else None


def _rhythm_shown(
    case: _Case, hump: Int[np.ndarray, " n"], scales: Sequence[tuple[float, float]]
) -> float:
    """How much likelier a rhythm makes the times of the pairs than chance [nats].

    Of many humps some are in rhythm by chance: each way to choose as many counts.
    """
    there = np.flatnonzero(hump >= 0)
    if case.is_timed or there.size < 2:
        return np.inf if case.is_timed else 0.0
    gaps, steps = np.diff(case.times[hump[there]]), np.diff(case.planned[there])
    shown = max(
        -float(_off(gaps / scale, steps, scatter).sum()) for scale, scatter in scales
    )
    return shown - math.log(math.comb(len(case.times), there.size))


def _off(
    gap: Float[np.ndarray, "*#s"], steps: Float[np.ndarray, "*#s"], scatter: float
) -> Float[np.ndarray, "*#s"]:
    """Cost of times between humps: a normal density about those between pushes.

    Its height counts, because what is no push may come at any time.
    """
    if not np.isfinite(scatter):
        return np.zeros(np.broadcast_shapes(gap.shape, steps.shape))
    wide = scatter * np.sqrt(steps)
    return ((gap - steps) / wide) ** 2 / 2 + np.log(2.507 * wide)


def _differs(
    case: _Case, one: Int[np.ndarray, " n"], other: Int[np.ndarray, " n"]
) -> bool:
    """Whether two ways differ by more than taking a brush for a push or for none."""
    is_brush = np.append(case.brush, True)
    return bool(np.any((one != other) & ~(is_brush[one] & is_brush[other])))


def _alignment(
    case: _Case,
    hump: Int[np.ndarray, " n"],
    other: Int[np.ndarray, " n"] | None,
    n_cycles: int,
) -> Alignment:
    """An assignment with what follows from it."""
    return Alignment(
        hump=hump,
        extra=tuple(np.setdiff1d(np.flatnonzero(~case.brush), hump).tolist()),
        other=other,
        n_cycles=n_cycles,
        expected=_expected(case, hump),
    )


def _expected(case: _Case, hump: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Times of all planned pushes, by those that are there."""
    there = np.flatnonzero(hump >= 0)
    if there.size < 2:
        return np.full(len(hump), np.nan)
    planned, times = case.planned[there], case.times[hump[there]]
    slope = np.polyfit(planned, times, 1)[0]
    expected = np.interp(case.planned, planned, times)
    before, after = case.planned < planned[0], case.planned > planned[-1]
    expected[before] = times[0] + slope * (case.planned[before] - planned[0])
    expected[after] = times[-1] + slope * (case.planned[after] - planned[-1])
    return expected


def _planned(
    n_planned: int, n_cycles: int, planned_times: Float[np.ndarray, " n"] | None
) -> Float[np.ndarray, " n"]:
    """Planned times, in periods where only the order is known."""
    if planned_times is None:
        return np.arange(n_planned * n_cycles, dtype=float)
    period = float(np.median(np.diff(planned_times))) if n_planned > 1 else 1.0
    one = planned_times - planned_times[0]
    return np.concatenate([one + k * (one[-1] + period) for k in range(n_cycles)])


def _is_in_rhythm(case: _Case) -> bool:
    """Whether pairing one by one is the likeliest, which needs no search.

    It is if no time between two pushes is off by what it takes to be another pair.
    """
    gaps = np.diff(case.times[~case.brush])
    steps = np.diff(case.planned)
    if len(gaps) < 1:
        return True
    scale = 1.0 if case.is_timed else float(np.median(gaps / steps))
    off = np.abs(gaps / scale - steps) / float(np.median(steps))
    return bool(np.all(off < _IN_TIME))


def _pair(case: _Case, scale: float, scatter: float) -> list[_Way]:
    """The cheapest pairing at one scale, and the cheapest that has another pair."""
    period = float(np.median(np.diff(case.planned))) if len(case.planned) > 1 else 1.0
    clock = case.times / scale / period
    steady = _Steady(clock, case.brush, case.planned / period, scatter)
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
    ways = [_traced(total, back, ahead, best)]
    taken = ways[0].hump
    rows = np.flatnonzero(taken >= 0)
    rest = total.copy()
    rest[rows, taken[rows]] = np.inf
    if np.isfinite(rest).any():
        ways.append(_traced(total, back, ahead, int(np.argmin(rest))))
    # What shares no other pair may still leave one of these out.
    for row in rows if rows.size > 1 else ():
        others = rows[rows != row]
        k = int(np.argmin(np.abs(others - row)))
        step = steady.planned[row] - steady.planned[others[k]]
        gap = steady.clock[taken[row]] - steady.clock[taken[others[k]]]
        if abs(gap - step) < _IN_TIME:
            continue  # what comes in time is the push
        fewer = taken.copy()
        fewer[row] = -1
        ways.append(_Way(hump=fewer, cost=steady.cost(fewer, begin, end)))
    return ways


def _traced(
    total: Float[np.ndarray, "n m"],
    back: Int[np.ndarray, "n m 2"],
    ahead: Int[np.ndarray, "n m 2"],
    through: int,
) -> _Way:
    """The cheapest way through a pair."""
    start = divmod(through, total.shape[1])
    hump = np.full(len(total), -1)
    for links in (back, ahead):
        i, j = start
        while i >= 0:
            hump[i] = j
            i, j = (int(k) for k in links[i, j])
    return _Way(hump=hump, cost=float(total[start]))


@dataclass(frozen=True, slots=True)
class _Steady:
    """Humps and plan on one clock, counted in periods."""

    clock: Float[np.ndarray, " m"]
    brush: Bool[np.ndarray, " m"]
    planned: Float[np.ndarray, " n"]
    scatter: float

    def turned(self) -> "_Steady":
        """The same from the end."""
        return _Steady(
            -self.clock[::-1], self.brush[::-1], -self.planned[::-1], self.scatter
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
            off = _off(gap[:, None], self.planned[i] - self.planned[k], self.scatter)
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
        off = _off(gaps, steps, self.scatter).sum()
        lead = self._lead(begin)[there[0], taken[0]]
        out = self.turned()._lead(-end)[::-1, ::-1][there[-1], taken[-1]]
        return float(own + extra + missing + off + lead + out)

    def _lead(self, begin: float) -> Float[np.ndarray, "n m"]:
        """Cost of the time before the first planned push, by its pair."""
        if not (np.isfinite(begin) and np.isfinite(self.scatter)):
            return np.zeros((len(self.planned), len(self.clock)))
        first = self.clock - (self.planned - self.planned[0])[:, None]
        lead = first - begin
        return np.where(lead < -SLACK, _OUTSIDE, np.maximum(lead, 0.0) / LEAD)
