"""Draws from densities whose logs are known at nodes.

Excluded: what they are densities of.
"""

import numpy as np
from jaxtyping import Float

from pushfit.parameters import TINY

# Depth below the peak at which a log density is held: exp of it, 1e-304, is still above
# the least number that is not flushed to 0.
DEPTH = 700.0
# A log density that rises by less over a segment is flat there: expm1(x)/x is 0/0.
# Drawn numbers alone follow, no derivatives, so that no series is needed.
FLAT = 1e-9


def draw_from_nodes(
    nodes: Float[np.ndarray, "n m"],
    log_density: Float[np.ndarray, "n m"],
    uniform: Float[np.ndarray, "n d"],
) -> Float[np.ndarray, "n d"]:
    """Draws from densities that are exponential between neighbouring nodes.

    A chord of a concave log density lies below it by nearly the same share
    everywhere, so the draws are right to fourth order in the distance of the nodes.

    Args:
        nodes: Ascending nodes of each density.
        log_density: Log of the density there, unnormalised; -inf allowed.
        uniform: Numbers in (0, 1) that become the draws.

    Returns:
        Draws, as many per density as there are numbers.
    """
    top = np.max(log_density, axis=1, keepdims=True)
    level = np.maximum(log_density - top, -DEPTH)
    step, rise = np.diff(nodes, axis=1), np.diff(level, axis=1)
    # ∫ exp over a segment: exp(left) (e^rise - 1) / rise, and its limit 1 at rise 0.
    is_flat = np.abs(rise) < FLAT
    safe = np.where(is_flat, 1.0, rise)
    mass = np.exp(level[:, :-1]) * step * np.where(is_flat, 1.0, np.expm1(rise) / safe)
    total = np.cumsum(mass, axis=1)
    wanted = uniform * total[:, -1:]
    rows = np.arange(nodes.shape[0])[:, None]
    segment = np.sum(total[:, None, :] < wanted[:, :, None], axis=2)
    segment = np.minimum(segment, step.shape[1] - 1)
    before = np.where(segment > 0, total[rows, segment - 1], 0.0)
    share = (wanted - before) / np.maximum(mass[rows, segment], TINY)
    share = np.clip(share, 0.0, 1.0)
    slope, flat = safe[rows, segment], is_flat[rows, segment]
    part = np.where(flat, share, np.log1p(share * np.expm1(slope)) / slope)
    return nodes[rows, segment] + part * step[rows, segment]
