"""Least squares of many tables at once: a screen over θ_c and C_rr, then polishing.

The same search as for a single table, in arrays of fixed size: every lane screens the
same grid with A in closed form, and optimistix polishes the best basins of all lanes
together. Excluded: posteriors.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float

from pushfit.fit.lanes import Face, Lane
from pushfit.fit.programs import compiled
from pushfit.fit.scan import LN_C_RR, PSI
from pushfit.fit.slopes import jacobian, linearised
from pushfit.model import Scalar

N_STARTS = 4
RTOL = ATOL = 1e-9
MAX_STEPS = 64
# Largest A at which the screen looks, as a share of the largest height.
SMALLEST_SHARE = 1e-3
# Steps towards the best C_rr and A at given θ_c.
N_STEPS = 9
# Stands for zero on a diagonal.
TINY = 1e-300


class LaneFit(eqx.Module):
    """Local optima of one table, best first.

    Args:
        u: ln tan θ_c of each.
        c: ln C_rr.
        a: ln A.
        chi_square: Misfit of the means, weighted by the noise.
        width: Standard deviation of u that the curvature there suggests.
        is_done: Whether the solver met its tolerance.
    """

    u: Float[Array, " k"]
    c: Float[Array, " k"]
    a: Float[Array, " k"]
    chi_square: Float[Array, " k"]
    width: Float[Array, " k"]
    is_done: Bool[Array, " k"]


class SmallNormal(lx.AbstractLinearSolver):
    """Normal equations of a few unknowns, their Cholesky factor written out.

    Least squares with one LAPACK call per lane would be many times slower.
    """

    def init(self, operator, options):
        """The matrix and the factor of its normal equations, row by row."""
        del options
        matrix = operator.as_matrix()
        columns = matrix.T
        n = columns.shape[0]
        lower = [[jnp.zeros(())] * n for _ in range(n)]
        for i in range(n):
            for j in range(i + 1):
                rest = jnp.sum(columns[i] * columns[j])
                rest = rest - sum(lower[i][k] * lower[j][k] for k in range(j))
                if i == j:
                    lower[i][i] = jnp.sqrt(jnp.maximum(rest, TINY))
                else:
                    lower[i][j] = rest / lower[j][j]
        return columns, lower

    def compute(self, state, vector, options):
        """Forward and backward substitution."""
        del options
        columns, lower = state
        vector = jnp.concatenate([jnp.ravel(part) for part in jax.tree.leaves(vector)])
        n, y, x = len(lower), [], {}
        for i in range(n):
            known = sum(lower[i][k] * y[k] for k in range(i))
            y.append((jnp.sum(columns[i] * vector) - known) / lower[i][i])
        for i in reversed(range(n)):
            known = sum(lower[k][i] * x[k] for k in range(i + 1, n))
            x[i] = (y[i] - known) / lower[i][i]
        solution = jnp.stack([x[i] for i in range(n)])
        return solution, lx.RESULTS.successful, {}

    def transpose(self, state, options):
        """Not asked for: nothing differentiates through the search."""
        raise ValueError("the transpose of a least-squares step is not defined")

    def conj(self, state, options):
        """The same: everything is real."""
        return state, options

    def assume_full_rank(self):
        """Damping sees to it."""
        return True


def fit_lane(lane: Lane) -> LaneFit:
    """Best fit of a table and its rivals.

    Args:
        lane: Table.

    Returns:
        Local optima, best first; without a finite misfit all are infinite.
    """
    starts = _screened(lane)
    scale = _weights(lane, starts[0])

    def residuals(z: Float[Array, " 3"]) -> Float[Array, " m"]:
        return (scale * (_heights(lane, z) - lane.mean)).ravel()

    def polished(start: Float[Array, " 3"]) -> tuple[Array, Array, Array, Array]:
        solution = optx.least_squares(
            lambda z, _: linearised(residuals)(z),
            optx.LevenbergMarquardt(rtol=RTOL, atol=ATOL, linear_solver=SmallNormal()),
            start,
            options={"jac": "fwd"},
            max_steps=MAX_STEPS,
            throw=False,
        )
        z = solution.value
        cost = jnp.sum(residuals(z) ** 2)
        slopes = jacobian(residuals)(z)
        # A weak prior: a flat valley is as wide as a prior lets it be.
        information = slopes.T @ slopes + jnp.eye(3)
        width = jnp.sqrt(_inverse_corner(information))
        return z, cost, width, solution.result == optx.RESULTS.successful

    z, cost, width, is_done = jax.vmap(polished)(starts)
    cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
    order = jnp.argsort(cost)
    u, c, a = z[order].T
    return LaneFit(u, c, a, cost[order], width[order], is_done[order])


def least_misfit(lane: Lane, face: Face, c: Scalar) -> tuple[Scalar, Scalar]:
    """Least misfit Q at given θ_c and ln C_rr, and ln A there.

    Channels share A and are weighted as in the lane; where sigma is sampled there is
    only one.
    """
    parabola = lane.parabola(lane.shape(face, c))
    curvature, best = jnp.stack(parabola.curvature), jnp.stack(parabola.best)
    A = jnp.sum(curvature * best) / jnp.sum(curvature)
    A = jnp.maximum(A, SMALLEST_SHARE * jnp.max(jnp.abs(best)))
    return jnp.sum(jnp.stack(parabola.squares(A))), jnp.log(A)


class NormalPrior(eqx.Module):
    """Means and precisions of ln C_rr, of ln A, and of their sum."""

    means: Float[Array, " 3"]
    precision: Float[Array, " 3"]


def climb(
    lane: Lane,
    face: Face,
    start: tuple[Scalar, Scalar],
    prior: NormalPrior,
    *,
    n_steps: int = N_STEPS,
) -> tuple[Scalar, Scalar, Scalar]:
    """Mode of (ln C_rr, ln A) at given θ_c, by damped Gauss-Newton.

    Args:
        lane: Table.
        face: Forces at the given θ_c.
        start: ln C_rr and ln A to begin with.
        prior: Prior, taken as normal; the sum stands for ln B less ln tan θ_c.
        n_steps: Number of evaluations, that of the start among them.

    Returns:
        ln C_rr, its marginal standard deviation, and ln A.
    """
    means, precision, (c, a) = prior.means, prior.precision, start
    parabola = lane.parabola(lane.shape(face, c))
    rates = jnp.stack(lane.rates(parabola.squares(jnp.exp(a))))
    weight = lane.weight * rates[:, None]

    def quadratic(c: Scalar, a: Scalar) -> tuple[Scalar, Array, Array]:
        """Cost, gradient and Gauss-Newton matrix entries in c and a."""
        shape, slope = jax.jvp(lambda c: lane.shape(face, c), (c,), (jnp.ones(()),))
        A = jnp.exp(a)
        residual, by_c, by_a = A * shape - lane.mean, A * slope, A * shape
        off = jnp.stack([c, a, c + a]) - means
        pull = precision * off
        cost = jnp.sum(weight * residual**2) + jnp.sum(pull * off)
        gradient = jnp.stack(
            [
                jnp.sum(weight * residual * by_c) + pull[0] + pull[2],
                jnp.sum(weight * residual * by_a) + pull[1] + pull[2],
            ]
        )
        information = jnp.stack(
            [
                jnp.sum(weight * by_c**2) + precision[0] + precision[2],
                jnp.sum(weight * by_c * by_a) + precision[2],
                jnp.sum(weight * by_a**2) + precision[1] + precision[2],
            ]
        )
        return cost, gradient, information

    def step(carry, _):
        place, seen, damping, trial = carry
        new = quadratic(*trial)
        is_better = new[0] < seen[0]
        place = jnp.where(is_better, jnp.stack(trial), place)
        seen = jax.tree.map(lambda x, y: jnp.where(is_better, x, y), new, seen)
        damping = jnp.clip(jnp.where(is_better, damping / 10, damping * 8), 1e-8, 1e8)
        _, (g_c, g_a), (cc, ca, aa) = seen
        cc, aa = cc * (1 + damping), aa * (1 + damping)
        determinant = cc * aa - ca * ca
        move_c = (aa * g_c - ca * g_a) / determinant
        move_a = (cc * g_a - ca * g_c) / determinant
        trial = (
            place[0] - jnp.clip(move_c, -2.0, 2.0),
            place[1] - jnp.clip(move_a, -2.0, 2.0),
        )
        return (place, seen, damping, trial), None

    nothing = (jnp.asarray(jnp.inf), jnp.zeros(2), jnp.array([1.0, 0.0, 1.0]))
    first = (jnp.stack([c, a]), nothing, jnp.asarray(1e-2), (c, a))
    (place, (_, _, (cc, ca, aa)), _, _), _ = jax.lax.scan(
        step, first, None, length=n_steps
    )
    return place[0], jax.lax.rsqrt(cc - ca * ca / aa), place[1]


def _screened(lane: Lane) -> Float[Array, "k 3"]:
    """The best cell of each of the best basins over θ_c."""
    u, c = jnp.log(jnp.tan(jnp.asarray(PSI))), jnp.asarray(LN_C_RR)

    def row(u: Scalar) -> tuple[Array, Array, Array]:
        face = lane.face(u)
        cost, a = jax.vmap(lambda c: least_misfit(lane, face, c))(c)
        cost = jnp.where(jnp.isfinite(cost), cost, jnp.inf)
        best = jnp.argmin(cost)
        return cost[best], c[best], a[best]

    cost, best_c, best_a = jax.lax.map(row, u)
    beyond = jnp.full(1, jnp.inf)
    left = jnp.concatenate([beyond, cost[:-1]])
    right = jnp.concatenate([cost[1:], beyond])
    # Basins first, then whatever else is low.
    is_basin = (cost <= left) & (cost <= right)
    order = jnp.argsort(jnp.where(is_basin, cost, cost + 1e12))[:N_STARTS]
    return jnp.stack([u, best_c, best_a], axis=1)[order]


def _heights(lane: Lane, z: Float[Array, " 3"]) -> Float[Array, "c n"]:
    """Heights at u, ln C_rr and ln A."""
    u, c, a = z
    return jnp.exp(a) * lane.shape(lane.face(u), c)


def _weights(lane: Lane, start: Float[Array, " 3"]) -> Float[Array, "c n"]:
    """Root of the weight of every residual."""
    u, c, a = start
    parabola = lane.parabola(lane.shape(lane.face(u), c))
    rates = jnp.stack(lane.rates(parabola.squares(jnp.exp(a))))
    return jnp.sqrt(lane.weight * rates[:, None])


def _inverse_corner(matrix: Float[Array, "3 3"]) -> Scalar:
    """First entry of the inverse of a symmetric matrix."""
    minor = matrix[1, 1] * matrix[2, 2] - matrix[1, 2] ** 2
    (a, b, c), (_, e, f), (_, _, i) = matrix
    determinant = a * minor - b * (b * i - c * f) + c * (b * f - c * e)
    return minor / determinant


@compiled
def fit_lanes(lanes: Lane) -> LaneFit:
    """`fit_lane` of stacked lanes."""
    return jax.vmap(fit_lane)(lanes)
