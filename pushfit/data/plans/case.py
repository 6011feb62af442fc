"""Humps and plan that are to be paired: what both tell of each other.

Pushes follow each other in regular time, but for jumps of the direction, and those of
one direction are of one height. Excluded: which pairing is the likeliest
(`pushfit.data.plans.assignment`, `pushfit.data.plans.alignment`). Constants were tried
in the cases of `benchmarks.recordings.plan_alignment`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.plans.schedule import PushSchedule

# A robot may pause between two pushes: as rare as five missing ones. At 9 three more of
# 2000 regular plans are refused; at 12 three times as many with a pause are wrong.
_PAUSE = 10.0
# Where jumps of the direction take longer than other moves, one may take any time.
_ANY_JUMP = 5.0
# Repeats differ by this share of their height, other humps by up to twice a height.
# What differs by far more is a repeat all the same once in twenty times.
_ALIKE, _UNLIKE = 0.1, 3.0
# Gaps off by less than this are in time without a search, in periods: five times the
# least scatter. At half 2 cases more are refused; twice changes none.
IN_TIME = 0.15
# Humps on time that show that plan and recording have one clock; share of all humps
# between them, and of those before and after, which may be another run.
_FEWEST, _ON_CLOCK, _BESIDE = 3, 0.6, 1 / 3
# Where there are as many humps as planned a pause is no rarer than this [nats], but
# for one that a missing push would leave; hands scatter by this share or more. The
# three were not tried at half and twice.
_ONE_PAUSE, _PAUSE_OF_BEATS, _LEAST_BY_HAND = 3.0, 7.0, 0.1
# Where most are off by more than this they are on time by chance, in periods: times of
# another clock are in one case of five, by middles or by onsets. At half again as
# much two fifths more plans that lack a push are taken for those of the own clock.
_SAME_CLOCK = 0.05
# A hand pushes after as many medians of its gaps, or as small a part of one, at most.
_BY_HAND = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Humps and plan, with the time that the recording covers.

    Args:
        times: Middles of the humps [s].
        heights: Their heights, in any unit.
        brush: Whether each is a brush.
        planned: Planned times, in any unit.
        is_timed: Whether those are stated, and not only the order.
        span: Begin and end of the recording [s].
        stretch: Which part of the plan each push is of; a pause is between two.
        direction: Which of the directions each push has: heights of one are alike.
        jumps: Jumps of the direction before each push; they take another time.
        jump_scatter: By how much more that scatters [periods].
    """

    times: Float[np.ndarray, " m"]
    heights: Float[np.ndarray, " m"]
    brush: Bool[np.ndarray, " m"]
    planned: Float[np.ndarray, " n"]
    is_timed: bool
    span: tuple[float, float]
    stretch: Int[np.ndarray, " n"]
    direction: Int[np.ndarray, " n"]
    jumps: Int[np.ndarray, " n"]
    jump_scatter: float = 0.0

    @classmethod
    def of(
        cls,
        times: Float[np.ndarray, " m"],
        heights: Float[np.ndarray, " m"],
        brush: Bool[np.ndarray, " m"],
        *,
        plan: PushSchedule,
        n_cycles: int,
        span: tuple[float, float],
    ) -> "Case":
        """Humps, and a plan that the recording runs through some times."""
        planned = _planned(plan.n_pushes, n_cycles, plan.time)
        # Stated times hold for jumps as well.
        is_jump = plan.is_jump & (plan.time is None)
        return cls(
            times=times,
            heights=heights,
            brush=brush,
            planned=planned,
            is_timed=plan.time is not None,
            span=span,
            # Several runs, within which anything may pause, would fit any schedule.
            stretch=np.arange(len(planned)) // (1 if n_cycles == 1 else plan.n_pushes),
            direction=np.tile(plan.direction, n_cycles),
            jumps=np.cumsum(np.tile(is_jump, n_cycles)),
        )

    @property
    def period(self) -> float:
        """Usual time between two pushes, as planned."""
        if not self.is_timed or len(self.planned) < 2:
            return 1.0
        return float(np.median(np.diff(self.planned)))

    @property
    def is_jump(self) -> Bool[np.ndarray, " k"]:
        """Whether the direction jumps between each push and the next."""
        return np.diff(self.jumps) > 0

    @property
    def is_repeated(self) -> bool:
        """Whether some direction has several pushes."""
        return len(np.unique(self.direction)) < len(self.direction)

    def cost_of_repeats(
        self, first: Int[np.ndarray, " k"], last: Int[np.ndarray, " k"]
    ) -> float:
        """Cost of the heights of humps of one direction, by both of each two."""
        return float(cost_of_heights(self.heights[first], self.heights[last]).sum())

    def cost_of_other_repeats(self, hump: Int[np.ndarray, " n"]) -> float:
        """The same of those of one direction that do not follow each other."""
        there = np.flatnonzero(hump >= 0)
        order = np.argsort(self.direction[there], kind="stable")
        own, place = self.direction[there][order], hump[there][order]
        is_other = (np.diff(own) == 0) & (np.diff(order) > 1)
        return self.cost_of_repeats(place[:-1][is_other], place[1:][is_other])

    def with_jumps(self, time: float, scatter: float) -> "Case":
        """The same plan where a jump of the direction takes another time.

        Args:
            time: That time, in those between other pushes.
            scatter: By how much more it scatters, in the same.
        """
        steps = np.where(self.is_jump, time, 1.0)
        planned = np.append(0.0, np.cumsum(steps))
        return replace(self, planned=planned, jump_scatter=scatter)

    def turned(self) -> "Case":
        """The case with time running backwards: last push and hump first."""
        return replace(
            self,
            times=-self.times[::-1],
            heights=self.heights[::-1],
            brush=self.brush[::-1],
            planned=-self.planned[::-1],
            span=(-self.span[1], -self.span[0]),
            stretch=-self.stretch[::-1],
            direction=self.direction[::-1],
            jumps=-self.jumps[::-1],
        )

    def in_periods(self, scale: float) -> "Case":
        """The same, all times in periods, of which each is so many of the plan's."""
        period = scale * self.period
        return replace(
            self,
            times=self.times / period,
            planned=self.planned / self.period,
            span=(self.span[0] / period, self.span[1] / period),
        )

    def cost_of_gaps(
        self,
        gaps: Float[np.ndarray, "*#s"],
        first: Int[np.ndarray, "*#s"],
        last: Int[np.ndarray, "*#s"],
        *,
        scatter: float,
    ) -> Float[np.ndarray, "*#s"]:
        """Cost of times between humps: a normal density about those between pushes.

        Its height counts, because what is no push may come at any time. Beyond it is a
        pause, which may last for any time.

        Args:
            gaps: Times between two humps [periods].
            first: Push that the first of them is, of each two.
            last: Push that the other one is.
            scatter: Scatter of a time between two pushes without a jump [periods].
        """
        steps = (self.planned[last] - self.planned[first]) / self.period
        if not np.isfinite(scatter):
            return np.zeros(np.broadcast_shapes(gaps.shape, steps.shape))
        n_jumps = self.jumps[last] - self.jumps[first]
        wide = np.sqrt(scatter**2 * steps + self.jump_scatter**2 * n_jumps)
        cost = ((gaps - steps) / wide) ** 2 / 2
        cost = cost + np.log(math.sqrt(2 * math.pi) * wide)
        is_between = self.stretch[last] != self.stretch[first]
        cost = np.where(is_between & (gaps > steps), np.minimum(cost, _PAUSE), cost)
        is_any_jump = is_between & (n_jumps > 0) & (gaps > last - first)
        return np.where(is_any_jump, np.minimum(cost, _ANY_JUMP), cost)

    def cost_of_all_gaps(self, scatter: float) -> float:
        """Cost of the times between as many humps as planned, if all are pushes.

        Either they keep a rhythm but for pauses, or they are by hand: their logs are
        normal.
        """
        gaps = np.diff(self.times[~self.brush])
        k = np.arange(len(gaps))
        steps = np.diff(self.planned) / self.period
        more = gaps - steps
        beats = np.maximum(np.round(more), 1.0)
        pause = np.where(np.abs(more - beats) < IN_TIME, _PAUSE_OF_BEATS, _ONE_PAUSE)
        may_pause = (more > 0) & (np.diff(self.stretch) > 0)
        cost = self.cost_of_gaps(gaps, k, k + 1, scatter=scatter)
        cost = np.where(may_pause, np.minimum(cost, pause), cost)
        return float(min(cost.sum(), _cost_by_hand(gaps, steps)))

    def is_in_rhythm(self, left_out: Sequence[float]) -> bool:
        """Whether pairing one by one is the likeliest, which needs no search.

        It is if no time between two pushes is off by what it takes to be another pair.
        What the user calls no push may have taken the time of one. A jump of the
        direction may take any longer time.
        """
        times = self.times[~self.brush]
        gaps = np.diff(times)
        steps = np.diff(self.planned)
        if len(gaps) < 1:
            return True
        scale = (
            1.0 if self.is_timed else float(np.median((gaps / steps)[~self.is_jump]))
        )
        off = gaps / scale - steps
        if not self.is_timed:
            between = np.histogram(np.asarray(left_out, dtype=float), times)[0]
            off = off - np.clip(np.round(off), 0, between)
        off = np.where(self.is_jump, np.minimum(off, 0.0), off)
        return bool(np.all(np.abs(off) / self.period < IN_TIME))

    def may_be_by_hand(self) -> bool:
        """Whether no two pushes are much nearer, or much further apart, than others."""
        gaps = np.diff(self.times[~self.brush])
        return bool(np.all(np.abs(np.log(gaps / np.median(gaps))) < np.log(_BY_HAND)))

    def on_the_clock(
        self, first: float, starts: Float[np.ndarray, " m"] | None
    ) -> Int[np.ndarray, " n"] | None:
        """Humps at the stated times as they are; None if the clock is another.

        What begins before the recording, such as at 0, is no time of its clock.

        Args:
            first: Stated time of the first push [s].
            starts: When the humps begin, which stated times may mean as well [s].
        """
        if not self.span[0] < first < self.span[1]:
            return None
        n_pushes, late = np.sum(~self.brush), IN_TIME * self.period
        best, least = None, np.inf
        for times in (self.times, starts):
            if times is None:
                continue
            off = times - first - self.planned[:, None]
            nearest = np.abs(off).argmin(axis=1)
            off = np.take_along_axis(off, nearest[:, None], axis=1)[:, 0]
            hump = np.where(np.abs(off) < late, nearest, -1)
            on = hump[hump >= 0]
            if len(np.unique(on)) < max(len(on), 1):
                continue
            n_on = np.count_nonzero(~self.brush[on])
            n_after = np.count_nonzero(~self.brush[max(on) + 1 :])
            n_beside = n_after + np.count_nonzero(~self.brush[: min(on)])
            usual = abs(float(np.median(off[hump >= 0])))
            is_own = n_on >= max(_FEWEST, _ON_CLOCK * (n_pushes - n_beside))
            is_own &= n_beside <= _BESIDE * n_on and usual < _SAME_CLOCK * self.period
            if is_own and usual < least:
                best, least = hump, usual
        return best

    def skips_beats(self, hump: Int[np.ndarray, " n"]) -> bool:
        """Whether humps that follow each other evenly are no neighbours in the plan."""
        gaps = np.diff(self.times[~self.brush])
        is_even = (
            np.abs(gaps / np.median(gaps) - 1) < IN_TIME if len(gaps) else gaps > 0
        )
        skips = np.any(np.diff(np.flatnonzero(hump >= 0)) > 1)
        return bool(skips and is_even.all() and not self.is_timed)

    def expected(self, hump: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Times of all planned pushes, by those that are there."""
        there = np.flatnonzero(hump >= 0)
        if there.size < 2:
            return np.full(len(hump), np.nan)
        planned, times = self.planned[there], self.times[hump[there]]
        slope = self.pace(hump)
        expected = np.interp(self.planned, planned, times)
        before, after = self.planned < planned[0], self.planned > planned[-1]
        expected[before] = times[0] + slope * (self.planned[before] - planned[0])
        expected[after] = times[-1] + slope * (self.planned[after] - planned[-1])
        return expected

    def pace(self, hump: Int[np.ndarray, " n"]) -> float:
        """Usual time from pair to pair over the planned one, whatever the pauses."""
        there = np.flatnonzero(hump >= 0)
        gaps = np.diff(self.times[hump[there]]) / np.diff(self.planned[there])
        return float(np.median(gaps))


def _cost_by_hand(
    gaps: Float[np.ndarray, " k"], steps: Float[np.ndarray, " k"]
) -> float:
    """Cost of times between humps by hand, a normal density of the logs."""
    logs = np.log(gaps / steps)
    scatter = max(float(logs.std()), _LEAST_BY_HAND)
    off = (logs - logs.mean()) / scatter
    cost = off**2 / 2 + np.log(math.sqrt(2 * math.pi) * scatter * gaps)
    return float(cost.sum())


def _planned(
    n_planned: int, n_cycles: int, planned_times: Float[np.ndarray, " n"] | None
) -> Float[np.ndarray, " m"]:
    """Planned times, in periods where only the order is known."""
    if planned_times is None:
        return np.arange(n_planned * n_cycles, dtype=float)
    period = float(np.median(np.diff(planned_times))) if n_planned > 1 else 1.0
    one = planned_times - planned_times[0]
    return np.concatenate([one + k * (one[-1] + period) for k in range(n_cycles)])


def cost_of_heights(
    one: Float[np.ndarray, "*#s"], other: Float[np.ndarray, "*#s"]
) -> Float[np.ndarray, "*#s"]:
    """Cost of two heights of one direction: what differs much is hardly a repeat.

    A normal density of their difference, in their mean, beside that of any two humps.
    """
    size = (np.abs(one) + np.abs(other)) / 2
    off = np.divide(one - other, size, out=np.zeros_like(size), where=size > 0)
    cost = (off / _ALIKE) ** 2 / 2 + math.log(math.sqrt(2 * math.pi) * _ALIKE / 2)
    return np.minimum(cost, _UNLIKE)
