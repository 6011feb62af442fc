"""Conditional modes: damped Gauss-Newton steps with some coordinates held."""

from typing import Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from pushfit.fit.sweep.cholesky import cholesky, solve
from pushfit.fit.sweep.target import Expansion

# Longest step of a coordinate, in logs: beyond it the expansion says nothing.
MAX_STEP = 1.5
# Damping at first, and its factors after a step that helps and one that does not.
DAMPING, EASE, TIGHTEN = 1e-3, 0.2, 5.0


@runtime_checkable
class Objective(Protocol):
    """A sum of squares and a normal prior beside it, for a vector of coordinates."""

    @property
    def mean(self) -> Float[Array, " q"]:
        """Of the normal prior."""
        ...

    @property
    def precision(self) -> Float[Array, "q q"]:
        """Of the normal prior."""
        ...

    def expand(self, y: Float[Array, " q"], /) -> Expansion:
        """What is to be least, and the same without the prior: slope and curvature."""
        ...


def descend(
    target: Objective,
    starts: Float[Array, "k q"],
    is_free: Bool[Array, " q"],
    n_steps: int,
) -> Expansion:
    """The best point met on the way down.

    Args:
        starts: Where to begin: from the lowest of them.
        is_free: Which coordinates may move.
        n_steps: Evaluations after those of the starts.
    """
    both = is_free[:, None] & is_free[None]
    k, q = starts.shape

    def step(
        carry: tuple[Expansion, Array, Array], count: Array
    ) -> tuple[tuple[Expansion, Array, Array], None]:
        best, damping, wanted = carry
        is_start = count < k
        # Starts and steps share one evaluation, which is what takes long to compile.
        wanted = jnp.where(is_start, starts[jnp.minimum(count, k - 1)], wanted)
        trial = target.expand(wanted)
        is_better = trial.cost < best.cost
        best = jax.tree.map(lambda a, b: jnp.where(is_better, a, b), trial, best)
        damping = jnp.where(is_better, damping * EASE, damping * TIGHTEN)
        damping = jnp.where(is_start, DAMPING, damping)
        hessian = jnp.where(both, best.hessian + target.precision, 0.0)
        extra = jnp.where(is_free, damping * jnp.diag(hessian), 1.0)
        slope = best.gradient + target.precision @ (best.y - target.mean)
        factor = cholesky(hessian + jnp.diag(extra))
        move = solve(factor, jnp.where(is_free, -slope, 0.0))
        longest = jnp.max(jnp.abs(move))
        move = move * jnp.minimum(1.0, MAX_STEP / jnp.maximum(longest, 1e-300))
        return (best, damping, best.y + move), None

    nothing = Expansion(
        y=starts[0],
        misfit=jnp.asarray(jnp.inf),
        cost=jnp.asarray(jnp.inf),
        gradient=jnp.zeros(q),
        hessian=jnp.zeros((q, q)),
    )
    first = (nothing, jnp.asarray(DAMPING), starts[0])
    (best, _, _), _ = jax.lax.scan(step, first, jnp.arange(k + n_steps))
    return best
