"""Which recorded hump is which planned push.

Counting does not tell where a push is missing. The rhythm does: pushes of a schedule
follow each other in regular time, from soon after the recording begins until shortly
before it ends, but for jumps of the direction, which take another time. Every way of
pairing in order has a likelihood by the times between its humps, the heights of those
of one direction, the pushes it leaves missing, the humps it leaves over and the time
before and after; the best one counts if no other comes near. Excluded: the rhythms that
humps may have (`pushfit.data.plans.rhythm`), finding and measuring them.
Constants were tried in the cases of `benchmarks.recordings.plan_alignment`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from pushfit.data.plans.assignment import cheapest_pairings, cost_in_order
from pushfit.data.plans.case import Case
from pushfit.data.plans.rhythm import (
    LEAD,
    MISSING_COST,
    SLACK,
    off_beat,
    rhythms,
    rhythms_with_jumps,
)
from pushfit.data.plans.schedule import PushSchedule

# Scatter of a time between two pushes that keep to a plan, in periods: somewhat more
# than `_LEAST_SCATTER` of those that show it. Half or twice changes no test.
_TIMED_SCATTER = 0.05
# How much likelier the best way must be: this many nats, 55 times. With twice as many
# 131 cases more are refused, and pushes missing inside a run are not placed.
_CLEAR = 4.0
# That as many pushes are missing as humps are over is so much rarer than none [nats].
# At 2 nats 9 of 10 000 regular plans with bumps are paired in order, with a warning, at
# twice as many 18, at none 4.
_AS_MANY = 2.0
# An order that is not likelier by so much is told to be in doubt.
_TOLD = 8.0
# Bumps halfway between pushes make a rhythm of half the period. A rhythm of a period so
# many times longer speaks against the best way unless that is so much likelier [nats]:
# at 4 two of 10 000 cases are paired wrong. 1.2 times or 10 nats refuse none more.
_LONGER, _CLEAR_OF_LONGER = 1.5, 8.0
# A hump this near to the moment of a missing push is that push, in periods: a bump is
# seldom just there. At 0.15 one case more of 10 000 that scatter by 4 % and 8 % is
# paired wrong; at 0.25 bumps pass for pushes in one of 1000 regular plans.
_AT_ITS_MOMENT = 0.2
# Pushes come too soon for regular time where a gap is so many times shorter than what
# so many percent of the gaps are below, which a pause leaves as it is. By itself that
# is told of 39 of the 40 plans with bumps in place of pushes that it was chosen by, and
# of 9 % of those by hand whose gaps scatter by 20 %; at the median of 23 and 1 %, at
# 1.6 times of 39 and 30 %.
_TOO_SOON, _USUAL_PERCENT = 1.8, 70
# A beat that more than this share are off is none, and among more pushes than these it
# takes long to find.
_FEW_OFF, _MOST_OF_A_BEAT = 1 / 3, 130
# Nats of rhythm that an assignment with missing or extra pushes needs: some four pairs,
# of five humps. Half pairs 23 cases more by the rhythm of fewer, twice refuses 95.
_EVIDENCE = 8.0

# A plan by one of its rhythms, with the period [s] and the scatter of gaps [periods].
Way = tuple[Case, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Pairs of recorded humps and planned pushes.

    Args:
        hump: For each planned push its hump, -1 where it is missing.
        extra: Humps that are no planned push.
        other: Another assignment that is nearly as good; None where there is none.
        expected: When each planned push was to be [s].
        off_beat: Humps that are paired for their number, against the rhythm.
        n_cycles: How often the recording runs through the schedule.
    """

    hump: Int[np.ndarray, " n"]
    extra: tuple[int, ...]
    other: Int[np.ndarray, " n"] | None
    expected: Float[np.ndarray, " n"]
    off_beat: tuple[int, ...] = ()
    n_cycles: int = 1

    @property
    def is_of_another(self) -> bool:
        """Whether a quarter of several runs, and more than one has, does not fit."""
        share = len(self.hump) / min(self.n_cycles, 4)
        return self.n_cycles > 1 and self.n_odd > share

    @property
    def is_in_doubt(self) -> bool:
        """Whether it is not the only one, or hardly one of this plan."""
        return self.other is not None or self.is_of_another

    @property
    def missing(self) -> tuple[int, ...]:
        """Planned pushes without a hump, as positions in the repeated schedule."""
        return tuple(np.flatnonzero(self.hump < 0).tolist())

    @property
    def n_odd(self) -> int:
        """Number of pushes missing or too many."""
        return len(self.missing) + len(self.extra)


def align(
    times: Float[np.ndarray, " m"],
    is_brush: Sequence[bool],
    *,
    plan: PushSchedule,
    span: tuple[float, float],
    begin: float = -np.inf,
    left_out: Sequence[float] = (),
    heights: Float[np.ndarray, " m"] | None = None,
    starts: Float[np.ndarray, " m"] | None = None,
) -> Alignment:
    """Pair humps with planned pushes, in order and in rhythm.

    Args:
        times: Middle of every hump, brushes included [s].
        is_brush: Whether a hump is so small that it may be no push.
        plan: Planned pushes. Where their times are known these have any origin, that of
            the recording where they agree with it.
        span: Begin and end of the recording [s].
        begin: Begin of the part of it that humps were looked for in [s].
        left_out: When there are humps that the user calls no pushes [s].
        heights: Heights of the humps, in any unit; None if nobody knows.
        starts: When the humps begin, which planned times may mean as well [s].
    """
    brush = np.asarray(is_brush, dtype=bool)
    alike = np.ones(len(times)) if heights is None else heights

    def runs(n_cycles: int) -> Case:
        return Case.of(times, alike, brush, plan=plan, n_cycles=n_cycles, span=span)

    likely = max(1, round(np.count_nonzero(~brush) / plan.n_pushes))
    # Some directions may show nothing in any of more runs, or bumps pass for a run.
    several = [likely, likely + 1, likely - 1] if likely > 1 else [1]
    if plan.time is not None and runs(1).on_the_clock(plan.time[0], starts) is not None:
        several = [1]
    found = []
    for n_cycles in several:
        case = runs(n_cycles)
        clock = None if plan.time is None else case.on_the_clock(plan.time[0], starts)
        one = _align(case, clock, begin=begin, left_out=left_out)
        one = replace(one, n_cycles=n_cycles)
        if not one.is_in_doubt:
            return one
        found.append(one)
    return found[0]


def _align(
    case: Case,
    clock: Int[np.ndarray, " n"] | None,
    *,
    begin: float,
    left_out: Sequence[float],
) -> Alignment:
    """The same for so many runs through the plan.

    Args:
        clock: Humps at the stated times; None if these are of another clock.
    """
    times, brush, span = case.times, case.brush, case.span
    n_pushes, n_planned = int(np.count_nonzero(~brush)), len(case.planned)
    in_order = np.flatnonzero(~brush)
    if n_pushes == n_planned and case.is_in_rhythm(left_out):
        return _alignment(case, in_order)
    if clock is not None:
        return _alignment(case, _joined(case, clock))
    if case.is_timed:
        ways = [(case, 1.0, _TIMED_SCATTER)]
    else:
        certain = times[~brush] if n_pushes > 1 else times
        ways = [
            (case, *scale) for scale in rhythms(certain, n_planned, span[1] - span[0])
        ]
        if np.any(case.is_jump):
            ways += [
                (case.with_jumps(*jump), period, scatter)
                for period, scatter, *jump in rhythms_with_jumps(certain)
            ]
    if n_pushes == n_planned and not case.is_timed:
        return _as_many(case, ways)
    case, best, others, _ = _likeliest(ways)
    shown = max(_rhythm_shown(*way, best) for way in ways)
    best = _joined(case, best)
    others = [_joined(case, other) for other in others]
    others = [*_stopped_early(case, best, begin), *others]
    if case.skips_beats(best):
        # The plan has no room for the rhythm, as where a recording was stopped early.
        best, *rest = _in_order(case)
        others = [*rest, *others]
    elif shown < _EVIDENCE:
        # Too few to keep a rhythm: it does not speak against mere order.
        others = [*_in_order(case), *others]
    others = [other for other in others if _differs(case, best, other)]
    return _alignment(case, best, others[0] if others else None)


def _as_many(case: Case, ways: Sequence[Way]) -> Alignment:
    """As many humps as planned: in order, unless a rhythm speaks against it."""
    ways = [way for way in ways if np.isfinite(way[1])]
    if not ways:
        # A hand has no rhythm that could tell otherwise.
        return _by_number(case)
    own, best, others, least = _likeliest(ways)
    in_order = np.flatnonzero(~case.brush)
    is_shown = max(_rhythm_shown(*way, best) for way in ways) > _EVIDENCE
    is_by_hand = not is_shown and case.may_be_by_hand()
    more = min(cost_in_order(*way) for way in ways) - _AS_MANY - least
    if np.array_equal(best, in_order):
        near = others[:1]
    elif more < (-_CLEAR if is_shown else 0.0):
        near = [best] if more > -_TOLD else []
    elif more < _CLEAR or case.brush[best[best >= 0]].any():
        # A brush is less likely a push than as many as planned are the pushes.
        return _alignment(own, in_order, best)
    else:
        return _alignment(own, best, in_order)
    return _by_number(case, None if is_by_hand or not near else near[0])


def _likeliest(
    ways: Sequence[Way],
) -> tuple[Case, Int[np.ndarray, " n"], list[Int[np.ndarray, " n"]], float]:
    """The likeliest assignment by any of some rhythms, and those that come near.

    Returns:
        The plan by its rhythm, the assignment, the others, and its cost [nats].
    """
    pairings = [
        (cost, scale, case, hump)
        for case, scale, scatter in ways
        for cost, hump in cheapest_pairings(case, scale, scatter)
    ]
    pairings.sort(key=lambda own: own[0])
    least, period, case, best = pairings[0]
    others = [
        hump
        for cost, scale, _, hump in pairings[1:]
        if cost - least < (_CLEAR_OF_LONGER if scale > _LONGER * period else _CLEAR)
    ]
    return case, best, others, least


def _joined(case: Case, hump: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """The same, where humps left over at the moments of missing pushes are these.

    A normal density of the gaps gives up too early what scatters more than the others.
    """
    expected, hump = case.expected(hump), hump.copy()
    there = np.flatnonzero(hump >= 0)
    if there.size < 2:
        return hump
    near = _AT_ITS_MOMENT * case.pace(hump) * case.period
    for i in np.flatnonzero(hump < 0):
        first = hump[:i].max(initial=-1) + 1
        after = hump[i:][hump[i:] >= 0]
        free = np.arange(first, after[0] if after.size else len(case.times))
        free = free[~case.brush[free]]
        off = np.abs(case.times[free] - expected[i])
        if free.size and off.min() < near:
            hump[i] = free[off.argmin()]
    return hump


def _by_number(case: Case, other: Int[np.ndarray, " n"] | None = None) -> Alignment:
    """As many humps as planned in order, and which of them are off the beat.

    Args:
        other: Another assignment, whose humps are on it; None where no one comes near.
    """
    pushes = np.flatnonzero(~case.brush)
    pairs = _alignment(case, pushes)
    off = pushes[_off_beat(case)] if other is None else np.setdiff1d(pushes, other)
    return replace(pairs, off_beat=tuple(off.tolist()))


def _off_beat(case: Case) -> Int[np.ndarray, " k"]:
    """Which pushes may be bumps, those off the beat of most; none where all are even.

    Nor are any where there is no beat, as of a hand.

    Where none is off it, they are the two that follow each other too soon.
    """
    times = case.times[~case.brush]
    gaps = np.diff(times)
    if gaps.min() * _TOO_SOON > np.percentile(gaps, _USUAL_PERCENT):
        return np.array([], dtype=int)
    if len(times) > _MOST_OF_A_BEAT:
        return gaps.argmin() + np.arange(2)
    bumps = off_beat(times, len(times), case.span[1] - case.span[0])
    if bumps.size > _FEW_OFF * len(times):
        return np.array([], dtype=int)
    return bumps if bumps.size else gaps.argmin() + np.arange(2)


def _in_order(case: Case) -> list[Int[np.ndarray, " n"]]:
    """Humps as the first planned pushes, and as the last ones."""
    humps = np.flatnonzero(~case.brush)
    n = min(len(humps), len(case.planned))
    none = np.full(len(case.planned) - n, -1)
    return [np.append(humps[:n], none), np.append(none, humps[len(humps) - n :])]


def _stopped_early(
    case: Case, hump: Int[np.ndarray, " n"], begin: float
) -> list[Int[np.ndarray, " n"]]:
    """The same humps as earlier pushes, if the recording may end before the plan does.

    That the first pushes are missing is as likely as that the last were not made, but
    for the time before the first push and that after the last one.
    """
    there, end = np.flatnonzero(hump >= 0), case.span[1]
    if case.is_timed or there.size < 2:
        return []
    first, last = there[[0, -1]]
    period, planned = case.pace(hump), case.planned
    before, after = planned[first] - planned[0], planned[-1] - planned[last]
    lead = (case.times[hump[first]] - begin) / period
    is_left_out = begin > case.span[0] and lead < before - SLACK
    rest = (end - case.times[hump[last]]) / period
    # Where the recording has room for all later pushes it was not stopped.
    has_room = rest + SLACK >= planned[-1] - planned[last - first]
    if first == 0 or is_left_out or has_room:
        return []
    made = max(int(rest - after + SLACK), 0)
    off = (before - max(rest - after, 0.0)) / LEAD + MISSING_COST * made
    earlier = np.append(hump[first:], np.full(first, -1))
    return [earlier] if off < _CLEAR else []


def _rhythm_shown(
    case: Case, scale: float, scatter: float, hump: Int[np.ndarray, " n"]
) -> float:
    """How much likelier a rhythm makes the times of the pairs than chance [nats].

    Of many humps some are in rhythm by chance: each way to choose as many counts.
    """
    there = np.flatnonzero(hump >= 0)
    if case.is_timed or there.size < 2:
        return np.inf if case.is_timed else 0.0
    gaps = np.diff(case.times[hump[there]]) / (scale * case.period)
    cost = case.cost_of_gaps(gaps, there[:-1], there[1:], scatter=scatter)
    return -float(cost.sum()) - math.log(math.comb(len(case.times), there.size))


def _differs(
    case: Case, one: Int[np.ndarray, " n"], other: Int[np.ndarray, " n"]
) -> bool:
    """Whether two differ by more than taking a brush for a push or for none.

    Which of the repeats of one direction a hump is makes no difference.
    """
    taken = np.full((2, len(case.times)), -1)
    for hump, own in zip((one, other), taken, strict=True):
        own[hump[hump >= 0]] = case.direction[hump >= 0]
    return bool(np.any(taken[0, ~case.brush] != taken[1, ~case.brush]))


def _alignment(
    case: Case, hump: Int[np.ndarray, " n"], other: Int[np.ndarray, " n"] | None = None
) -> Alignment:
    """An assignment with what follows from it."""
    return Alignment(
        hump=hump,
        extra=tuple(np.setdiff1d(np.flatnonzero(~case.brush), hump).tolist()),
        other=other,
        expected=case.expected(hump),
    )
