"""How high each push is: the top of its course over the rest before it.

Baselines are robust means of the rest just before a push, carried to the top by the
drift to the rest after it (`pushfit.data.peaks.rests`). Tops are either the apex of
a hump (`pushfit.data.peaks.apex`) or the level of a held plateau, by the shape of the
push alone: a height does not depend on what else the recording holds. Excluded: finding
the pushes (`pushfit.data.pushes.detection`). What constants do was seen in the
recordings of `benchmarks.recordings.real_recordings`, and in pushes of
`benchmarks.recordings.peak_accuracy`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.config.inputs import Definition
from pushfit.data.peaks.apex import N_BINS, fit_apex
from pushfit.data.peaks.apex_or_plateau import (
    MARGIN,
    PROFILE_BINS,
    are_held,
    bin_means,
    calmed,
    held_window,
)
from pushfit.data.peaks.blocks import RestNoise
from pushfit.data.peaks.rests import rests_of
from pushfit.data.peaks.saturation import saturated_pushes
from pushfit.data.pushes.feet import WIDTH_PER_SMOOTHING, Feet
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.pushes.running_means import RunningMeans
from pushfit.data.rows import rows_of
from pushfit.parameters import TINY

# Window of the apex: the part of the hump above 1 - depth, deeper the more it takes to
# see a shape in the noise. With at most 0.5 and two sigma instead of three, half sines
# of five times their noise were read too high by 0.12 σ instead of 0.06.
_DEPTH = (0.3, 0.7)
_DEPTH_WITHOUT_NOISE, _DEPTH_SIGMAS = 0.25, 3.0
# Misfit that noise reaches once in 10^4 windows: chi-square of 11 degrees of freedom.
_MAX_MISFIT = 3.3
# Windows are given up smoothly about it; what is left of the doubt ends here.
_STEEP, _NEGLIGIBLE = 8, 0.01
# A narrower window is this share of the last, around the mean of the parts weighed by
# this power, which makes it one of the highest. Both move heights of `trial2`, whose
# tops are bumpy.
_NARROWER, _SHARP = 0.6, 16
# A longer stretch without samples may hide the top: share of the window, and of the
# width; of the width where it is at the top itself; and usual steps. Twice the first or
# the last takes the flag from two of four pushes with gaps of `short_dropouts`; half
# changes none. Elsewhere in a push of `peg_poke` one moves the height by up to 24 sd.
_MAX_GAP, _TOP_GAP = 0.25, 0.05
_STEPS_OF_GAP = 3.0
# Eight parts scatter more than this by chance once in 10^3 (chi-square, 7 degrees).
_BEYOND_CHANCE = 1.86
# What the family of shapes misses where there is no noise, as a share of the height:
# half makes sds of `trial2` up to a quarter smaller; twice is too large for half sines.
_SHAPE = 0.001
# More than half of the pushes, or of what is believed of the windows of one.
_MOST = 0.5
# Share of the width on either side of the moment of a missing push. Not tuned: wider is
# less noise, and more of the slope of whatever is there.
_MOMENT = 0.1
# Share of the height that the baseline may move by under a push. Twice flags no push of
# the real recordings, half two more each of `short_dropouts` and `p0_Pa`.
_MAX_DRIFT = 0.15


@dataclass(frozen=True, slots=True, kw_only=True)
class Height:
    """Height of one push.

    Args:
        height: Top over baseline [unit].
        sd: Standard deviation of `height` [unit].
        baseline: Rest level under the top [unit].
        t_peak: Time of the top [s].
        definition: Whether it is the apex of a hump or the level of a plateau; empty
            where there is no hump.
        flags: Flag words, see `pushfit.data.tables.rules.FLAGS`.
    """

    height: float
    sd: float
    baseline: float
    t_peak: float
    definition: Literal["apex", "plateau", ""]
    flags: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Pushes:
    """Courses of pushes from foot to foot, over their baselines, beside their noise."""

    course: RunningMeans
    feet: Feet[np.ndarray]
    profile: Float[np.ndarray, "p m"]
    base: Float[np.ndarray, " p"]
    noise: RestNoise

    def only(self, rows: Int[np.ndarray, " r"]) -> "_Pushes":
        """The pushes in these rows."""
        feet, noise = rows_of(self.feet, rows), rows_of(self.noise, rows)
        return replace(rows_of(self, rows), feet=feet, noise=noise)


@dataclass(frozen=True, slots=True)
class _Tops:
    """Levels, their sd and times of the tops, and where samples are missing."""

    level: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]
    time: Float[np.ndarray, " p"]
    has_gap: Bool[np.ndarray, " p"]


def measure_heights(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    *,
    definition: Definition,
    limit: float | None = None,
    is_missing: Sequence[bool] = (),
    course: RunningMeans | None = None,
) -> tuple[Height, ...]:
    """Measure humps, each by itself.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Humps in any order and at least one. Heights of those that go down are
            negative.
        definition: What the height is; "auto" decides by the shape of each push.
        limit: Largest reading of the sensor; None to recognise it [unit].
        is_missing: Whether each is but the moment of a push that has no hump; none
            where empty.

    Returns:
        Heights in the same order.
    """
    signs = np.array([extent.sign for extent in extents])
    noise, base = rests_of(time, signal, extents)
    if course is None or -1 in signs:
        course = RunningMeans.of(time, _upright(signal, extents, base.level))
    feet = Feet.together([extent.feet for extent in extents])
    windows = np.stack([feet.start, feet.end], axis=1)
    profile = bin_means(course, windows, PROFILE_BINS)[0]
    calm = calmed(profile, base.level, extents, noise=noise)
    missing = np.array(is_missing or [False] * len(extents))
    shaped = are_held(course, extents, calm=calm, base=base.level, noise=noise)
    stated = np.full(len(extents), definition == "plateau")
    held = (shaped if definition == "auto" else stated) & ~missing
    pushes = _Pushes(
        course=course, feet=feet, profile=profile, base=base.level, noise=noise
    )
    tops = _tops(pushes, calm, held, missing)
    drift = base.drift(tops.time)
    is_cut = saturated_pushes(
        signal,
        extents,
        signs=signs.tolist(),
        limit=limit,
        sigma=noise.sigma,
        # By its shape: what is read of a hold does not make it pointed.
        held=shaped & ~missing,
        quantum=noise.quantum,
    )
    # The drift of an upright picture of a dip goes the other way.
    rise = tops.level - base.level - signs * drift
    family = np.where(held, 0.0, _SHAPE * rise)
    sd = np.sqrt(tops.sd**2 + base.sd_at(tops.time) ** 2 + family**2)
    # A rest that is too short to tell of drift shows a step; half of it is at the top.
    step = np.abs(base.step) / 2
    rate = np.abs(base.slope) + 2 * base.doubt
    moved = np.maximum(rate * np.abs(tops.time - base.time), step)
    # A hump whose top is beside it is the end of one that is not seen.
    is_beside = (tops.time < windows[:, 0]) | (tops.time > windows[:, 1])
    longest = _longest(_MAX_GAP * feet.width, course.step)
    is_blind = _largest_gap(time, windows) > longest
    checks = {
        "clipped": np.array([e.is_cut for e in extents]) | (is_beside & ~missing),
        "gap": tops.has_gap | (is_blind & ~missing),
        "saturated": is_cut & ~missing,
        "missing": missing,
        "drift": ~missing & (moved > _MAX_DRIFT * np.abs(rise)),
    }
    return tuple(
        Height(
            height=float(signs[k] * rise[k]),
            sd=float(sd[k]),
            baseline=float(base.level[k] + drift[k]),
            t_peak=float(tops.time[k]),
            definition="" if missing[k] else "plateau" if held[k] else "apex",
            flags=frozenset(word for word, is_so in checks.items() if is_so[k]),
        )
        for k in range(len(extents))
    )


def _upright(
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    base: Float[np.ndarray, " p"],
) -> Float[np.ndarray, " n"]:
    """The signal with each dip mirrored at its baseline."""
    upright = signal.copy()
    for extent, level in zip(extents, base, strict=True):
        if extent.sign < 0:
            part = slice(extent.start, extent.end)
            upright[part] = 2 * level - signal[part]
    return upright


def _tops(
    pushes: _Pushes,
    calm: Float[np.ndarray, "p m"],
    held: Bool[np.ndarray, " p"],
    missing: Bool[np.ndarray, " p"],
) -> _Tops:
    """Plateaus of the pushes that are held, moments of the missing, else apexes."""
    level, sd, when = np.full((3, len(held)), np.nan)
    tops = _Tops(level, sd, when, np.zeros(len(held), dtype=bool))
    for find, shown, kind in (
        (_plateaus, replace(pushes, profile=calm), held),
        (_moments, pushes, missing),
        (_apexes, pushes, ~held & ~missing),
    ):
        rows = np.flatnonzero(kind)
        if rows.size:
            own = find(shown.only(rows))
            for name in ("level", "sd", "time", "has_gap"):
                getattr(tops, name)[rows] = getattr(own, name)
    return tops


def _moments(pushes: _Pushes) -> _Tops:
    """Means around the moments at which pushes were to be at their tops."""
    when, half = pushes.feet.peak, _MOMENT * pushes.feet.width
    time = pushes.course.time
    windows = np.clip(np.stack([when - half, when + half], axis=1), time[0], time[-1])
    means, counts = bin_means(pushes.course, windows, 1)
    sd = pushes.noise.of_mean(counts[:, 0])
    return _Tops(means[:, 0], sd, when, counts[:, 0] == 0)


def _plateaus(pushes: _Pushes) -> _Tops:
    """Median of the held part; its sd from the scatter of eight parts of it."""
    start, windows = pushes.feet.start, np.empty((len(pushes.base), 2))
    step = (pushes.feet.end - start) / PROFILE_BINS
    for k in range(len(windows)):
        rise = pushes.profile[k] - pushes.base[k]
        first, last = held_window(rise / max(rise.max(), TINY))
        margin = MARGIN * (last - first)
        share = np.array([first + margin, max(last - margin, first + margin + 1)])
        windows[k] = start[k] + share * step[k]
    parts, counts = bin_means(pushes.course, windows, 8)
    scatter = parts.std(axis=1, ddof=1) / np.sqrt(8)
    least = pushes.noise.of_mean(counts.sum(axis=1))
    return _Tops(
        np.median(parts, axis=1),
        # The median of eight scatters 1.2 times as much as their mean.
        1.2 * np.where(scatter > _BEYOND_CHANCE * least, scatter, least),
        windows.mean(axis=1),
        np.mean(counts == 0, axis=1) > _MAX_GAP,
    )


def _apexes(pushes: _Pushes) -> _Tops:
    """Apex of each hump, in the widest window whose course the family describes."""
    from scipy.ndimage import uniform_filter1d  # noqa: PLC0415 - slow to load

    smooth = uniform_filter1d(pushes.profile, 3, axis=1, mode="nearest")
    rise = np.maximum(smooth.max(axis=1) - pushes.base, TINY)
    noise = _DEPTH_SIGMAS * pushes.noise.sigma / rise
    depth = np.clip(_DEPTH_WITHOUT_NOISE + noise, *_DEPTH)
    windows = _top_windows(smooth, depth * rise, pushes.feet)
    time = pushes.course.time
    # Sums over windows, from the widest to the narrowest, by how far each is believed.
    level, square, when, gap = np.zeros((4, len(windows)))
    doubt = np.ones(len(windows))
    width = pushes.feet.width
    brief = np.maximum(width / WIDTH_PER_SMOOTHING, pushes.course.step)
    todo = np.arange(len(windows))
    while todo.size:
        bins, counts = bin_means(pushes.course, windows[todo], N_BINS)
        n = counts.sum(axis=1)
        per_bin = rows_of(pushes.noise, todo).of_part(n / N_BINS)
        half = np.diff(windows[todo], axis=1)[:, 0] / 2
        enough = n / (2 * N_BINS)
        # What lies between few samples is doubt.
        few = np.clip(2 - enough, 0.0, 1.0)
        fit = fit_apex(bins, per_bin, few / np.maximum(n, 1))
        middle = windows[todo].mean(axis=1)
        top = np.where(np.isnan(fit.height), bins.max(axis=1), fit.height)
        top -= pushes.base[todo]
        own_sd = np.where(np.isnan(fit.sd), per_bin, fit.sd)
        misfit = np.minimum(fit.misfit / _MAX_MISFIT, 1e3) ** _STEEP
        # Of few samples a narrower window shows nothing more, and of what is briefer
        # than the smoothing it would show a tremor.
        more = np.minimum(enough, half / brief[todo])
        misfit *= np.clip(more - 1, 0.0, 1.0)
        left = doubt[todo] * misfit / (1 + misfit)
        left[left < _NEGLIGIBLE] = 0.0
        weight = doubt[todo] - left
        level[todo] += weight * top
        square[todo] += weight * (own_sd**2 + top**2)
        when[todo] += weight * (middle + half * fit.position)
        least = _longest(2 * _MAX_GAP * half, pushes.course.step)
        gap[todo] += weight * (_largest_gap(time, windows[todo]) > least)
        doubt[todo] = left
        # Around the highest parts, without a jump where two of them are alike.
        share = bins - bins.min(axis=1, keepdims=True)
        share = (share / np.maximum(share.max(axis=1, keepdims=True), TINY)) ** _SHARP
        where = (2 * np.arange(N_BINS) + 1) / N_BINS - 1
        centre = middle + half * (share @ where) / np.maximum(share.sum(axis=1), TINY)
        reach = _NARROWER * half
        windows[todo] = np.stack([centre - reach, centre + reach], axis=1)
        todo = todo[left > 0]
    sd = np.sqrt(np.maximum(square - level**2, 0.0))
    # Straight lines across a top are below it.
    after = np.clip(np.searchsorted(time, when), 1, len(time) - 1)
    least = _longest(_TOP_GAP * width, pushes.course.step)
    has_gap = (gap > _MOST) | (time[after] - time[after - 1] > least)
    return _Tops(level + pushes.base, sd, when, has_gap)


def _top_windows(
    smooth: Float[np.ndarray, "p m"],
    depth: Float[np.ndarray, " p"],
    feet: Feet[np.ndarray],
) -> Float[np.ndarray, "p 2"]:
    """Stretch around the largest part of each course that stays near the top."""
    index, peak = np.arange(PROFILE_BINS), smooth.argmax(axis=1)[:, None]
    over = smooth - smooth.max(axis=1, keepdims=True) + depth[:, None]
    left = np.where((over < 0) & (index < peak), index, 0).max(axis=1)
    right = np.where((over < 0) & (index > peak), index, PROFILE_BINS - 1).min(axis=1)
    # Between two parts, so that what moves a level by little moves a window by little.
    rows = np.arange(len(over))
    left = left + _share(over[rows, left], over[rows, left + 1])
    right = right - _share(over[rows, right], over[rows, right - 1])
    step = (feet.end - feet.start) / PROFILE_BINS
    # Half a part more on either side: a part is below the level as a whole.
    return feet.start[:, None] + step[:, None] * np.stack([left, right + 1], axis=1)


def _share(
    low: Float[np.ndarray, " p"], high: Float[np.ndarray, " p"]
) -> Float[np.ndarray, " p"]:
    """Where lines from one part to the next pass 0; at their begin if they do not."""
    return np.where(low < 0, -low / np.maximum(high - low, TINY), 0.0)


def _longest(allowed: Float[np.ndarray, " p"], step: float) -> Float[np.ndarray, " p"]:
    """Times without a sample that are no gaps: these, or a few usual steps [s]."""
    return np.maximum(allowed, _STEPS_OF_GAP * step)


def _largest_gap(
    time: Float[np.ndarray, " n"], windows: Float[np.ndarray, "p 2"]
) -> Float[np.ndarray, " p"]:
    """Longest time without a sample in each window [s]."""
    gaps = []
    parts = np.searchsorted(time, windows)
    for (start, end), (first, last) in zip(windows, parts.tolist(), strict=True):
        inside = time[max(0, first - 1) : last + 1].copy()
        inside[0], inside[-1] = max(inside[0], start), min(inside[-1], end)
        gaps.append(np.diff(inside).max(initial=0.0))
    return np.array(gaps)
