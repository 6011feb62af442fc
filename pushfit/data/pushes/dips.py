"""Rest of a whole recording, and what falls below it.

Where pushes go both ways, or dips lie between them, a hump is one over the level that
most readings have in common. Excluded: the levels that heights are measured from
(`pushfit.data.peaks.rests`).
"""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from pushfit.data.pushes.found_humps import Extent
from pushfit.data.pushes.noise import SignalNoise

# Long enough for several pushes, short enough for drift [s]. At twice a return from a
# dip counts as a push in `test_returns_from_dips_are_no_pushes`; half changes nothing.
_STRETCH = 30.0
# Sensors undershoot after a release by a few percent of a push; what falls below rest
# by more than this share of the highest push is no undershoot.
_DIP = 0.25
# Beside such a dip lower ones are dips as well, beyond this share of it. It came with
# cuts anywhere of the barometer, whose p0 has dips; half or twice changes no whole one.
_LESSER = 0.4
# Time at either end of a recording that stands for rest, too short for a push [s], and
# samples of it at least.
_END, _FEWEST = 0.2, 5
# Noise of the ends of a recording that is no difference of level, once in 16 000
# [sigma].
_SLACK = 4.0
# Densest stretches of readings that differ by less, as a share of all, are alike: far
# above rounding, 1e-16, far below a count of any sensor.
_ROUNDING = 1e-9
# By this share of what a recording spans its ends may differ and be its rest, as by a
# drift; by the other either end may move in itself, less than a flank does, and a rest
# be off the line from end to end. Not tuned.
_ALIKE, _AT = 0.25, 0.05
# Readings beyond these shares of all, as of a jerk, span nothing. Not tuned.
_SPANNED = 0.01, 0.99
# A level is that of so many readings of a stretch at least, as a share, which are not
# spread farther than so many times the densest of as many, and less than those between
# by so many sd: flanks are. With twice the share, or half of the times, more rests an
# eighth as long as equal holds are missed.
_SHARE, _AS_DENSE, _DENSER = 0.04, 20.0, 4.0
# Readings of a level lie so many widths of its densest around these: those alone may be
# at its edge by chance.
_AROUND = 3.0
# Fewer readings show no level. A quarter or twice as many change no test.
_LEAST = 8
# Resolutions that lie between readings of one level, where counts are coarse. At half
# or twice more trains of counted holds are misread.
_COUNTS = 3.0
# Blocks whose extremes tell whether there are dips at all: more would only cost time.
_MAX_BLOCKS = 1 << 14
# Samples of a stretch that show its level well enough.
_ENOUGH = 4096


def rest_curves(
    time: Float[np.ndarray, " n"], signals: Float[np.ndarray, "k n"]
) -> Float[np.ndarray, "k n"]:
    """Rest levels, at sample times [s], of signals that pushes may raise or lower.

    The middle of the densest quarter of the readings, in stretches of half a minute:
    rest is what a signal that goes both ways has in common with itself. Where another
    level, of fewer readings, is that of both ends of the recording, that one; whether
    these are at rest is told by all signals together, such as those of one force.
    """
    parts = [_stretches(time, signal) for signal in signals]
    spans = np.array([_span(stretches) for _, stretches in parts])
    ends = np.array(
        [[_end_levels(time, own, _END * k) for k in (0, 1)] for own in signals]
    )
    whole = float(np.linalg.norm(spans))
    moved = np.linalg.norm(np.ptp(ends, axis=1), axis=0)
    apart = np.linalg.norm(np.ptp(ends[:, 0], axis=1))
    is_rest = moved.max() <= _AT * whole and apart <= _ALIKE * whole
    curves = []
    for (middles, stretches), span, own in zip(parts, spans, ends, strict=True):
        levels = [_densest(ordered) for ordered in stretches]
        if is_rest:
            near = np.interp(middles, time[[0, -1]], own[0])
            levels = [
                _level_near(expected, ordered, densest=level, slack=_AT * span)
                for expected, ordered, level in zip(
                    near.tolist(), stretches, levels, strict=True
                )
            ]
        curves.append(np.interp(time, middles, levels))
    return np.array(curves)


def _span(stretches: list[Float[np.ndarray, " _"]]) -> float:
    """What nearly all readings span."""
    lows, highs = np.array([np.quantile(own, _SPANNED) for own in stretches]).T
    return float(highs.max() - lows.min())


def _stretches(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
) -> tuple[list[float], list[Float[np.ndarray, " m"]]]:
    """Middles of stretches [s], and some of their readings in order."""
    n_stretches = max(1, round((time[-1] - time[0]) / _STRETCH))
    edges = np.linspace(time[0], time[-1], n_stretches + 1)
    index = np.searchsorted(time, edges)
    index[-1] = len(time)
    middles, stretches = [], []
    for first, last in pairwise(index):
        if first < last:
            some = slice(first, last, max(1, (last - first) // _ENOUGH))
            stretches.append(np.sort(signal[some]))
            middles.append(float((time[first] + time[last - 1]) / 2))
    return middles, stretches


def _end_levels(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"], inside: float = 0.0
) -> tuple[float, float]:
    """Levels near both ends of a recording.

    Args:
        inside: How far from them [s].
    """
    begin, end, n = time[0] + inside, time[-1] - inside, len(time)
    few = min(_FEWEST, n)
    first, stop, last = np.searchsorted(time, [begin, begin + _END, end - _END])
    until = max(int(np.searchsorted(time, end, side="right")), few)
    first, last = min(first, n - few), min(last, until - few)
    return (
        float(np.median(signal[first : max(stop, first + few)])),
        float(np.median(signal[last:until])),
    )


def _densest(ordered: Float[np.ndarray, " m"]) -> float:
    """Middle of the densest quarter of readings that are in order."""
    n = max(1, len(ordered) // 4)
    widths = ordered[n - 1 :] - ordered[: len(ordered) - n + 1]
    # Of counts many stretches are equally dense; rounding must not choose.
    narrow = widths.min() + _ROUNDING * (ordered[-1] - ordered[0])
    ties = np.flatnonzero(widths <= narrow)
    start = int(ties[len(ties) // 2])
    return float(np.median(ordered[start : start + n]))


def _level_near(
    expected: float, ordered: Float[np.ndarray, " m"], *, densest: float, slack: float
) -> float:
    """The densest of the levels near an expected one, if any is there.

    Args:
        ordered: Readings in order.
        densest: Where most of them lie, which stands for what is not there.
        slack: How far it may be off.
    """
    n = max(_LEAST, int(_SHARE * len(ordered)))
    if len(ordered) <= n or abs(densest - expected) < slack:
        return densest
    widths = ordered[n - 1 :] - ordered[: len(ordered) - n + 1]
    # Where counts are equal, some of the next ones are as dense.
    count = np.min(widths, where=widths > 0, initial=np.inf)
    widths = np.maximum(widths, _COUNTS * count)
    middles = ordered[n // 2 : n // 2 + len(widths)]
    first, last = np.searchsorted(middles, [expected - slack, expected + slack])
    if first == last:
        return densest
    nearest = int(first + np.argmin(widths[first:last]))
    own = int(np.clip(np.searchsorted(middles, densest), 0, len(widths) - 1))
    between = widths[min(nearest, own) : max(nearest, own) + 1].max()
    # Widths of so many readings scatter by chance.
    denser = 1 + _DENSER * np.sqrt(2 / n)
    is_level = widths[nearest] <= min(_AS_DENSE * widths.min(), between / denser)
    if not is_level:
        return densest
    level, reach = middles[nearest], _AROUND * widths[nearest]
    around = slice(*np.searchsorted(ordered, [level - reach, level + reach]))
    return float(np.median(ordered[around]))


def without_dips(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    *,
    noise: SignalNoise,
    extents_of: Callable[[Float[np.ndarray, " n"]], tuple[Extent, ...]],
) -> tuple[Float[np.ndarray, " n"], tuple[Extent, ...]]:
    """Fill what falls far below rest up to it.

    Rest is the level that most readings have in common. That may be one of long
    plateaus: where it lies clearly above the lower end of the recording, rest is that
    end. The lower one, because the other may lie inside a push or beyond a step. Where
    both ends do, rest is what most stretches of the recording have in common.

    Returns:
        The signal with the dips filled, itself if there are none; and the dips.
    """
    ends = _end_levels(time, signal)
    middles, stretches = _stretches(time, signal)
    levels = [_densest(ordered) for ordered in stretches]
    n_end = max(_FEWEST, int(np.searchsorted(time, time[0] + _END)))
    slack = _SLACK * noise.sigma / n_end**0.5

    # Where both ends lie inside pushes, a stretch without a rest is told by the others.
    highest = min(*ends, sorted(levels)[(len(levels) - 1) // 2])

    def rest_at(when: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        usual = np.interp(when, middles, levels)
        return np.where(usual > highest + slack, highest, usual)

    # Nearly all recordings end here, so this looks at the extremes of short blocks.
    blocks = np.arange(0, len(time), 1 + len(time) // _MAX_BLOCKS)
    rest = rest_at(time[blocks])
    least = _DIP * float((np.maximum.reduceat(signal, blocks) - rest).max())
    if (rest - np.minimum.reduceat(signal, blocks)).max() <= max(0.0, least):
        return signal, ()
    rest = rest_at(time)
    depth = np.maximum(rest - signal, 0.0)
    falls = extents_of(depth)
    has_dips = any(fall.height > least for fall in falls)
    dips = tuple(f for f in falls if has_dips and f.height > _LESSER * least)
    filled = signal.copy() if dips else signal
    for dip in dips:
        # With its fringe, which would be the foot of whatever comes next.
        edges = [dip.t_start - dip.width / 2, dip.t_end + dip.width / 2]
        part = slice(*np.searchsorted(time, edges))
        filled[part] = np.maximum(signal[part], rest[part])
    return filled, dips
