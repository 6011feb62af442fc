"""Levels that are held beside a push: a finger that touches first, or a dip after it.

Excluded: levels on both sides of its top (`pushfit.data.pushes.shelves`). What
constants do at half and at twice was seen in the recordings of
`benchmarks.recordings.real_recordings`.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.feet import GUARD, LEAST, Feet
from pushfit.data.pushes.running_means import View
from pushfit.data.pushes.tracing import trace_feet
from pushfit.parameters import TINY

# A rest is the same, or held again, up to this share of the height. Not tuned.
SAME_REST = 0.1
# Share of the width by which feet of one push may lie elsewhere: the usual smoothing.
_SAME_PUSH = 0.1
# A level that is held before a push is its rest up to this share of the height, and
# named up to twice that: a finger that touches first. At half, a touch of 0.9 N is in
# some heights of 5 to 15 N and not in others; twice changes no real recording.
_LIGHT = 0.2
# Of the level its two halves may differ by so much, and the way to it takes so much of
# its time. Half or twice either changes no real recording.
_UNLEVEL, _ON_THE_WAY = 0.25, 0.25


def from_within(
    view: View, feet: Feet[np.ndarray]
) -> tuple[Feet[np.ndarray], Float[np.ndarray, " p"]]:
    """Feet that pushes reach from half of their heights, if they are the same pushes.

    Where the course beside a push is not clear of noise, or has a bump, feet found in
    turns with the levels of the rests may lie in several places, by where the search
    began. Half of the height is passed in the same place whatever else there is.

    Returns:
        Feet, and the level that each push holds on the way up all the same, as a share
        of its height; 0 for none.
    """
    within = replace(
        feet, start=feet.half_up, end=feet.half_down, moved=np.zeros_like(feet.moved)
    )
    found = trace_feet(view, within)
    off = np.abs(
        [
            getattr(found, name) - getattr(feet, name)
            for name in ("start", "half_up", "half_down", "end")
        ]
    )
    is_same = off <= _SAME_PUSH * feet.width
    # A finger that touches lightly, and waits, is at rest: if a push began before that
    # where the touch is more than a foot, heights would jump among those that stand on
    # the same one.
    before, after = (_held_beside(view, feet, found, sign) for sign in (-1, 1))
    is_same[0] |= before <= _LIGHT
    is_same[3] |= (before <= _LIGHT) & (after <= _LIGHT)
    # A dip after a release is no rest, and the level of the last rest is no touch.
    dips = _are_dips(feet)
    rest = view.course.mean(*found.before)
    is_back = np.abs(np.diff(rest)) <= SAME_REST * found.height[1:]
    is_after_dip = dips[0] & np.isfinite(before) & np.append(False, is_back)
    is_same[:3] |= is_after_dip
    is_same[3] |= is_after_dip & dips[1]
    is_found = np.logical_and.reduce(is_same)
    is_named = ~is_found & (before <= 2 * _LIGHT)
    return found.where(is_found, feet), np.where(is_named, before, 0.0)


def are_returns(
    view: View,
    feet: Feet[np.ndarray],
    within: Feet[np.ndarray],
    *,
    is_cut: Bool[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """Which is the last, and rises from a dip to the rest before that and stays there.

    The push before it is whole: what it begins with is no rest otherwise.

    Args:
        within: Feet that pushes reach from half of their heights.
    """
    top = view.course.mean(feet.half_up, feet.half_down)
    rest = view.course.mean(*within.before)
    is_rest = np.abs(top[1:] - rest[:-1]) <= SAME_REST * feet.height[1:]
    is_last = feet.are_outer[1] & is_cut
    return is_last & _are_dips(feet)[0] & np.append(False, is_rest & ~is_cut[:-1])


def _are_dips(feet: Feet[np.ndarray]) -> Bool[np.ndarray, "2 p"]:
    """Whether what is before pushes, and after them, is too brief for a rest."""
    length = np.diff(np.array([feet.before, feet.after()]), axis=1)[:, 0]
    return (length < LEAST * feet.span) & ~np.array(feet.are_outer)


def _held_beside(
    view: View, feet: Feet[np.ndarray], within: Feet[np.ndarray], sign: int
) -> Float[np.ndarray, " p"]:
    """Levels between two feet before pushes (-1) or after them (1), over those beyond.

    Args:
        within: Feet on the level, if there is one.

    Returns:
        Shares of the heights; infinite where the course keeps to no level.
    """
    beyond, outer, inner, half = (
        (feet.before, feet.start, within.start, within.half_up)
        if sign < 0
        else (feet.after(), feet.end, within.end, within.half_down)
    )
    inner = inner + GUARD * (inner - half)
    shares = np.array([_ON_THE_WAY, (1 + _ON_THE_WAY) / 2, 1.0])[:, None]
    parts = outer + shares * (inner - outer)
    far, near = (
        view.course.mean(*np.sort(ends, axis=0)) for ends in (parts[:2], parts[1:])
    )
    level = near - view.course.mean(*beyond)
    is_long = sign * (outer - inner) >= LEAST * within.span
    is_held = is_long & (np.abs(near - far) <= _UNLEVEL * level)
    return np.where(is_held, level / np.maximum(feet.height, TINY), np.inf)
