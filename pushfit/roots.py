"""Roots of functions of one number, many at a time, with derivatives.

Newton steps inside a bracket that always holds the root; where a step would leave it,
the bracket is halved. Excluded: anything that knows what a push is.
"""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

# Relative step at which the search ends: that step leaves about its square, and the one
# after it, which also carries the derivatives, the square of that.
RTOL = 1e-5
# Halving alone would take this many steps to reach it from a bracket of length 1.
MAX_STEPS = 60
# Steps before the first question whether all have arrived, without narrowing the
# bracket: one loop over the entries, where each step of the search is several. Three
# were measured to be slower.
N_UNROLLED = 2
# Smallest slope, as a share of the mean slope over the bracket: at a fold the
# derivative of a root is infinite, and one that large serves nobody.
SMALLEST_SLOPE = 1e-6

C = TypeVar("C")
Numbers = Float[Array, " n"]


class _Search(eqx.Module):
    """State of a search: bracket, best guess and which entries have arrived."""

    x: Numbers
    lower: Numbers
    upper: Numbers
    has_arrived: Bool[Array, " n"]
    n_steps: Int[Array, ""]


def falling_root(
    function: Callable[[C, Numbers], Numbers],
    context: C,
    bracket: tuple[Numbers, Numbers],
    start: Numbers,
) -> Numbers:
    """Where an elementwise function falls through zero, entry by entry.

        x = x_0 - f(x_0, c) / (∂f/∂x),   x_0 held fixed

    The last Newton step leaves x as it is and gives it the derivatives of the implicit
    function theorem, in forward and in reverse mode.

    Args:
        function: f of the context and of x; the entries must not mix.
        context: c, all numbers that f depends on beside x, to be differentiated.
        bracket: Least and largest x.
        start: First guess.

    Returns:
        Roots to about 1e-15 of their size, of several the one that Newton steps from
        the guess lead to. Without derivatives: the lower end where f is not positive
        there, and the upper where no root was found.
    """
    frozen = jax.lax.stop_gradient(context)
    lower, upper = jax.lax.stop_gradient(bracket)
    at_lower = function(frozen, lower)
    is_falling = at_lower > 0
    guess = jnp.clip(jax.lax.stop_gradient(start), lower, upper)

    def advance(search: _Search) -> _Search:
        value, slope = _with_slope(function, frozen, search.x)
        low = jnp.where(value > 0, search.x, search.lower)
        high = jnp.where(value > 0, search.upper, search.x)
        newton = search.x - value / jnp.where(slope == 0, jnp.inf, slope)
        is_settled = jnp.abs(newton - search.x) <= RTOL * jnp.abs(search.x)
        is_inside = ((newton > low) & (newton < high)) | is_settled
        found = jnp.where(is_inside, newton, (low + high) / 2)
        # Entries that have arrived stay, so that none depends on its neighbours.
        return _Search(
            x=jnp.where(search.has_arrived, search.x, found),
            lower=low,
            upper=high,
            has_arrived=search.has_arrived | is_settled | ~jnp.isfinite(value),
            n_steps=search.n_steps + 1,
        )

    def nearer(x: Numbers) -> Numbers:
        """Newton step, or none where it would leave the bracket."""
        value, slope = _with_slope(function, frozen, x)
        newton = x - value / slope
        return jnp.where((newton > lower) & (newton < upper), newton, x)

    before = guess
    for _ in range(N_UNROLLED - 1):
        before = nearer(before)
    x = nearer(before)
    is_near = (x != before) & (jnp.abs(x - before) <= RTOL * x)
    first = _Search(
        x=jnp.where(is_falling, x, lower),
        lower=lower,
        upper=upper,
        has_arrived=~is_falling | is_near,
        n_steps=jnp.zeros((), int),
    )
    last = jax.lax.while_loop(
        lambda search: ~jnp.all(search.has_arrived) & (search.n_steps < MAX_STEPS),
        advance,
        first,
    )
    has_root = is_falling & last.has_arrived & (last.x > lower)
    value, slope = _with_slope(function, context, jax.lax.stop_gradient(last.x))
    mean_slope = -at_lower / jnp.where(has_root, last.x - lower, 1.0)
    steepest = jnp.where(has_root, SMALLEST_SLOPE * mean_slope, -1.0)
    slope = jnp.minimum(jax.lax.stop_gradient(slope), steepest)
    end = jnp.where(is_falling, upper, lower)
    return jnp.where(has_root, last.x - jnp.where(has_root, value, 0.0) / slope, end)


def _with_slope(
    function: Callable[[C, Numbers], Numbers], context: C, x: Numbers
) -> tuple[Numbers, Numbers]:
    """Value and derivative in x."""
    return jax.jvp(lambda t: function(context, t), (x,), (jnp.ones_like(x),))
