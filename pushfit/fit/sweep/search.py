"""Conditional modes: damped Gauss-Newton steps with some coordinates held.

Excluded: the grid of them, and their masses (`pushfit.fit.sweep.sheet`).
"""

from collections.abc import Callable
from typing import Protocol, TypeVar, runtime_checkable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from pushfit.fit.sweep.cholesky import cholesky, solve
from pushfit.fit.sweep.target import Expansion
from pushfit.model import Scalar
from pushfit.parameters import TINY

# Longest step of a coordinate, in logs: beyond it the expansion says nothing.
MAX_STEP = 1.5
# Damping at first, and its factors after a step that helps and one that does not: with
# others as many draws count.
DAMPING, EASE, TIGHTEN = 1e-3, 0.2, 5.0

N = TypeVar("N")
S = TypeVar("S")
K = TypeVar("K")
Count = int | Int[Array, ""]


@runtime_checkable
class Objective(Protocol):
    """A sum of squares and a normal prior beside it, for a vector of coordinates."""

    @property
    def mean(self) -> Float[Array, " q"]:
        """Mean of the normal prior."""
        ...

    @property
    def precision(self) -> Float[Array, "q q"]:
        """Precision, the inverse covariance, of the normal prior."""
        ...

    def expand(self, y: Float[Array, " q"], /) -> Expansion:
        """What is to be least, and the same without the prior: slope and curvature."""
        ...


class Round(eqx.Module):
    """Searches side by side.

    Args:
        starts: Where each may begin.
        is_free: Which of its coordinates may move.
        held: What its objective is told, beside the coordinates.
        n_starts: How many of the starts are tried.
        n_steps: Evaluations after those of the starts.
    """

    starts: Float[Array, "n k q"]
    is_free: Bool[Array, "n q"]
    held: Float[Array, "n h"]
    n_starts: Count
    n_steps: Count


# What is to be least, given what a search holds.
ObjectiveOf = Callable[[Float[Array, " h"]], Objective]


def in_rounds(
    target: ObjectiveOf,
    numbers: N,
    first: Round,
    *,
    state: S,
    onward: Callable[[N, Expansion, S], tuple[K, Round, S]],
) -> tuple[S, K]:
    """Searches in rounds, each from what the one before found.

    All share one evaluation, which is what takes long to compile and to load.

    Args:
        onward: What is kept of a round, given its numbers and ends, and the next one.

    Returns:
        The last state, and what was kept, by round.
    """

    def round_(carry: tuple[Round, S], number: N) -> tuple[tuple[Round, S], K]:
        this, state = carry
        kept, following, state = onward(number, descend(target, this), state)
        return (following, state), kept

    # Counts are numbers of the program's own: those that Python knows change nothing.
    first = jax.tree.map(jnp.asarray, first)
    (_, state), kept = jax.lax.scan(round_, (first, state), numbers)
    return state, kept


def descend(target: ObjectiveOf, this: Round) -> Expansion:
    """The best points met on the way down, from the lowest start of each search.

    What is mapped over the searches is a step and not their loop: JAX takes several
    times as long to trace the latter.
    """
    k = this.starts.shape[1]

    def step(
        count: Int[Array, ""],
        carry: tuple[Expansion, Float[Array, " n"], Float[Array, "n q"]],
    ) -> tuple[Expansion, Float[Array, " n"], Float[Array, "n q"]]:
        is_start = count < this.n_starts
        # Starts and steps share one evaluation.
        at_start = this.starts[:, jnp.minimum(count, k - 1)]
        best, damping, wanted = carry
        carry = best, damping, jnp.where(is_start, at_start, wanted)
        return jax.vmap(lambda *one: _step(target, is_start, *one))(
            carry, this.is_free, this.held
        )

    starts = this.starts[:, 0]
    damping = jnp.full(len(starts), DAMPING)
    first = (unknown_expansion(starts), damping, starts)
    best, _, _ = jax.lax.fori_loop(0, this.n_starts + this.n_steps, step, first)
    return best


def _step(
    target: ObjectiveOf,
    is_start: Bool[Array, ""],
    carry: tuple[Expansion, Scalar, Float[Array, " q"]],
    is_free: Bool[Array, " q"],
    held: Float[Array, " h"],
) -> tuple[Expansion, Scalar, Float[Array, " q"]]:
    """A point looked at, and where to look next.

    Args:
        is_start: Whether the point is no step from the best one.
        carry: The best point so far, its damping, and the point.
    """
    objective, (best, damping, wanted) = target(held), carry
    trial = objective.expand(wanted)
    is_better = trial.cost < best.cost
    best = jax.tree.map(lambda a, b: jnp.where(is_better, a, b), trial, best)
    damping = jnp.where(is_better, damping * EASE, damping * TIGHTEN)
    damping = jnp.where(is_start, DAMPING, damping)
    both = is_free[:, None] & is_free[None]
    hessian = jnp.where(both, best.hessian + objective.precision, 0.0)
    extra = jnp.where(is_free, damping * jnp.diag(hessian), 1.0)
    slope = best.gradient + objective.precision @ (best.y - objective.mean)
    factor = cholesky(hessian + jnp.diag(extra))
    move = solve(factor, jnp.where(is_free, -slope, 0.0))
    longest = jnp.max(jnp.abs(move))
    move = move * jnp.minimum(1.0, MAX_STEP / jnp.maximum(longest, TINY))
    return best, damping, best.y + move


def unknown_expansion(y: Float[Array, "*n q"]) -> Expansion:
    """Points of which nothing is known."""
    q = y.shape[-1]
    return Expansion(
        y=y,
        misfit=jnp.full(y.shape[:-1], jnp.inf),
        cost=jnp.full(y.shape[:-1], jnp.inf),
        gradient=jnp.zeros(y.shape),
        hessian=jnp.zeros((*y.shape, q)),
    )
