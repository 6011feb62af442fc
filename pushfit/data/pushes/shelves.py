"""Levels that a hump holds on either side of its top: a push on a step, perhaps.

A grip that changes for one or two pushes and back looks like one push, as high as both
together; nothing in it says which it is. Excluded: levels that are held on the way up
alone (`pushfit.data.pushes.touches`), and steps that more pushes stand on
(`pushfit.data.pushes.humps`). What constants do was seen in the recordings of
`benchmarks.recordings.real_recordings`.
"""

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.feet import Feet, PerPush
from pushfit.data.pushes.humps import longest_run
from pushfit.data.pushes.running_means import View
from pushfit.parameters import TINY

# Parts of a course from foot to foot: means over the usual time would round a shelf
# away.
_GRID = 120
# Shelves are looked for at these shares of the height: below them is a touch, and what
# is above them may be the top. Steps of two thirds find no other.
_SHARES = np.arange(0.2, 0.91, 0.03)
# A shelf keeps within this share of the height, on either side for so much of the push,
# and of what is above it. With half of either time two humps of the soft skin, and
# presses of a barometer, have shelves; at twice the first pairs of pushes on a step do
# not.
_BAND, _HELD, _OF_TOP = 0.04, 0.1, 0.2
# From the first to the last third of it a shelf moves by less than this share.
_FLAT = 0.02


def shelves(view: View, feet: Feet[np.ndarray]) -> PerPush:
    """Levels that humps hold before and after their tops, as shares of the heights.

    Returns:
        The one that is held for longest; 0 where there is none, or noise hides it.
    """
    y = view.course.parts(np.linspace(feet.start, feet.end, _GRID + 1, axis=1))
    tau = np.maximum((feet.end - feet.start) / _GRID, feet.step)
    height = np.maximum(feet.height, TINY)[:, None]
    course = 1 + (y - y.max(axis=1, keepdims=True)) / height
    is_seen = 3 * feet.noise(tau) < _BAND * height[:, 0]
    found = np.zeros(len(course))
    for k in np.flatnonzero(is_seen & _may_have(course)):
        found[k] = _shelf(course[k])
    return found


def _may_have(course: Float[np.ndarray, "p m"]) -> Bool[np.ndarray, " p"]:
    """Whether courses are near a level for long enough, in one go or not."""
    is_before = np.arange(_GRID) < course.argmax(axis=1)[:, None]
    may = np.zeros(len(course), dtype=bool)
    for level in _SHARES:
        near = np.abs(course - level) <= _BAND
        n_before = np.count_nonzero(near & is_before, axis=1)
        least = np.minimum(n_before, np.count_nonzero(near, axis=1) - n_before)
        may |= least >= _HELD * _GRID
    return may


def _shelf(course: Float[np.ndarray, " m"]) -> float:
    """Level of 0..1 that a course holds for longest on both sides of its top."""
    top = int(course.argmax())
    longest, found = 0.0, 0.0
    for level in _SHARES:
        near = np.abs(course - level) <= _BAND
        above = np.count_nonzero(course > level + _BAND)
        sides = course[:top], course[top:]
        runs = [longest_run(near[:top]), longest_run(near[top:])]
        held = min(n for n, _ in runs)
        if held < max(_HELD * _GRID, _OF_TOP * above, longest):
            continue
        if all(_is_flat(y[k : k + n]) for y, (n, k) in zip(sides, runs, strict=True)):
            longest, found = held, float(level)
    return found


def _is_flat(run: Float[np.ndarray, " n"]) -> bool:
    """Whether a stretch of a course is no slow flank."""
    third = len(run) // 3
    return bool(abs(run[:third].mean() - run[-third:].mean()) < _FLAT)
