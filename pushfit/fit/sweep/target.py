"""The posterior of one table in the coordinates of the sweep.

Predictions and priors are those of `Problem`, the likelihood is its own with repeats
pooled and sampled noise apart (`pushfit.fit.sweep.likelihood`); what is added here
serves only to find where the density is large. Excluded: finding where that is
(`pushfit.fit.sweep.sheet`).
"""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from pushfit.fit.problem.priors.conditional_prior import SCORES
from pushfit.fit.problem.problem import ModelPoint, Problem
from pushfit.fit.problem.repeats.pooling import Pooled
from pushfit.fit.problem.slopes import with_slopes
from pushfit.fit.sweep.coordinate_roles import Roles
from pushfit.fit.sweep.likelihood import log_likelihood, noise_terms
from pushfit.mechanics.combinations import contact, tangential_stiffness
from pushfit.mechanics.containers import unit_vector
from pushfit.mechanics.numerics import norm2
from pushfit.model import Scalar

# Stands for a cost that is not finite.
IMPOSSIBLE = 1e300
# Least change of a quantile per unit of its normal score: where quantiles coincide the
# density of draws stays finite, and so a draw keeps a weight. Not tuned.
SMALLEST_SLOPE = 1e-12
# Of the columns of a table of quantiles.
FIRST_SCORE, SCORE_STEP = float(SCORES[0]), float(SCORES[1] - SCORES[0])


class QuantileTable(eqx.Module):
    """A prior given a number: quantiles by normal score, linear between entries.

    Args:
        start: First value of the number.
        step: Distance between its values.
        values: Quantile for each value, at each of `SCORES`.
    """

    start: Scalar
    step: Scalar
    values: Float[Array, "r s"]

    def draw(self, whole: Scalar, score: Scalar) -> tuple[Scalar, Scalar]:
        """The quantile at a normal score, and the log density of such draws."""
        row, p = _place((whole - self.start) / self.step, self.values.shape[0])
        column, q = _place((score - FIRST_SCORE) / SCORE_STEP, self.values.shape[1])
        corner = self.values[row + jnp.arange(2)][:, column + jnp.arange(2)]
        low, high = corner[0] * (1 - p) + corner[1] * p
        slope = jnp.maximum((high - low) / SCORE_STEP, SMALLEST_SLOPE)
        log_density = jax.scipy.stats.norm.logpdf(score) - jnp.log(slope)
        return low + q * (high - low), log_density


class Target(eqx.Module):
    """A posterior to be swept.

    Args:
        pooled: Data, grasp, noise and priors, repeats pooled.
        mean: Of the coordinates of the sweep before the data.
        precision: Of the normal distribution that stands for their prior; that of an
            ellipse for ln s at its mean.
        covariance: Of the same.
        shape_sd: Prior standard deviation of e1 and e2.
        tables: Priors of the conditional coordinates by name.
        reference_alpha: Azimuth of θ_c [rad].
        roles: Part that each coordinate plays.
    """

    pooled: Pooled
    mean: Float[Array, " q"]
    precision: Float[Array, "q q"]
    covariance: Float[Array, "q q"]
    shape_sd: Scalar
    tables: Mapping[str, QuantileTable]
    reference_alpha: Scalar
    roles: Roles = eqx.field(static=True)

    def seen(self, y: Float[Array, " q"]) -> dict[str, Scalar]:
        """Sampling coordinates by name; those that heights do not see are 0."""
        z = {name: jnp.zeros(()) for name in self.pooled.problem.names}
        for name, value in zip(self.roles.others, y[2:], strict=True):
            z[name] = value
        if self.roles.inner is not None:
            z[self.roles.inner] = y[1]
        if self.roles.pivot is not None:
            sign = 1.0 if self.roles.pivot == "ln_B" else -1.0
            outer = outer_of(self.pooled.problem, z, self.reference_alpha)
            z[self.roles.pivot] = sign * (y[0] - outer)
        return z

    def vector(self, z: Mapping[str, Scalar]) -> Float[Array, " p"]:
        """Sampling coordinates in the order of the problem."""
        return jnp.stack([z[name] for name in self.pooled.problem.names])

    def differences(self, y: Float[Array, " q"]) -> Float[Array, "c n"]:
        """Predictions less mean heights; 0 for padding [table unit]."""
        return self.differences_at(self.seen(y))

    def differences_at(self, z: Mapping[str, Scalar]) -> Float[Array, "c n"]:
        """The same at sampling coordinates by name."""
        problem = self.pooled.problem
        return problem.differences(problem.predict(state_of(problem, z)))

    def log_prob(self, x: Float[Array, " p"]) -> Scalar:
        """Unnormalised log posterior density of sampling coordinates."""
        named = dict(zip(self.pooled.problem.names, x, strict=True))
        return self.log_prob_of(x, self.differences_at(named))

    def log_prob_of(
        self, x: Float[Array, " p"], difference: Float[Array, "c n"]
    ) -> Scalar:
        """The same where the differences are known."""
        named = dict(zip(self.pooled.problem.names, x, strict=True))
        level = log_likelihood(self.pooled, difference, named)
        value = level + self.pooled.problem.log_prior(x)
        return jnp.where(jnp.isnan(value), -jnp.inf, value)

    def cost(self, y: Float[Array, " q"], difference: Float[Array, "c n"]) -> Scalar:
        """Negative log of likelihood times normal prior, up to a constant."""
        terms = noise_terms(self.pooled, difference)
        return finite(-terms.log_likelihood) + self.half_square(y)

    def half_square(self, y: Float[Array, " q"]) -> Scalar:
        """Half the squared distance from the prior's mean, in its own sd."""
        z = y - self.mean
        return z @ self.precision @ z / 2

    def expand(self, y: Float[Array, " q"]) -> "Expansion":
        """Second-order expansion of the negative log likelihood, by Gauss-Newton."""
        difference, jacobian = with_slopes(self.differences, y)
        terms = noise_terms(self.pooled, difference)
        misfit = finite(-terms.log_likelihood)
        weighted = jacobian * terms.weights[None]
        gradient = jnp.einsum("qcn,cn->q", weighted, difference)
        hessian = jnp.einsum("qcn,rcn->qr", weighted, jacobian)
        # Where no push can be predicted nothing is known of the slope either, and one
        # such node must not spoil the sums over all.
        is_known = (misfit < IMPOSSIBLE) & jnp.all(jnp.isfinite(hessian))
        return Expansion(
            y=y,
            misfit=misfit,
            cost=misfit + self.half_square(y),
            gradient=jnp.where(is_known, gradient, 0.0),
            hessian=jnp.where(is_known, hessian, 0.0),
        )


class Expansion(eqx.Module):
    """Negative log likelihood around a point.

    Args:
        y: The point.
        misfit: Negative log likelihood.
        cost: The same with the normal prior.
        gradient: Of the misfit.
        hessian: Of the misfit.
    """

    y: Float[Array, "*n q"]
    misfit: Float[Array, "*n"]
    cost: Float[Array, "*n"]
    gradient: Float[Array, "*n q"]
    hessian: Float[Array, "*n q q"]


def state_of(problem: Problem, z: Mapping[str, Scalar]) -> ModelPoint:
    """What heights depend on at sampling coordinates, the shortest way."""
    is_seen = set(problem.data_names) <= set(z)
    names = problem.data_names if is_seen else problem.names
    point = jnp.stack([z[name] for name in names])
    return problem.data_state(point) if is_seen else problem.state(point)


def outer_of(
    problem: Problem, z: Mapping[str, Scalar], reference_alpha: Scalar
) -> Scalar:
    """U = ln(B |u(α)| / (A C_rr)) at sampling coordinates."""
    group = contact(state_of(problem, z).params)
    x, y = tangential_stiffness(group, unit_vector(reference_alpha))
    return jnp.log(norm2(x, y) / (group.A * group.C_rr))


def finite(cost: Scalar) -> Scalar:
    """A cost, very large where it is not finite."""
    return jnp.nan_to_num(cost, nan=IMPOSSIBLE, posinf=IMPOSSIBLE)


def _place(position: Scalar, n: int) -> tuple[Int[Array, ""], Scalar]:
    """Index of the entry below a position, held inside, and the share beyond it."""
    held = jnp.clip(position, 0, n - 1)
    index = jnp.minimum(held.astype(int), n - 2)
    return index, held - index
