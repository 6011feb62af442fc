"""The posterior density as nested integrals: over C_rr and A inside, θ_c outside.

At given θ_c the heights leave a narrow ridge in (ln C_rr, ln A). Each inner integral is
centred on the ridge and stretched by sinh, which resolves a peak of width 1e-6 and a
prior of width 10 with the same nodes. What remains is smooth in the outer coordinate

    u = ln tan θ_c   (without preload)

between the elevations that were pushed: there alone a push changes from rolled to
unrolled. With a preload u is stretched so that this stays so.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.fit.problem.priors.tabulated_density import TabulatedDensity
from pushfit.fit.problem.problem import Problem
from pushfit.model import Contact, Scalar, contact
from tests.oracle import priors
from tests.oracle.cells import GAUSS, KRONROD, NODES
from tests.oracle.noise_grid import NoiseGrid

# Inner nodes: panels in t, where coordinate = centre + scale sinh(t). Those between
# these shares of the core hold ±3.6 standard deviations, the outer ones reach 200 of
# them or the prior's end, whichever is nearer. With one panel in the core standard
# deviations of draws were 0.6 % too small.
CORE, REACH = 2.0, 6.0
SHARES = (-1.0, 0.0, 1.0)
N_PANELS = len(SHARES) + 1
N_NODES = N_PANELS * NODES.size
N_SCREEN = 13
# Gauss-Newton steps towards the centre of a ridge, on the model and on scalars.
LM_STEPS, SCALAR_STEPS = 16, 8


Ridge = tuple[Scalar, Scalar, Callable[[Scalar], Float[Array, "c k"]]]


class Strip(eqx.Module):
    """Outer nodes: ln B as a function of A and C_rr.

        ln B = ln C_rr + (1 - f) g(θ_l) + f g(θ_r) + beyond
        g(θ) = ln( (F_0/S_p + A sin θ) / cos θ )

    Args:
        left: θ_l, the pushed elevation below [rad].
        right: θ_r, the one above; equal to `left` beyond the lowest and highest [rad].
        share: f, the place between the two in u.
        beyond: u past the lowest or highest elevation.
        width: Distance of the two in u; 1 beyond.
    """

    left: Float[Array, "*n"]
    right: Float[Array, "*n"]
    share: Float[Array, "*n"]
    beyond: Float[Array, "*n"]
    width: Float[Array, "*n"]


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

    def coordinate(self, t: Float[Array, "*s"]) -> Float[Array, "*s"]:
        """Value of the coordinate at t."""
        return self.centre + self.scale * jnp.sinh(t)


class Integrand(eqx.Module):
    """Likelihood times prior of A, B and C_rr.

    Args:
        problem: Problem; its own priors of the six are not looked at.
        noise: Noise.
        prior_A: Density of ln A; None where A is fixed, as below.
        prior_B: Density of ln B.
        prior_C: Density of ln C_rr.
        is_linear: Whether heights are proportional to A at given u and C_rr.
        is_smooth: Whether no prior of A or B has an edge inside its range.
    """

    problem: Problem
    noise: NoiseGrid
    prior_A: TabulatedDensity | None
    prior_B: TabulatedDensity | None
    prior_C: TabulatedDensity | None
    is_linear: bool = eqx.field(static=True)
    is_smooth: bool = eqx.field(static=True)

    @property
    def pivot(self) -> str:
        """Coordinate that u replaces; A is not replaced but taken as it is."""
        free = {"B": self.prior_B, "C": self.prior_C, "A": self.prior_A}
        return next((name for name, table in free.items() if table is not None), "")

    def over_C(self, node: Strip | Scalar) -> Inner:
        """Integral over C_rr and A, or over A alone if C_rr is no inner coordinate."""
        if self.prior_C is None or self.pivot == "C":
            return self.over_A(node, jnp.zeros(()))
        centre, scale = self._ridge(node)
        low, high = _range(self.prior_C)

        def value(c: Scalar) -> tuple[Scalar, Scalar]:
            inner = self.over_A(node, c)
            return inner.log_integral, inner.error

        return self._integrate(value, centre, scale, (low, high))

    def over_A(self, node: Strip | Scalar, c: Scalar) -> Inner:
        """Integral over A at given u and ln C_rr; a single point if A is not inner."""
        if self.prior_A is None or self.pivot == "A":
            a = jnp.zeros(()) if isinstance(node, Strip) else node
            log_f = self.log_density(node, c, a)
            zero = jnp.zeros(())
            return Inner(
                jnp.zeros(N_NODES), zero, zero, jnp.zeros(N_NODES), log_f, zero
            )
        centre, scale, squares = self._along_A(node, c)

        def value(a: Scalar) -> tuple[Scalar, Scalar]:
            likelihood = self.noise.log_likelihood(squares(a))
            return likelihood + self.log_prior(node, c, a), jnp.zeros(())

        return self._integrate(value, centre, scale, _range(self.prior_A))

    def log_density(self, node: Strip | Scalar, c: Scalar, a: Scalar) -> Scalar:
        """Log of likelihood times prior density in (u, ln C_rr, ln A)."""
        squares = self._squares(self.contact(node, c, a))
        return self.noise.log_likelihood(squares) + self.log_prior(node, c, a)

    def noise_profile(
        self, node: Strip | Scalar, c: Scalar, a: Scalar
    ) -> Float[Array, "c k"]:
        """Log of the conditional density of each channel's sigma on its grid."""
        squares = self._squares(self.contact(node, c, a))
        return self.noise.constant - squares / 2

    def log_prior(self, node: Strip | Scalar, c: Scalar, a: Scalar) -> Scalar:
        """Log prior density in (u, ln C_rr, ln A), without what is fixed."""
        group = self.contact(node, c, a)
        total = jnp.zeros(())
        for table, value in (
            (self.prior_A, group.A),
            (self.prior_B, group.B),
            (self.prior_C, group.C_rr),
        ):
            if table is not None:
                total = total + priors.log_density(table, jnp.log(value))
        if isinstance(node, Strip):
            rise = self._g(node.right, group.A) - self._g(node.left, group.A)
            is_end = node.left == node.right
            slope = jnp.where(is_end, 1.0, rise / node.width)
            total = total + jnp.log(slope)
        return total

    def contact(self, node: Strip | Scalar, c: Scalar, a: Scalar) -> Contact:
        """A, B and C_rr at a point; coordinates that are fixed are not looked at."""
        state = self.problem.data_state(jnp.zeros(len(self.problem.data_names)))
        fixed = contact(state.params)
        A = fixed.A if self.prior_A is None else jnp.exp(a)
        C_rr = fixed.C_rr if self.prior_C is None else jnp.exp(c)
        B = fixed.B
        if isinstance(node, Strip):
            ln_ratio = (
                (1 - node.share) * self._g(node.left, A)
                + node.share * self._g(node.right, A)
                + node.beyond
            )
            if self.pivot == "B":
                B = C_rr * jnp.exp(ln_ratio)
            else:
                C_rr = B * jnp.exp(-ln_ratio)
        return eqx.tree_at(lambda g: (g.A, g.B, g.C_rr), fixed, (A, B, C_rr))

    def _g(self, theta: Scalar, A: Scalar) -> Scalar:
        """Log of B / C_rr that puts the critical angle at θ."""
        grasp = self.problem.grasp
        pressed = grasp.preload / grasp.push_length + A * jnp.sin(theta)
        return jnp.log(pressed) - jnp.log(jnp.cos(theta))

    def _residuals(self, group: Contact) -> Float[Array, "c n"]:
        state = self.problem.data_state(jnp.zeros(len(self.problem.data_names)))
        state = eqx.tree_at(lambda s: s.params, state, group)
        return self.problem.residuals(state).reshape(self.problem.mask.shape)

    def _squares(self, group: Contact) -> Float[Array, "c k"]:
        """Weighted sums of squared residuals for every sigma of every channel."""
        square = self._residuals(group) ** 2
        return jnp.einsum("ckn,cn->ck", self.noise.weight, square)

    def _along_A(self, node: Strip | Scalar, c: Scalar) -> Ridge:
        """Mode and width of ln A at given u and ln C_rr, and the misfit around it."""
        start = self._scaled(node, c)
        if not self.is_linear:
            centre, scale = _centre(
                lambda z: self._all_residuals(node, c, z[0]), start[None], LM_STEPS
            )
            return centre, scale, lambda a: self._squares(self.contact(node, c, a))
        # Heights are x h with x = A / A_start: one look at the model serves all of A.
        residuals, height = self._line(node, c, start)
        steepness = jnp.sqrt(jnp.sum(height**2))
        best = 1 - jnp.sum(height * residuals) / steepness**2
        offset = jnp.log(self.contact(node, c, start).B) - start

        def scalar_residuals(z: Float[Array, " 1"]) -> Float[Array, " 3"]:
            misfit = steepness * (jnp.exp(z[0] - start) - best)
            priors = self._normal_priors(c, z[0] + offset, z[0])[:2]
            return jnp.stack([misfit, *priors])

        centre, scale = _centre(scalar_residuals, start[None], SCALAR_STEPS)
        # About the centre, not about A = 0: noise of 1e-6 leaves no digits to lose.
        factor = jnp.exp(centre - start)
        at_centre = residuals + (factor - 1) * height
        weight = self.noise.weight
        constant = jnp.einsum("ckn,cn->ck", weight, at_centre**2)
        linear = jnp.einsum("ckn,cn->ck", weight, at_centre * height)
        square = jnp.einsum("ckn,cn->ck", weight, height**2)

        def squares(a: Scalar) -> Float[Array, "c k"]:
            step = factor * jnp.expm1(a - centre)
            return constant + step * (2 * linear + step * square)

        return centre, scale, squares

    def _line(
        self, node: Strip | Scalar, c: Scalar, a: Scalar
    ) -> tuple[Float[Array, "c n"], Float[Array, "c n"]]:
        """Residuals at ln A = a, and what they would be with no observation."""
        residuals = self._residuals(self.contact(node, c, a))
        sigma = self.problem.reference_sigma
        observed = jnp.where(self.problem.mask, self.problem.observed / sigma, 0.0)
        return residuals, residuals + observed

    def _ridge(self, node: Strip | Scalar) -> tuple[Scalar, Scalar]:
        """About the mode and the marginal standard deviation of ln C_rr at given u."""
        assert self.prior_C is not None
        has_A = self.prior_A is not None

        def residuals(z: Float[Array, " m"]) -> Float[Array, " r"]:
            return self._all_residuals(node, z[0], z[1] if has_A else jnp.zeros(()))

        low, high = _range(self.prior_C)
        spread = jnp.linspace(-5.0, 5.0, N_SCREEN) * self.prior_C.sd
        c = jnp.clip(self.prior_C.mean + spread, low, high)
        a = jax.vmap(lambda value: self._scaled(node, value))(c)
        starts = jnp.stack([c, a], axis=1) if has_A else c[:, None]
        costs = jax.vmap(lambda z: jnp.sum(residuals(z) ** 2))(starts)
        best = jnp.argmin(jnp.where(jnp.isfinite(costs), costs, jnp.inf))
        return _centre(residuals, starts[best], LM_STEPS)

    def _scaled(self, node: Strip | Scalar, c: Scalar) -> Scalar:
        """Ln A that fits the heights best by scale, held near the prior."""
        if self.prior_A is None:
            return jnp.zeros(())
        start = self.prior_A.mean
        residuals, height = self._line(node, c, start)
        square = jnp.sum(height**2)
        best = 1 - jnp.sum(height * residuals) / jnp.where(square > 0, square, 1.0)
        low, high = _range(self.prior_A)
        return jnp.clip(start + jnp.log(jnp.maximum(best, 1e-3)), low, high)

    def _all_residuals(
        self, node: Strip | Scalar, c: Scalar, a: Scalar
    ) -> Float[Array, " r"]:
        """Residuals of the data, and of the priors as if they were normal."""
        group = self.contact(node, c, a)
        B, C = jnp.log(group.B), jnp.log(group.C_rr)
        priors = jnp.stack(self._normal_priors(C, B, jnp.log(group.A)))
        return jnp.concatenate([self._residuals(group).ravel(), priors])

    def _normal_priors(self, c: Scalar, b: Scalar, a: Scalar) -> list[Scalar]:
        """Distance from the prior means of A, B and C_rr in standard deviations."""
        tables = (self.prior_A, self.prior_B, self.prior_C)
        return [
            jnp.zeros(()) if table is None else (value - table.mean) / table.sd
            for table, value in zip(tables, (a, b, c), strict=True)
        ]

    def _integrate(
        self,
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
        t = ((edges[1:] + edges[:-1]) / 2)[:, None] + jnp.outer(
            half, jnp.asarray(NODES)
        )
        t = t.ravel()
        log_f, inner_error = jax.vmap(value)(centre + scale * jnp.sinh(t))
        log_density = log_f + jnp.log(scale * jnp.cosh(t))
        log_density = jnp.where(jnp.isnan(log_density), -jnp.inf, log_density)
        peak = jnp.max(log_density)
        peak = jnp.where(jnp.isfinite(peak), peak, 0.0)
        f = jnp.exp(log_density - peak).reshape(N_PANELS, -1)
        kronrod, gauss = (
            half * (f @ jnp.asarray(KRONROD)),
            half * (f @ jnp.asarray(GAUSS)),
        )
        total = jnp.sum(kronrod)
        safe = jnp.where(total > 0, total, 1.0)
        relative = jnp.sum(jnp.abs(kronrod - gauss)) / safe
        # On analytic functions the 15-point rule has twice the digits of the other.
        error = jnp.minimum(1.0, relative**2 if self.is_smooth else relative)
        weight = jnp.outer(half, jnp.asarray(KRONROD)).ravel() * f.ravel()
        error = error + jnp.sum(weight * inner_error) / safe
        return Inner(t, centre, scale, log_density, jnp.log(total) + peak, error)


def _range(table: TabulatedDensity) -> tuple[Scalar, Scalar]:
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
