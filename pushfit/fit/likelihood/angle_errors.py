"""Errors of the push angles as scatter of the heights: errors in variables.

To first order an elevation off by δ moves a height by δ ∂h/∂θ, so that angles with
standard deviations s_θ and s_α, drawn anew for every push, add

    (∂h/∂θ)² s_θ² + (∂h/∂α)² s_α²

to the variance of every height. Slopes are those of the model at the best fit, which is
sought again under the new weights. Excluded: an offset that all repeats of a direction
share, and its correlation between the channels of one push.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs import compiled
from pushfit.model import Pushes


@compiled
def angle_slopes(problem: Problem, y: Float[Array, " q"]) -> Float[Array, "2 c n"]:
    """Slopes of noise-free heights in θ and α [table unit/rad].

    Args:
        problem: Problem.
        y: Data coordinates.
    """
    state = problem.data_state(y)

    def heights(
        theta: Float[Array, " n"], alpha: Float[Array, " n"]
    ) -> Float[Array, "c n"]:
        return replace(problem, pushes=Pushes(theta, alpha)).predict(state)

    angles = (problem.pushes.theta, problem.pushes.alpha)
    ones = jnp.ones_like(angles[0])
    along = ((ones, 0 * ones), (0 * ones, ones))
    return jnp.stack([jax.jvp(heights, angles, tangent)[1] for tangent in along])


def angle_scatter(
    problem: Problem, y: Float[Array, " q"], angle_sd: tuple[float, float]
) -> Float[np.ndarray, "c n"]:
    """Standard deviations that errors of the angles add to heights [table unit].

    Args:
        problem: Problem, its coordinates those of y.
        y: Data coordinates of a fit.
        angle_sd: Standard deviations of θ and α [rad].
    """
    if not any(angle_sd):
        return np.zeros(problem.mask.shape)
    slopes = np.where(problem.mask, np.asarray(angle_slopes(problem, y)), 0.0)
    return np.hypot(slopes[0] * angle_sd[0], slopes[1] * angle_sd[1])
