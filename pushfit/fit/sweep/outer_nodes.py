"""Nodes along the outer coordinate, dense where the posterior is large.

Each round moves the nodes to quantiles of what the last one found, tempered so that
the tails keep some, and follows every low valley to its bottom. Neighbours hand each
other their conditional modes. Excluded: the inner coordinate.
"""

import itertools
from collections.abc import Callable
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from pushfit.fit.sweep.cholesky import (
    cholesky,
    half_solve,
    log_diagonal,
    solve,
)
from pushfit.fit.sweep.search import Count, Objective, Round
from pushfit.fit.sweep.segments import make_segments
from pushfit.fit.sweep.target import IMPOSSIBLE, Expansion, Target, state_of
from pushfit.model import Scalar
from pushfit.parameters import TINY

# Nodes along u, local minima that are followed, rounds, and steps of each round: with
# half of the nodes or two steps the log evidences of some tables move.
N_NODES, N_MODES, N_ROUNDS, N_STEPS = 64, 4, 6, 5
# Standard deviations of the prior that are swept: 2e-9 of it lies beyond.
REACH = 6.0
# Powers of the density, and the share of the nodes that each places: the first resolves
# what is there, the others keep valleys in sight whose bottom was not met yet.
TEMPERS = ((1.0, 0.5), (0.2, 0.3), (0.02, 0.2))
# Starts of a node from those around it: the nearest lower one, and three along ridges.
N_NEAR = 4
# A node is lower than another by more than this, in units of the log density.
MARGIN = 0.1
# Longest move along a ridge from one node to the next, as of a step of the search [log
# units].
MAX_RIDGE_MOVE = 1.5
# First guesses: ln C_rr in standard deviations from its prior mean, and ellipses: a
# circle, and one of each way to lie.
INNER_GUESSES = (-2.0, 0.0, 2.0)
SHAPES = ((0.0, 0.0), (1.2, 0.0), (-1.2, 0.0), (0.0, 1.2), (0.0, -1.2))
# Least and largest factor on the stiffness of a guess that brings it to the heights:
# far beyond the prior's, and no node becomes infinite.
SCALES = (1e-3, 1e3)
# Share of the information on a coordinate that the others leave at least: where
# rounding takes all of it, its root is still no 0 below a fraction. Not tuned.
LEAST_LEFT = 1e-12


# Share of all nodes that should lie below each of them.
Placing = Callable[[Expansion], Float[Array, " n"]]


def first_round(target: Target) -> Round:
    """The search at the first nodes of u."""
    return begun(_first_starts(target), _is_followed(target))


def later_round(target: Target, nodes: Expansion, number: Int[Array, ""]) -> Round:
    """The search at nodes of u where the posterior is large, after a round."""

    def log_density(node: Expansion) -> Scalar:
        information = without_s(target, node.hessian + target.precision)
        return -node.cost - log_diagonal(cholesky(information[1:, 1:]))

    def placing(nodes: Expansion) -> Float[Array, " n"]:
        return tempered(nodes.y[:, 0], jax.vmap(log_density)(nodes), TEMPERS)

    return next_round(
        target,
        nodes,
        _is_followed(target),
        placing=placing,
        is_final=number == N_ROUNDS - 2,
    )


def _is_followed(target: Target) -> Bool[Array, " q"]:
    """Coordinates that follow u."""
    q = target.mean.size
    return jnp.asarray([i > 0 and not _is_s(target, i) for i in range(q)])


def ascending(nodes: Expansion) -> Expansion:
    """Nodes by their first coordinate."""
    order = jnp.argsort(nodes.y[:, 0])
    return jax.tree.map(lambda a: a[order], nodes)


def next_round(
    target: Objective,
    nodes: Expansion,
    is_free: Bool[Array, " q"],
    *,
    placing: Placing,
    is_final: Bool[Array, ""],
) -> Round:
    """The search at nodes that are placed anew, some of them free to slide to minima.

    Args:
        nodes: Ascending.
        is_final: Whether no other round follows it: what slides may halt halfway, above
            the nodes that it passes.
    """
    u = nodes.y[:, 0]
    at = jnp.interp(jnp.linspace(0, 1, u.size - N_MODES), placing(nodes), u)
    at = jnp.concatenate([u[_minima(nodes)], at])
    slides = (jnp.arange(u.size) < N_MODES) & ~is_final
    is_first = jnp.arange(is_free.size) == 0
    along = slides[:, None] & is_first[None]
    return again(neighbouring(target, nodes, is_free, at=at), is_free[None] | along)


def begun(
    starts: Float[Array, "n q"], is_free: Bool[Array, " q"], n_steps: Count = N_STEPS
) -> Round:
    """A search that has one start for each node."""
    several = jnp.repeat(starts[:, None], N_NEAR, axis=1)
    return replace(again(several, is_free), n_starts=1, n_steps=n_steps)


def again(starts: Float[Array, "n k q"], is_free: Bool[Array, "..."]) -> Round:
    """A search that tries all starts; its objective is told nothing yet."""
    n, _, q = starts.shape
    return Round(
        starts=starts,
        is_free=jnp.broadcast_to(is_free, (n, q)),
        held=jnp.zeros((n, 0)),
        n_starts=N_NEAR,
        n_steps=N_STEPS,
    )


def tempered(
    u: Float[Array, " n"],
    log_density: Float[Array, " n"],
    tempers: tuple[tuple[float, float], ...],
) -> Float[Array, " n"]:
    """Cumulative shares of nodes that a density places.

    Args:
        tempers: Powers of the density, and the share of the nodes that each places.
    """
    total = jnp.zeros(u.size)
    for power, share in tempers:
        level = power * (log_density - jnp.max(log_density))
        total = total + share * make_segments(u, level).cumulative
    return total


def without_s(target: Target, matrix: Float[Array, "q q"]) -> Float[Array, "r r"]:
    """Rows and columns of all coordinates but ln s, which the prior draws."""
    kept = np.array([i for i in range(matrix.shape[0]) if not _is_s(target, i)])
    return matrix[kept][:, kept]


def _is_s(target: Target, index: int) -> bool:
    return target.roles.has_s and index == 2


def _prior_given(
    target: Target, known: tuple[Scalar, ...]
) -> tuple[Float[Array, " q"], Float[Array, " q"]]:
    """Prior mean and sd of all coordinates, the first of them known."""
    mean, covariance = target.mean, target.covariance
    for i, value in enumerate(known):
        gain = covariance[:, i] / covariance[i, i]
        mean = mean + gain * (value - mean[i])
        covariance = covariance - gain[:, None] * covariance[i][None]
    return mean, jnp.sqrt(jnp.diag(covariance))


def _first_starts(target: Target) -> Float[Array, "n q"]:
    """The best of a few guesses at each node, stiffness scaled to the heights."""
    names = target.roles.names
    mean, sd = _prior_given(target, ())
    u = mean[0] + sd[0] * jnp.linspace(-REACH, REACH, N_NODES)
    has_shape = bool({"f1", "e1"} & set(names))
    shapes = SHAPES if has_shape else SHAPES[:1]
    guesses = jnp.asarray(
        [(c, *f) for c, f in itertools.product(INNER_GUESSES, shapes)]
    )

    problem = target.pooled.problem

    def guess(
        u: Scalar, shift: Float[Array, " s"]
    ) -> tuple[Float[Array, " q"], Scalar]:
        mean, sd = _prior_given(target, (u,))
        y, _ = _prior_given(target, (u, mean[1] + shift[0] * sd[1]))
        for i, name in enumerate(names):
            if name in ("f1", "e1", "f2", "e2"):
                y = y.at[i].add(shift[int(name[1])])

        def at(
            y: Float[Array, " q"], is_last: Bool[Array, ""]
        ) -> tuple[Float[Array, " q"], Scalar]:
            predicted = problem.predict(state_of(problem, target.seen(y)))
            scaled = y
            if "ln_A" in names:
                ln_scale = _ln_scale(target, predicted)
                scaled = y.at[names.index("ln_A")].add(ln_scale)
            cost = target.cost(y, problem.differences(predicted))
            return jnp.where(is_last, y, scaled), cost

        # Both predictions are one evaluation, which is what takes long to compile.
        y, costs = jax.lax.scan(at, y, jnp.array([False, True]))
        return y, costs[1]

    tried, costs = jax.vmap(lambda u: jax.vmap(lambda s: guess(u, s))(guesses))(u)
    return tried[jnp.arange(N_NODES), jnp.argmin(costs, axis=1)]


def _ln_scale(target: Target, predicted: Float[Array, "c n"]) -> Scalar:
    """Log of the factor that brings predictions closest to the heights."""
    problem = target.pooled.problem
    predicted = jnp.where(problem.mask, predicted, 0.0)
    weight = target.pooled.count / problem.reference_sigma**2
    scale = jnp.sum(weight * predicted * problem.observed)
    scale = scale / jnp.maximum(jnp.sum(weight * predicted**2), TINY)
    # A push that cannot be predicted at the guess must not make the node unknown.
    return jnp.log(jnp.clip(jnp.nan_to_num(scale, nan=1.0), *SCALES))


def neighbouring(
    target: Objective,
    nodes: Expansion,
    is_free: Bool[Array, " q"],
    *,
    at: Float[Array, " m"],
) -> Float[Array, "m k q"]:
    """Starts at values of the first coordinate, as the nodes around them offer.

    Those to the left, to the right and beyond follow their ridge. The nearest one that
    is lower is also taken as it is, however far: ridges lead through a valley node by
    node, and rounds are fewer than nodes. Where none is lower, that is the left one.
    """
    u = nodes.y[:, 0]
    right = jnp.clip(jnp.searchsorted(u, at), 1, u.size - 1)
    ridges = jax.vmap(lambda h: _mode_slope(target, h, is_free))(nodes.hessian)

    def along(start: Int[Array, " m"]) -> Float[Array, "m q"]:
        move = ridges[start] * (at - u[start])[:, None]
        return nodes.y[start] + jnp.clip(move, -MAX_RIDGE_MOVE, MAX_RIDGE_MOVE)

    beyond = jnp.clip(right + 1, 1, u.size - 1)
    here = jnp.interp(at, u, nodes.cost)
    is_lower = nodes.cost[None] < here[:, None] - MARGIN
    distance = jnp.where(is_lower, jnp.abs(u[None] - at[:, None]), jnp.inf)
    lower = jnp.where(is_lower.any(axis=1), jnp.argmin(distance, axis=1), right - 1)
    tried = (nodes.y[lower], along(right - 1), along(right), along(beyond))
    return jnp.stack(tried, axis=1).at[:, :, 0].set(at[:, None])


def _mode_slope(
    target: Objective, hessian: Float[Array, "q q"], is_free: Bool[Array, " q"]
) -> Float[Array, " q"]:
    """Change of the conditional mode per unit of the first coordinate."""
    both = is_free[:, None] & is_free[None]
    information = hessian + target.precision
    held = jnp.where(both, information, 0.0) + jnp.diag(jnp.where(is_free, 0.0, 1.0))
    return solve(cholesky(held), jnp.where(is_free, -information[:, 0], 0.0))


def _minima(nodes: Expansion) -> Int[Array, " k"]:
    """The lowest nodes of the lowest valleys."""
    edge = jnp.full(1, jnp.inf)
    padded = jnp.concatenate([edge, nodes.cost, edge])
    is_low = (nodes.cost <= padded[:-2]) & (nodes.cost <= padded[2:])
    _, chosen = jax.lax.top_k(-jnp.where(is_low, nodes.cost, IMPOSSIBLE), N_MODES)
    return chosen


def schur(matrix: Float[Array, "q q"]) -> Scalar:
    """Information on the first coordinate with the others free."""
    half = half_solve(cholesky(matrix[1:, 1:]), matrix[1:, 0])
    return jnp.maximum(matrix[0, 0] - jnp.sum(half**2), LEAST_LEFT * matrix[0, 0])


def ridge_slope(matrix: Float[Array, "q q"]) -> Float[Array, " q-1"]:
    """Change of the other conditional modes per unit of the first coordinate."""
    return solve(cholesky(matrix[1:, 1:]), -matrix[1:, 0])
