"""How to say that a recording does not hold the pushes that were planned."""

from collections.abc import Sequence

import numpy as np

from pushfit.data.alignment import Alignment
from pushfit.data.detection import Extent
from pushfit.data.schedule import PushSchedule
from pushfit.errors import DataError, Problem

# More are no help: after a wrong schedule it is all of them.
N_SHOWN = 3


def mismatch_error(
    schedule: PushSchedule, pairs: Alignment, extents: Sequence[Extent]
) -> DataError:
    """Name the pushes that are missing or too many.

    Args:
        schedule: Planned pushes.
        pairs: What was found of them.
        extents: All humps that were paired.

    Returns:
        An error with found and planned pushes of the directions in which they differ,
        and one problem per doubtful push.
    """
    plan = schedule.repeated(pairs.n_cycles)
    path = schedule.source.path if schedule.source else None
    problems = [
        Problem(
            code="push_missing",
            message=f"{_named(plan, i)} has no hump{_between(pairs, extents, i)}",
            path=path,
            value=str(plan.push[i]),
        )
        for i in pairs.missing
    ]
    problems += [
        Problem(
            code="push_extra",
            message=f"the hump at {extents[j].t_peak:.2f} s is no planned push",
            path=path,
            value=f"{extents[j].t_peak:.2f} s",
        )
        for j in pairs.extra
    ]
    n_found = plan.n_pushes - len(pairs.missing) + len(pairs.extra)
    doubt = (
        "; another assignment fits nearly as well, so check which one it is"
        if pairs.is_ambiguous
        else ""
    )
    return DataError(
        f"{plan.n_pushes} pushes are planned, {n_found} found: "
        f"{_first([p.message for p in problems], '; ')}{doubt}. Correct the schedule, "
        "state min_height, or set peaks.allow_missing. Found of planned by "
        f"(theta, alpha): {_counts(plan, pairs)}",
        code="push_mismatch",
        problems=tuple(problems),
    )


def _named(plan: PushSchedule, i: int) -> str:
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


def _counts(plan: PushSchedule, pairs: Alignment) -> str:
    """Found and planned pushes of the directions in which they differ."""
    degrees = np.degrees(np.stack([plan.theta, plan.alpha], axis=1)).round(6)
    counts = []
    directions = list(dict.fromkeys(map(tuple, degrees)))
    for theta, alpha in directions:
        same = (degrees[:, 0] == theta) & (degrees[:, 1] == alpha)
        planned, found = int(same.sum()), int((pairs.hump[same] >= 0).sum())
        if found != planned:
            counts.append(f"({theta:g}, {alpha:g}) {found} of {planned}")
    if pairs.extra:
        counts.append(f"none {len(pairs.extra)} of 0")
    n_whole = len(directions) - len(counts) + bool(pairs.extra)
    return f"{_first(counts, ', ')}, the other {n_whole} whole"


def _first(texts: Sequence[str], between: str) -> str:
    """The first few, and how many more there are."""
    shown = list(texts[:N_SHOWN])
    if len(texts) > N_SHOWN:
        shown.append(f"and {len(texts) - N_SHOWN} more")
    return between.join(shown)
