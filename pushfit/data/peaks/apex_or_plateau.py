"""What kind of course a push has: held at a level, or passing through a top.

Decided from the push alone. Above half of its height two families are tried, of five
numbers each: a hyperbola, which has a top, and straight flanks beside a level. Noise
blurs the choice, but never in favour of one. Excluded: how high the top or the level is
(`pushfit.data.peaks.heights`).
"""

import functools
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.peaks.apex import bases, hyperbolas, moments
from pushfit.data.peaks.blocks import RestNoise
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.pushes.humps import longest_run
from pushfit.data.pushes.running_means import RunningMeans
from pushfit.parameters import TINY

# Parts of a push above half its height, for five numbers. With a sample in each a hold
# is told from a top; where it took two, short ones were read too high.
PROFILE_BINS = 32
# A plateau stays within this share of its height for so long a part of the time above
# half height, and scatters less than this. Of the recordings tried, held pushes have
# 0.49-0.96 and < 0.043, pointed ones 0.2-0.6.
_BAND = 0.1
_HELD_SHARE = 0.45
_MAX_SCATTER = 0.06
# The upper level is sought among parts above this share of the height: above 0.9, two
# holds of `force_N`, which overshoots, are taken for tops.
_HIGH = 0.8
# A push settles to no less than this share of its top: of a level near half of it next
# to nothing decides whether it is above. In coarse counts a push of `trial2` was read
# half as high; `peg_poke` settles to 0.6.
_SETTLED = 0.55
# Share of a held part that is left out at either end: its way in and out. Half or twice
# moves most heights of `force_N`, by up to 1.6 and 2.3 sd.
MARGIN = 0.15
# Noise of a course that is left in a band of 0.1, and the most parts averaged for it:
# at twice the first, noisy plateaus are read twice as much too high.
_CALM, _MAX_CALMING = 0.035, 7
# Families on the window [-1, 1] above half height: tops and roundings of hyperbolas,
# first and last moments of a level.
_TOPS = np.linspace(-0.8, 0.8, 17)
_ROUNDINGS = np.array([0.01, 0.1, 0.3, 1.0, 4.0])
_MOMENTS = np.linspace(-0.95, 0.95, 20)
# A shorter level is a round top; at twice two holds of `force_N` are, too. What a
# family leaves where none has its form: beyond all squares, and finite, since the two
# are subtracted.
_SHORTEST = 0.4
_NEVER = 1e300
# Gain that a level needs, in chi-square and as a share of the squared height: a round
# top may look flat in noise and is then read too low, and no hyperbola is quite a sine.
# At twice the second, two of the 12 holds of `force_N` are taken for tops.
_EVIDENCE, _UNLIKE = 0.5, 0.004


def bin_means(
    course: RunningMeans,
    windows: Float[np.ndarray, "p 2"],
    n_bins: int,
) -> tuple[Float[np.ndarray, "p bins"], Int[np.ndarray, "p bins"]]:
    """Means and counts of the samples in equal parts of windows of times [s]."""
    # Next to nothing of a push still has a level.
    lengths = np.maximum(np.diff(windows, axis=1), course.step)
    edges = windows[:, :1] + lengths * np.linspace(0, 1, n_bins + 1)
    return course.parts(edges), np.diff(np.searchsorted(course.time, edges), axis=1)


def calmed(
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    extents: Sequence[Extent],
    *,
    noise: RestNoise,
) -> Float[np.ndarray, "p m"]:
    """Profiles averaged over so many parts that their noise is small in the band."""
    n = np.array([extent.end - extent.start for extent in extents])
    rise = np.maximum(profile.max(axis=1) - base, TINY)
    share = np.minimum(noise.of_part(n / PROFILE_BINS) / rise, 1.0)
    widths = np.clip(np.ceil((share / _CALM) ** 2), 1, _MAX_CALMING).astype(int)
    calm = profile.copy()
    for width in np.unique(widths[widths > 1]):
        rows = np.flatnonzero(widths == width)
        half = width // 2
        padded = np.pad(profile[rows], ((0, 0), (half, half)), mode="edge")
        parts = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=1)
        calm[rows] = parts.mean(axis=2)
    return calm


def held_part(course: Float[np.ndarray, " m"]) -> tuple[int, int]:
    """First and one past the last part of a course, of 0..1, that stay near a level.

    That is the upper level; or, where it is none of its top, the one that the push
    settles to before its release.
    """
    high = course[course >= _HIGH]
    if high.size == 0:
        return 0, 0
    last = int(np.flatnonzero(course > 0.5)[-1]) + 1
    for first in range(int(np.argmax(course)), last):
        tail = course[first:last]
        n, begin = longest_run(np.abs(tail - np.median(tail)) <= _BAND)
        lower = first, first + n
        # However long the release takes: that is beyond it.
        if begin == 0 and _is_long(course, lower):
            if _is_low(course, lower):
                return lower
            break
    n, begin = longest_run(np.abs(course - np.median(high)) <= _BAND)
    return begin, begin + n


def held_window(course: Float[np.ndarray, " m"]) -> tuple[float, float]:
    """Where a course, of 0..1, enters and leaves the band of its held part, in parts.

    Between two parts, so that a foot that moves by little moves no edge by a part.
    """
    first, last = held_part(course)
    if last == first:
        return float(first), float(last)
    inside = _BAND - np.abs(course - np.median(course[first:last]))
    begin = first + 0.5 - _inner(inside[first], inside[max(first - 1, 0)])
    end = last - 0.5 + _inner(inside[last - 1], inside[min(last, len(course) - 1)])
    return begin, end


def _inner(inside: float, outside: float) -> float:
    """Share of the way from a part to the next one that lies inside of a band."""
    return float(np.clip(inside / max(inside - outside, TINY), 0.0, 1.0))


def _is_long(course: Float[np.ndarray, " m"], part: tuple[int, int]) -> bool:
    """Whether a part is a large share of the time above half height."""
    return part[1] - part[0] >= _HELD_SHARE * int(np.count_nonzero(course > 0.5))


def are_held(
    course: RunningMeans,
    extents: Sequence[Extent],
    *,
    calm: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> Bool[np.ndarray, " p"]:
    """Whether each push stays at a level instead of passing through a top.

    Args:
        course: Samples, pushes going up.
    """
    held = np.zeros(len(extents), dtype=bool)
    windows = np.array([[e.feet.half_up, e.feet.half_down] for e in extents])
    bins, counts = bin_means(course, windows, PROFILE_BINS)
    variance = noise.of_part(counts.mean(axis=1)) ** 2
    gain = _misfit(bins, *_hyperbolas()) - _misfit(bins, *_levels())
    rise = calm - base[:, None]
    height = np.maximum(rise.max(axis=1), TINY)
    is_level = gain > _EVIDENCE * variance + _UNLIKE * height**2
    scaled = rise / height[:, None]
    may_be_low = _may_settle(scaled)
    for k in np.flatnonzero(is_level | may_be_low).tolist():
        # Too few samples show no level, and a line across a gap between few is none.
        n_samples = extents[k].end - extents[k].start
        if n_samples >= 2 * PROFILE_BINS or counts[k].min() > 0:
            held[k] = _is_steady(scaled[k]) and (
                is_level[k] or _is_low(scaled[k], held_part(scaled[k]))
            )
    return held


def _may_settle(course: Float[np.ndarray, "p m"]) -> Bool[np.ndarray, " p"]:
    """Whether enough of each course follows its top and lies below it."""
    is_after = np.arange(course.shape[1]) > course.argmax(axis=1)[:, None]
    between = is_after & (course > 0.5) & (course < 1 - _BAND)
    return between.sum(axis=1) >= _HELD_SHARE * (course > 0.5).sum(axis=1)


def _is_low(course: Float[np.ndarray, " m"], part: tuple[int, int]) -> bool:
    """Whether the level that a part ends at is so far below the top to be none of it.

    By its later half: where it begins, of a level that is still relaxed to, is decided
    by noise.
    """
    level = float(np.median(course[sum(part) // 2 : part[1]]))
    return _SETTLED < level < 1 - 2 * _BAND


def _is_steady(course: Float[np.ndarray, " m"]) -> bool:
    """Whether a course, scaled to 0..1, keeps to a level for long enough."""
    first, last = held_part(course)
    margin = round(MARGIN * (last - first))
    inner = course[first + margin : last - margin]
    is_long = len(inner) >= 4 and _is_long(course, (first, last))
    return bool(is_long and inner.std() <= _MAX_SCATTER)


def _misfit(
    bins: Float[np.ndarray, "p bins"],
    q: Float[np.ndarray, "g 3 bins"],
    inverse: Float[np.ndarray, "g 3 3"],
    is_hyperbola: bool,
) -> Float[np.ndarray, " p"]:
    """Squares that the best of a family leaves, beyond all if none has its form."""
    y = bins - bins.mean(axis=1, keepdims=True)
    along = q @ y.T
    left = (y**2).sum(axis=1) - (along**2).sum(axis=1)
    _, b, c = (inverse @ along).transpose(1, 0, 2)
    has_form = np.abs(c) < b if is_hyperbola else (b > 0) & (c > 0)
    return np.where(has_form, left, _NEVER).min(axis=0)


@functools.cache
def _hyperbolas() -> tuple[
    Float[np.ndarray, "g 3 bins"], Float[np.ndarray, "g 3 3"], bool
]:
    """Orthonormal bases of hyperbolas of every top and rounding."""
    top, rounding = (a.ravel() for a in np.meshgrid(_TOPS, _ROUNDINGS))
    q, triangle = bases(*hyperbolas(top, rounding, PROFILE_BINS))
    return q, np.linalg.inv(triangle), True


@functools.cache
def _levels() -> tuple[Float[np.ndarray, "g 3 bins"], Float[np.ndarray, "g 3 3"], bool]:
    """Orthonormal bases of levels with a flank on either side."""
    first, last = (a.ravel() for a in np.meshgrid(_MOMENTS, _MOMENTS))
    is_long = last - first >= _SHORTEST
    rise = -np.maximum(0.0, first[is_long, None] - moments(PROFILE_BINS))
    fall = -np.maximum(0.0, moments(PROFILE_BINS) - last[is_long, None])
    q, triangle = bases(rise, fall)
    return q, np.linalg.inv(triangle), False
