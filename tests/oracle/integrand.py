"""The posterior density as nested integrals: over C_rr and A inside, θ_c outside.

At given θ_c the heights leave a narrow ridge in (ln C_rr, ln A). Each inner integral is
centred on the ridge and stretched by sinh, which resolves a peak of width 1e-6 and a
prior of width 10 with the same nodes. What remains is smooth in the outer coordinate

    u = ln tan θ_c

between the elevations that were pushed: there alone a push changes from rolled to
unrolled.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.model import Scalar, contact
from tests.oracle import priors
from tests.oracle.cells import GAUSS, KRONROD, NODES

# Inner nodes: panels in t, where coordinate = centre + scale sinh(t). Those between
# these shares of the core hold ±3.6 standard deviations, the outer ones reach 200 of
# them or the prior's end, whichever is nearer. With one panel in the core standard
# deviations of draws were 0.6 % too small.
CORE, REACH = 2.0, 6.0
SHARES = (-1.0, 0.0, 1.0)
N_PANELS = len(SHARES) + 1
N_SCREEN = 13
# Gauss-Newton steps towards the centre of a ridge, on the model and on scalars.
LM_STEPS, SCALAR_STEPS = 16, 8


class Inner(eqx.Module):
    """One inner integral at its nodes.

    Args:
        t: Nodes, ascending.
        centre: Where t = 0.
        scale: Stretch of sinh(t).
        log_density: Log of integrand times |d coordinate/dt| at the nodes.
        log_integral: By the 15-point rule in each panel.
        error: Its relative error, from the 7-point rule in each panel.
    """

    t: Float[Array, " m"]
    centre: Scalar
    scale: Scalar
    log_density: Float[Array, " m"]
    log_integral: Scalar
    error: Scalar


class Integrand(eqx.Module):
    """Likelihood times prior of A, B and C_rr, in (u, ln C_rr, ln A).

    Args:
        problem: Problem; its own priors of the six are not looked at.
        constant: What the log likelihood adds to the sum of squares.
        prior_A: Density of ln A.
        prior_B: Density of ln B.
        prior_C: Density of ln C_rr.
    """

    problem: Problem
    constant: Scalar
    prior_A: priors.DensityTable
    prior_B: priors.DensityTable
    prior_C: priors.DensityTable

    def over_C(self, u: Scalar) -> Inner:
        """Integral over C_rr and A."""
        centre, scale = self._ridge(u)

        def value(c: Scalar) -> tuple[Scalar, Scalar]:
            inner = self.over_A(u, c)
            return inner.log_integral, inner.error

        return _integrate(value, centre, scale, _range(self.prior_C))

    def over_A(self, u: Scalar, c: Scalar) -> Inner:
        """Integral over A at given u and ln C_rr."""
        centre, scale, squares = self._along_A(u, c)

        def value(a: Scalar) -> tuple[Scalar, Scalar]:
            likelihood = self.constant - squares(a) / 2
            return likelihood + self._log_prior(u, c, a), jnp.zeros(())

        return _integrate(value, centre, scale, _range(self.prior_A))

    def _log_prior(self, u: Scalar, c: Scalar, a: Scalar) -> Scalar:
        return (
            priors.log_density(self.prior_A, a)
            + priors.log_density(self.prior_B, u + c + a)
            + priors.log_density(self.prior_C, c)
        )

    def _residuals(self, u: Scalar, c: Scalar, a: Scalar) -> Float[Array, " n"]:
        """Those at a point, where B = A C_rr tan θ_c."""
        state = self.problem.data_state(jnp.zeros(len(self.problem.data_names)))
        values = jnp.exp(a), jnp.exp(u + c + a), jnp.exp(c)
        group = contact(state.params)
        group = eqx.tree_at(lambda g: (g.A, g.B, g.C_rr), group, values)
        return self.problem.residuals(eqx.tree_at(lambda s: s.params, state, group))

    def _along_A(
        self, u: Scalar, c: Scalar
    ) -> tuple[Scalar, Scalar, Callable[[Scalar], Scalar]]:
        """Mode and width of ln A at given u and ln C_rr, and the misfit around it."""
        start = self._scaled(u, c)
        # Heights are x h with x = A / A_start: one look at the model serves all of A.
        residuals, height = self._line(u, c, start)
        steepness = jnp.sqrt(jnp.sum(height**2))
        best = 1 - jnp.sum(height * residuals) / steepness**2

        def scalar_residuals(z: Float[Array, " 1"]) -> Float[Array, " 3"]:
            misfit = steepness * (jnp.exp(z[0] - start) - best)
            return jnp.stack([misfit, *self._normal_priors(u, c, z[0])[:2]])

        centre, scale = _centre(scalar_residuals, start[None], SCALAR_STEPS)
        # About the centre, not about A = 0: noise of 1e-6 leaves no digits to lose.
        factor = jnp.exp(centre - start)
        at_centre = residuals + (factor - 1) * height
        constant, linear = jnp.sum(at_centre**2), jnp.sum(at_centre * height)

        def squares(a: Scalar) -> Scalar:
            step = factor * jnp.expm1(a - centre)
            return constant + step * (2 * linear + step * steepness**2)

        return centre, scale, squares

    def _line(
        self, u: Scalar, c: Scalar, a: Scalar
    ) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
        """Residuals at ln A = a, and what they would be with no observation."""
        problem, residuals = self.problem, self._residuals(u, c, a)
        observed = problem.observed / problem.reference_sigma
        return residuals, residuals + jnp.where(problem.mask, observed, 0.0).ravel()

    def _ridge(self, u: Scalar) -> tuple[Scalar, Scalar]:
        """About the mode and the marginal standard deviation of ln C_rr at given u."""

        def residuals(z: Float[Array, " 2"]) -> Float[Array, " r"]:
            """Of the data, and of the priors as if they were normal."""
            priors = jnp.stack(self._normal_priors(u, *z))
            return jnp.concatenate([self._residuals(u, *z), priors])

        low, high = _range(self.prior_C)
        spread = jnp.linspace(-5.0, 5.0, N_SCREEN) * self.prior_C.sd
        c = jnp.clip(self.prior_C.mean + spread, low, high)
        a = jax.vmap(lambda value: self._scaled(u, value))(c)
        starts = jnp.stack([c, a], axis=1)
        costs = jax.vmap(lambda z: jnp.sum(residuals(z) ** 2))(starts)
        best = jnp.argmin(jnp.where(jnp.isfinite(costs), costs, jnp.inf))
        return _centre(residuals, starts[best], LM_STEPS)

    def _scaled(self, u: Scalar, c: Scalar) -> Scalar:
        """Ln A that fits the heights best by scale, held near the prior."""
        start = self.prior_A.mean
        residuals, height = self._line(u, c, start)
        square = jnp.sum(height**2)
        best = 1 - jnp.sum(height * residuals) / jnp.where(square > 0, square, 1.0)
        low, high = _range(self.prior_A)
        return jnp.clip(start + jnp.log(jnp.maximum(best, 1e-3)), low, high)

    def _normal_priors(self, u: Scalar, c: Scalar, a: Scalar) -> list[Scalar]:
        """Distance from the prior means of A, B and C_rr in standard deviations."""
        tables = (self.prior_A, self.prior_B, self.prior_C)
        values = (a, u + c + a, c)
        return [(v - t.mean) / t.sd for t, v in zip(tables, values, strict=True)]


def _integrate(
    value: Callable[[Scalar], tuple[Scalar, Scalar]],
    centre: Scalar,
    scale: Scalar,
    bounds: tuple[Scalar, Scalar],
) -> Inner:
    """Integral of exp(value) over the bounds, on the stretched panels."""
    low, high = bounds
    centre = jnp.clip(centre, low, high)
    bottom = jnp.maximum(jnp.arcsinh((low - centre) / scale), -REACH)
    top = jnp.minimum(jnp.arcsinh((high - centre) / scale), REACH)
    low_core, high_core = jnp.maximum(-CORE, bottom / 2), jnp.minimum(CORE, top / 2)
    core = low_core + (high_core - low_core) * (1 + jnp.asarray(SHARES)) / 2
    edges = jnp.concatenate([bottom[None], core, top[None]])
    half = (edges[1:] - edges[:-1]) / 2
    middle = (edges[1:] + edges[:-1]) / 2
    t = (middle[:, None] + jnp.outer(half, jnp.asarray(NODES))).ravel()
    log_f, inner_error = jax.vmap(value)(centre + scale * jnp.sinh(t))
    log_density = log_f + jnp.log(scale * jnp.cosh(t))
    log_density = jnp.where(jnp.isnan(log_density), -jnp.inf, log_density)
    peak = jnp.max(log_density)
    peak = jnp.where(jnp.isfinite(peak), peak, 0.0)
    f = jnp.exp(log_density - peak).reshape(N_PANELS, -1)
    kronrod = half * (f @ jnp.asarray(KRONROD))
    gauss = half * (f @ jnp.asarray(GAUSS))
    total = jnp.sum(kronrod)
    safe = jnp.where(total > 0, total, 1.0)
    relative = jnp.sum(jnp.abs(kronrod - gauss)) / safe
    # On analytic functions the 15-point rule has twice the digits of the other.
    error = jnp.minimum(1.0, relative**2)
    weight = jnp.outer(half, jnp.asarray(KRONROD)).ravel() * f.ravel()
    error = error + jnp.sum(weight * inner_error) / safe
    return Inner(t, centre, scale, log_density, jnp.log(total) + peak, error)


def _range(table: priors.DensityTable) -> tuple[Scalar, Scalar]:
    return table.start, priors.end(table)


def _centre(
    residuals, start: Float[Array, " m"], n_steps: int
) -> tuple[Scalar, Scalar]:
    """First coordinate of a least-squares optimum and its standard deviation.

    A fixed number of damped Gauss-Newton steps: all nodes march in lockstep, and the
    centre of an integral need not be exact.
    """
    m = start.size

    def twice(z: Float[Array, " m"]):
        r = residuals(z)
        return r, r

    def step(carry, _):
        best, trial, damping = carry
        jacobian, r = jax.jacfwd(twice, has_aux=True)(trial)
        seen = (trial, jnp.sum(r**2), jacobian.T @ jacobian, jacobian.T @ r)
        is_better = seen[1] < best[1]
        best = jax.tree.map(lambda a, b: jnp.where(is_better, a, b), seen, best)
        damping = jnp.clip(jnp.where(is_better, damping / 10, damping * 10), 1e-9, 1e9)
        z, _, information, gradient = best
        damped = information + damping * jnp.diag(jnp.diag(information))
        move = jnp.clip(_solve_small(damped, gradient), -3.0, 3.0)
        return (best, z - move, damping), None

    none = (start, jnp.asarray(jnp.inf), jnp.eye(m), jnp.zeros(m))
    ((z, _, information, _), _, _), _ = jax.lax.scan(
        step, (none, start, jnp.asarray(1e-3)), None, length=n_steps
    )
    variance = _solve_small(information, jnp.zeros(m).at[0].set(1.0))[0]
    return z[0], jnp.sqrt(jnp.maximum(variance, 1e-30))


def _solve_small(
    matrix: Float[Array, "m m"], vector: Float[Array, " m"]
) -> Float[Array, " m"]:
    """Solution of one or two linear equations, without a LAPACK call per lane."""
    if vector.size == 1:
        return vector / matrix[0]
    (a, b), (c, d) = matrix
    x, y = vector
    return jnp.stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)
