"""Sums of squares with one quantity held at a value.

A quantity is a data coordinate, θ_c or α*. Each is imposed by elimination, so that what
follows it meets an ordinary least-squares problem, and every quantity shares one
compiled program. Excluded: which values are tried.
"""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from pushfit.fit.problem.derived import critical_angle_at
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.slopes import with_slopes
from pushfit.fit.sweep.outer_nodes import SCALES
from pushfit.fit.sweep.target import IMPOSSIBLE, Expansion, finite
from pushfit.mechanics.numerics import norm2
from pushfit.model import Scalar
from pushfit.parameters import TINY

# Least information on any coordinate: steps stay finite where heights say nothing.
LEAST_INFORMATION = 1e-6
# Size of the least ellipse whose axis is turned: that of a circle has no log.
ROUNDEST = 1e-2
# θ_c where there is none, or where it plays no part [rad].
SOME_ANGLE = 0.1
# Stands in a log for a pivot that is not positive, or none [its unit]: costs there stay
# finite until `is_possible` rejects them. Not tuned.
SMALLEST_PIVOT = 1e-12


class Likelihood(eqx.Module):
    """Half the sum of squares of a problem, for a value of a quantity and all else.

    Its coordinates are the value [ln unit, or rad], followed by those of `chart`.

    Args:
        problem: Problem.
        index: Which of `quantities` has the value.
        reference_alpha: Azimuth of θ_c [rad].
        angle: θ_c where it is held, too [rad]; NaN where it is free.
    """

    problem: Problem
    index: Int[Array, ""]
    reference_alpha: Scalar
    angle: Scalar

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of what may be imposed."""
        return imposable(self.problem)

    @property
    def mean(self) -> Float[Array, " w"]:
        """No prior acts: it has next to no precision."""
        return jnp.zeros(len(self.problem.data_names) + 1)

    @property
    def precision(self) -> Float[Array, "w w"]:
        """Next to nothing, which keeps steps finite."""
        return LEAST_INFORMATION * jnp.eye(self.mean.size)

    @property
    def is_free(self) -> Bool[Array, " w"]:
        """Coordinates that are neither the value nor what it replaces."""
        names = self.problem.data_names
        replaced = {"theta_c": pivot_name(self.problem), "alpha_star": "f2"}
        slots = [names.index(str(replaced.get(q, q))) for q in self.quantities]
        at = jnp.arange(-1, len(names))
        is_free = (at >= 0) & (at != jnp.asarray(slots)[self.index])
        for is_used, pivot in self._second_pivots():
            is_free = is_free & ~(is_used & (at == names.index(pivot)))
        return is_free

    def _second_pivots(self) -> list[tuple[Bool[Array, ""], str]]:
        """Coordinates that may keep θ_c while another quantity is held, and when.

        The first, or the second where the first is itself held.
        """
        names = self.problem.data_names
        law = self.problem.grasp.law
        if "theta_c" not in self.quantities or law.is_searched:
            return []
        is_left = ~jnp.isnan(self.angle) & (self.index != len(names))
        pivots = [pivot for pivot in law.ties if pivot in names][:2]
        is_first_held = self.index == names.index(pivots[0])
        is_used = is_left & ~is_first_held, is_left & is_first_held
        return list(zip(is_used, pivots, strict=False))

    def critical_angle(self, y: Float[Array, " q"]) -> Scalar:
        """θ_c at data coordinates; NaN where the contact never rolls [rad]."""
        return critical_angle_at(self.problem, y, self.reference_alpha)

    def softened(self, sharpness: Scalar) -> "Likelihood":
        """The same with a transition that is at most so sharp.

        Where forces are searched it stays as it is: a soft one costs three searches
        for the tilt, and the tilt rounds the switch by itself.
        """
        grasp = self.problem.grasp
        if grasp.law.is_searched:
            return self
        softer = jnp.minimum(sharpness, grasp.sharpness)
        grasp = replace(grasp, sharpness=softer)
        return replace(self, problem=replace(self.problem, grasp=grasp))

    def point(self, w: Float[Array, " w"]) -> Float[Array, " q"]:
        """Data coordinates."""
        y = self.impose(w[0], w[1:])
        names, kept = self.problem.data_names, y
        for is_used, pivot in self._second_pivots():
            at = names.index(pivot)
            angle = jnp.nan_to_num(self.angle, nan=SOME_ANGLE)
            value = self._pivot_value(pivot, angle, y)
            kept = kept.at[at].set(jnp.where(is_used, value, y[at]))
        return kept

    def expand(self, w: Float[Array, " w"]) -> Expansion:
        """Second-order expansion by Gauss-Newton."""
        # In two steps: in one the point is worked out anew for every slope.
        y, turned = with_slopes(self.point, w)
        residuals, jacobian = with_slopes(self.problem.data_residuals, y)
        jacobian = turned @ jacobian
        cost = finite(jnp.sum(residuals**2) / 2)
        cost = jnp.where(self.is_possible(w[0], y), cost, IMPOSSIBLE)
        return Expansion(
            y=w,
            misfit=cost,
            cost=cost,
            gradient=jacobian @ residuals,
            hessian=jacobian @ jacobian.T,
        )

    def at(self, value: Scalar, y: Float[Array, " q"]) -> Float[Array, " w"]:
        """Coordinates of data coordinates that have the value."""
        return jnp.concatenate([value[None], self.chart(y)])

    def start(
        self, value: Scalar, y: Float[Array, " q"]
    ) -> tuple[Float[Array, " w"], Scalar]:
        """Coordinates near data coordinates, stiffness scaled to the heights.

        Returns:
            The coordinates, and half the sum of squares there, very large where the
            value is impossible.
        """
        problem = self.problem
        weight = jnp.where(problem.mask, problem.reference_sigma**-2, 0.0)
        # Forces are proportional to these together.
        is_scaled = np.isin(problem.data_names, ["ln_A", "ln_B", "ln_F_0"])

        def at(
            z: Float[Array, " q"], is_last: Bool[Array, ""]
        ) -> tuple[Float[Array, " q"], Scalar]:
            y = self.impose(value, z)
            predicted = problem.predict(problem.data_state(y))
            scale = jnp.sum(weight * predicted * problem.observed)
            scale = scale / jnp.maximum(jnp.sum(weight * predicted**2), TINY)
            shift = jnp.where(is_scaled, jnp.log(jnp.clip(scale, *SCALES)), 0.0)
            residuals = problem.with_constraint(problem.residuals_of(predicted), y)
            cost = finite(jnp.sum(residuals**2) / 2)
            cost = jnp.where(self.is_possible(value, y), cost, IMPOSSIBLE)
            return jnp.where(is_last, z, z + shift), cost

        # Both predictions are one evaluation, which is what takes long to compile.
        z, costs = jax.lax.scan(at, self.chart(y), jnp.array([False, True]))
        return jnp.concatenate([value[None], z]), costs[1]

    def impose(self, value: Scalar, z: Float[Array, " q"]) -> Float[Array, " q"]:
        """Data coordinates near z at which the quantity has the value.

        For α* the place of f1 holds ln |f|, so that the ellipse cannot turn by 90°.
        """
        names = self.quantities
        y = jnp.where(jnp.arange(z.size) == self.index, value, z)
        if "theta_c" in names:
            pivot = str(pivot_name(self.problem))
            at = self.problem.data_names.index(pivot)
            at_angle = z.at[at].set(self._pivot_value(pivot, value, z))
            y = jnp.where(self.index == names.index("theta_c"), at_angle, y)
        if "alpha_star" in names:
            f1 = self.problem.data_names.index("f1")
            # The soft axis lies across the stiff one, hence the sign.
            shape = -jnp.exp(z[f1]) * jnp.stack(
                [jnp.cos(2 * value), jnp.sin(2 * value)]
            )
            turned = z.at[f1].set(shape[0]).at[f1 + 1].set(shape[1])
            y = jnp.where(self.index == names.index("alpha_star"), turned, y)
        return y

    def chart(self, y: Float[Array, " q"]) -> Float[Array, " q"]:
        """The z from which `impose` returns to y, if y has the value."""
        if "alpha_star" not in self.quantities:
            return y
        f1 = self.problem.data_names.index("f1")
        size = jnp.maximum(norm2(y[f1], y[f1 + 1]), ROUNDEST)
        is_axis = self.index == self.quantities.index("alpha_star")
        return jnp.where(is_axis, y.at[f1].set(jnp.log(size)), y)

    def is_possible(self, value: Scalar, y: Float[Array, " q"]) -> Bool[Array, ""]:
        """Whether θ_c of the model at y is the angle imposed: not beyond lift-off.

        Where that takes a search of its own it is left to others.
        """
        is_tie = self.problem.grasp.law.is_tie
        if "theta_c" not in self.quantities or is_tie is None:
            return jnp.asarray(True)
        state = self.problem.data_state(y)
        is_switch = is_tie(state.params, state.grasp(self.problem.grasp), value)
        return is_switch | (self.index != self.quantities.index("theta_c"))

    def _pivot_value(self, pivot: str, angle: Scalar, z: Float[Array, " q"]) -> Scalar:
        """Log of the pivot that puts the critical angle at an angle."""
        state, direction = self.problem.data_state(z), (angle, self.reference_alpha)
        tie = self.problem.grasp.law.ties[pivot]
        value = tie(state.params, state.grasp(self.problem.grasp), direction)
        value = jnp.where(jnp.isnan(value), 0.0, value)
        return jnp.log(jnp.maximum(value, SMALLEST_PIVOT))


def imposable(problem: Problem) -> tuple[str, ...]:
    """Names of the quantities that a value may be imposed on."""
    names = list(problem.data_names)
    span = problem.grasp.support_span
    pivot = pivot_name(problem)
    if pivot is not None and not (pivot == "ln_A" and span is not None):
        names.append("theta_c")
    # With two supports the best direction is not the soft axis.
    if "f1" in names and span is None:
        names.append("alpha_star")
    return tuple(names)


def pivot_name(problem: Problem) -> str | None:
    """Data coordinate that θ_c replaces; None where nothing is free to move it."""
    ties = problem.grasp.law.ties
    return next((name for name in ties if name in problem.data_names), None)
