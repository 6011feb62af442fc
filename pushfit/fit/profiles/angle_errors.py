"""Errors of the push angles as scatter of the heights: errors in variables.

To first order an elevation off by δ moves a height by δ ∂h/∂θ, so that angles with
standard deviations s_θ and s_α, drawn anew for every push, add

    (∂h/∂θ)² s_θ² + (∂h/∂α)² s_α²

to the variance of every height. Slopes are those of the model at the best fit, which is
sought again under the new weights. At θ_c, and wherever else an error may reach beyond
a bend, the square is the mean of those to either side over one standard deviation.
Excluded: an offset that all repeats of a direction share, and its correlation between
the channels of one push.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.predictions import predict_points
from pushfit.fit.problem.problem import Problem

# Of joints that resolve whole degrees: size of errors that nobody states [rad].
COMMON_SD = float(np.radians(1.0))
# Far above the rounding of forces [rad].
SHORTEST = 1e-6


def angle_slopes(
    problem: Problem,
    y: Float[np.ndarray, " q"],
    sizes: Sequence[float] = (COMMON_SD, COMMON_SD),
) -> Float[np.ndarray, "2 2 c n"]:
    """Slopes of noise-free heights in θ and α, behind and ahead [table unit/rad].

    Args:
        sizes: Sizes of the errors of θ and α [rad].
    """
    theta, alpha = problem.angles
    s_theta, s_alpha = steps = np.maximum(sizes, SHORTEST)
    turned = np.stack(
        [
            np.concatenate([theta, theta - s_theta, theta + s_theta, theta, theta]),
            np.concatenate([alpha, alpha, alpha, alpha - s_alpha, alpha + s_alpha]),
        ]
    )
    heights = predict_points(problem, y[None], turned).heights[0]
    here, *beside = np.split(heights, 5, axis=1)
    behind, ahead = np.stack(beside[::2]), np.stack(beside[1::2])
    slopes = (
        np.stack([here - behind, ahead - here], axis=1) / steps[:, None, None, None]
    )
    return np.where(problem.mask, slopes, 0.0)


def steepness(slopes: Float[np.ndarray, "2 2 c n"]) -> Float[np.ndarray, "2 c n"]:
    """What errors of θ and α make heights scatter by, per error [table unit/rad]."""
    return np.sqrt(np.mean(slopes**2, axis=1))
