"""Does tilting matter to θ_c: both mechanics fitted to the same heights.

The fit by tilting mechanics is the best point of one search along θ_c. L and s keep
what is known of them beforehand. Excluded: intervals by tilting mechanics, for which
`mechanics = "tilting"` is there.
"""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from pushfit.config import GraspConfig
from pushfit.fit.likelihood.curve import search
from pushfit.fit.likelihood.least_squares import costs_at, residuals_at
from pushfit.fit.problem.constraint_terms import with_constraints
from pushfit.fit.problem.data_coordinates import data_names
from pushfit.fit.problem.derived import PARAMETERS, critical_angles, in_contact
from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs import compiled
from pushfit.fit.results import (
    FitResult,
    Notice,
    PosteriorResult,
    Quantity,
)
from pushfit.fit.setup import Setup
from pushfit.mechanics.displacements import displacements
from pushfit.model import Grasp, Parameters, Pushes, as_float

# Below this tilt θ_c is not off by a degree: nothing is fitted [deg].
LARGE_TILT_DEG = 2.0
# A bias of this share of its width lowers the coverage of a 90 % interval to 79 %; of
# half its width to 50 %.
WORTH_OF_WIDTH = 0.25
# The same where there is no interval [deg].
WORTH_DEG = 2.0
# Tilting mechanics whose chi-square is larger by this are not what the heights say.
WORSE = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltingFit:
    """Best fit by tilting mechanics.

    Args:
        theta_c_deg: Critical angle; None where the contact never rolls.
        chi_square: Sum of squared residuals of the pushes that keep contact.
        is_held: Which pushes keep contact.
    """

    theta_c_deg: float | None
    chi_square: float
    is_held: Bool[np.ndarray, " n"]


def implied_tilt_deg(setup: Setup, posterior: PosteriorResult) -> float:
    """Largest tilt that a linear solution implies.

    Args:
        setup: Problem by linear mechanics.
        posterior: Draws; the tilt is that of their medians.

    Returns:
        Tilt of the push that tilts the object most [deg].
    """
    problem = setup.problem
    names = [n for n in (*PARAMETERS, "e1", "e2") if n in posterior.samples]
    middle = {n: float(np.median(posterior.samples[n])) for n in names}
    params = Parameters(**middle)
    tilt = np.asarray(_tilt(params, problem.pushes, problem.grasp))
    return float(np.degrees(np.max(tilt[: len(setup.rows)])))


def tilting_problem(problem: Problem) -> Problem:
    """The same heights and priors by tilting mechanics.

    Args:
        problem: Problem by linear mechanics.
    """
    grasp = replace(problem.grasp, mechanics="tilting")
    fixed = {name: float(value) for name, value in problem.fixed.items()}
    names = data_names(problem.priors, fixed, grasp)
    return with_constraints(replace(problem, grasp=grasp, data_names=names))


def fit_tilting(problem: Problem, *, reference_alpha: float) -> TiltingFit:
    """Rough fit by tilting mechanics, without the pushes that would lose contact.

    Args:
        problem: Problem by linear mechanics.
        reference_alpha: Azimuth of θ_c [rad].
    """
    problem = tilting_problem(problem)
    y = _best(problem)
    is_held = np.asarray(in_contact(problem, as_float(y))) & np.asarray(problem.mask[0])
    if not np.array_equal(is_held, problem.mask[0]):
        mask = np.asarray(problem.mask) & is_held
        problem = replace(problem, mask=jnp.asarray(mask, dtype=bool))
        y = _best(problem)
    angle = critical_angles(problem, as_float(y[None]), as_float(reference_alpha))
    angle = float(np.asarray(angle)[0])
    residuals = np.asarray(residuals_at(problem, as_float(y)))[: problem.mask.size]
    return TiltingFit(
        theta_c_deg=None if np.isnan(angle) else float(np.degrees(angle)),
        chi_square=float(np.sum(residuals**2)),
        is_held=is_held,
    )


def tilt_notice(
    setup: Setup,
    fit: FitResult,
    posterior: PosteriorResult,
    theta_c: Quantity,
    *,
    config: GraspConfig,
    reference_alpha: float,
) -> Notice | None:
    """Warn where linear mechanics move θ_c by a good part of its interval.

    Where tilting mechanics do not apply, for example because L is not stated, the size
    of the tilt decides alone.

    Args:
        setup: Problem.
        fit: Least squares of it.
        posterior: Draws.
        theta_c: θ_c as reported.
        config: Configuration in force.
        reference_alpha: Azimuth of θ_c [rad].

    Returns:
        A warning with θ_c by both mechanics; None where both agree within a quarter of
        the interval, and by tilting mechanics.
    """
    problem = setup.problem
    if problem.grasp.mechanics == "tilting" or not problem.data_names:
        return None
    tilt = implied_tilt_deg(setup, posterior)
    if tilt < LARGE_TILT_DEG:
        return None
    linear = fit.modes[0].theta_c_deg
    start = f"the fit implies that the object tilts by up to {tilt:.0f}°"
    reason = config.why_not_tilting()
    if reason is not None:
        return Notice(
            code="large_tilt",
            text=f"{start}; the paper's equations hold for small tilts, and at 2° and "
            "more θ_c may be off by several degrees beyond its interval. It is not "
            f"computed by tilting mechanics: {reason}",
        )
    tilting = fit_tilting(problem, reference_alpha=reference_alpha)
    if linear is None or tilting.theta_c_deg is None:
        return None
    worth = WORTH_DEG
    if theta_c.interval is not None:
        worth = WORTH_OF_WIDTH * (theta_c.interval[1] - theta_c.interval[0])
    if abs(tilting.theta_c_deg - linear) < worth:
        return None
    at_linear = residuals_at(problem, as_float(fit.estimate))
    held = np.tile(tilting.is_held, len(problem.channels))
    chi_square = float(np.sum(np.asarray(at_linear)[held] ** 2))
    remedy = 'use mechanics = "tilting" with L measured'
    if tilting.chi_square > chi_square + WORSE:
        remedy = (
            "the heights themselves prefer the paper's equations, so check L, the push "
            "length and the unit of the heights first"
        )
    return Notice(
        code="large_tilt",
        text=f"{start}, which the paper's equations leave out: they put θ_c at "
        f"{linear:.1f}° (chi-square {chi_square:.0f}), tilting mechanics with the same "
        f"priors of L and s at {tilting.theta_c_deg:.1f}° (chi-square "
        f"{tilting.chi_square:.0f}); {remedy}",
    )


def _best(problem: Problem) -> Float[np.ndarray, " q"]:
    """Best point of a search."""
    pool = search(problem).curve.points
    costs = np.asarray(costs_at(problem, as_float(pool)))
    return pool[int(np.nanargmin(costs))]


@compiled
def _tilt(params: Parameters, pushes: Pushes, grasp: Grasp) -> Float[Array, " n"]:
    return displacements(params, pushes, grasp).tilt
