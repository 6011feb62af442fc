"""Which pushes are two, and which two are one, each by its own course.

The search judges valleys by what rests the file has, and averages for as long as its
usual push lasts; so what it joined or parted is looked at by itself again. Excluded:
the search (`pushfit.data.pushes.hump_search`).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.feet import CLEAR, FOOT, Feet, PerPush, are_cut
from pushfit.data.pushes.running_means import RunningMeans, View
from pushfit.data.pushes.tracing import thinned_course
from pushfit.data.rows import rows_of

# Points of a course from foot to foot: some twelve in each averaging time of a
# triangle. Half or twice as many part no other push of a real recording.
_GRID = 240
# Averaging of the finer course, as a share of the usual one: brief enough for a rest
# that the usual one fills. Half or twice decides none of the real ones.
_FINE = 0.125
# A valley is deeper than noise makes one, as maxima of the search are higher [sigma].
_SIGNIFICANT = 6.0


def join_one(
    view: View, feet: Feet[np.ndarray], *, is_rest: Bool[np.ndarray, " p"]
) -> tuple[Feet[np.ndarray], Int[np.ndarray, " q"]]:
    """Join two pushes whose course does not fall low between them, the first such two.

    They are clear of the noise, and nearer to each other than they are wide.

    Args:
        is_rest: Whether what follows each is known to be a rest.

    Returns:
        All pushes, the feet of a joined one roughly; and which each was.
    """
    places = np.arange(len(feet.start))
    tau = feet.averaging(view)
    noise = feet.noise(tau)
    is_clear = feet.height > CLEAR * noise
    gap = feet.start[1:] - feet.end[:-1]
    is_near = gap < np.maximum(feet.width[:-1], feet.width[1:])
    pairs = np.flatnonzero(~is_rest[:-1] & is_clear[:-1] & is_clear[1:] & is_near)
    if pairs.size == 0:
        return feet, places
    ends = feet.lowest[:, None], feet.highest[:, None]
    top = view.course.smooth(feet.peak[:, None], tau=tau[:, None], ends=ends)[:, 0]
    first = (top - feet.height - np.maximum(feet.moved, 0.0))[pairs]
    last = (top - feet.height + np.minimum(feet.moved, 0.0))[pairs + 1]
    # The rest that a cut push is not seen to go back to is that of the other one.
    is_cut = are_cut(view, feet)
    last = np.where(is_cut[pairs + 1], first, last)
    first = np.where(is_cut[pairs], last, first)
    left, right = rows_of(feet, pairs), rows_of(feet, pairs + 1)
    tops = top[pairs], top[pairs + 1]
    both = replace(
        left,
        peak=np.where(tops[0] >= tops[1], left.peak, right.peak),
        half_down=right.half_down,
        end=right.end,
        highest=right.highest,
        height=np.maximum(*tops) - np.maximum(first, last),
        moved=last - first,
    )
    # By the middle of both rests, for drift under two pushes fills no valley. Averaging
    # fills a short rest: in a finer course half of the share has to do.
    usual = both.averaging(view)
    fine = np.maximum(_FINE * usual, right.step) if view.smoothing is None else usual
    moved = np.abs(both.moved) / 2
    shares = [
        _valleys(view.course, both, tau=own, sigmas=0.0, moved=moved)[2].min(axis=1)
        for own in (usual, fine)
    ]
    is_one = (shares[0] >= view.split) & (shares[1] >= view.split / 2)
    if not is_one.any():
        return feet, places
    one = int(is_one.argmax())
    k = int(pairs[one])
    joined = [*feet.apart()[:k], both.apart()[one], *feet.apart()[k + 2 :]]
    return Feet.together(joined), np.delete(places, k)


def part_doubles(
    view: View, feet: Feet[np.ndarray]
) -> tuple[Feet[np.ndarray], Int[np.ndarray, " q"]]:
    """Part each push in two whose course falls low between two tops.

    Returns:
        All pushes, the feet of two that were one roughly; and which each was.
    """
    when, y, share = _valleys(
        thinned_course(feet, view),
        feet,
        tau=feet.averaging(view),
        sigmas=_SIGNIFICANT,
        moved=np.abs(feet.moved),
    )
    parts = []
    for k, own in enumerate(feet.apart()):
        valley = int(share[k].argmin())
        if share[k, valley] < view.split:
            sides = slice(None, valley + 1), slice(valley, None)
            parts += [_part(own, when[k, side], y[k, side]) for side in sides]
        else:
            parts.append(own)
    n_parts = 1 + (share.min(axis=1) < view.split)
    return Feet.together(parts), np.repeat(np.arange(len(n_parts)), n_parts)


def _valleys(
    course: RunningMeans,
    feet: Feet[np.ndarray],
    *,
    tau: PerPush,
    sigmas: float,
    moved: PerPush,
) -> tuple[
    Float[np.ndarray, "p m"], Float[np.ndarray, "p m"], Float[np.ndarray, "p m"]
]:
    """Courses from foot to foot, and their height as a share of the tops around.

    Args:
        course: Running means of the samples [unit].
        tau: Averaging times [s].
        sigmas: So many times the noise is no valley.
        moved: How far below the higher of the rests heights are counted from [unit].

    Returns:
        Times, running means, and shares; 1 where the course falls by no more than
        noise does.
    """
    length = (feet.end - feet.start)[:, None]
    when = feet.start[:, None] + length * np.linspace(0.0, 1.0, _GRID)
    ends = feet.lowest[:, None], feet.highest[:, None]
    y = course.smooth(when, tau=tau[:, None], ends=ends)
    # The foot is near the rest, or the rest is not that of this course.
    least = y.min(axis=1) - 2 * FOOT * np.ptp(y, axis=1)
    base = np.maximum(y.max(axis=1) - feet.height - moved, least)[:, None]
    tops = np.minimum(
        np.maximum.accumulate(y, axis=1),
        np.maximum.accumulate(y[:, ::-1], axis=1)[:, ::-1],
    )
    noise = sigmas * feet.noise(tau)
    share = (y - base) / np.where(tops > base, tops - base, 1.0)
    return when, y, np.where(tops - y > noise[:, None], share, 1.0)


def _part(
    feet: Feet[float], when: Float[np.ndarray, " m"], y: Float[np.ndarray, " m"]
) -> Feet[float]:
    """A part of a push; half way to its top is guessed."""
    start, peak, end = (float(when[k]) for k in (0, y.argmax(), -1))
    return replace(
        feet,
        start=start,
        half_up=(start + peak) / 2,
        peak=peak,
        half_down=(peak + end) / 2,
        end=end,
    )
