"""Which recorded hump is which planned push.

Counting does not tell where a push is missing. The rhythm does: pushes of a schedule
follow each other in regular time, from soon after the recording begins until shortly
before it ends. Every way of pairing in order has a likelihood by the times between its
humps, the pushes it leaves missing, the humps it leaves over and the time before and
after; the best one counts if no other comes near. Excluded: finding the humps and
measuring them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

# Minus log probabilities, of a push without a hump and of a hump without a push.
_MISSING, _EXTRA = 2.0, 2.5
# A brush is most often none, and is then no news.
_EXTRA_BRUSH, _PAIR_BRUSH = 0.2, 1.0
# Time before the first push and after the last, in periods: mean of an exponential.
_LEAD = 1.5
# A push cannot be planned before the recording begins, or after it ends.
_OUTSIDE, _SLACK = 30.0, 0.1
# Scatter of a time between two pushes that robots keep, and keep to a plan, in periods.
_LEAST_SCATTER, _TIMED_SCATTER = 0.03, 0.05
# Standard deviation over the median of a normal distribution, and a fifth more: the
# time of one push is off in the gaps on both sides of it.
_WIDER = 1.2 * 1.4826
# A hump is on the beat of another if it is off by less than this, in periods; humps
# have a rhythm if this share of so many neighbours is. Of random ones 0.2 to 0.4 is.
_BEAT, _STEADY, _NEIGHBOURS, _FEW_BEATS = 0.1, 0.45, 8, 4
# Gaps off by less than this are in time without a search.
_IN_TIME = 0.15
# How much likelier the best way must be: this many nats.
_CLEAR = 4.0
# Periods worth trying are as good as the best one but for so many nats, and so many.
_WORTH, _MOST_PERIODS = 8.0, 10
# Nats of rhythm that an assignment with missing or extra pushes needs: some six pairs.
_EVIDENCE = 15.0
_MAX_EXTRA_RUN = 6
_MAX_SKIPPED_LAGS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Pairs of recorded humps and planned pushes.

    Args:
        hump: For each planned push its hump, -1 where it is missing.
        extra: Humps that are no planned push.
        other: Another assignment that is nearly as good; None where there is none.
        n_cycles: How often the recording runs through the schedule.
        expected: When each planned push was to be at its top [s].
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
        return tuple(int(i) for i in np.flatnonzero(self.hump < 0))

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
        times: Tops of the humps [s].
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
        times: Time of every hump, brushes included [s].
        is_brush: Whether a hump is so small that it may be no push.
        n_planned: Pushes in the schedule.
        planned_times: Their times, from any origin; None for a steady rhythm [s].
        span: Begin and end of the recording; unbounded where unknown [s].

    Returns:
        The likeliest alignment.
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
    scales = _scales(case)
    if n_pushes == len(planned) and not np.isfinite(scales[0][1]):
        # A hand has no rhythm that could tell otherwise.
        return _alignment(case, in_order, None, n_cycles)
    ways = _ways(case, scales)
    if n_pushes == len(planned) and not np.array_equal(ways[0].hump, in_order):
        other = None if case.is_timed else in_order
        return _alignment(case, ways[0].hump, other, n_cycles)
    if case.brush.all() or _rhythm_shown(case, ways[0].hump, scales) < _EVIDENCE:
        # Too few to keep a rhythm: whatever fits, others would as well.
        others = [
            way.hump for way in ways[1:] if _differs(case, ways[0].hump, way.hump)
        ]
        if others:
            return _alignment(case, ways[0].hump, others[0], n_cycles)
    near = [
        way
        for way in ways[1:]
        if way.cost < ways[0].cost + _CLEAR and _differs(case, ways[0].hump, way.hump)
    ]
    return _alignment(case, ways[0].hump, near[0].hump if near else None, n_cycles)


def _rhythm_shown(
    case: _Case, hump: Int[np.ndarray, " n"], scales: Sequence[tuple[float, float]]
) -> float:
    """How much likelier a rhythm makes the times of the pairs than chance [nats]."""
    there = np.flatnonzero(hump >= 0)
    if case.is_timed or there.size < 2:
        return np.inf if case.is_timed else 0.0
    gaps, steps = np.diff(case.times[hump[there]]), np.diff(case.planned[there])
    shown = []
    for scale, scatter in scales:
        if np.isfinite(scatter):
            wide = scatter * np.sqrt(steps)
            off = (gaps / scale - steps) / wide
            shown.append(float(-(off**2 / 2 + np.log(2.507 * wide)).sum()))
    return max(shown, default=0.0)


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
    chosen = set(hump[hump >= 0].tolist())
    return Alignment(
        hump=hump,
        extra=tuple(
            int(j) for j in np.flatnonzero(~case.brush) if int(j) not in chosen
        ),
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


def _ways(case: _Case, scales: Sequence[tuple[float, float]]) -> list[_Way]:
    """The likeliest ways of pairing, the best first."""
    found: dict[bytes, _Way] = {}
    for scale, scatter in scales:
        for way in _pair(case, scale, scatter):
            key = way.hump.tobytes()
            if key not in found or way.cost < found[key].cost:
                found[key] = way
    return sorted(found.values(), key=lambda way: way.cost)


def _scales(case: _Case) -> list[tuple[float, float]]:
    """Seconds for one planned unit that are worth trying, with the scatter of gaps."""
    if case.is_timed:
        return [(1.0, _TIMED_SCATTER)]
    times = case.times[~case.brush] if (~case.brush).sum() > 1 else case.times
    n = len(case.planned)
    if len(times) < 2:
        return [(np.inf, np.inf)]
    lags = range(1, min(_MAX_SKIPPED_LAGS, len(times) - 1) + 1)
    gaps = np.concatenate([times[k:] - times[:-k] for k in lags])
    periods = (gaps[:, None] / np.arange(1, max(n, 2))).ravel()
    room = case.span[1] - case.span[0]
    if np.isfinite(room):
        periods = periods[periods * (n - 1 - 2 * _SLACK) <= room]
    periods = _distinct(periods)
    if periods.size == 0:
        return [(np.inf, np.inf)]
    on_beat = _coherence(times, periods)
    cost = -on_beat * len(times) * np.log(1 / (2 * _BEAT))
    if np.isfinite(room):
        cost = cost + (room - (n - 1) * periods) / periods / _LEAD
    else:
        cost = cost + np.abs(np.log(periods / np.median(np.diff(times)))) * _MISSING
    best = np.argsort(cost)[:_MOST_PERIODS]
    best = best[cost[best] <= cost[best[0]] + _WORTH]
    steady = [_refined(times, float(periods[k])) for k in best if on_beat[k] > _STEADY]
    return steady or [(np.inf, np.inf)]


def _distinct(periods: Float[np.ndarray, " p"]) -> Float[np.ndarray, " q"]:
    """Medians of periods that are within a percent of each other."""
    ordered = np.sort(periods)
    groups = np.split(ordered, 1 + np.flatnonzero(np.diff(np.log(ordered)) > 0.01))
    return np.array([np.median(group) for group in groups if group.size])


def _coherence(
    times: Float[np.ndarray, " m"], periods: Float[np.ndarray, " p"]
) -> Float[np.ndarray, " p"]:
    """Share of neighbours that the better half of the humps have on a beat.

    The better half, because what is no push is off the beat of all others.
    """
    m = len(times)
    index = np.arange(m)
    apart = np.abs(index[:, None] - index)
    near = (apart > 0) & (apart <= _NEIGHBOURS)
    beats = np.abs(times[:, None] - times) / periods[:, None, None]
    is_on = near & (np.abs(beats - np.maximum(np.round(beats), 1.0)) < _BEAT)
    share = np.sort(is_on.sum(axis=2) / near.sum(axis=1), axis=1)[:, m // 2 :]
    return share.mean(axis=1)


def _refined(times: Float[np.ndarray, " m"], period: float) -> tuple[float, float]:
    """Period and scatter by the pairs of humps that are a few beats apart."""
    first, last = np.triu_indices(len(times), 1)
    gaps = times[last] - times[first]
    scatter = _LEAST_SCATTER
    for _ in range(3):
        beats = np.maximum(np.round(gaps / period), 1.0)
        is_on = (np.abs(gaps / period - beats) < _BEAT) & (beats <= _FEW_BEATS)
        if not is_on.any():
            break
        period = float(gaps[is_on].sum() / beats[is_on].sum())
        off = np.abs(gaps[is_on] / period - beats[is_on])
        scatter = max(_WIDER * float(np.median(off)), _LEAST_SCATTER)
    return period, scatter


def _pair(case: _Case, scale: float, scatter: float) -> list[_Way]:
    """The cheapest pairing at one scale, and the cheapest that has another pair."""
    period = float(np.median(np.diff(case.planned))) if len(case.planned) > 1 else 1.0
    clock = case.times / scale if np.isfinite(scale) else np.zeros(len(case.times))
    steady = _Steady(clock / period, case.brush, case.planned / period, scatter)
    begin, end = (t / scale / period for t in case.span)
    cost, back = steady.forward(begin)
    turned = steady.turned()
    after, ahead = (a[::-1, ::-1] for a in turned.forward(-end))
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
    n, m = total.shape
    hump = np.full(n, -1)
    start = divmod(through, m)
    i, j = start
    while i >= 0:
        hump[i] = j
        i, j = (int(k) for k in back[i, j])
    i, j = start
    while i >= 0:
        hump[i] = j
        i, j = (int(k) for k in ahead[i, j])
        # Counted from the other end.
        i, j = (n - 1 - i, m - 1 - j) if i >= 0 else (-1, -1)
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
        cost = _MISSING * np.arange(n)[:, None] + humps[:-1] + self._lead(begin)
        own = np.where(self.brush, _PAIR_BRUSH, 0.0)
        back = np.full((n, m, 2), -1)
        for i in range(n):
            for dj in range(1, min(m - 1, _MAX_EXTRA_RUN) + 1):
                if i == 0:
                    break
                steps = self.planned[i] - self.planned[:i]
                gap = self.clock[dj:] - self.clock[:-dj]
                between = humps[dj:-1] - humps[1 : m - dj + 1]
                way = (
                    cost[:i, :-dj]
                    + self._off(gap, steps)
                    + _MISSING * (i - 1 - np.arange(i))[:, None]
                    + between
                )
                least = way.argmin(axis=0)
                value = way[least, np.arange(m - dj)]
                better = np.flatnonzero(value < cost[i, dj:])
                cost[i, dj + better] = value[better]
                back[i, dj + better, 0] = least[better]
                back[i, dj + better, 1] = better
            cost[i] += own
        return cost, back

    def cost(self, hump: Int[np.ndarray, " n"], begin: float, end: float) -> float:
        """What one assignment costs."""
        there = np.flatnonzero(hump >= 0)
        taken = hump[there]
        own = np.where(self.brush, _PAIR_BRUSH, 0.0)[taken].sum()
        left = np.ones(len(self.clock), dtype=bool)
        left[taken] = False
        extra = np.where(self.brush, _EXTRA_BRUSH, _EXTRA)[left].sum()
        missing = _MISSING * (len(hump) - len(there))
        gaps, steps = np.diff(self.clock[taken]), np.diff(self.planned[there])
        off = sum(
            self._off(gap[None], step[None])[0, 0]
            for gap, step in zip(gaps, steps, strict=True)
        )
        lead = self._lead(begin)[there[0], taken[0]]
        out = self.turned()._lead(-end)[::-1, ::-1][there[-1], taken[-1]]
        return float(own + extra + missing + off + lead + out)

    def _off(
        self, gap: Float[np.ndarray, " k"], steps: Float[np.ndarray, " i"]
    ) -> Float[np.ndarray, "i k"]:
        """Cost of a time between humps: a normal density about that between pushes.

        Its height counts, because what is no push may come at any time.
        """
        if not np.isfinite(self.scatter):
            return np.zeros((len(steps), len(gap)))
        scatter = self.scatter * np.sqrt(steps)[:, None]
        return ((gap - steps[:, None]) / scatter) ** 2 / 2 + np.log(2.507 * scatter)

    def _lead(self, begin: float) -> Float[np.ndarray, "n m"]:
        """Cost of the time before the first planned push, by its pair."""
        if not (np.isfinite(begin) and np.isfinite(self.scatter)):
            return np.zeros((len(self.planned), len(self.clock)))
        first = self.clock - (self.planned - self.planned[0])[:, None]
        lead = first - begin
        return np.where(lead < -_SLACK, _OUTSIDE, np.maximum(lead, 0.0) / _LEAD)
