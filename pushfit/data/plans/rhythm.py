"""Which rhythms the times of some humps may have.

Pushes of a robot follow each other in nearly regular time; some of them may be missing,
and what is no push comes between. So periods are judged by the humps that are on each
other's beat. Excluded: which hump is which push (`pushfit.data.plans.alignment`).
Constants were tried in the cases of `benchmarks.recordings.plan_alignment`.
"""

import numpy as np
from jaxtyping import Float, Int

# Minus log probability of a push without a hump: one in seven.
MISSING_COST = 2.0
# Time before the first push and after the last, in periods: mean of an exponential.
LEAD = 1.5
# By how much a push may be planned before a recording begins, in periods: half pairs 2
# cases more, but scatter of what is planned moves ends by as much.
SLACK = 0.1
# Scatter of a time between two pushes that robots keep, in periods: times of the cases
# scatter by 0.02, gaps by 0.028. Twice refuses 32 cases more; half pairs 6 more.
_LEAST_SCATTER = 0.03
# Standard deviation over the median of a normal distribution, and a fifth more: the
# time of one push is off in the gaps on both sides of it.
_WIDER = 1.2 * 1.4826
# A hump is on the beat of another if it is off by less than this, in periods, three
# times the least scatter.
_BEAT = 0.1
# A beat is looked for at either width, and three in four humps are on it: bumps share
# a wider one, few pushes a narrower one. Of 41 plans with bumps in place of pushes 21
# have these named and nothing else; 17 if six in ten are on it.
_BEATS, _SHARE_ON = (0.1, 0.15), 0.75
# Humps have a rhythm if this share of so many neighbours on either side is on a beat;
# of random ones 0.2 to 0.4 are. At twice 17 cases are paired wrong by mere order.
_STEADY, _NEIGHBOURS = 0.45, 8
# Beats that a period is measured over: over many, an error of its first guess miscounts
# them. With eight 1 case more is paired, with two 5 fewer.
_FEW_BEATS = 4
# Periods worth trying are as good as the best one but for so many nats, and so many.
# Half or twice of either changes no case; fewer are faster.
_WORTH, _MOST_PERIODS = 8.0, 10
# Gaps of one kind differ by less than this share from one to the next, and so many
# kinds of them are tried.
_SAME, _MOST_JUMPS = 0.04, 3
# Humps apart whose times are tried as a period or several: two bumps may lie between
# any two pushes. Two or six change no case.
_MAX_SKIPPED_LAGS = 3
# Periods that differ by less than this share, a tenth of `_BEAT`, are tried as one.
_ALIKE = 0.01


def rhythms(
    times: Float[np.ndarray, " m"], n_planned: int, room: float
) -> list[tuple[float, float]]:
    """Periods that are worth trying, the likeliest first.

    Args:
        times: Times of humps [s].
        n_planned: Pushes that are to find room in the recording.
        room: Length of the recording [s].

    Returns:
        Periods [s] and scatters of the gaps [periods]; both infinite if there is none.
    """
    if len(times) < 2:
        return [(np.inf, np.inf)]
    periods = _distinct(_with_room(times, n_planned, room, most=max(n_planned, 2)))
    if periods.size == 0:
        return [(np.inf, np.inf)]
    on_beat = _coherence(times, periods)
    cost = -on_beat * len(times) * np.log(1 / (2 * _BEAT))
    cost = cost + (room - (n_planned - 1) * periods) / periods / LEAD
    best = np.argsort(cost)[:_MOST_PERIODS]
    best = best[cost[best] <= cost[best[0]] + _WORTH]
    steady = [_refined(times, float(periods[k])) for k in best if on_beat[k] > _STEADY]
    return steady or [(np.inf, np.inf)]


def rhythms_with_jumps(
    times: Float[np.ndarray, " m"],
) -> list[tuple[float, float, float, float]]:
    """Rhythms in which a jump of the direction takes longer than another move.

    The usual time comes again and again. The longer ones do so as well, also with a
    push that is missing, or scatter.

    Returns:
        Usual periods [s], scatters of these, times of a jump and by how much more these
        scatter [periods].
    """
    gaps = np.sort(np.diff(times))
    groups = np.split(gaps, 1 + np.flatnonzero(np.diff(np.log(gaps)) > _SAME))
    common = [group for group in groups if group.size > 1]
    found = []
    for usual in sorted(common, key=len, reverse=True)[:_MOST_JUMPS]:
        period, scatter = _middle(usual)
        scatter = max(scatter / period, _LEAST_SCATTER)
        longer = [g / period for g in groups if np.median(g) > (1 + _BEAT) * period]
        often = sorted(longer, key=len, reverse=True)[:_MOST_JUMPS]
        jumps = [*often, *(group - 1 for group in often)]
        if len(longer) > 1:
            jumps.append(np.concatenate(longer))
        found += [
            (period, scatter, *_middle(group))
            for group in jumps
            if np.median(group) > 1 + _BEAT
        ]
    return found


def _middle(values: Float[np.ndarray, " k"]) -> tuple[float, float]:
    """Median, and standard deviation by that of a normal distribution.

    That of few is wider than it seems.
    """
    middle = float(np.median(values))
    wider = _WIDER * (1 + _FEW_BEATS / len(values))
    return middle, wider * float(np.median(np.abs(values - middle)))


def off_beat(
    times: Float[np.ndarray, " m"], n_planned: int, room: float
) -> Int[np.ndarray, " k"]:
    """Which humps are off the one beat that is likeliest to be that of the others.

    Unlike `rhythms`, of the same arguments, this asks for no steadiness.
    """
    most = _MAX_SKIPPED_LAGS + 1
    periods = np.unique(_with_room(times, n_planned, room, most=most))
    if periods.size == 0:
        return np.array([], dtype=int)
    beats = (times[:, None] - times) / periods[:, None, None]
    off, best, bumps = np.abs(beats - np.round(beats)), -np.inf, np.array([], dtype=int)
    lead = (room - (n_planned - 1) * periods) / periods / LEAD
    for beat in _BEATS:
        is_on = off < beat
        on, beside = _SHARE_ON / (2 * beat), (1 - _SHARE_ON) / (1 - 2 * beat)
        shown = np.where(is_on, np.log(on), np.log(beside)).sum(axis=1) - lead[:, None]
        period, origin = np.unravel_index(shown.argmax(), shown.shape)
        if shown[period, origin] > best:
            best = float(shown[period, origin])
            bumps = np.flatnonzero(~is_on[period, :, origin])
    return bumps


def _with_room(
    times: Float[np.ndarray, " m"], n_planned: int, room: float, *, most: int
) -> Float[np.ndarray, " p"]:
    """Times between near humps over 1, 2, ... below `most`, if all pushes have room."""
    lags = range(1, min(_MAX_SKIPPED_LAGS, len(times) - 1) + 1)
    gaps = np.concatenate([times[k:] - times[:-k] for k in lags])
    periods = (gaps[:, None] / np.arange(1, most)).ravel()
    return periods[periods * (n_planned - 1 - 2 * SLACK) <= room]


def _distinct(periods: Float[np.ndarray, " p"]) -> Float[np.ndarray, " q"]:
    """Medians of periods that are alike."""
    ordered = np.sort(periods)
    groups = np.split(ordered, 1 + np.flatnonzero(np.diff(np.log(ordered)) > _ALIKE))
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
