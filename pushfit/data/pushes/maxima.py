"""Local maxima that stand out, and the mean over three neighbours.

Both are in SciPy, whose packages take longer to load than a recording to evaluate; the
tests compare them.
"""

import numpy as np
from jaxtyping import Float, Int


def prominent_maxima(
    y: Float[np.ndarray, " m"], prominence: float
) -> Int[np.ndarray, " k"]:
    """Positions of local maxima, as `scipy.signal.find_peaks` defines prominence.

    Args:
        y: Signal; its two ends are no maxima.
        prominence: How far it falls to either side, at least, before it is higher.

    Returns:
        Ascending; of a flat top the middle.
    """
    starts = np.flatnonzero(np.diff(y, prepend=np.nan) != 0)
    ends = np.append(starts[1:], len(y)) - 1
    is_up = np.diff(y[starts]) > 0
    tops = np.flatnonzero(is_up[:-1] & ~is_up[1:]) + 1
    if tops.size == 0:
        return tops
    heights = y[starts[tops]]
    lows = np.minimum.reduceat(y[starts], np.insert(tops, 0, 0))
    before = _lows_before(heights, lows[:-1])
    after = _lows_before(heights[::-1], lows[:0:-1])[::-1]
    kept = heights - np.maximum(before, after) >= prominence
    return (starts[tops[kept]] + ends[tops[kept]]) // 2


def _lows_before(
    heights: Float[np.ndarray, " k"], lows: Float[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Lowest between each top and the nearest higher one before it, or the start.

    Args:
        heights: Tops in turn.
        lows: The lowest between each and the one before it.
    """
    found = lows.tolist()
    higher: list[tuple[float, float]] = []
    for k, height in enumerate(heights.tolist()):
        while higher and higher[-1][0] <= height:
            found[k] = min(found[k], higher.pop()[1])
        higher.append((height, found[k]))
    return np.array(found)


def mean_of_three(y: Float[np.ndarray, "*p m"]) -> Float[np.ndarray, "*p m"]:
    """Mean of each value and its two neighbours in a row; the ends stand twice."""
    padded = np.concatenate([y[..., :1], y, y[..., -1:]], axis=-1)
    return (padded[..., :-2] + padded[..., 1:-1] + padded[..., 2:]) / 3
