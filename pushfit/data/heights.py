"""How high each push is: the top of its course over the rest before it.

Baselines are robust means of the rest just before a push, carried to the top by the
drift of the neighbouring rests. Tops are either the apex of a hump
(`pushfit.data.apex`) or the level of a held plateau, one definition for all pushes of a
recording, because heights are compared with each other. Excluded: finding the pushes
(`pushfit.data.detection`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.apex import N_BINS, fit_apex
from pushfit.data.detection import Extent, Noise
from pushfit.data.rests import Rest, RestNoise, find_rests, rest_noise, slopes
from pushfit.data.saturation import saturated_pushes

Definition = Literal["auto", "apex", "plateau"]

_PROFILE_BINS = 32
# A plateau stays within this share of its height for so long a part of the time above
# half height, and bends and scatters less than this. Of the recordings tried, held
# pushes have 0.49-0.96, < 0.04 and < 0.043, pointed ones 0.2-0.4; a sine 0.61 and 0.10.
_BAND = 0.1
_HELD_SHARE = 0.45
_MAX_BEND = 0.045
_MAX_SCATTER = 0.06
# Window of the apex: the part of the hump above 1 - depth, deeper the more it takes to
# see a shape in the noise.
_DEPTH = (0.3, 0.5)
# Misfit that noise reaches once in 10^4 windows: chi-square of 11 degrees of freedom.
_MAX_MISFIT = 3.3
# A longer stretch without samples may hide the top: share of the window, usual steps.
_MAX_GAP = 0.25
_STEPS_OF_GAP = 3.0
_STEP_SAMPLES = 100_000
# Pushes that are asked for their shape; more would not change the majority.
_MAX_VOTES = 100
# Noise of a course that is left in a band of 0.1, and the most parts averaged for it.
_CALM, _MAX_CALMING = 0.035, 7
# Eight parts scatter more than this by chance once in 10^3 (chi-square, 7 degrees).
_BEYOND_CHANCE = 1.86
# What the family of shapes misses where there is no noise, as a share of the height.
_SHAPE = 0.0015
# Share of the height that the baseline may move by under a push.
_MAX_DRIFT = 0.2
# Share of the height by which a rest may lie above both of its neighbours.
_MAX_UNREST = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Height:
    """Height of one push.

    Args:
        height: Top over baseline [unit].
        sd: Standard deviation of `height` [unit].
        baseline: Rest level under the top [unit].
        t_peak: Time of the top [s].
        flags: Flag words, see `pushfit.data.table_rules.FLAGS`.
    """

    height: float
    sd: float
    baseline: float
    t_peak: float
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
) -> tuple[tuple[Height, ...], Literal["apex", "plateau"]]:
    """Measure pushes.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Where the pushes are, in order; at least one.
        definition: What the height is; "auto" decides by the shape of most pushes.
        limit: Largest reading of the sensor; None to recognise it [unit].
        signs: 1 for a push that goes up, -1 for one that goes down, whose height is
            negative; None if all go up.

    Returns:
        Heights in the same order, and the definition used.
    """
    rests = find_rests(time, signal, extents)
    noise = rest_noise(signal, rests, Noise.of(signal))
    base, base_sd, base_time = _baselines(rests, noise, extents)
    signs = [1] * len(extents) if signs is None else signs
    upright = _upright(signal, extents, base, signs)
    profile = _profiles(time, upright, extents)
    if definition == "auto":
        calm = _calmed(profile, base, extents, noise)
        definition = "plateau" if _are_held(calm, base, extents) else "apex"
    find = _plateaus if definition == "plateau" else _apexes
    tops = find(time, upright, extents, profile, base, noise)
    drift = slopes(rests) * (tops.time - base_time)
    is_cut = saturated_pushes(
        signal,
        extents,
        signs=signs,
        limit=limit,
        sigma=noise.sigma if definition == "apex" else 0.0,
    )
    heights = []
    for k, extent in enumerate(extents):
        baseline = float(base[k] + drift[k])
        # The drift of an upright picture of a dip goes the other way.
        height = float(tops.level[k] - base[k] - signs[k] * drift[k])
        checks = {
            "clipped": extent.cut_start or extent.cut_end,
            "gap": bool(tops.has_gap[k]),
            "saturated": bool(is_cut[k]),
            "drift": bool(abs(drift[k]) > _MAX_DRIFT * abs(height)),
        }
        heights.append(
            Height(
                height=signs[k] * height,
                sd=float(np.linalg.norm([tops.sd[k], base_sd[k], _SHAPE * height])),
                baseline=baseline,
                t_peak=float(tops.time[k]),
                flags=frozenset(word for word, is_so in checks.items() if is_so),
            )
        )
    return tuple(heights), definition


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


def _baselines(
    rests: Sequence[Rest], noise: RestNoise, extents: Sequence[Extent]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Level, sd and time of the rest before each push; after it if there is none."""
    levels = []
    for k, extent in enumerate(extents):
        rest = rests[k] if rests[k].n_samples else rests[k + 1]
        level = rest.level
        if 0 < k < len(extents) - 1:
            beside = (rests[k - 1].level + rests[k + 1].level) / 2
            highest = max(rests[k - 1].level, rests[k + 1].level)
            # The signal did not come to rest before this push.
            if level > highest + _MAX_UNREST * extent.height:
                level = beside
        levels.append((level, noise.of_rest(rest), rest.time))
    level, sd, time = (np.array(a) for a in zip(*levels, strict=True))
    return level, sd, time


def _bin_means(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    windows: Float[np.ndarray, "p 2"],
    n_bins: int,
) -> tuple[Float[np.ndarray, "p bins"], Int[np.ndarray, "p bins"]]:
    """Means and counts of the samples in equal parts of windows; empty parts filled."""
    share = np.linspace(0, 1, n_bins + 1)
    edges = windows[:, :1] + np.diff(windows, axis=1) * share
    # reduceat takes no index beyond the last sample; the very last one is left out.
    index = np.minimum(np.searchsorted(time, edges), len(time) - 1)
    counts = np.diff(index, axis=1)
    pairs = np.stack([index[:, :-1], index[:, 1:]], axis=2).ravel()
    sums = np.add.reduceat(signal, pairs)[::2]
    means = sums.reshape(counts.shape) / np.maximum(counts, 1)
    middle = (edges[:, :-1] + edges[:, 1:]) / 2
    empty = counts == 0
    means[empty] = np.interp(middle[empty], time, signal)
    return means, counts


def _profiles(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> Float[np.ndarray, "p bins"]:
    """Course of every push in a fixed number of parts."""
    windows = np.array([[e.t_start, e.t_end] for e in extents])
    return _bin_means(time, signal, windows, _PROFILE_BINS)[0]


def _calmed(
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    extents: Sequence[Extent],
    noise: RestNoise,
) -> Float[np.ndarray, "p m"]:
    """Profiles averaged over so many parts that their noise is small in the band."""
    n = np.array([extent.end - extent.start for extent in extents])
    share = noise.of_mean(n / _PROFILE_BINS) / np.maximum(
        profile.max(axis=1) - base, 1e-300
    )
    width = int(np.clip(np.ceil((np.median(share) / _CALM) ** 2), 1, _MAX_CALMING))
    half = width // 2
    padded = np.pad(profile, ((0, 0), (half, half)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1, axis=1)
    return windows.mean(axis=2)


def _longest_run(inside: Bool[np.ndarray, " m"]) -> tuple[int, int]:
    """First and one past the last position of the longest stretch of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside, [0]])))
    if edges.size == 0:
        return 0, 0
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    return int(edges[2 * longest]), int(edges[2 * longest + 1])


def _held_part(course: Float[np.ndarray, " m"]) -> tuple[int, int]:
    """Where a course, scaled to 0..1, stays near its upper level."""
    high = course[course >= 0.8]
    if high.size == 0:
        return 0, 0
    return _longest_run(np.abs(course - np.median(high)) <= _BAND)


def _are_held(
    profile: Float[np.ndarray, "p m"],
    base: Float[np.ndarray, " p"],
    extents: Sequence[Extent],
) -> bool:
    """Whether most pushes stay at a level instead of passing through a top."""
    votes = []
    for k in range(0, len(extents), 1 + len(extents) // _MAX_VOTES):
        row, level, extent = profile[k], base[k], extents[k]
        if extent.end - extent.start < 2 * _PROFILE_BINS:
            votes.append(False)  # too few samples to show a level
            continue
        course = (row - level) / max(row.max() - level, 1e-300)
        first, last = _held_part(course)
        margin = round(0.15 * (last - first))
        inner = course[first + margin : last - margin]
        if len(inner) < 4:
            votes.append(False)
            continue
        bend = -np.polyfit(np.linspace(-1, 1, len(inner)), inner, 2)[0]
        share = (last - first) / max(1, np.count_nonzero(course > 0.5))
        votes.append(
            share >= _HELD_SHARE and bend <= _MAX_BEND and inner.std() <= _MAX_SCATTER
        )
    return bool(sum(votes) > len(votes) / 2)


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
    profile = _calmed(profile, base, extents, noise)
    for k, extent in enumerate(extents):
        course = (profile[k] - base[k]) / max(profile[k].max() - base[k], 1e-300)
        first, last = _held_part(course)
        margin = 0.15 * (last - first)
        share = np.array([first + margin, max(last - margin, first + margin + 1)])
        step = (extent.t_end - extent.t_start) / _PROFILE_BINS
        windows[k] = extent.t_start + share * step
    parts, counts = _bin_means(time, signal, windows, 8)
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
    step = float(np.median(np.diff(time[:_STEP_SAMPLES])))
    todo = np.arange(len(extents))
    while todo.size:
        bins, counts = _bin_means(time, signal, windows[todo], N_BINS)
        n = counts.sum(axis=1)
        per_bin = noise.of_mean(n / N_BINS)
        fit = fit_apex(bins, per_bin)
        misfit = np.maximum(fit.misfit, 1.0)
        middle = windows[todo].mean(axis=1)
        half = np.diff(windows[todo], axis=1)[:, 0] / 2
        level[todo] = np.where(np.isnan(fit.height), bins.max(axis=1), fit.height)
        excess = np.where(fit.misfit > _MAX_MISFIT, np.sqrt(misfit), 1.0)
        sd[todo] = np.where(np.isnan(fit.sd), per_bin, fit.sd) * np.where(
            np.isfinite(excess), excess, 1.0
        )
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
        last = right[0] + 0.5 if right.size else float(_PROFILE_BINS)
        step = (extent.t_end - extent.t_start) / _PROFILE_BINS
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
