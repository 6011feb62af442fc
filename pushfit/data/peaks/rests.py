"""The rests between pushes: their level, their drift and their noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int, Real

from pushfit.data.pushes.detection import Extent
from pushfit.data.pushes.feet import Feet
from pushfit.data.pushes.noise import Noise

# Share of the time between two pushes in which the signal comes to rest.
_TAIL = 0.5
# A rest of fewer samples shows no level.
_FEWEST = 3
_FEWEST_BLOCKS = 4
# Share of the height by which a rest may lie above the one after the push, if it is
# short: the signal had not come to rest.
_MAX_UNREST = 0.1
# Share of the height by which drift may move the rest under a push; sensors and grasps
# are shifted by more. And how many sd a rest may move that has settled.
_SHIFT, _UNSETTLED = 0.08, 4.0
# The mean of the middle half scatters by 9 % more than the mean.
_MIDDLE = 1.09
_ALL = slice(None)
# Long enough for several pushes, short enough for drift [s].
_STRETCH = 30.0
_BLOCK, _SMALL_BLOCK = 16, 8
_MAX_SAMPLES = 1024
# Sensors undershoot after a release by a few percent of a push; what falls below rest
# by more than this share of the highest push is no undershoot.
_DIP = 0.25
# Time at either end of a recording that stands for rest, too short for a push [s].
_END = 0.2
# Noise of the ends of a recording that is no difference of level [sigma].
_SLACK = 4.0
_ROUNDING = 1e-9
_MAX_BLOCKS = 1 << 14


@dataclass(frozen=True, slots=True, kw_only=True)
class RestNoise:
    """Noise of samples at rest beside each push.

    Args:
        sigma: Standard deviation of a sample [unit].
        correlation: Variance of a mean over that of independent samples.
        quantum: Resolution [unit].
    """

    sigma: Float[np.ndarray, " p"]
    correlation: Float[np.ndarray, " p"]
    quantum: float

    def of(self, rows: Int[np.ndarray, " r"]) -> "RestNoise":
        """Noise beside some of the pushes."""
        return RestNoise(
            sigma=self.sigma[rows],
            correlation=self.correlation[rows],
            quantum=self.quantum,
        )

    def of_mean(
        self,
        n_samples: Real[np.ndarray, " p"],
        rows: Int[np.ndarray, " p"] | slice = _ALL,
    ) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of so many samples beside some pushes [unit]."""
        sigma = self.sigma[rows]
        variance = self.correlation[rows] * sigma**2 / np.maximum(n_samples, 1.0)
        return np.sqrt(variance + self._rounding(sigma))

    def of_part(
        self,
        n_samples: Real[np.ndarray, " p"],
        rows: Int[np.ndarray, " p"] | slice = _ALL,
    ) -> Float[np.ndarray, " p"]:
        """Standard deviations of means of neighbouring samples [unit].

        Without correlation, which a few rests show badly: what is slower than a part of
        a push has to show in the push itself.
        """
        sigma = self.sigma[rows]
        variance = sigma**2 / np.maximum(n_samples, 1.0)
        return np.sqrt(variance + self._rounding(sigma))

    def _rounding(self, sigma: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Variance that is not averaged out where noise does not reach a count."""
        return np.where(sigma < self.quantum / 2, self.quantum**2 / 12, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Rest level under each push, from the rests beside it and from nothing else.

        level(t) = level + slope (t - time)

    Args:
        level: Mean of the rest before the push; of that after it where the samples
            show none before, NaN where they show neither [unit].
        time: Middle of that rest [s].
        slope: Drift to the rest after the push [unit/s].
        doubt: Drift that may be a shift instead [unit/s].
        sd: Standard deviation of `level` [unit].
        sd_after: Standard deviation of the level that `slope` leads to [unit].
        time_after: Its time; NaN where there is none [s].
    """

    level: Float[np.ndarray, " p"]
    time: Float[np.ndarray, " p"]
    slope: Float[np.ndarray, " p"]
    doubt: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]
    sd_after: Float[np.ndarray, " p"]
    time_after: Float[np.ndarray, " p"]

    def drift(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Change of the level since `time` [unit].

        Args:
            when: A time for each push [s].
        """
        return self.slope * (when - self.time)

    def sd_at(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviation of the level [unit].

        Args:
            when: A time for each push [s].
        """
        since = when - self.time
        share = np.where(
            self.slope == 0.0,
            0.0,
            since / np.maximum(self.time_after - self.time, 1e-9),
        )
        share = np.nan_to_num(share)
        own, after = (1 - share) * self.sd, share * np.nan_to_num(self.sd_after)
        return np.sqrt(own**2 + after**2 + (self.doubt * since) ** 2)


def rest_windows(
    time: Float[np.ndarray, " n"], extents: Sequence[Extent], *, is_long: bool = False
) -> tuple[Int[np.ndarray, "p 2"], Int[np.ndarray, "p 2"]]:
    """Samples of the rests before and after each push, first and one past the last.

    They are measured from the feet of the push, so that a neighbour or an end of the
    recording can only cut them short, never move them.

    Args:
        time: Sample times [s].
        extents: Pushes in order.
        is_long: Whether to take all that is settled, to judge the noise.

    Returns:
        Rests before and after; empty where there is none.
    """
    feet = Feet.together([extent.feet for extent in extents])
    before, after = np.stack(feet.before, axis=1), np.stack(feet.after, axis=1)
    if is_long:
        before[:, 0] -= _MAX_SAMPLES * feet.step
        after[:, 1] += _MAX_SAMPLES * feet.step
    room = feet.start[1:] - feet.end[:-1]
    before[1:, 0] = np.maximum(before[1:, 0], feet.end[:-1] + _TAIL * room)
    # In a short rest a part of it has to do.
    before[1:, 1] = np.maximum(before[1:, 1], feet.start[1:] - _TAIL * room / 2)
    middle = feet.end[:-1] + room / 2
    after[:-1, 1] = np.maximum(np.minimum(after[:-1, 1], middle), after[:-1, 0])
    return np.searchsorted(time, before), np.searchsorted(time, after)


def baselines(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    noise: RestNoise,
) -> Baselines:
    """Rest levels under pushes, each by its own rests.

    The rest before a push is its baseline. That after it tells of drift, unless it is
    off by more than drift can be, or has not settled: then the grasp or the sensor has
    changed under the push, and what lies between is doubt.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Pushes in order.
        noise: Noise beside each push.

    Returns:
        The baselines.
    """
    windows = rest_windows(time, extents)
    # Rests before and after, by level, middle and number of samples.
    parts = [np.array([_rest(time, signal, w) for w in own]) for own in windows]
    (level, when, n), (level_after, when_after, n_after) = (p.T for p in parts)
    sd, sd_after = (_MIDDLE * noise.of_mean(count) for count in (n, n_after))
    height = np.array([max(e.height, 1e-300) for e in extents])
    only_after = np.isnan(level) | _is_unrest(extents, level - level_after, height)
    rate = (level_after - level) / np.maximum(when_after - when, 1e-9)
    shift = np.clip((level_after - level) / height, -1e3, 1e3)
    unsettled = np.clip(_unsettled(signal, time, windows[1], rate, noise), -1e3, 1e3)
    trust = 1 / (1 + (shift / _SHIFT) ** 4) / (1 + (unsettled / _UNSETTLED) ** 4)
    has_both = np.isfinite(rate) & ~only_after
    starts = np.array([e.t_start for e in extents])
    return Baselines(
        level=_filled(np.where(only_after, level_after, level), signal),
        time=np.nan_to_num(np.where(only_after, when_after, when), nan=0.0)
        + np.where(only_after & np.isnan(when_after), starts, 0.0),
        slope=np.where(has_both, trust * rate, 0.0),
        doubt=np.where(has_both, (1 - trust) * np.abs(rate) / 2, 0.0),
        sd=np.where(only_after, sd_after, sd),
        sd_after=sd_after,
        time_after=when_after,
    )


def _rest(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    window: Int[np.ndarray, " 2"],
) -> tuple[float, float, int]:
    """Level, middle and samples of a rest; NaN where there is next to nothing of it."""
    first, last = (int(k) for k in window)
    if last - first < _FEWEST:
        return np.nan, np.nan, 0
    part = slice(first, last)
    return _middle_mean(signal[part]), float(time[part].mean()), last - first


def _filled(
    level: Float[np.ndarray, " p"], signal: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " p"]:
    """Levels, those of pushes without any rest beside them from the nearest others."""
    known = np.flatnonzero(np.isfinite(level))
    if known.size == 0:
        return np.full(len(level), float(signal.min()))
    return np.interp(np.arange(len(level)), known, level[known])


def _is_unrest(
    extents: Sequence[Extent],
    excess: Float[np.ndarray, " p"],
    height: Float[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """Whether the signal did not come to rest before a push, but did so after it."""
    is_short = np.array(
        [False, *(b.t_start - a.t_end < b.width / 2 for a, b in pairwise(extents))]
    )
    return is_short & (np.nan_to_num(excess) > _MAX_UNREST * height)


def _unsettled(
    signal: Float[np.ndarray, " n"],
    time: Float[np.ndarray, " n"],
    windows: Int[np.ndarray, "p 2"],
    rate: Float[np.ndarray, " p"],
    noise: RestNoise,
) -> Float[np.ndarray, " p"]:
    """How far the rests after pushes move besides their drift [sd]."""
    moved, expected, n = np.zeros((3, len(windows)))
    for k, (first, last) in enumerate(windows.tolist()):
        half = (last - first) // 2
        if half < _FEWEST:
            continue
        early, late = slice(first, first + half), slice(last - half, last)
        moved[k] = signal[late].mean() - signal[early].mean()
        expected[k] = np.nan_to_num(rate[k]) * (time[late].mean() - time[early].mean())
        n[k] = half
    return np.where(n > 0, (moved - expected) / (2**0.5 * noise.of_part(n) + 1e-300), 0)


def rest_curve(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Rest level of a signal that pushes may raise or lower.

    The middle of the densest quarter of the readings, in stretches of half a minute:
    rest is what a signal that goes both ways has in common with itself.

    Args:
        time: Sample times [s].
        signal: Samples.

    Returns:
        Level at every sample.
    """
    return np.interp(time, *_rest_knots(time, signal))


def _rest_knots(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Middles of stretches and their rest levels."""
    n_stretches = max(1, round((time[-1] - time[0]) / _STRETCH))
    edges = np.linspace(time[0], time[-1], n_stretches + 1)
    index = np.searchsorted(time, edges)
    index[-1] = len(time)
    middles, levels = [], []
    for first, last in pairwise(index):
        # A sample of the samples is enough for a level.
        ordered = np.sort(signal[first : last : max(1, (last - first) // 4096)])
        if len(ordered) == 0:
            continue
        n = max(1, len(ordered) // 4)
        widths = ordered[n - 1 :] - ordered[: len(ordered) - n + 1]
        # Of counts many stretches are equally dense; rounding must not choose.
        narrow = widths.min() + _ROUNDING * (ordered[-1] - ordered[0])
        ties = np.flatnonzero(widths <= narrow)
        start = int(ties[len(ties) // 2])
        levels.append(np.median(ordered[start : start + n]))
        middles.append((time[first] + time[last - 1]) / 2)
    return np.array(middles), np.array(levels)


def without_dips(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents_of: Callable[[Float[np.ndarray, " n"]], tuple[Extent, ...]],
) -> tuple[Float[np.ndarray, " n"], tuple[Extent, ...]]:
    """Fill what falls far below rest up to it.

    Rest is the level that most readings have in common. That may be one of long
    plateaus: where it lies clearly above the lower end of the recording, rest is that
    end. The lower one, because the other may lie inside a push or beyond a step.

    Args:
        time: Sample times [s].
        signal: Samples.
        extents_of: Finds the humps of a picture.

    Returns:
        The signal with the dips filled, itself if there are none; and the dips.
    """
    n_first, n_last = np.searchsorted(time, [time[0] + _END, time[-1] - _END])
    n_last = min(int(n_last), len(time) - 5)
    ends = (np.median(signal[: max(5, int(n_first))]), np.median(signal[n_last:]))
    knots = _rest_knots(time, signal)
    n_end = max(5, int(n_first))
    slack = _SLACK * Noise.of(signal).sigma / n_end**0.5

    def rest_at(when: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        usual = np.interp(when, *knots)
        return np.where(usual > min(ends) + slack, min(ends), usual)

    # Nearly all recordings end here, so this looks at the extremes of short blocks.
    blocks = np.arange(0, len(time), 1 + len(time) // _MAX_BLOCKS)
    rest = rest_at(time[blocks])
    least = _DIP * float((np.maximum.reduceat(signal, blocks) - rest).max())
    if (rest - np.minimum.reduceat(signal, blocks)).max() <= max(0.0, least):
        return signal, ()
    rest = rest_at(time)
    depth = np.maximum(rest - signal, 0.0)
    dips = tuple(dip for dip in extents_of(depth) if dip.height > least)
    filled = signal.copy() if dips else signal
    for dip in dips:
        # With its fringe, which would be the foot of whatever comes next.
        edges = [dip.t_start - dip.width / 2, dip.t_end + dip.width / 2]
        part = slice(*np.searchsorted(time, edges))
        filled[part] = np.maximum(signal[part], rest[part])
    return filled, dips


def rest_noise(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
) -> RestNoise:
    """Noise of the samples at rest beside each push, and how far it averages out.

    Args:
        time: Sample times [s].
        signal: Samples [unit].
        extents: Pushes in order.

    Returns:
        The noise; that of all rests beside a push whose own are too short.
    """
    general = Noise.of(signal)
    floor = general.quantum**2 / 12
    near = list(zip(*rest_windows(time, extents), strict=True))
    far = list(zip(*rest_windows(time, extents, is_long=True), strict=True))
    around = [[_blocks(signal, w, _BLOCK) for w in pair] for pair in far]
    everywhere = _correlation([b for pair in around for b in pair], floor) or 1.0
    return RestNoise(
        sigma=np.array(
            [
                _scatter(signal, beside, floor)
                or _scatter(signal, between, floor)
                or general.sigma
                for beside, between in zip(near, far, strict=True)
            ]
        ),
        correlation=np.array([_correlation(p, floor) or everywhere for p in around]),
        quantum=general.quantum,
    )


def _blocks(
    signal: Float[np.ndarray, " n"], window: Int[np.ndarray, " 2"], length: int
) -> Float[np.ndarray, "b m"]:
    """Samples of a rest in blocks, those nearest to its end."""
    first, last = (int(k) for k in window)
    n_blocks = min(max(last - first, 0), _MAX_SAMPLES) // length
    return signal[last - n_blocks * length : last].reshape(n_blocks, length)


def _scatter(
    signal: Float[np.ndarray, " n"],
    windows: Sequence[Int[np.ndarray, " 2"]],
    floor: float,
) -> float | None:
    """Standard deviation of a sample within blocks; None from too few of them."""
    blocks = np.concatenate([_blocks(signal, w, _SMALL_BLOCK) for w in windows])
    if len(blocks) < _FEWEST_BLOCKS:
        return None
    return float(np.sqrt(max(float(blocks.var(axis=1, ddof=1).mean()), floor)))


def _correlation(
    blocks: Sequence[Float[np.ndarray, "_ m"]], floor: float
) -> float | None:
    """Variance of means over that of independent samples; None from too few blocks."""
    steps = [np.diff(b.mean(axis=1)) for b in blocks if len(b) > 1]
    n_steps = sum(map(len, steps))
    if n_steps < _FEWEST_BLOCKS:
        return None
    within = float(np.mean(np.concatenate(blocks).var(axis=1, ddof=1)))
    between = float(np.mean(np.concatenate(steps) ** 2)) / 2
    correlation = between * _BLOCK / max(within, floor, 1e-300)
    # Beyond chance only: the ratio itself scatters by sqrt(2/n).
    return 1.0 if correlation < 1 + 3 * np.sqrt(2 / n_steps) else float(correlation)


def _middle_mean(samples: Float[np.ndarray, " n"]) -> float:
    """Mean of the middle half: robust, and finer than a median of counts."""
    ordered = np.sort(samples)
    cut = len(ordered) // 4
    return float(ordered[cut : len(ordered) - cut].mean())
