"""Least squares with one quantity held at a value: the points of profile likelihoods.

A quantity is a data coordinate, θ_c or α*. Each is imposed by elimination, so that the
solver meets an ordinary least-squares problem and every quantity shares one compiled
program. Excluded: which values to ask for, and what the sums of squares mean.
"""

import itertools
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float, Int

from pushfit.critical_tilt import critical_friction
from pushfit.directions import critical_angle
from pushfit.fit.problem import Problem, State
from pushfit.fit.programs import compiled
from pushfit.model import (
    Contact,
    Grasp,
    Scalar,
    as_float,
    rolling_limits,
    tangential_stiffness,
    unit_vector,
)
from pushfit.numerics import norm2

# Sums of squares good to 1e-6 of a unit of chi-square need no more.
RTOL = ATOL = 1e-8
MAX_STEPS = 60
# Values solved per call of the compiled program, and starts of each.
CHUNK, N_STARTS = 64, 3
# Sharpness of the transition that leads to the hard one: of an azimuth sweep with
# preload two in three values of A then come within 4 of the least chi-square, without
# it two in thirty. Neighbours must still improve on what remains.
SOFT = 16.0
# Offsets of ln A and ln C_rr around each start of the pool: with the value imposed, the
# old A and C_rr may be decades off.
SHIFTS = tuple(itertools.product((0.0, -0.7, 0.7), (0.0, -0.5, 0.5, -1.5, 1.5)))
# Coordinates that θ_c replaces, first choice first. Where the object tilts only C_rr
# follows from the angle without a search: it is what the unrolled push needs there.
PIVOTS = {"linear": ("ln_B", "ln_C_rr", "ln_A"), "tilting": ("ln_C_rr",)}
# Distance of an imposed θ_c of tilting mechanics from another crossing [rad].
SAME_ANGLE = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Solutions:
    """Best fits with a quantity imposed.

    Args:
        points: Data coordinates.
        chi_square: Sums of squared residuals; infinite where the value is impossible.
    """

    points: Float[np.ndarray, "k q"]
    chi_square: Float[np.ndarray, " k"]


class ConstrainedFit(eqx.Module):
    """Least squares of a problem with one quantity imposed.

    Args:
        problem: Problem.
        pool: Data coordinates from which solutions are sought, of every basin.
        reference_alpha: Azimuth of θ_c [rad].
    """

    problem: Problem
    pool: Float[Array, "k q"]
    reference_alpha: Scalar = eqx.field(converter=as_float)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of what may be imposed."""
        names = list(self.problem.data_names)
        span = self.problem.grasp.support_span
        pivot = pivot_name(self.problem)
        if pivot is not None and not (pivot == "ln_A" and span is not None):
            names.append("theta_c")
        # With two supports the best direction is not the soft axis.
        if "f1" in names and span is None:
            names.append("alpha_star")
        return tuple(names)

    def solve(
        self,
        quantity: tuple[str, ...],
        value: Float[np.ndarray, " k"],
        starts: Float[np.ndarray, "k s q"] | None = None,
    ) -> Solutions:
        """Best fit at each value.

        Args:
            quantity: Name of the quantity imposed in each fit.
            value: Its value [ln unit, or rad].
            starts: Data coordinates to start from; None screens the pool.

        Returns:
            Solutions in the order of the values.
        """
        index = np.array([self.quantities.index(name) for name in quantity])
        points, costs = [], []
        for first in range(0, len(value), CHUNK):
            part = np.arange(first, min(first + CHUNK, len(value)))
            # Repeating the last value keeps the shape, and so the compiled program.
            rows = np.minimum(np.arange(first, first + CHUNK), len(value) - 1)
            k, v = jnp.asarray(index[rows]), jnp.asarray(value[rows])
            if starts is None:
                chosen = self._seek(k, v)
            else:
                chosen = jnp.asarray(starts[rows])
            y, cost = _solve(self, k, v, chosen)
            points.append(np.asarray(y)[: part.size])
            costs.append(np.asarray(cost)[: part.size])
        return Solutions(
            points=np.concatenate(points), chi_square=np.concatenate(costs)
        )

    def impose(
        self, index: Int[Array, ""], value: Scalar, z: Float[Array, " q"]
    ) -> Float[Array, " q"]:
        """Data coordinates near z at which the quantity has the value.

        For α* the place of f1 holds ln |f|, so that the ellipse cannot turn by 90°.
        """
        names = self.quantities
        y = jnp.where(jnp.arange(z.size) == index, value, z)
        if "theta_c" in names:
            pivot = self.problem.data_names.index(str(pivot_name(self.problem)))
            at_angle = z.at[pivot].set(self._pivot_value(value, z))
            y = jnp.where(index == names.index("theta_c"), at_angle, y)
        if "alpha_star" in names:
            f1 = self.problem.data_names.index("f1")
            # The soft axis lies across the stiff one, hence the sign.
            shape = -jnp.exp(z[f1]) * jnp.stack(
                [jnp.cos(2 * value), jnp.sin(2 * value)]
            )
            turned = z.at[f1].set(shape[0]).at[f1 + 1].set(shape[1])
            y = jnp.where(index == names.index("alpha_star"), turned, y)
        return y

    def chart(self, index: Int[Array, ""], y: Float[Array, " q"]) -> Float[Array, " q"]:
        """The z from which `impose` returns to y, if y has the value."""
        if "alpha_star" not in self.quantities:
            return y
        f1 = self.problem.data_names.index("f1")
        size = jnp.maximum(norm2(y[f1], y[f1 + 1]), 1e-2)
        is_axis = index == self.quantities.index("alpha_star")
        return jnp.where(is_axis, y.at[f1].set(jnp.log(size)), y)

    def is_possible(
        self, index: Int[Array, ""], value: Scalar, y: Float[Array, " q"]
    ) -> Array:
        """Whether θ_c of the model at y is the angle imposed: not beyond lift-off."""
        if "theta_c" not in self.quantities:
            return jnp.asarray(True)
        state = self.problem.data_state(y)
        if self.problem.grasp.mechanics == "tilting":
            grasp = self._grasp(state)
            alpha = self.reference_alpha
            angle = critical_angle(state.params, grasp, alpha)
            is_switch = jnp.abs(angle - value) < SAME_ANGLE
        else:
            A, F = state.params.A, state.preload / self.problem.grasp.push_length
            sine = jnp.sin(value)
            # Below the second bound the angle is the lower end of the rolling range.
            is_switch = (F + A * sine > 0) & (A + F * sine >= 0)
        return is_switch | (index != self.quantities.index("theta_c"))

    def _seek(
        self, index: Int[Array, " k"], value: Float[Array, " k"]
    ) -> Float[Array, "k s q"]:
        """Starts from the pool, the last of them carried along a soft transition.

        On either side of a hard switch the other branch has no slope: from the pool
        alone a solver stops at the first push whose branch would have to change.
        """
        chosen = _screen(self, index, value)
        grasp = self.problem.grasp
        # Where the object tilts the rolling force has a slope in every coordinate, and
        # a soft equilibrium costs three searches instead of one.
        if np.isfinite(grasp.sharpness) or grasp.mechanics == "tilting":
            return chosen
        soft = replace(self.problem, grasp=replace(grasp, sharpness=SOFT))
        y, _ = _solve(replace(self, problem=soft), index, value, chosen)
        return chosen.at[:, -1].set(y)

    def _grasp(self, state: State) -> Grasp:
        """The grasp with the preload of a point."""
        return eqx.tree_at(lambda g: g.preload, self.problem.grasp, state.preload)

    def _pivot_value(self, angle: Scalar, z: Float[Array, " q"]) -> Scalar:
        """Log of the pivot that puts the critical angle at an angle.

        B |u_e| cos θ_c = limit (F_0/S_p + A sin θ_c)
        """
        grasp = self.problem.grasp
        state = self.problem.data_state(z)
        group: Contact = state.params  # pyright: ignore[reportAssignmentType]
        if grasp.mechanics == "tilting":
            direction = (angle, self.reference_alpha)
            friction = critical_friction(group, self._grasp(state), direction)
            return _safe_log(jnp.where(jnp.isnan(friction), 0.0, friction))
        preload = state.preload / grasp.push_length
        pivot = pivot_name(self.problem)
        sine, cosine = jnp.sin(angle), jnp.cos(angle)
        unit = eqx.tree_at(lambda c: c.B, group, jnp.ones_like(group.B))
        x, y = tangential_stiffness(unit, unit_vector(self.reference_alpha))
        if pivot == "ln_A":
            ratio = group.B * norm2(x, y) * cosine / group.C_rr
            return _safe_log((ratio - preload) / sine)
        pressed = (preload + group.A * sine) / cosine
        if grasp.support_span is None:
            size = norm2(x, y)
            if pivot == "ln_B":
                return _safe_log(pressed * group.C_rr / size)
            return _safe_log(group.B * size / pressed)
        x, y = jnp.abs(x), jnp.abs(y)
        limit_x, limit_y = rolling_limits(group, grasp.support_span)
        if pivot == "ln_B":
            # θ_c is the larger of the angles about both axes.
            return _safe_log(pressed * jnp.minimum(limit_x / x, limit_y / y))
        needed = group.B / pressed
        return _safe_log(jnp.maximum(needed * x - (limit_x - group.C_rr), needed * y))


def pivot_name(problem: Problem) -> str | None:
    """Data coordinate that θ_c replaces; None where nothing is free to move it."""
    pivots = PIVOTS[problem.grasp.mechanics]
    return next((name for name in pivots if name in problem.data_names), None)


def _safe_log(value: Scalar) -> Scalar:
    """Log that stays finite on the wrong side, where `is_possible` rejects."""
    return jnp.log(jnp.maximum(value, 1e-12))


@compiled
def _screen(
    fit: ConstrainedFit, index: Int[Array, " k"], value: Float[Array, " k"]
) -> Float[Array, "k s q"]:
    """The best of the shifted pool at each value, from different basins."""
    names = fit.problem.data_names
    shifts = np.zeros((len(SHIFTS), len(names)))
    for column, name in enumerate(("ln_A", "ln_C_rr")):
        if name in names:
            shifts[:, names.index(name)] = [shift[column] for shift in SHIFTS]

    def one(i: Int[Array, ""], v: Scalar) -> Float[Array, "s q"]:
        z = jax.vmap(lambda y: fit.chart(i, y))(fit.pool)
        z = z[:, None, :] + jnp.asarray(shifts)[None]

        def cost(point: Float[Array, " q"]) -> Scalar:
            y = fit.impose(i, v, point)
            total = jnp.sum(fit.problem.data_residuals(y) ** 2)
            return jnp.where(fit.is_possible(i, v, y), total, jnp.inf)

        costs = jax.vmap(jax.vmap(cost))(z)
        costs = jnp.where(jnp.isfinite(costs), costs, jnp.inf)
        best = jnp.argmin(costs, axis=1)
        per_basin = jnp.min(costs, axis=1)
        _, order = jax.lax.top_k(-per_basin, N_STARTS)
        chosen = z[order, best[order]]
        return jax.vmap(lambda point: fit.impose(i, v, point))(chosen)

    return jax.lax.map(lambda pair: one(*pair), (index, value))


@compiled
def _solve(
    fit: ConstrainedFit,
    index: Int[Array, " k"],
    value: Float[Array, " k"],
    starts: Float[Array, "k s q"],
) -> tuple[Float[Array, "k q"], Float[Array, " k"]]:
    """Levenberg-Marquardt from every start; the best of each value."""
    solver = optx.LevenbergMarquardt(rtol=RTOL, atol=ATOL)

    def one(
        i: Int[Array, ""], v: Scalar, start: Float[Array, " q"]
    ) -> tuple[Float[Array, " q"], Scalar]:
        solution = optx.least_squares(
            lambda z, _: fit.problem.data_residuals(fit.impose(i, v, z)),
            solver,
            fit.chart(i, start),
            options={"jac": "fwd"},
            max_steps=MAX_STEPS,
            throw=False,
        )
        y = fit.impose(i, v, solution.value)
        cost = jnp.sum(fit.problem.data_residuals(y) ** 2)
        is_valid = fit.is_possible(i, v, y) & jnp.isfinite(cost)
        return y, jnp.where(is_valid, cost, jnp.inf)

    n_starts = starts.shape[1]
    flat = starts.reshape(-1, starts.shape[2])
    lanes = (jnp.repeat(index, n_starts), jnp.repeat(value, n_starts), flat)
    # One lane after the other: under vmap all wait for the slowest, four times as long.
    points, costs = jax.lax.map(lambda lane: one(*lane), lanes)
    costs = costs.reshape(-1, n_starts)
    points = points.reshape(*costs.shape, -1)
    best = jnp.argmin(costs, axis=1)
    rows = jnp.arange(best.size)
    return points[rows, best], costs[rows, best]
