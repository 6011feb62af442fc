"""The outer coordinate of the posterior integral and the cells it starts from.

Cells end at every elevation that was pushed, where the integrand has a kink, and crowd
around every mode of the likelihood. Excluded: integrating.
"""

import itertools
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import FitResult
from tests.oracle import priors
from tests.oracle.integrand import Integrand, Strip

# Elevations outside this range switch nowhere [rad].
LOWEST, HIGHEST = np.radians((0.05, 89.9))
# With more elevations than this their kinks are too weak to need cells of their own.
MAX_KNOTS = 64
# Prior standard deviations that the outer range covers.
N_SD = 10.0
# Cells around a mode grow by this factor from this many standard deviations on.
FIRST, GROWTH = 3.0, 5.0
# Widest cell to start from [log units].
WIDEST = 1.5
MAX_MODES = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class OuterAxis:
    """Outer coordinate: u over strips between elevations, or ln A.

    Args:
        breakpoints: Elevations at which pushes change over [rad]; empty for ln A.
        edges: Ends of the cells to start from, ascending.
    """

    breakpoints: Float[np.ndarray, " k"]
    edges: Float[np.ndarray, " e"]

    def points(self, u: Float[np.ndarray, " n"]) -> Strip | Float[Array, " n"]:
        """What the integrand takes for outer nodes."""
        if self.breakpoints.size == 0:
            return jnp.asarray(u)
        at = np.log(np.tan(self.breakpoints))
        right = np.searchsorted(at, u)
        last = self.breakpoints.size - 1
        low, high = np.clip(right - 1, 0, last), np.clip(right, 0, last)
        width = np.where(high > low, at[high] - at[low], 1.0)
        return Strip(
            left=jnp.asarray(self.breakpoints[low]),
            right=jnp.asarray(self.breakpoints[high]),
            share=jnp.asarray(np.where(high > low, (u - at[low]) / width, 0.0)),
            beyond=jnp.asarray(np.where(high > low, 0.0, u - at[low])),
            width=jnp.asarray(width),
        )


def make_axis(integrand: Integrand, fit: FitResult) -> OuterAxis:
    """Outer coordinate of an integrand.

    Args:
        integrand: Integrand with at least one free combination.
        fit: Least squares; its modes are where the integrand peaks.

    Returns:
        Axis with the cells to start from.
    """
    if integrand.pivot == "A":
        assert integrand.prior_A is not None
        table = integrand.prior_A
        ends = (float(table.start), float(priors.end(table)))
        return OuterAxis(
            breakpoints=np.zeros(0), edges=_edges(integrand, fit, ends, None)
        )
    breakpoints = _breakpoints(integrand.problem)
    means, sds = _prior_moments(integrand)
    # ln B - ln C_rr at the lowest and the highest elevation, A at its prior mean.
    ratio = means[1] - means[2]
    spread = N_SD * float(np.sqrt(np.sum(sds**2)))
    at = np.log(np.tan(breakpoints))
    low = at[0] + min(0.0, ratio - spread - _g(integrand, breakpoints[:1], means[0])[0])
    high = at[-1] + max(
        0.0, ratio + spread - _g(integrand, breakpoints[-1:], means[0])[0]
    )
    edges = _edges(integrand, fit, (low, high), breakpoints)
    return OuterAxis(breakpoints=breakpoints, edges=edges)


def _breakpoints(problem: Problem) -> Float[np.ndarray, " k"]:
    """Elevations at which a push changes from rolled to unrolled."""
    grasp = problem.grasp
    middle = np.array([np.pi / 4])
    if np.isfinite(grasp.sharpness) or grasp.support_span is not None:
        return middle
    used = np.any(np.asarray(problem.mask), axis=0)
    theta = np.unique(np.round(np.asarray(problem.pushes.theta)[used], 9))
    theta = theta[(theta > LOWEST) & (theta < HIGHEST)]
    if theta.size > MAX_KNOTS:
        theta = theta[np.linspace(0, theta.size - 1, MAX_KNOTS).astype(int)]
    return theta if theta.size else middle


def _prior_moments(
    integrand: Integrand,
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Prior means and standard deviations of ln A, ln B and ln C_rr."""
    tables = (integrand.prior_A, integrand.prior_B, integrand.prior_C)
    zero = jnp.zeros(())
    group = integrand.contact(zero, zero, zero)
    fixed = np.log([float(group.A), float(group.B), float(group.C_rr)])
    means = [
        v if t is None else float(t.mean) for t, v in zip(tables, fixed, strict=True)
    ]
    sds = [0.0 if t is None else float(t.sd) for t in tables]
    return np.array(means), np.array(sds)


def _g(
    integrand: Integrand, theta: Float[np.ndarray, " k"], ln_A: float
) -> Float[np.ndarray, " k"]:
    """Log of the B / C_rr that puts θ_c at θ, as in `Strip`."""
    grasp = integrand.problem.grasp
    preload = float(grasp.preload) / float(grasp.push_length)
    return np.log((preload + np.exp(ln_A) * np.sin(theta)) / np.cos(theta))


def _edges(
    integrand: Integrand,
    fit: FitResult,
    ends: tuple[float, float],
    breakpoints: Float[np.ndarray, " k"] | None,
) -> Float[np.ndarray, " e"]:
    """Ends of the first cells."""
    low, high = ends
    centres, scales = _modes(integrand, fit, breakpoints)
    low, high = min([low, *(centres - 2)]), max([high, *(centres + 2)])
    edges = [low, high]
    if breakpoints is not None:
        edges += list(np.log(np.tan(breakpoints)))
    for centre, scale in zip(centres, scales, strict=True):
        reach = FIRST * scale
        while reach < WIDEST:
            edges += [centre - reach, centre + reach]
            reach *= GROWTH
    # Edges of different modes that all but coincide would make empty cells.
    tolerance = min([*(scales / 2), 0.01])
    ordered = np.unique(edges)
    kept = ordered[np.r_[True, np.diff(ordered) > tolerance]]
    kept[-1] = ordered[-1]
    filled = [
        np.linspace(a, b, max(2, int(np.ceil((b - a) / WIDEST)) + 1))[:-1]
        for a, b in itertools.pairwise(kept)
    ]
    return np.concatenate([*filled, kept[-1:]])


def _modes(
    integrand: Integrand, fit: FitResult, breakpoints: Float[np.ndarray, " k"] | None
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Outer coordinate of every mode and about the width of its peak."""
    means, sds = _prior_moments(integrand)
    names = integrand.problem.data_names
    order = ("ln_A", "ln_B", "ln_C_rr")
    gradient = np.array([-1.0, 1.0, -1.0]) if breakpoints is not None else np.eye(3)[0]
    columns = [order.index(name) for name in names if name in order]
    precision = np.diag(1 / sds[columns] ** 2)
    centres, scales = [], []
    for mode in fit.modes[:MAX_MODES]:
        logs = [mode.coordinates.get(n, m) for n, m in zip(order, means, strict=True)]
        y = jnp.asarray([mode.coordinates[name] for name in names])
        jacobian = np.asarray(_jacobian(integrand.problem, y))
        covariance = np.linalg.inv(jacobian.T @ jacobian + precision)
        weights = gradient[columns]
        scales.append(float(np.sqrt(weights @ covariance @ weights)))
        if breakpoints is None:
            centres.append(logs[0])
            continue
        g, at = _g(integrand, breakpoints, logs[0]), np.log(np.tan(breakpoints))
        ratio = logs[1] - logs[2]
        beyond = min(ratio - g[0], 0.0) + max(ratio - g[-1], 0.0)
        centres.append(float(np.interp(ratio, g, at)) + beyond)
    return np.array(centres), np.array(scales)


@compiled
def _jacobian(problem: Problem, y: Float[Array, " q"]) -> Float[Array, "m q"]:
    return jax.jacfwd(problem.data_residuals)(y)
