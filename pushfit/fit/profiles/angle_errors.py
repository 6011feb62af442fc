"""Errors of the push angles as scatter of the heights: errors in variables.

To first order an elevation off by δ moves a height by δ ∂h/∂θ, so that angles with
standard deviations s_θ and s_α, drawn anew for every push, add

    (∂h/∂θ)² s_θ² + (∂h/∂α)² s_α²

to the variance of every height. Slopes are those of the model at the best fit, which is
sought again under the new weights. Excluded: an offset that all repeats of a direction
share, and its correlation between the channels of one push.
"""

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.predictions import heights_of, predict_points
from pushfit.fit.problem.problem import Problem
from pushfit.model import Pushes

# Far above the rounding of forces and far below the angles that bend them [rad].
STEP = 1e-6


def angle_slopes(
    problem: Problem, y: Float[np.ndarray, " q"]
) -> Float[np.ndarray, "2 c n"]:
    """Slopes of noise-free heights in θ and α [table unit/rad]."""
    theta, alpha = np.asarray(problem.pushes.theta), np.asarray(problem.pushes.alpha)
    # Central differences: before and behind along each angle.
    turned = Pushes(
        np.concatenate([theta - STEP, theta + STEP, theta, theta]),
        np.concatenate([alpha, alpha, alpha - STEP, alpha + STEP]),
    )
    heights = heights_of(problem, predict_points(problem, y[None], turned))[0]
    of_theta, of_alpha = np.split(heights, 2, axis=1)
    differences = [np.subtract(*np.split(h, 2, axis=1)) for h in (of_theta, of_alpha)]
    slopes = -np.stack(differences) / (2 * STEP)
    return np.where(problem.mask, slopes, 0.0)
