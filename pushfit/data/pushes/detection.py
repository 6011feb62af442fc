"""Where in a signal the pushes are: their extent and their order, not their height.

A search of the whole signal finds humps (`pushfit.data.pushes.hump_search`), each of
which is then looked at by itself. Excluded: baselines and heights
(`pushfit.data.peaks.heights`) and which push is which (`pushfit.data.plans.alignment`).
What constants do at half and at twice was seen in the recordings of
`benchmarks.recordings.real_recordings`.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.doubles import join_one, part_doubles
from pushfit.data.pushes.feet import FOOT, WIDTH_PER_SMOOTHING, Feet, are_cut
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.pushes.hump_search import search_humps
from pushfit.data.pushes.running_means import View
from pushfit.data.pushes.shelves import shelves
from pushfit.data.pushes.touches import SAME_REST, are_returns, from_within
from pushfit.data.pushes.tracing import trace_feet
from pushfit.data.rows import rows_of

# A push narrower than this is not one of a robot's; it is where smoothing starts [s].
# From twice as much, feet of `short_dropouts` and `p0_Pa` are found elsewhere.
FIRST_SMOOTHING = 0.1
# Averaging is longer in a second search where pushes allow for so many times as much:
# the search takes as long as the first. 1 or 3 changes no real recording.
_LONGER = 1.5
# A hump below this share of the largest is a brush. Half adds two to the presses of
# `p3_Pa`; twice loses presses of `p1_Pa`, `p2_Pa` and `p3_Pa`.
_BRUSH = 0.03
# Below this share it is one if the next larger hump is so many times higher. Half of
# the share, or twice the times, takes 9 humps of the soft skin at 0.5 N for pushes;
# half of the times loses 2 of 5 pushes of `short_dropouts`.
_SMALL, _GAP_RATIO = 0.15, 5.0
# A hump that an end of the signal cuts off, and that is longer than this share of the
# signal, or than so many whole pushes, is a trend. At twice the first a drift alone is
# a push; half, and both of the second, change no test and no real recording.
_MAX_CUT, _CUT_LENGTHS = 0.5, 3.0
# A trend falls, or rises, all the way: it holds a push where its course has a top that
# is this share as high as the usual push, seen at so many points. Not tuned.
_OF_USUAL, _POINTS = 0.5, 240
# A jerk is so many times briefer than the push, and nearer to it: those of the
# tests last 50 ms. Half or twice changes none of them, and no real recording.
BRIEFER = 10.0
# Means of the signal that differ by so many sd are no chance.
_BEYOND = 6.0
# A level that is not left is a rest if so many pushes return to it, or one that is
# `_OF_USUAL`: wiggles of one that the recording cuts do not, or are lower. Not tuned.
_RETURNS = 3
# Times that pushes are joined, and parted, by their own course: an end for what would
# go on for ever. Half or twice as many change no real recording.
_MOST_ONE, _MOST_TWO = 8, 2


def find_extents(view: View) -> tuple[Extent, ...]:
    """Find all humps that rise from rest and return to it, in order of time."""
    if view.noise.sigma == 0.0 or len(view.signal) < 5:
        return ()
    time, (found, is_low, is_rest) = view.time, _searched(view)
    if found.start.size == 0:
        return ()
    # A hump that is too low is no part of a push.
    is_rest |= is_low | np.append(is_low[1:], True)
    feet, whose = _resolved(view, found, is_rest)
    is_low = is_low[whose]
    is_cut = are_cut(view, feet)
    is_push = ~_are_trends(feet, is_cut=is_cut, time=time, is_low=is_low)
    trends, whole = np.flatnonzero(~is_push & is_cut), feet.height[~is_cut & ~is_low]
    least = _OF_USUAL * float(np.median(whole)) if whole.size else np.inf
    # Of fewer the usual height may be that of a wiggle.
    alone = least if whole.size >= _RETURNS else np.inf
    beyond = _beyond_steps(view, rows_of(feet, trends), least=alone)
    if trends.size and whole.size and not beyond:
        is_push[trends] = _have_tops(view, rows_of(feet, trends), least=least)
    within, contact = from_within(view, feet)
    is_jerk, rows = ~is_push, np.flatnonzero(is_push)
    if rows.size:
        is_jerk[rows] = _are_jerks(rows_of(feet, rows), is_cut=is_cut[rows])
    is_jerk |= are_returns(view, feet, within, is_cut=is_cut)
    others = np.array([e.height for e in beyond if not e.is_brush])
    smallest = 0.0
    if view.min_height is None:
        # A jolt at an end of the signal, of any height, closes no gap.
        is_jolt = _are_jolts(feet, is_cut=is_cut, is_other=is_jerk | is_low)
        smallest = max(
            _smallest_push(np.append(feet.height[rows], others))
            for rows in (~is_jerk, ~is_jerk & ~is_jolt)
        )
    is_brush = (feet.height < smallest) | is_jerk
    feet = within.where(~is_cut, feet)
    shelf = shelves(view, feet)
    first, last = np.searchsorted(time, [feet.start, feet.end])
    first = np.minimum(first, len(time) - 1)
    last = np.maximum(last, first + 1)
    pushes = [
        Extent(
            start=int(first[k]),
            end=int(last[k]),
            feet=own,
            is_brush=bool(is_brush[k]),
            is_cut=bool(is_cut[k]),
            is_low=bool(is_low[k]),
            contact=0.0 if is_cut[k] else float(contact[k]),
            shelf=float(shelf[k]),
        )
        for k, own in enumerate(feet.apart())
        if is_push[k]
    ]
    pushes += [replace(e, is_brush=e.is_brush or e.height < smallest) for e in beyond]
    return tuple(sorted(pushes, key=lambda push: push.t_peak))


def _searched(
    view: View,
) -> tuple[Feet[np.ndarray], Bool[np.ndarray, " p"], Bool[np.ndarray, " p"]]:
    """Humps as `search_humps` has them, averaged over a share of their usual width."""
    tau = view.smoothing or FIRST_SMOOTHING
    found, is_low, is_rest, wander = search_humps(view, tau=tau)
    # A step shows no width: what never comes, or never falls, to half of its height.
    is_open = (found.half_up <= found.start) | (found.half_down >= found.end)
    has_width = ~is_low & ~(is_open & _are_long(found, is_open | is_low, view.time))
    if view.smoothing is None and has_width.any():
        wider = float(np.median(found.width[has_width])) / WIDTH_PER_SMOOTHING
        if wider > _LONGER * tau:
            wide = search_humps(view, tau=wider, wander=wander)
            # What is lost to averaging stands out without it.
            if _n_large(wide[0], wide[1]) >= _n_large(found, is_low):
                found, is_low, is_rest, _ = wide
    return found, is_low, is_rest


def _beyond_steps(view: View, steps: Feet[np.ndarray], *, least: float) -> list[Extent]:
    """Pushes on levels that the signal begins with, or goes to and does not leave.

    Args:
        least: Height of half a usual push, of which a single one that is no more than
            twice one shows that a level is a rest [unit].
    """
    begin, end = float(view.time[0]), float(view.time[-1])
    found = []
    for step in steps.apart():
        is_after = end - step.half_down < step.half_up - begin
        edge = step.half_up if is_after else step.half_down
        edge = _off_flank(view, edge, 1 if is_after else -1)
        if not begin < edge < end:
            continue
        part = view.between(edge, np.inf) if is_after else view.between(begin, edge)
        pushes = [
            push
            for push in find_extents(part)
            if not push.is_cut or push.t_start > edge or push.t_end < edge
        ]
        heights = [push.height for push in pushes if _returns_to_rest(push)]
        are_usual = [least <= own <= least / _OF_USUAL**2 for own in heights]
        if len(heights) >= _RETURNS or any(are_usual):
            first = int(np.searchsorted(view.time, edge)) if is_after else 0
            found += [
                replace(push, start=push.start + first, end=push.end + first)
                for push in pushes
            ]
    return found


def _off_flank(view: View, edge: float, sign: int) -> float:
    """Where the signal is no longer on its way up, after a time (1) or before it."""
    way = sign * FIRST_SMOOTHING
    chance = _BEYOND * view.noise.of_mean(FIRST_SMOOTHING / view.course.step)

    def level(steps: int) -> float:
        ends = sorted((edge + steps * way, edge + (steps + 1) * way))
        return float(view.course.mean(*np.array(ends)[:, None])[0])

    while (
        view.time[0] < edge + 2 * way < view.time[-1] and level(1) - level(0) > chance
    ):
        edge += way
    return edge


def _returns_to_rest(push: Extent) -> bool:
    """Whether a push ends on the level that it began on, and both are seen."""
    is_whole = not (push.is_cut or push.is_brush)
    return is_whole and 0 < abs(push.feet.moved) <= SAME_REST * push.height


def _n_large(found: Feet[np.ndarray], is_low: Bool[np.ndarray, " p"]) -> int:
    """Number of humps that are no brushes by their height alone."""
    heights = found.height[~is_low]
    return int(np.count_nonzero(heights >= _BRUSH * heights.max(initial=0.0)))


def _resolved(
    view: View, found: Feet[np.ndarray], is_rest: Bool[np.ndarray, " p"]
) -> tuple[Feet[np.ndarray], Int[np.ndarray, " q"]]:
    """Feet of pushes that are one and no more, each by its own course; and whose."""
    whose, feet = np.arange(len(is_rest)), trace_feet(view, found)
    # First what is one is joined, then what is two is parted, and not for ever.
    for _ in range(_MOST_ONE):
        found, own = join_one(view, feet, is_rest=is_rest[whose])
        if len(own) == len(whose):
            break
        whose, feet = whose[own], trace_feet(view, found)
    for _ in range(_MOST_TWO):
        found, own = part_doubles(view, feet)
        if len(own) == len(whose):
            break
        whose, feet = whose[own], trace_feet(view, found)
    return feet, whose


def _are_trends(
    feet: Feet[np.ndarray],
    *,
    is_cut: Bool[np.ndarray, " p"],
    time: Float[np.ndarray, " n"],
    is_low: Bool[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """What begins before the signal or never ends, unless it is as short as a push."""
    slack = 2 * float(np.median(feet.step))
    # What is left of it in its own smoothing is one reading.
    is_reading = (feet.width < slack) & ~is_cut
    # Of what does both, more than half is there on either side.
    rises = feet.half_up > time[0] + slack
    falls = feet.half_down < time[-1] - slack
    is_long = is_cut & _are_long(feet, is_cut | is_low, time)
    return is_reading | ~(rises | falls) | (is_long & ~(rises & falls))


def _have_tops(
    view: View, feet: Feet[np.ndarray], *, least: float
) -> Bool[np.ndarray, " p"]:
    """Whether each course falls from one of its ends before it rises to its top.

    Args:
        least: By so much it rises at least, and falls by a foot of that [unit].
    """
    tau = feet.averaging(view)[:, None]
    ends = feet.lowest[:, None], feet.highest[:, None]
    have = np.zeros(len(feet.start), dtype=bool)
    for outer in (feet.start, feet.end):
        when = np.linspace(outer, feet.peak, _POINTS, axis=1)
        y = view.course.smooth(when, tau=tau, ends=ends)
        low = y.min(axis=1)
        have |= (y[:, -1] - low >= least) & (y[:, 0] - low >= FOOT * least)
    return have


def _are_long(
    feet: Feet[np.ndarray],
    is_other: Bool[np.ndarray, " p"],
    time: Float[np.ndarray, " n"],
) -> Bool[np.ndarray, " p"]:
    """Whether each is far longer than the whole pushes, or most of the signal.

    Args:
        is_other: Which of them are no whole pushes.
    """
    length = feet.end - feet.start
    whole = length[~is_other]
    duration = float(time[-1] - time[0])
    return length > (_CUT_LENGTHS * whole.max() if whole.size else _MAX_CUT * duration)


def _are_jerks(
    feet: Feet[np.ndarray], *, is_cut: Bool[np.ndarray, " p"]
) -> Bool[np.ndarray, " p"]:
    """What is far briefer than a push beside it: a jerk on contact or on retracting.

    A push that is cut may be as wide as the others are.
    """
    gap, width = feet.start[1:] - feet.end[:-1], feet.width

    def jerks(width: Float[np.ndarray, " p"]) -> Bool[np.ndarray, " p"]:
        before = BRIEFER * np.maximum(width[:-1], gap) < width[1:]
        after = BRIEFER * np.maximum(width[1:], gap) < width[:-1]
        return np.append(before, False) | np.append(False, after)

    others = width[~is_cut & ~jerks(width)]
    usual = float(np.median(others)) if others.size else 0.0
    return jerks(np.where(is_cut, np.maximum(width, usual), width))


def _are_jolts(
    feet: Feet[np.ndarray],
    *,
    is_cut: Bool[np.ndarray, " p"],
    is_other: Bool[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """What an end of the signal cuts, shorter and steeper than any whole hump.

    Args:
        is_other: Which of them are no pushes.
    """
    length = feet.end - feet.start
    flanks = np.array([feet.half_up - feet.start, feet.end - feet.half_down])
    # The flank that is seen of what is cut is the longer one.
    flank = np.where(is_cut, flanks.max(axis=0), flanks.min(axis=0))
    slope = feet.height / np.maximum(flank, feet.step)
    whole = ~is_cut & ~is_other
    is_brief = length < np.min(length[whole], initial=np.inf)
    is_steep = slope > np.max(slope[whole], initial=0.0)
    return is_cut & is_brief & is_steep & whole.any()


def _smallest_push(heights: Float[np.ndarray, " k"]) -> float:
    """Height below which humps are brushes: far below the largest, beyond a gap."""
    ordered = np.sort(heights)[::-1]
    if len(ordered) == 0:
        return 0.0
    largest = float(ordered[0])
    small = ordered < _SMALL * largest
    after_gap = np.append(False, ordered[1:] * _GAP_RATIO < ordered[:-1])
    beyond = np.flatnonzero((small & after_gap) | (ordered < _BRUSH * largest))
    return float(ordered[beyond[0] - 1]) if beyond.size else 0.0
