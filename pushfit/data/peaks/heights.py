"""How high each push is: the top of its course over the rest before it.

Baselines are robust means of the rest just before a push, carried to the top by the
drift to the rest after it (`pushfit.data.peaks.rests`). Tops are either the apex of a
hump (`pushfit.data.peaks.apex`) or the level of a held plateau, by the shape of the
push alone: a height does not depend on what else the recording holds. Excluded: finding
the pushes (`pushfit.data.pushes.detection`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.peaks.apex import N_BINS, fit_apex
from pushfit.data.peaks.rests import Baselines, RestNoise, baselines, rest_noise
from pushfit.data.peaks.saturation import saturated_pushes
from pushfit.data.peaks.shape import (
    PROFILE_BINS,
    are_held,
    bin_means,
    calmed,
    held_part,
    profiles,
)
from pushfit.data.pushes.detection import Extent, usual_step

Definition = Literal["auto", "apex", "plateau"]

# Window of the apex: the part of the hump above 1 - depth, deeper the more it takes to
# see a shape in the noise.
_DEPTH = (0.3, 0.5)
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

    Returns:
        Heights in the same order.
    """
    signs = [1] * len(extents) if signs is None else signs
    noise = rest_noise(time, signal, extents)
    base = baselines(time, signal, extents, noise)
    upright = _upright(signal, extents, base.level, signs)
    profile = profiles(time, upright, extents)
    calm = calmed(profile, base.level, extents, noise)
    held = are_held(time, upright, extents, calm=calm, base=base.level, noise=noise)
    if definition != "auto":
        held = np.full(len(extents), definition == "plateau")
    missing = np.array(is_missing or [False] * len(extents))
    held &= ~missing
    kinds = (held, missing)
    tops = _tops(time, upright, extents, (profile, calm), kinds, base.level, noise)
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
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    profiles: tuple[Float[np.ndarray, "p m"], Float[np.ndarray, "p m"]],
    kinds: tuple[Bool[np.ndarray, " p"], Bool[np.ndarray, " p"]],
    base: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> _Tops:
    """Plateaus of the pushes that are held, moments of the missing, else apexes."""
    held, missing = kinds
    n = len(extents)
    level, sd, when = np.empty((3, n))
    has_gap = np.zeros(n, dtype=bool)
    for find, profile, rows in (
        (_plateaus, profiles[1], np.flatnonzero(held)),
        (_moments, profiles[0], np.flatnonzero(missing)),
        (_apexes, profiles[0], np.flatnonzero(~held & ~missing)),
    ):
        if rows.size:
            some = [extents[int(k)] for k in rows]
            found = find(time, signal, some, profile[rows], base[rows], noise.of(rows))
            level[rows], sd[rows] = found.level, found.sd
            when[rows], has_gap[rows] = found.time, found.has_gap
    return _Tops(level=level, sd=sd, time=when, has_gap=has_gap)


def _moments(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> _Tops:
    """Means around the moments at which pushes were to be at their tops."""
    windows = np.array(
        [[e.t_peak - _MOMENT * e.width, e.t_peak + _MOMENT * e.width] for e in extents]
    )
    windows = np.clip(windows, time[0], time[-1])
    means, counts = bin_means(time, signal, windows, 1)
    return _Tops(
        level=means[:, 0],
        sd=noise.of_mean(counts[:, 0]),
        time=np.array([e.t_peak for e in extents]),
        has_gap=counts[:, 0] == 0,
    )


def _plateaus(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> _Tops:
    """Median of the held part; its sd from the scatter of eight parts of it."""
    windows = np.empty((len(extents), 2))
    for k, extent in enumerate(extents):
        course = (profile[k] - base[k]) / max(profile[k].max() - base[k], 1e-300)
        first, last = held_part(course)
        margin = 0.15 * (last - first)
        share = np.array([first + margin, max(last - margin, first + margin + 1)])
        step = (extent.t_end - extent.t_start) / PROFILE_BINS
        windows[k] = extent.t_start + share * step
    parts, counts = bin_means(time, signal, windows, 8)
    scatter = parts.std(axis=1, ddof=1) / np.sqrt(8)
    least = noise.of_mean(counts.sum(axis=1))
    return _Tops(
        level=np.median(parts, axis=1),
        # The median of eight scatters 1.2 times as much as their mean.
        sd=1.2 * np.where(scatter > _BEYOND_CHANCE * least, scatter, least),
        time=windows.mean(axis=1),
        has_gap=np.mean(counts == 0, axis=1) > _MAX_GAP,
    )


def _apexes(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> _Tops:
    """Apex of each hump, in the widest window whose course the family describes."""
    smooth = (
        np.pad(profile, ((0, 0), (1, 1)), mode="edge")[:, :-2]
        + profile
        + np.pad(profile, ((0, 0), (1, 1)), mode="edge")[:, 2:]
    ) / 3
    rise = np.maximum(smooth.max(axis=1) - base, 1e-300)
    depth = np.clip(0.25 + 2 * noise.sigma / rise, *_DEPTH)
    windows = _top_windows(smooth, depth * rise, extents)
    level, sd, when, gap = (np.full(len(extents), np.nan) for _ in range(4))
    step = usual_step(time)
    todo = np.arange(len(extents))
    while todo.size:
        bins, counts = bin_means(time, signal, windows[todo], N_BINS)
        n = counts.sum(axis=1)
        per_bin = noise.of_part(n / N_BINS, todo)
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
    return _Tops(level=level, sd=sd, time=when, has_gap=gap.astype(bool))


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
    for start, end in windows:
        first, last = np.searchsorted(time, [start, end])
        inside = np.clip(time[max(0, first - 1) : last + 1], start, end)
        gaps.append(np.diff(inside).max(initial=0.0))
    return np.array(gaps)
