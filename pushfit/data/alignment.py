"""Which recorded hump is which planned push.

Counting does not tell where a push is missing. The rhythm does: pushes of a schedule
follow each other in regular time, so a gap of two periods lacks one push and a hump
between two others is one too many. Excluded: finding the humps and measuring them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

# Costs. A gap wrong by a whole period costs three missing pushes: only a steady rhythm
# tells anything, and then it tells more than the number of humps does.
_MISSING = 1.0
_EXTRA = 1.0
_EXTRA_BRUSH = 0.1
_PAIR_BRUSH = 0.3
_OFF = 3.0
_MAX_OFF = 1.0
# Relative scatter of the gaps up to which pushes have a rhythm.
_STEADY = 0.2
# A second alignment this close to the best is as good as it.
_AMBIGUOUS = 0.5
_MAX_SKIPPED = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """Pairs of recorded humps and planned pushes.

    Args:
        hump: For each planned push its hump, -1 where it is missing.
        extra: Humps that are no planned push.
        is_ambiguous: Whether another alignment fits nearly as well.
        n_cycles: How often the recording runs through the schedule.
    """

    hump: Int[np.ndarray, " n"]
    extra: tuple[int, ...]
    is_ambiguous: bool
    n_cycles: int

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


def align(
    times: Float[np.ndarray, " m"],
    is_brush: Sequence[bool],
    *,
    n_planned: int,
    planned_times: Float[np.ndarray, " n"] | None,
) -> Alignment:
    """Pair humps with planned pushes, in order and in rhythm.

    Args:
        times: Time of every hump, brushes included [s].
        is_brush: Whether a hump is so small that it may be no push.
        n_planned: Pushes in the schedule.
        planned_times: Their times, from any origin; None for a steady rhythm [s].

    Returns:
        The alignment that explains the humps at least cost.
    """
    brush = np.asarray(is_brush, dtype=bool)
    n_pushes = int(np.count_nonzero(~brush))
    n_cycles = 1
    if n_pushes > n_planned and n_pushes % n_planned == 0:
        n_cycles = n_pushes // n_planned
    planned = _planned(n_planned, n_cycles, planned_times)
    if n_pushes == len(planned) and _is_in_rhythm(times[~brush], planned):
        hump = np.flatnonzero(~brush)
        return Alignment(hump=hump, extra=(), is_ambiguous=False, n_cycles=n_cycles)
    hump, margin = _cheapest(times, brush, planned)
    chosen = set(hump[hump >= 0].tolist())
    extra = tuple(int(i) for i in np.flatnonzero(~brush) if int(i) not in chosen)
    return Alignment(
        hump=hump, extra=extra, is_ambiguous=margin < _AMBIGUOUS, n_cycles=n_cycles
    )


def _planned(
    n_planned: int,
    n_cycles: int,
    planned_times: Float[np.ndarray, " n"] | None,
) -> Float[np.ndarray, " n"]:
    """Planned times in periods of the rhythm."""
    if planned_times is None:
        return np.arange(n_planned * n_cycles, dtype=float)
    period = float(np.median(np.diff(planned_times))) if n_planned > 1 else 1.0
    one = (planned_times - planned_times[0]) / max(period, 1e-12)
    return np.concatenate([one + k * (one[-1] + 1) for k in range(n_cycles)])


def _cheapest(
    times: Float[np.ndarray, " m"],
    brush: Bool[np.ndarray, " m"],
    planned: Float[np.ndarray, " n"],
) -> tuple[Int[np.ndarray, " n"], float]:
    """Cheapest pairing that keeps the order, and by how much another one costs more.

    The margin is that of pairing a push that is missing, or a hump that is extra.
    """
    period, weight = _rhythm(times[~brush], planned)
    clock = times / period
    before, back = _forward(clock, brush, planned, weight)
    after = _forward(-clock[::-1], brush[::-1], -planned[::-1], weight)[0][::-1, ::-1]
    # A pair belongs to the way to it and to the way from it.
    total = before + after - np.where(brush, _PAIR_BRUSH, 0.0)
    n, m = total.shape
    hump = np.full(n, -1)
    end = before + _skip_costs(n, brush)[::-1, ::-1]
    i, j = (int(k) for k in np.unravel_index(np.argmin(end), end.shape))
    while i >= 0:
        hump[i] = j
        i, j = (int(k) for k in back[i, j])
    left_out = np.setdiff1d(np.arange(m), hump)
    others = [total[k].min() for k in np.flatnonzero(hump < 0)]
    others += [total[:, k].min() for k in left_out if not brush[k]]
    return hump, float(min(others, default=np.inf) - end.min())


def _rhythm(
    times: Float[np.ndarray, " m"], planned: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Time of one planned period, and what a gap off by one costs."""
    gaps = np.diff(times)
    if len(gaps) < 2:
        return 1.0, 0.0
    period = float(np.median(gaps))
    if not np.allclose(np.diff(planned), 1.0):
        # Uneven on purpose: its scatter is no sign of an unsteady hand.
        return period / float(np.median(np.diff(planned))), _OFF
    scatter = 1.4826 * float(np.median(np.abs(gaps - period))) / period
    return period, _OFF if scatter < _STEADY else 0.0


def _is_in_rhythm(
    times: Float[np.ndarray, " n"], planned: Float[np.ndarray, " n"]
) -> bool:
    """Whether pairing one by one is the cheapest, which needs no search.

    It is if no two gaps together cost more than leaving out a push and a hump.
    """
    period, weight = _rhythm(times, planned)
    off = np.abs(np.diff(times) / period - np.diff(planned))
    return bool(np.all(2 * weight * off < _MISSING + _EXTRA))


def _skip_costs(n: int, brush: Bool[np.ndarray, " m"]) -> Float[np.ndarray, "n m"]:
    """Cost of leaving out all pushes and humps before each pair."""
    humps = np.cumsum(np.where(brush, _EXTRA_BRUSH, _EXTRA))
    return _MISSING * np.arange(n)[:, None] + np.append(0.0, humps[:-1])


def _forward(
    clock: Float[np.ndarray, " m"],
    brush: Bool[np.ndarray, " m"],
    planned: Float[np.ndarray, " n"],
    weight: float,
) -> tuple[Float[np.ndarray, "n m"], Int[np.ndarray, "n m 2"]]:
    """Least cost of everything up to each pair, and the pair before it.

    Between two pairs, pushes may be missing and humps extra; the step costs by how far
    the time between the humps is from the time planned.
    """
    n, m = len(planned), len(clock)
    cost = _skip_costs(n, brush)
    humps = np.append(0.0, np.cumsum(np.where(brush, _EXTRA_BRUSH, _EXTRA)))
    own = np.where(brush, _PAIR_BRUSH, 0.0)
    back = np.full((n, m, 2), -1)
    for i in range(n):
        for di in range(1, min(i, _MAX_SKIPPED) + 1):
            for dj in range(1, min(m - 1, _MAX_SKIPPED) + 1):
                off = clock[dj:] - clock[:-dj] - (planned[i] - planned[i - di])
                step = (
                    cost[i - di, :-dj]
                    + weight * np.minimum(np.abs(off), _MAX_OFF)
                    + _MISSING * (di - 1)
                    + (humps[dj:-1] - humps[1 : m - dj + 1])
                )
                better = step < cost[i, dj:]
                cost[i, dj:][better] = step[better]
                where = np.flatnonzero(better)
                back[i, dj + where, 0] = i - di
                back[i, dj + where, 1] = where
        cost[i] += own
    return cost, back
