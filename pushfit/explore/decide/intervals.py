"""Shortest intervals of weighted draws and of tables of probability.

An angle that is undefined (NaN: the contact never rolls) lies in no interval but counts
towards the whole, so an interval can only be had where enough draws have the angle.
Excluded: the intervals of a result (`pushfit.fit.problem.derived`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pushfit.parameters import HALF_TURN, TINY


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedAngle:
    """An angle and what would count as deciding it.

    Args:
        values: Its draws; NaN where undefined [deg].
        is_axis: Whether it is an azimuth of period 180°, all of which are reached.
        width: Width asked for [deg].
        prob: Probability that an interval must have.
    """

    values: Float[np.ndarray, " n"]
    is_axis: bool
    width: float
    prob: float


def shortest_interval(
    target: AskedAngle, weights: Float[np.ndarray, " n"]
) -> tuple[float, float] | None:
    """Shortest interval of an angle with the probability asked for.

    Args:
        weights: Weights of its draws, which sum to 1.

    Returns:
        Lower and upper end [deg]; of an axis the lower lies in [0, 180) and the upper
        may exceed 180. None where no interval has that much weight.
    """
    known = np.isfinite(target.values)
    values, weights = target.values[known], weights[known]
    if weights.sum() < target.prob:
        return None
    values = np.mod(values, HALF_TURN) if target.is_axis else values
    order = np.argsort(values, kind="stable")
    values, weights = values[order], weights[order]
    n = values.size
    if target.is_axis:
        values = np.concatenate([values, values + HALF_TURN])
        weights = np.concatenate([weights, weights])
    above = np.cumsum(weights)
    below = np.concatenate([[0.0], above[: n - 1]])
    # An ulp less, so that all the weight there is can be asked for.
    end = np.searchsorted(above, below + target.prob * (1 - 1e-12))
    start = np.arange(n)[end < values.size]
    end = end[end < values.size]
    best = int(np.argmin(values[end] - values[start]))
    return float(values[start[best]]), float(values[end[best]])


def column_widths(
    table: Float[np.ndarray, "g m"], prob: float, *, step: float, is_axis: bool = False
) -> Float[np.ndarray, " m"]:
    """Width of the shortest interval in every column of a table of probability.

    Args:
        table: Probability by bin of the angle and column; what is missing of a
            column to 1 has no angle.
        step: Width of a bin [deg].
        is_axis: Whether the bins go once round an axis.

    Returns:
        Widths, interpolated within bins; infinite where no interval suffices [deg].
    """
    g = table.shape[0]
    columns = (np.concatenate([table, table]) if is_axis else table).T
    above = np.concatenate(
        [np.zeros((columns.shape[0], 1)), np.cumsum(columns, axis=1)], axis=1
    )
    # Each column on a stretch of its own, so that one search serves them all.
    stretch = 4.0 * np.arange(above.shape[0])[:, None]
    target = above[:, :g] + prob
    found: Int[np.ndarray, "m g"] = np.searchsorted(
        (above + stretch).ravel(), (target + stretch).ravel()
    ).reshape(target.shape)
    end = found - above.shape[1] * np.arange(above.shape[0])[:, None]
    is_there = target <= above[:, -1:]
    end = np.clip(end, 1, above.shape[1] - 1)
    high = np.take_along_axis(above, end, axis=1)
    low = np.take_along_axis(above, end - 1, axis=1)
    part = np.clip((target - low) / np.maximum(high - low, TINY), 0.0, 1.0)
    widths = np.where(is_there, end - 1 + part - np.arange(g), np.inf)
    return step * np.min(widths, axis=1)
