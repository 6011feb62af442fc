"""Functions with their slopes against coordinates.

`jax.jacfwd` works with the coordinates as the last axis of every number on the way:
loops over four entries, which the processor cannot run many at a time. Excluded: what
the functions are.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled
from pushfit.model import as_float

Residuals = Callable[[Float[Array, " q"]], Float[Array, " m"]]
# Points of one call.
N_POINTS = 24


def with_slopes(
    function: Callable[[Float[Array, " q"]], Float[Array, "..."]],
    y: Float[Array, " q"],
    *,
    in_turn: bool = False,
) -> tuple[Float[Array, "..."], Float[Array, "q ..."]]:
    """A function and its slopes, by coordinate.

    What the function takes a search for is sought once, and not for each coordinate.

    Args:
        in_turn: One coordinate after the other, which is faster at a few points, and
            slower at hundreds.
    """
    values, along = jax.linearize(function, y)
    over = jax.lax.map if in_turn else lambda f, x: jax.vmap(f)(x)
    return values, over(along, jnp.eye(y.size))


def linearised(function: Residuals) -> Residuals:
    """The same function to solvers that differentiate it forward themselves.

        f(y_0) + J(y_0) (y - y_0),   y_0 = y held fixed

    Returns:
        Function of the same values, wherever derivatives are finite, and of the first
        derivatives that `with_slopes` has.
    """

    def tangent_plane(y: Float[Array, " q"]) -> Float[Array, " m"]:
        fixed = jax.lax.stop_gradient(y)
        values, slopes = with_slopes(function, fixed, in_turn=True)
        return values + (y - fixed) @ slopes

    return tangent_plane


def residuals_at(
    problem: Problem, points: Float[np.ndarray, "k q"]
) -> tuple[Float[np.ndarray, "k m"], Float[np.ndarray, "k m q"]]:
    """Residuals and their Jacobians at a few data coordinates.

    Args:
        points: Data coordinates, `N_POINTS` of them at most.

    Returns:
        Residuals of the rows, padding included, then those of the constraint; their
        derivatives.
    """
    rows = np.minimum(np.arange(N_POINTS), len(points) - 1)
    found = _residuals_at(problem.of_data, as_float(points[rows]))
    residuals, jacobians = (np.asarray(a)[: len(points)] for a in found)
    return residuals, jacobians


@compiled
def _residuals_at(
    problem: Problem, points: Float[Array, "k q"]
) -> tuple[Float[Array, "k m"], Float[Array, "k m q"]]:
    values, slopes = jax.vmap(lambda y: with_slopes(problem.data_residuals, y))(points)
    return values, slopes.swapaxes(1, 2)
