"""Least squares: every valley of the sweep, polished by Levenberg-Marquardt.

The solver is optimistix; what decides whether its answer may be used is here: finite
residuals, the rank of the Jacobian, the best of all modes rather than the first.
Excluded: finding the valleys (`pushfit.fit.profiles.curve`).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from pushfit.errors import FitError
from pushfit.fit.problem.derived import critical_angles
from pushfit.fit.problem.predictions import predict_points
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.problem.slopes import linearised, residuals_at
from pushfit.fit.profiles.curve import search_curve
from pushfit.fit.profiles.weights import (
    uneven_noise,
    uneven_warnings,
    with_known_noise,
    with_noise_of,
)
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import FitResult, FitStatus, Mode
from pushfit.fit.results.fits_along import FitsAlong
from pushfit.model import as_float

# Points, sums of squares, and whether the solver arrived, best first.
Optima = tuple[
    Float[np.ndarray, "k q"], Float[np.ndarray, " k"], Bool[np.ndarray, " k"]
]
# The same in any order, of JAX.
TracedOptima = tuple[Float[Array, "k q"], Float[Array, " k"], Bool[Array, " k"]]

# Far below any standard error that real heights allow, and above rounding.
RTOL = ATOL = 1e-10
# Steps of a start: along what the heights do not see the solver walks until they run
# out, and where it has walked to is as good as any other place. On a kink they run out,
# too, and all other starts wait for it.
MAX_STEPS = 48
# On a kink of the hard switch steps shrink to nothing short of the optimum; started
# again from there with a full step, the solver mostly gets across.
MAX_ROUNDS = 24
# Of these between two estimates of the noise.
N_SETTLING = 4
# Modes closer than this in every coordinate are one mode found twice [log units].
SAME_MODE = 1e-3
# Modes worse than the best by more than this never matter to a 99.9 % set.
KEPT_DELTA_CHI_SQUARE = 30.0
# A thousandth of a standard error, squared.
FLAT_DELTA_CHI_SQUARE = 1e-6
# Where no finite ellipse fits best, chi-square falls towards its infimum for ever: all
# steps of a last round then gain less than a thirtieth of a standard error, squared.
STALLED_DELTA_CHI_SQUARE = 1e-3
# Below this ratio a singular value is rounding, not information.
RANK_TOLERANCE = 1e-8
# An optimum on a kink lies within 1e-10 of it; so far to either side [log units] a
# smooth likelihood has the same standard errors, and one with a kink others.
BESIDE = 1e-8
# Standard errors that differ by less than this share are the same: it is less than the
# two digits show that are printed.
SAME_ERRORS = 0.01


def fit_least_squares(
    setup: Setup, *, reference_alpha: float, throw: bool = True
) -> FitResult:
    """Best fit of the data coordinates, with every other mode beside it.

        minimise Σ ((prediction - height) / sigma)²   over (ln A, ln B, ln C_rr, ...)

    Args:
        setup: Problem and its provenance, its noise settled.
        reference_alpha: Azimuth at which θ_c of a mode is quoted [rad].
        throw: Raise instead of returning a result whose status is not OK.

    Raises:
        FitError: If no start has finite residuals, or none arrived, and `throw` is
            set; it carries points and costs.
    """
    found = polish(setup.problem, search_of(setup, reference_alpha).valleys)
    return fit_result(setup, found, reference_alpha=reference_alpha, throw=throw)


def fit_result(
    setup: Setup, found: Optima, *, reference_alpha: float, throw: bool = True
) -> FitResult:
    """What optima say, however they were found.

    Args:
        setup: Problem and its provenance, its noise settled.
        found: Points, sums of squares, and whether the solver arrived; best first.
        reference_alpha: Azimuth at which θ_c of a mode is quoted [rad].
        throw: Raise instead of returning a result whose status is not OK.

    Raises:
        FitError: If the best has no finite residuals or did not arrive, and `throw` is
            set; it carries points and costs.
    """
    problem, (points, costs, is_done) = setup.problem, found
    mask = np.asarray(problem.mask)
    is_data = np.r_[mask.ravel(), np.ones(problem.n_constraints, bool)]
    step = BESIDE * np.eye(points.shape[1])
    beside = np.concatenate([np.zeros((1, len(step))), step, -step])
    residuals, jacobians = residuals_at(problem, points[0] + beside)
    residuals, jacobians = residuals[0, is_data], jacobians[:, is_data]
    jacobian = jacobians[0]
    if not np.isfinite(costs[0]):
        status = FitStatus.NO_FINITE_START
    elif is_done[0] or _is_flat(jacobian, residuals):
        status = FitStatus.OK
    else:
        status = FitStatus.MAX_STEPS
    if throw and status is not FitStatus.OK:
        raise FitError(
            status.value,
            code=status.name.lower(),
            names=problem.data_names,
            points=points.tolist(),
            costs=costs.tolist(),
        )
    channel_index, column = np.nonzero(mask)
    predicted = _heights_at(problem, points[0])
    angles = critical_angles(problem, points, reference_alpha)
    return FitResult(
        names=problem.data_names,
        estimate=points[0],
        covariance=_covariance(jacobians),
        jacobian=jacobian,
        singular_values=np.linalg.svd(jacobian, compute_uv=False),
        modes=_modes(problem, points, costs, angles),
        chi_square=float(costs[0]),
        n_data=int(mask.sum()),
        n_free=problem.n_free,
        sigma=np.asarray(problem.reference_sigma)[mask],
        predicted=predicted[mask],
        channel=tuple(problem.channels[i] for i in channel_index),
        row=tuple(setup.rows[i] for i in column),
        status=status,
    )


def search_of(setup: Setup, reference_alpha: float | None = None) -> FitsAlong:
    """Best fits along the leading quantity of a setup: those that it has, or new."""
    problem, found = setup.problem, setup.search
    if found is not None and np.array_equal(found.observed, problem.observed):
        return found
    return search_curve(problem, reference_alpha)


def polish(
    problem: Problem, starts: Float[np.ndarray, "k q"], max_rounds: int = MAX_ROUNDS
) -> Optima:
    """Local optima reached from each start."""
    minimiser = partial(_polish, problem.of_data)
    return restarted(minimiser, starts, max_rounds)


def restarted(
    minimiser: Callable[[Float[Array, "k q"]], TracedOptima],
    starts: Float[np.ndarray, "k q"],
    max_rounds: int = MAX_ROUNDS,
) -> Optima:
    """Minima reached from each start, the minimiser restarted while that helps."""
    points = np.asarray(starts)
    costs = np.full(len(points), np.inf)
    is_done = np.zeros(len(points), dtype=bool)
    for _ in range(max_rounds):
        found, found_costs, found_done = (
            np.asarray(a) for a in minimiser(as_float(points))
        )
        gain = costs - found_costs
        is_better = np.isfinite(found_costs) & ~(gain <= 0)
        points = np.where(is_better[:, None], found, points)
        costs = np.where(is_better, found_costs, costs)
        # A restart that gains next to nothing has arrived, whatever the solver says of
        # its steps: on a kink they never meet its tolerance.
        has_arrived = found_done | (gain <= STALLED_DELTA_CHI_SQUARE)
        is_done = np.where(np.isfinite(found_costs), has_arrived, is_done)
        if not np.any(gain[is_better] > FLAT_DELTA_CHI_SQUARE):
            break
    order = np.argsort(costs, kind="stable")
    return points[order], costs[order], is_done[order]


def settle_noise(setup: Setup, reference_alpha: float | None = None) -> Setup:
    """The setup searched, its weights those of the best fit that they lead to.

    Returns:
        Unchanged where sigma was given or pooled and nothing adds to it. A sampled one
        solves Σ r² / (sd² + sigma²) = n - p in every channel at the best fit.
    """
    found = search_of(setup, reference_alpha)
    problem = stated = setup.problem
    noise, is_sampled = setup.noise, setup.noise.kind == "sampled"
    if not (is_sampled or noise.follows_fit):
        return replace(setup, search=found)
    points = found.valleys
    # Noise and fit meet through relative weights alone, those of what is known
    # beforehand and of heavy tails among them: three rounds settle both, each of which
    # is a restart of the one before.
    has_weights = noise.follows_fit or bool(np.any(np.asarray(stated.sd)))
    has_weights |= len(problem.channels) + problem.n_constraints > 1
    has_weights |= problem.likelihood == "student_t"
    n_rounds = N_SETTLING if has_weights else MAX_ROUNDS
    for _ in range(3 if has_weights else 1):
        points, _, _ = polish(problem, points, n_rounds)
        predicted = _heights_at(problem, points[0])
        added, shares = uneven_noise(stated, noise, points[0], predicted=predicted)
        problem = with_known_noise(stated, added)
        if is_sampled:
            problem = with_noise_of(problem, predicted)
    found = replace(found, valleys=points)
    if has_weights:
        # Other weights have other best fits, near the first ones.
        found = search_curve(problem, reference_alpha, found)
    warnings = (*noise.warnings, *uneven_warnings(noise, shares))
    noise = replace(noise, warnings=warnings)
    return replace(setup, problem=problem, noise=noise, search=found)


@compiled
def _polish(problem: Problem, starts: Float[Array, "k q"]) -> TracedOptima:
    return jax.vmap(lambda start: minimise(problem.data_residuals, start))(starts)


def minimise(
    residuals: Callable[[Float[Array, " q"]], Float[Array, " m"]],
    start: Float[Array, " q"],
) -> tuple[Float[Array, " q"], Float[Array, ""], Bool[Array, ""]]:
    """Local minimum of a sum of squares, by Levenberg-Marquardt.

    Returns:
        Coordinates, sum of squares there, and whether the solver met its tolerance.
    """
    import optimistix as optx  # noqa: PLC0415 - slow to load, needed only to trace

    solution = optx.least_squares(
        lambda y, _: linearised(residuals)(y),
        optx.LevenbergMarquardt(rtol=RTOL, atol=ATOL),
        start,
        options={"jac": "fwd"},
        max_steps=MAX_STEPS,
        throw=False,
    )
    # Residuals that are computed once more are once more compiled.
    cost = jnp.sum(solution.state.f_info.residual**2)
    is_done = solution.result == optx.RESULTS.successful
    return solution.value, cost, is_done


def _is_flat(
    jacobian: Float[np.ndarray, "n p"], residuals: Float[np.ndarray, " n"]
) -> bool:
    """Whether even a full Gauss-Newton step would not lower chi-square noticeably.

    Along a direction that the data do not see the solver walks until its steps run out;
    where it has walked to is as good as any other place there.
    """
    step, *_ = np.linalg.lstsq(jacobian, residuals, rcond=RANK_TOLERANCE)
    return float(np.sum((jacobian @ step) ** 2)) < FLAT_DELTA_CHI_SQUARE


def _covariance(jacobians: Float[np.ndarray, "k n p"]) -> Float[np.ndarray, "p p"]:
    """Inverse of JᵀJ at the first, or NaN throughout where that is no covariance.

    On a kink χ² is no parabola: J there mixes the two sides, and may have full rank
    where either side leaves a continuum.
    """
    inverses = np.array([_inverse_information(jacobian) for jacobian in jacobians])
    errors = np.sqrt(np.diagonal(inverses, axis1=1, axis2=2))
    # NaN compares as false.
    is_same = np.abs(errors - errors[0]) <= SAME_ERRORS * errors[0]
    return inverses[0] if np.all(is_same) else np.full_like(inverses[0], np.nan)


def _inverse_information(
    jacobian: Float[np.ndarray, "n p"],
) -> Float[np.ndarray, "p p"]:
    """Inverse of JᵀJ, or NaN throughout: a pseudo-inverse would print small errors."""
    n, p = jacobian.shape
    nothing = np.full((p, p), np.nan)
    if n < p or not np.all(np.isfinite(jacobian)):
        return nothing
    _, singular_values, axes = np.linalg.svd(jacobian, full_matrices=False)
    if singular_values[-1] <= RANK_TOLERANCE * singular_values[0]:
        return nothing
    return (axes.T / singular_values**2) @ axes


def _modes(
    problem: Problem,
    points: Float[np.ndarray, "k q"],
    costs: Float[np.ndarray, " k"],
    angles: Float[np.ndarray, " k"],
) -> tuple[Mode, ...]:
    """Distinct optima that could matter, best first."""
    modes, kept = [], []
    for point, cost, angle in zip(points, costs, angles, strict=True):
        if not cost <= costs[0] + KEPT_DELTA_CHI_SQUARE:
            continue
        if any(np.max(np.abs(point - other)) < SAME_MODE for other in kept):
            continue
        kept.append(point)
        modes.append(
            Mode(
                coordinates=dict(zip(problem.data_names, point.tolist(), strict=True)),
                theta_c_deg=None if np.isnan(angle) else float(np.degrees(angle)),
                chi_square=float(cost),
            )
        )
    return tuple(modes)


def costs_at(
    problem: Problem, points: Float[np.ndarray, "k q"]
) -> Float[np.ndarray, " k"]:
    """Sum of squared residuals at data coordinates."""
    heights = predict_points(problem, points, problem.angles).heights
    sums = _sums_of_squares(problem.of_data, as_float(heights), as_float(points))
    return np.asarray(sums)


def _heights_at(
    problem: Problem, y: Float[np.ndarray, " q"]
) -> Float[np.ndarray, "c n"]:
    """Heights of the rows at data coordinates, with what they share [table unit]."""
    heights = predict_points(problem, y[None], problem.angles).heights[0]
    return np.asarray(problem.observed) + problem.differences(heights)


@compiled
def _sums_of_squares(
    problem: Problem, heights: Float[Array, "k c n"], points: Float[Array, "k q"]
) -> Float[Array, " k"]:
    def one(heights: Float[Array, "c n"], y: Float[Array, " q"]) -> Float[Array, ""]:
        return jnp.sum(problem.with_constraint(problem.residuals_of(heights), y) ** 2)

    return jax.vmap(one)(heights, points)
