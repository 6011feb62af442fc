"""Jacobians of residuals with respect to a few coordinates.

`jax.jacfwd` works with the coordinates as the last axis of every number on the way:
loops over four entries, which the processor cannot run many at a time. Excluded: what
the residuals are.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

Residuals = Callable[[Float[Array, " q"]], Float[Array, " m"]]
Jacobian = Callable[[Float[Array, " q"]], Float[Array, "m q"]]


def jacobian(function: Residuals) -> Jacobian:
    """As `jax.jacfwd`, one coordinate after the other.

    Args:
        function: Function of the coordinates.

    Returns:
        Its Jacobian as a function of the coordinates.
    """

    def columns(y: Float[Array, " q"]) -> Float[Array, "m q"]:
        def along(direction: Float[Array, " q"]) -> Float[Array, " m"]:
            return jax.jvp(function, (y,), (direction,))[1]

        # Not `jax.vmap`: the compiler would move the axis to the end again.
        return jax.lax.map(along, jnp.eye(y.size)).T

    return columns


def linearised(function: Residuals) -> Residuals:
    """The same function to solvers that differentiate it forward themselves.

        f(y_0) + J(y_0) (y - y_0),   y_0 = y held fixed

    Args:
        function: Function of the coordinates.

    Returns:
        Function of the same values, wherever derivatives are finite, and of the first
        derivatives that `jacobian` has.
    """

    def tangent_plane(y: Float[Array, " q"]) -> Float[Array, " m"]:
        fixed = jax.lax.stop_gradient(y)
        return function(fixed) + jacobian(function)(fixed) @ (y - fixed)

    return tangent_plane
