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

# Longest step of a coordinate, in logs: beyond it the expansion says nothing.
MAX_STEP = 1.5
# Damping at first, and its factors after a step that helps and one that does not.
DAMPING, EASE, TIGHTEN = 1e-3, 0.2, 5.0

N = TypeVar("N")
S = TypeVar("S")
Count = int | Int[Array, ""]


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


class Round(eqx.Module):
    """Searches side by side.

    Args:
        starts: Where each may begin.
        is_free: Which of its coordinates may move.
        n_starts: How many of the starts are tried.
        n_steps: Evaluations after those of the starts.
    """

    starts: Float[Array, "n k q"]
    is_free: Bool[Array, "n q"]
    n_starts: Count
    n_steps: Count


def in_rounds(
    target: Callable[[N], Objective],
    numbers: N,
    first: Round,
    state: S,
    onward: Callable[[N, Expansion, S], tuple[Expansion, Round, S]],
) -> tuple[S, Expansion]:
    """Searches in rounds, each from what the one before found.

    All share one evaluation, which is what takes long to compile and to load.

    Args:
        target: What is to be least in a round, given its numbers.
        numbers: For each round.
        onward: What is kept of a round, given its numbers and ends, and the next one.

    Returns:
        The last state, and what was kept, by round.
    """

    def round_(carry: tuple[Round, S], number: N) -> tuple[tuple[Round, S], Expansion]:
        this, state = carry
        objective = target(number)
        ends = jax.vmap(
            lambda starts, is_free: descend(
                objective, starts, is_free, this.n_steps, n_starts=this.n_starts
            )
        )(this.starts, this.is_free)
        kept, following, state = onward(number, ends, state)
        return (following, state), kept

    # Counts are numbers of the program's own: those that Python knows change nothing.
    first = jax.tree.map(jnp.asarray, first)
    (_, state), kept = jax.lax.scan(round_, (first, state), numbers)
    return state, kept


def descend(
    target: Objective,
    starts: Float[Array, "k q"],
    is_free: Bool[Array, " q"],
    n_steps: Count,
    *,
    n_starts: Count | None = None,
) -> Expansion:
    """The best point met on the way down.

    Args:
        starts: Where to begin: from the lowest of them.
        is_free: Which coordinates may move.
        n_steps: Evaluations after those of the starts.
        n_starts: How many of the starts are tried, if not all.
    """
    both = is_free[:, None] & is_free[None]
    k = starts.shape[0]
    n_tried = k if n_starts is None else n_starts

    def step(
        count: Array, carry: tuple[Expansion, Array, Array]
    ) -> tuple[Expansion, Array, Array]:
        best, damping, wanted = carry
        is_start = count < n_tried
        # Starts and steps share one evaluation.
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
        return best, damping, best.y + move

    first = (unknown(starts[0]), jnp.asarray(DAMPING), starts[0])
    best, _, _ = jax.lax.fori_loop(0, n_tried + n_steps, step, first)
    return best


def unknown(y: Float[Array, "*n q"]) -> Expansion:
    """Points of which nothing is known."""
    q = y.shape[-1]
    return Expansion(
        y=y,
        misfit=jnp.full(y.shape[:-1], jnp.inf),
        cost=jnp.full(y.shape[:-1], jnp.inf),
        gradient=jnp.zeros(y.shape),
        hessian=jnp.zeros((*y.shape, q)),
    )
