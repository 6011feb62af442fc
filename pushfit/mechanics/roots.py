"""Roots of functions of one number, many at a time, with derivatives.

Newton steps inside a bracket that always holds the root; where a step would leave it,
or is hardly shorter than the last one, the bracket is halved. Excluded: anything that
knows what a push is.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Int

from pushfit.mechanics.containers import Vector

# Relative step at which the search ends: that step leaves about its square, and the one
# after it, which also carries the derivatives, the square of that.
RTOL = 2e-4
# Newton's steps go to and fro for ever across some kinks: each is at most this share of
# the one before it.
SHORTER = 0.9
# Halving alone would take this many steps to reach it from a bracket of length 1.
MAX_STEPS = 60
# Smallest slope, as a share of the mean slope over the bracket: at a fold the
# derivative of a root is infinite, and one that large serves nobody.
SMALLEST_SLOPE = 1e-6

C = TypeVar("C")


class _Search(eqx.Module):
    """State of a search.

    Args:
        x: Last points.
        lower: Lower ends of the brackets.
        upper: Upper ends of the brackets.
        newton: Where Newton's step leads from the last point.
        length: Of the step that led to it.
        n_steps: Steps taken.
    """

    x: Vector
    lower: Vector
    upper: Vector
    newton: Vector
    length: Vector
    n_steps: Int[Array, ""]

    @property
    def has_arrived(self) -> Bool[Array, " n"]:
        """Entries whose step is short, or whose function is not a number."""
        is_settled = jnp.abs(self.newton - self.x) <= RTOL * jnp.abs(self.x)
        return is_settled | jnp.isnan(self.newton)

    @property
    def is_over(self) -> Bool[Array, " n"]:
        """Entries that have arrived, or whose bracket leaves nothing to look for."""
        is_narrow = self.upper - self.lower <= RTOL * self.upper
        return self.has_arrived | is_narrow


def falling_root(
    function: Callable[[C, Vector], Vector],
    context: C,
    bracket: tuple[Vector, Vector],
    *,
    start: Vector,
) -> Vector:
    """Where an elementwise function falls through zero, entry by entry.

        x = x_0 - f(x_0, c) / (∂f/∂x),   x_0 held fixed

    The last Newton step leaves x as it is and gives it the derivatives of the implicit
    function theorem, in forward and in reverse mode.

    Args:
        function: f of the context and of x; the entries must not mix.
        context: c, all numbers that f depends on beside x, to be differentiated.
        bracket: Least and largest x.
        start: Guess of x, moved into the bracket.

    Returns:
        Roots to about 1e-15 of their size where f is no more curved than x², and their
        derivatives to about 1e-7; of several roots the one that Newton steps from the
        guess lead to. Without derivatives: the lower end where f is not positive there,
        and the upper where no root was found.
    """
    frozen = jax.lax.stop_gradient(context)
    lower, upper = jax.lax.stop_gradient(bracket)
    at_lower = function(frozen, lower)
    is_falling = at_lower > 0

    def newton(x: Vector) -> Vector:
        """Where Newton's step leads; where f does not fall, out of any bracket."""
        value, slope = _with_slope(function, frozen, x)
        out = jnp.sign(value) * jnp.inf
        # One number, which also tells the sign of f: the compiler would work out f
        # anew for each array that a step keeps.
        return jnp.where(slope < 0, x - value / slope, jnp.where(value == 0, x, out))

    def advance(search: _Search) -> _Search:
        low = jnp.where(search.newton > search.x, search.x, search.lower)
        high = jnp.where(search.newton < search.x, search.x, search.upper)
        is_inside = (search.newton > low) & (search.newton < high)
        is_shorter = jnp.abs(search.newton - search.x) <= SHORTER * search.length
        is_guess = jnp.isnan(search.x)
        is_good = (is_inside & is_shorter) | is_guess
        found = jnp.where(is_good, search.newton, (low + high) / 2)
        # Entries whose search is over stay, so that none depends on its neighbours.
        stays = search.is_over
        return _Search(
            x=jnp.where(stays, search.x, found),
            lower=low,
            upper=high,
            newton=jnp.where(stays, search.newton, newton(found)),
            length=jnp.where(is_guess, jnp.inf, jnp.abs(found - search.x)),
            n_steps=search.n_steps + 1,
        )

    guess = jnp.clip(jax.lax.stop_gradient(start), lower, upper)
    # No step has led to the guess: f stands once in the program, inside the loop.
    first = _Search(
        x=jnp.where(is_falling, jnp.nan, lower),
        lower=lower,
        upper=upper,
        newton=jnp.where(is_falling, guess, lower),
        length=jnp.full_like(lower, jnp.inf),
        n_steps=jnp.zeros((), int),
    )
    last = jax.lax.while_loop(
        lambda search: ~jnp.all(search.is_over) & (search.n_steps < MAX_STEPS),
        advance,
        first,
    )
    root = jax.lax.stop_gradient(last.newton)
    has_root = is_falling & last.has_arrived & (root > lower)
    safe = jnp.where(has_root, root, lower)
    value = function(context, safe)
    _, slope = _with_slope(function, frozen, safe)
    mean_slope = -at_lower / jnp.where(has_root, root - lower, 1.0)
    steepest = jnp.where(has_root, SMALLEST_SLOPE * mean_slope, -1.0)
    step = jnp.where(has_root, value, 0.0) / jnp.minimum(slope, steepest)
    return jnp.where(has_root, root - step, jnp.where(is_falling, upper, lower))


def _with_slope(
    function: Callable[[C, Vector], Vector], context: C, x: Vector
) -> tuple[Vector, Vector]:
    """Value and derivative in x."""
    return jax.jvp(lambda t: function(context, t), (x,), (jnp.ones_like(x),))
