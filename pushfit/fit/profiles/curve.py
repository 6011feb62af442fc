"""The least sum of squares for every value of a quantity: its profile likelihood.

One program serves every quantity of a problem, however it is imposed.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from pushfit.fit.problem.derived import critical_angle_at, critical_angles
from pushfit.fit.problem.problem import Problem
from pushfit.fit.profiles.guesses import guesses
from pushfit.fit.profiles.held import Likelihood, imposable
from pushfit.fit.programs import compiled
from pushfit.fit.sweep.outer import follow, tempered
from pushfit.fit.sweep.repeats import pool_repeats
from pushfit.fit.sweep.search import descend
from pushfit.fit.sweep.target import IMPOSSIBLE, Expansion
from pushfit.model import as_float

# Ends of the range of θ_c, without and with a preload, and of the soft axis [deg].
THETA_ENDS, PRELOADED_ENDS, AXIS_ENDS = (0.05, 89.95), (-89.0, 89.95), (-90.0, 90.0)
# Distances from where a log is expected at which it is tried; the last is a factor 3000
# and stands for the end of the range.
LOG_OFFSETS = np.geomspace(0.003, 8.0, 13)
# Distance of an imposed θ_c from another crossing, where only a search tells [rad].
SAME_ANGLE = 1e-6
# Δχ² that a search resolves best, that of 90 %.
LEVEL = 2.7
# Values of a curve, and points that starts are chosen from.
N_VALUES, N_FIRST = 96, 32
N_POOL, N_PLAIN_POOL = 24, 8
# Powers of the profile likelihood that place values, and the share each has; the rest
# gathers where it crosses the level, within so many standard deviations.
TEMPERS = ((1.0, 0.25), (0.2, 0.2), (0.02, 0.2))
CROSSING, AT_CROSSING = 0.15, 0.35
# The curve sees no fit that has no θ_c, and on the hard switch a node may halt above
# one that has: from every second of its points, and from those that it began with, so
# many steps lead down with nothing held. The lowest so many ends are kept, unless they
# are one valley: of the same sum of squares, and near each other [log units].
EVERY, N_DOWN, N_VALLEYS = 2, 12, 8
SAME_COST, SAME_VALLEY = 0.01, 1.0
# Sharpness of the transition in each round, for points of the pool in turn and
# afterwards. Across the hard switch the other branch has no slope: a soft one leads
# there, and sharpens round by round. Its own valley may be another one, and so half of
# the points do without. Where forces are searched the switch is rounder, and programs
# are slow to compile: points of the pool are not followed one by one.
FAMILY_SHARPNESS = ((16.0, 1024.0), (4096.0, 4096.0))
SHARPNESS = (256.0, 4096.0, 1e6, 1e6, 1e6, 1e6)
# θ_c held where a point has none [rad].
SOME_ANGLE = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Profile of one quantity.

    Args:
        values: Values, ascending [ln unit, or rad].
        points: Data coordinates of the best fit at each value.
        chi_square: Its sum of squared residuals; infinite where it is impossible.
    """

    values: Float[np.ndarray, " g"]
    points: Float[np.ndarray, "g q"]
    chi_square: Float[np.ndarray, " g"]

    def joined(self, other: "Curve") -> "Curve":
        """Both curves as one; of equal values the better fit stays."""
        values = np.concatenate([self.values, other.values])
        chi_square = np.concatenate([self.chi_square, other.chi_square])
        points = np.concatenate([self.points, other.points])
        order = np.lexsort((chi_square, values))
        is_first = np.diff(values[order], prepend=-np.inf) > 0
        kept = order[is_first]
        return Curve(
            values=values[kept], points=points[kept], chi_square=chi_square[kept]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """Best fits along one quantity, from end to end.

    Args:
        observed: Heights that were fitted.
        quantity: Name of the quantity: θ_c, or what else is free.
        reference_alpha: Azimuth of θ_c [rad].
        is_thorough: Whether the fits began with those of a search, or guesses are many
            beside the shapes of a problem without an ellipse.
        curve: The fits.
        valleys: Points at the bottom of the lowest valleys, or near it, lowest first.
    """

    observed: Float[np.ndarray, "c n"]
    quantity: str
    reference_alpha: float
    is_thorough: bool
    curve: Curve
    valleys: Float[np.ndarray, "k q"]


def search(
    problem: Problem,
    reference_alpha: float | None = None,
    before: Search | None = None,
) -> Search:
    """Look at the whole likelihood before any solver starts, so that no mode is missed.

    Args:
        reference_alpha: Azimuth of θ_c [rad]; None for that of the first push, since
            any will do to tell valleys apart.
        before: Search under other weights, to begin with; None for guesses.
    """
    if reference_alpha is None:
        reference_alpha = float(np.asarray(problem.pushes.alpha)[0])
    quantities, guessed = imposable(problem), guesses(problem)
    name = "theta_c" if "theta_c" in quantities else quantities[0]
    others = guessed if before is None else np.resize(before.valleys, guessed.shape)
    curve = profile_curve(
        problem,
        quantities.index(name),
        first_values(problem, name, guessed[:, 0]),
        guessed if before is None else before.curve.points,
        reference_alpha=reference_alpha,
        level=LEVEL,
    )
    return Search(
        observed=np.asarray(problem.observed),
        quantity=name,
        reference_alpha=reference_alpha,
        is_thorough=before is not None or "f1" not in problem.data_names,
        curve=curve,
        valleys=_valleys(problem, np.concatenate([curve.points[::EVERY], others])),
    )


def first_values(
    problem: Problem, name: str, near: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " g"]:
    """Values that a profile begins with, from end to end.

    Args:
        near: Where a log is expected.
    """
    if name == "theta_c":
        is_preloaded = (
            "ln_F_0" in problem.data_names or float(problem.grasp.preload) > 0
        )
        low, high = np.radians(PRELOADED_ENDS if is_preloaded else THETA_ENDS)
    elif name == "alpha_star":
        low, high = np.radians(AXIS_ENDS)
    else:
        low, high = np.min(near), np.max(near)
        between = np.linspace(low, high, N_FIRST - 2 * LOG_OFFSETS.size)
        return np.r_[low - LOG_OFFSETS[::-1], between, high + LOG_OFFSETS]
    return np.linspace(low, high, N_FIRST)


def profile_curve(
    problem: Problem,
    index: int,
    values: Float[np.ndarray, " g"],
    pool: Float[np.ndarray, "p q"],
    *,
    reference_alpha: float,
    level: float,
) -> Curve:
    """Best fits along a quantity, dense where they matter.

    Args:
        index: Which of the imposable quantities.
        values: Range to begin with, `N_FIRST` of them, ascending.
        pool: Data coordinates from which solutions are sought, of every basin.
        reference_alpha: Azimuth of θ_c [rad].
        level: Δχ² at the ends of the set that is wanted.
    """
    means, scatter = _of_means(problem)
    n_pool = N_POOL if "f1" in problem.data_names else N_PLAIN_POOL
    rows = np.linspace(0, len(pool) - 1, n_pool).round().astype(int)
    at, points, cost = (
        np.asarray(a)
        for a in _curve(
            means,
            jax.device_put(np.asarray(index)),
            as_float(values),
            as_float(pool[rows]),
            as_float(reference_alpha),
            as_float(level),
        )
    )
    chi_square = np.where(cost < IMPOSSIBLE, 2 * cost + scatter, np.inf)
    if imposable(problem)[index] == "theta_c" and problem.grasp.law.is_tie is None:
        angles = critical_angles(problem, points, reference_alpha)
        is_other = ~(np.abs(angles - at) < SAME_ANGLE)
        chi_square = np.where(is_other, np.inf, chi_square)
    return Curve(values=at, points=points, chi_square=chi_square)


def _of_means(problem: Problem) -> tuple[Problem, float]:
    """The problem of the means of repeats, at data coordinates, and what they scatter.

    No fit changes that.
    """
    pooled = pool_repeats(problem)
    means = pooled.problem
    mask, sigma = np.asarray(means.mask), np.array(means.reference_sigma)
    scatter = float(np.sum((np.asarray(pooled.scatter) / sigma**2)[mask]))
    sigma[mask] /= np.sqrt(np.asarray(pooled.count)[mask])
    return replace(means.of_data, reference_sigma=as_float(sigma)), scatter


def _valleys(
    problem: Problem, points: Float[np.ndarray, "n q"]
) -> Float[np.ndarray, "k q"]:
    """Ends of the ways down, the lowest first; always as many, repeated if need be."""
    ends, costs = (
        np.asarray(a) for a in _descended(_of_means(problem)[0], as_float(points))
    )
    kept: list[int] = []
    for i in np.argsort(costs, kind="stable"):
        is_other = np.abs(costs[kept] - costs[i]) > SAME_COST
        is_other |= np.max(np.abs(ends[kept] - ends[i]), axis=1) > SAME_VALLEY
        if np.all(is_other):
            kept.append(int(i))
    return ends[np.resize(kept[:N_VALLEYS], N_VALLEYS)]


@compiled
def _descended(
    problem: Problem, points: Float[Array, "n q"]
) -> tuple[Float[Array, "n q"], Float[Array, " n"]]:
    # With its value free, too, whichever is held holds nothing.
    target = Likelihood(problem, jnp.asarray(0), jnp.zeros(()))
    is_free = target.is_free.at[0].set(True)

    def one(y: Float[Array, " q"]) -> tuple[Array, Array]:
        start = target.at(y[0], y)
        end = descend(target, start[None], is_free, N_DOWN)
        return target.point(end.y), end.cost

    return jax.vmap(one)(points)


@compiled
def _curve(
    problem: Problem,
    index: Int[Array, ""],
    values: Float[Array, " m"],
    pool: Float[Array, "p q"],
    reference_alpha: Float[Array, ""],
    level: Float[Array, ""],
) -> tuple[Float[Array, " g"], Float[Array, "g q"], Float[Array, " g"]]:
    target = Likelihood(problem, index, reference_alpha)

    def family(
        y: Float[Array, " q"], rounds: Float[Array, " r"]
    ) -> tuple[Array, Array]:
        """Best fits along the values with θ_c as it is, where it can be held."""
        if problem.grasp.law.is_searched:
            return jax.vmap(lambda value: target.start(value, y))(values)
        angle = critical_angle_at(problem, y, reference_alpha)
        held = replace(target, angle=jnp.where(jnp.isnan(angle), SOME_ANGLE, angle))
        nodes = follow(
            held.softened,
            rounds,
            jax.vmap(lambda value: held.start(value, y)[0])(values),
            held.is_free,
            None,
        )
        w = jax.vmap(lambda w: target.at(w[0], held.point(w)))(nodes.y)
        return w, nodes.cost

    kinds = jnp.asarray(FAMILY_SHARPNESS)[jnp.arange(len(pool)) % 2]
    w, costs = jax.vmap(family)(pool, kinds)
    best = jnp.argmin(costs, axis=0)

    def placing(nodes: Expansion) -> Float[Array, " g"]:
        u = nodes.y[:, 0]
        delta = nodes.cost - jnp.min(nodes.cost)
        miss = (jnp.sqrt(2 * delta) - jnp.sqrt(level)) / CROSSING
        at_level = tempered(u, -(miss**2) / 2, ((1.0, AT_CROSSING),))
        return tempered(u, -delta, TEMPERS) + at_level

    starts = w[best, jnp.arange(values.size)]
    extra = jnp.arange(N_VALUES) % values.size
    nodes = follow(
        target.softened,
        jnp.asarray(SHARPNESS),
        starts[jnp.sort(extra)],
        target.is_free,
        placing,
    )
    return nodes.y[:, 0], jax.vmap(target.point)(nodes.y), nodes.cost
