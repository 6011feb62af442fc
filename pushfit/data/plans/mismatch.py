"""How to say that a recording does not hold the pushes that were planned.

Excluded: the pairing itself (`pushfit.data.plans.alignment`).
"""

from collections.abc import Sequence

import numpy as np

from pushfit.data.plans.alignment import Alignment
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.found_humps import Extent
from pushfit.errors import DataError, InputProblem, counted, stated

# Pushes in which two assignments differ that are shown.
_MAX_SHOWN = 4
# Faults that are shown: after a wrong schedule it is all of them.
_N_SHOWN = 3


def mismatch_error(
    schedule: PushSchedule, pairs: Alignment, extents: Sequence[Extent]
) -> DataError:
    """Name the pushes that are missing or too many.

    Returns:
        An error with found and planned pushes of the directions in which they differ,
        and one problem per doubtful push.
    """
    plan = schedule.repeated(pairs.n_cycles)
    path = schedule.source.path if schedule.source else None
    problems = [
        InputProblem(
            code="push_missing",
            message=f"{push_name(plan, i)} has no hump{_between(pairs, extents, i)}"
            + (_else(pairs, i) if schedule.time is None else ""),
            path=path,
            value=str(plan.push[i]),
        )
        for i in pairs.missing
    ]
    is_brush_taken = bool(_brushes_taken(pairs, extents))
    problems += [
        InputProblem(
            code="push_extra",
            message=(
                f"the hump at {extents[j].t_peak:.2f} s is no planned push and left out"
                + ("" if is_brush_taken else f"; say so by {_left_out(extents[j])}")
            ),
            path=path,
            value=f"{extents[j].t_peak:.2f} s",
        )
        for j in pairs.extra
    ]
    n_found = plan.n_pushes - len(pairs.missing) + len(pairs.extra)
    where = f" in {path}" if path else ""
    if pairs.n_cycles > 1:
        where += f", run through {pairs.n_cycles} times"
    verb = "is" if plan.n_pushes == 1 else "are"
    return DataError(
        f"{counted(plan.n_pushes, 'push')} {verb} planned{where}, {n_found} found: "
        f"{_first([p.message for p in problems], '; ') or 'not in their rhythm'}"
        f"{_doubt(schedule, pairs, extents)}",
        code="push_mismatch",
        problems=tuple(problems),
    )


def _doubt(schedule: PushSchedule, pairs: Alignment, extents: Sequence[Extent]) -> str:
    """The assignments between which the times do not decide, and what would."""
    plan = schedule.repeated(pairs.n_cycles)
    if pairs.is_of_another:
        return (
            f". {pairs.n_cycles} runs through the schedule leave more pushes missing "
            "or over than it has: it looks like that of another recording. Schedules "
            "go with recordings by their order; if it is the right one, take what is "
            "found by `allow_missing=True`"
        )
    if pairs.other is None:
        return ""
    differ = np.flatnonzero(pairs.hump != pairs.other)[:_MAX_SHOWN]
    shown = [
        "; ".join(f"push {plan.push[i]} {_at(extents, int(hump[i]))}" for i in differ)
        for hump in (pairs.hump, pairs.other)
    ]
    brushes = _brushes_taken(pairs, extents)
    only = np.setdiff1d(pairs.hump, [-1, *pairs.other]).tolist()
    doubtful = (*brushes, *pairs.extra, *only)
    remedies = []
    if doubtful:
        remedies.append(
            f"leave out what is no push by {_left_out(extents[doubtful[0]])}"
        )
    if brushes:
        remedies[0] += (
            f", the hump far lower than the others {_at(extents, brushes[0])}"
        )
    is_short = len(pairs.extra) > len(pairs.missing)
    rows = "a row for each push that was made, or " if is_short else ""
    times = "a column time_s, when each push begins"
    if schedule.time is not None:
        times = "the time_s at which its pushes begin on the clock of the recording"
    remedies += ["state `min_height`", "or take (a) by `allow_missing=True`"]
    return (
        f". Two assignments fit nearly as well: (a) {shown[0]}; (b) {shown[1]}. Give "
        f"the schedule {rows}{times}, {', '.join(remedies)}. In (a) "
        f"{_counts(plan, pairs)}"
    )


def _brushes_taken(pairs: Alignment, extents: Sequence[Extent]) -> tuple[int, ...]:
    """Humps far lower than the others that either of two assignments has as pushes."""
    if pairs.other is None:
        return ()
    taken = np.union1d(pairs.hump, pairs.other).tolist()
    return tuple(j for j in taken if j >= 0 and extents[j].is_brush)


def _left_out(extent: Extent) -> str:
    """How to leave out a hump."""
    return stated(exclude=[extent.window])


def _at(extents: Sequence[Extent], hump: int) -> str:
    """Where a push is, in words."""
    return "missing" if hump < 0 else f"at {extents[hump].t_peak:.2f} s"


def push_name(plan: PushSchedule, i: int) -> str:
    """A planned push in words."""
    return (
        f"push {plan.push[i]} (theta {np.degrees(plan.theta[i]):g}, "
        f"alpha {np.degrees(plan.alpha[i]):g}, repeat {plan.repeat[i]})"
    )


def _between(pairs: Alignment, extents: Sequence[Extent], i: int) -> str:
    """Where a missing push should have been."""
    before = pairs.hump[:i][pairs.hump[:i] >= 0]
    after = pairs.hump[i + 1 :][pairs.hump[i + 1 :] >= 0]
    if before.size and after.size:
        start, end = extents[before[-1]].t_end, extents[after[0]].t_start
        return f" between {start:.2f} s and {end:.2f} s"
    if before.size:
        return f" after {extents[before[-1]].t_end:.2f} s"
    return f" before {extents[after[0]].t_start:.2f} s" if after.size else ""


def _else(pairs: Alignment, i: int) -> str:
    """What a rhythm without a gap does not tell, where pushes are missing at an end."""
    is_found = pairs.hump >= 0
    if pairs.other is not None:
        return ""  # both ways are shown
    if i > 0 and not is_found[i:].any() and is_found[i - 1]:
        return ", unless an earlier one was not made and all after it are one row off"
    if i + 1 < len(is_found) and not is_found[: i + 1].any() and is_found[i + 1]:
        return ", unless a later one was not made and all before it are one row off"
    return ""


def _counts(plan: PushSchedule, pairs: Alignment) -> str:
    """Which directions lack pushes, and how many humps are left over."""
    degrees = np.degrees(np.stack([plan.theta, plan.alpha], axis=1)).round(6)
    lacking = []
    directions = list(dict.fromkeys(map(tuple, degrees)))
    for theta, alpha in directions:
        same = (degrees[:, 0] == theta) & (degrees[:, 1] == alpha)
        planned, found = int(same.sum()), int((pairs.hump[same] >= 0).sum())
        if found != planned:
            lacking.append(f"({theta:g}, {alpha:g}) has {found} of {planned}")
    n_whole = len(directions) - len(lacking)
    parts = ["no direction lacks a push"]
    if lacking:
        parts = [f"directions (theta, alpha) lack pushes: {_first(lacking, ', ')}"]
    if lacking and n_whole:
        others = "other direction has" if n_whole == 1 else f"other {n_whole} have"
        parts.append(f"the {others} all of theirs")
    if pairs.extra:
        n_extra = len(pairs.extra)
        is_or_are = "is" if n_extra == 1 else "are"
        parts.append(f"{counted(n_extra, 'hump')} {is_or_are} left over")
    return "; ".join(parts)


def _first(texts: Sequence[str], between: str) -> str:
    """The first few, and how many more there are."""
    shown = list(texts[:_N_SHOWN])
    if len(texts) > _N_SHOWN:
        shown.append(f"and {len(texts) - _N_SHOWN} more")
    return between.join(shown)
