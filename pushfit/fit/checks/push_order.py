"""What the order of the pushes makes doubtful: drift, and elevations in turn.

Excluded: what else a table says of itself (`pushfit.fit.checks.table_checks`).
"""

from collections.abc import Iterator

import numpy as np
import scipy
from jaxtyping import Float, Int

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.results import ResultWarning

# Of the spread of push numbers, what lies within directions where their repeats were
# made one after another; of whole sweeps it is most.
IN_A_ROW = 0.1
# Chance of a drift that is none, of each kind. At 0.001 it is said of 22 % instead of
# 45 % of sweeps that fall by 15 %, of 17 elevations thrice with noise of 0.5 %.
DRIFT_LEVEL = 0.005
# Rank correlation of push numbers and elevations that are in order, of how many.
IN_ORDER, FEW_ELEVATIONS = 0.95, 5
# Of all pushes, those between two of a direction that was pushed again later.
LATER = 0.5


def drift_in_repeats(table: PeakTable) -> Iterator[ResultWarning]:
    """Whether repeats made in a row drift, as all pushes may do with them.

    Least squares of heights on push numbers, both about the means of their directions,
    by one slope or by one in proportion to these means; nothing is said where most
    directions were pushed again much later.
    """
    rows = np.flatnonzero(table.is_used)
    order = table.frame["push"].to_numpy(dtype=float)[rows]
    within, n_directions = _about_means(order, table.groups[rows])
    degrees_of_freedom = rows.size - n_directions - 1
    if degrees_of_freedom < 1:
        return
    if np.sum(within**2) >= IN_A_ROW * np.var(order) * rows.size:
        return
    for channel in table.channels:
        heights = table.heights(channel)[rows]
        off, _ = _about_means(heights, table.groups[rows])
        by_one = slope_through_zero(off, within, degrees_of_freedom)
        in_proportion = slope_through_zero(
            off, within * (heights - off), degrees_of_freedom
        )
        p_value, slope = min(by_one, in_proportion)
        times, unit = (100, " %") if in_proportion < by_one else (1, "")
        step, whole = times * slope, times * slope * np.ptp(order)
        if p_value < DRIFT_LEVEL:
            yield ResultWarning(
                code="drift_in_repeats",
                text=f"repeats in a row change {channel}_{table.unit} by "
                f"{step:+.2g}{unit} from push to push; if all pushes do, "
                f"{whole:+.2g}{unit} from the first to the last, heights follow their "
                "order as well as their direction, and no interval allows for it: "
                "push in random order, or the directions again in whole sweeps",
            )


def follows_elevation(table: PeakTable) -> bool:
    """Whether pushes went through the elevations in order, and never again.

    A drift of grip or sensor then looks like an effect of θ.
    """
    rows = np.flatnonzero(table.is_used)
    order, theta = table.frame["push"].to_numpy(dtype=float)[rows], table.theta[rows]
    if np.unique(theta.round(6)).size < FEW_ELEVATIONS:
        return False
    group = table.groups[rows]
    longest = max(np.ptp(order[group == one]) for one in np.unique(group))
    is_again = longest > LATER * np.ptp(order)
    rank = scipy.stats.spearmanr(order, theta).statistic
    return bool(not is_again and abs(rank) > IN_ORDER)


def slope_through_zero(
    off: Float[np.ndarray, " n"],
    along: Float[np.ndarray, " n"],
    degrees_of_freedom: int,
) -> tuple[float, float]:
    """Slope of what has no mean, by least squares, and the chance of one so large.

    Returns:
        The chance if there is none, and the slope; 1 and 0 where it is not seen.
    """
    spread = float(along @ along)
    if spread == 0 or degrees_of_freedom < 1:
        return 1.0, 0.0
    slope = float(along @ off) / spread
    scatter = float(np.sum((off - slope * along) ** 2)) / degrees_of_freedom
    statistic = abs(slope) * np.sqrt(spread / scatter) if scatter > 0 else 0.0
    return 2 * float(scipy.special.stdtr(degrees_of_freedom, -statistic)), slope


def _about_means(
    values: Float[np.ndarray, " n"], group: Int[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], int]:
    """Values about the means of their groups, and the number of these."""
    _, inverse, counts = np.unique(group, return_inverse=True, return_counts=True)
    return values - (np.bincount(inverse, values) / counts)[inverse], counts.size
