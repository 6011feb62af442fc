"""How high each push is: the top of its course over the rest before it.

Baselines are robust means of the rest just before a push, carried to the top by the
drift to the rest after it (`pushfit.data.peaks.rests`). Tops are either the apex of a
hump (`pushfit.data.peaks.apex`) or the level of a held plateau, by the shape of the
push alone: a height does not depend on what else the recording holds. Excluded: finding
the pushes (`pushfit.data.pushes.detection`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.peaks.apex import N_BINS, fit_apex
from pushfit.data.peaks.rests import Baselines, RestNoise, rests_of
from pushfit.data.peaks.saturation import saturated_pushes
from pushfit.data.peaks.shape import (
    PROFILE_BINS,
    are_held,
    bin_means,
    calmed,
    held_part,
    profiles,
)
from pushfit.data.pushes.course import Course
from pushfit.data.pushes.detection import Extent, usual_step
from pushfit.data.pushes.maxima import mean_of_three

Definition = Literal["auto", "apex", "plateau"]

# Window of the apex: the part of the hump above 1 - depth, deeper the more it takes to
# see a shape in the noise.
_DEPTH = (0.3, 0.7)
# Misfit that noise reaches once in 10^4 windows: chi-square of 11 degrees of freedom.
_MAX_MISFIT = 3.3
# A longer stretch without samples may hide the top: share of the window, usual steps.
_MAX_GAP = 0.25
_STEPS_OF_GAP = 3.0
# Eight parts scatter more than this by chance once in 10^3 (chi-square, 7 degrees).
_BEYOND_CHANCE = 1.86
# What the family of shapes misses where there is no noise, as a share of the height.
_SHAPE = 0.0015
_MOST = 0.5
# Share of the width on either side of the moment of a missing push.
_MOMENT = 0.1
# Share of the height that the baseline may move by under a push.
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

    course: Course
    extents: Sequence[Extent]
    profile: Float[np.ndarray, "p m"]
    base: Float[np.ndarray, " p"]
    noise: RestNoise

    def only(self, rows: Int[np.ndarray, " r"]) -> "_Pushes":
        """Some of the pushes."""
        return _Pushes(
            course=self.course,
            extents=[self.extents[k] for k in rows],
            profile=self.profile[rows],
            base=self.base[rows],
            noise=self.noise.of(rows),
        )


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
    limit: float | None,
    signs: Sequence[int] | None = None,
    is_missing: Sequence[bool] = (),
    left_out: Sequence[Extent] = (),
) -> tuple[Height, ...]:
    """Measure pushes, each by itself.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Where the pushes are, in order; at least one.
        definition: What the height is; "auto" decides by the shape of each push.
        limit: Largest reading of the sensor; None to recognise it [unit].
        signs: 1 for a push that goes up, -1 for one that goes down, whose height is
            negative; None if all go up.
        is_missing: Whether each push has no hump, so that only its moment is measured;
            none where empty.
        left_out: Humps that are not measured: no pushes, and no rests either.

    Returns:
        Heights in the same order.
    """
    signs = [1] * len(extents) if signs is None else signs
    noise, base = rests_of(time, signal, extents, left_out)
    course = Course.of(time, _upright(signal, extents, base.level, signs))
    profile = profiles(course, extents)
    calm = calmed(profile, base.level, extents, noise)
    held = are_held(course, extents, calm=calm, base=base.level, noise=noise)
    if definition != "auto":
        held = np.full(len(extents), definition == "plateau")
    missing = np.array(is_missing or [False] * len(extents))
    held &= ~missing
    pushes = _Pushes(
        course=course, extents=extents, profile=profile, base=base.level, noise=noise
    )
    tops = _tops(pushes, calm, held, missing)
    drift = base.drift(tops.time)
    is_cut = saturated_pushes(
        signal,
        extents,
        signs=signs,
        limit=limit,
        # Where most are held, readings pile up at levels by themselves; among pointed
        # pushes a level is that of the limit.
        sigma=np.where(held & (held.mean() > _MOST), 0.0, noise.sigma),
    )
    # The drift of an upright picture of a dip goes the other way.
    rise = tops.level - base.level - np.array(signs) * drift
    family = np.where(held, 0.0, _SHAPE * rise)
    sd = np.sqrt(tops.sd**2 + base.sd_at(tops.time) ** 2 + family**2)
    checks = {
        "clipped": np.array([e.is_cut for e in extents]),
        "gap": tops.has_gap,
        "saturated": is_cut & ~missing,
        "missing": missing,
        "drift": ~missing & (_moved(base, tops.time) > _MAX_DRIFT * np.abs(rise)),
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


def _moved(base: Baselines, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
    """How far the rest has moved, or may have, under the top [unit]."""
    return (np.abs(base.slope) + 2 * base.doubt) * np.abs(when - base.time)


def _upright(
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    base: Float[np.ndarray, " p"],
    signs: Sequence[int],
) -> Float[np.ndarray, " n"]:
    """The signal with each dip mirrored at its baseline."""
    upright = signal.copy() if -1 in signs else signal
    for extent, level, sign in zip(extents, base, signs, strict=True):
        if sign < 0:
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
    when = np.array([e.t_peak for e in pushes.extents])
    half = _MOMENT * np.array([e.width for e in pushes.extents])
    time = pushes.course.time
    windows = np.clip(np.stack([when - half, when + half], axis=1), time[0], time[-1])
    means, counts = bin_means(pushes.course, windows, 1)
    sd = pushes.noise.of_mean(counts[:, 0])
    return _Tops(means[:, 0], sd, when, counts[:, 0] == 0)


def _plateaus(pushes: _Pushes) -> _Tops:
    """Median of the held part; its sd from the scatter of eight parts of it."""
    windows = np.empty((len(pushes.extents), 2))
    for k, extent in enumerate(pushes.extents):
        rise = pushes.profile[k] - pushes.base[k]
        first, last = held_part(rise / max(rise.max(), 1e-300))
        margin = 0.15 * (last - first)
        share = np.array([first + margin, max(last - margin, first + margin + 1)])
        step = (extent.t_end - extent.t_start) / PROFILE_BINS
        windows[k] = extent.t_start + share * step
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
    smooth = mean_of_three(pushes.profile)
    rise = np.maximum(smooth.max(axis=1) - pushes.base, 1e-300)
    depth = np.clip(0.25 + 3 * pushes.noise.sigma / rise, *_DEPTH)
    windows = _top_windows(smooth, depth * rise, pushes.extents)
    time = pushes.course.time
    level, sd, when, gap = np.full((4, len(windows)), np.nan)
    step = usual_step(time)
    todo = np.arange(len(windows))
    while todo.size:
        bins, counts = bin_means(pushes.course, windows[todo], N_BINS)
        n = counts.sum(axis=1)
        per_bin = pushes.noise.of_part(n / N_BINS, todo)
        fit = fit_apex(bins, per_bin)
        middle = windows[todo].mean(axis=1)
        half = np.diff(windows[todo], axis=1)[:, 0] / 2
        level[todo] = np.where(np.isnan(fit.height), bins.max(axis=1), fit.height)
        sd[todo] = np.where(np.isnan(fit.sd), per_bin, fit.sd)
        when[todo] = middle + half * fit.position
        least = np.maximum(2 * _MAX_GAP * half, _STEPS_OF_GAP * step)
        gap[todo] = _largest_gap(time, windows[todo]) > least
        again = (fit.misfit > _MAX_MISFIT) & (n > 2 * N_BINS)
        peak = bins.argmax(axis=1)
        centre = middle + half * (2 * (peak + 0.5) / N_BINS - 1)
        narrower = np.stack([centre - 0.6 * half, centre + 0.6 * half], axis=1)
        windows[todo[again]] = narrower[again]
        todo = todo[again]
    return _Tops(level, sd, when, gap.astype(bool))


def _top_windows(
    smooth: Float[np.ndarray, "p m"],
    depth: Float[np.ndarray, " p"],
    extents: Sequence[Extent],
) -> Float[np.ndarray, "p 2"]:
    """Stretch around the largest part of each course that stays near the top."""
    windows = np.empty((len(extents), 2))
    for k, extent in enumerate(extents):
        peak = int(np.argmax(smooth[k]))
        low = np.flatnonzero(smooth[k] < smooth[k, peak] - depth[k])
        left = low[low < peak]
        right = low[low > peak]
        first = left[-1] + 0.5 if left.size else 0.0
        last = right[0] + 0.5 if right.size else float(PROFILE_BINS)
        step = (extent.t_end - extent.t_start) / PROFILE_BINS
        windows[k] = extent.t_start + step * np.array([first, last])
    return windows


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
