"""Likelihood sets of every quantity, in as many pieces and as open as they are.

The profile likelihood of a quantity is the best fit that each of its values allows. No
standard error enters: sets come from thresholds on the profile alone, so two separate
critical angles stay two, and an end that no push bounds stays open. Excluded: the fits
along a quantity (`pushfit.fit.profiles.curve`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.derived import axis_within, critical_angles
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.conditional_likelihood import imposable
from pushfit.fit.profiles.curve import (
    DELTA_CHI_SQUARE,
    N_FIRST,
    first_values,
    fits_along,
)
from pushfit.fit.profiles.curve_search import Fits
from pushfit.fit.profiles.derived_profiles import implied_profiles
from pushfit.fit.profiles.least_squares import costs_at, search_of
from pushfit.fit.profiles.profile_sets import (
    NARROWEST,
    pieces_below,
    threshold,
    verdict_of,
)
from pushfit.fit.results import FitResult, LikelihoodProfile, Piece
from pushfit.fit.results.fits_along import Curve
from pushfit.mechanics.directions import is_whole
from pushfit.parameters import unit_of

# The ellipse is reported by its axis; the others are held by what is known beforehand.
UNPROFILED = ("f1", "f2", "ln_s", "ln_L", "ln_p")
# Distance from the end of the reach that stands for none [deg].
JUMP = 1e-6
# Where sqrt(Δχ²) takes a longer step across a level, its two values do not tell where
# between them the curve crosses it, or the search failed at one: values that are placed
# there lie closer by far [standard deviations].
STEEP = 1.0


def likelihood_profiles(
    setup: Setup,
    fit: FitResult,
    *,
    reference_alpha: float,
    prob: float,
    reach: tuple[float, float],
    wanted: Sequence[str] | None = None,
) -> dict[str, LikelihoodProfile]:
    """Profile likelihood of everything that the data may tell.

        Δχ²(v) = min over all else of χ² given the value v, minus the least χ²

    Thresholds are those of one quantity: chi-square where sigma is known, F where it
    was estimated.

    Args:
        reference_alpha: Azimuth of θ_c [rad].
        reach: Lowest and highest azimuth for α* [rad].
        wanted: Names of the quantities, as `imposable` names them; None for all.

    Returns:
        Profiles of theta_c [deg], alpha_star [deg], A, B, C_rr, F_0 and of the free
        parameters of the six, as far as each exists.
    """
    dof = degrees_of_freedom(setup, fit)
    newton = "N" if setup.is_calibrated else "sensor unit"
    level = threshold(prob, dof)
    curves = _curves(setup, fit, reference_alpha, level, wanted)
    profiles = {}
    for name, curve in curves.items():
        delta = curve.chi_square - np.min(curve.chi_square)
        short = name.removeprefix("ln_")
        if name == "alpha_star":
            values, delta, pieces = _axis_set(curve.values, delta, reach, level)
        else:
            is_angle = name == "theta_c"
            values = np.degrees(curve.values) if is_angle else np.exp(curve.values)
            narrowest = NARROWEST if is_angle else 0.0
            pieces = pieces_below(values, delta, level, narrowest=narrowest)
        profiles[short] = LikelihoodProfile(
            name=short,
            unit=unit_of(short, newton),
            values=values,
            delta_chi_square=delta,
            pieces=pieces,
            prob=prob,
            verdict=verdict_of(pieces),
            degrees_of_freedom=dof,
        )
    return profiles | implied_profiles(setup.problem, profiles, newton=newton)


def degrees_of_freedom(setup: Setup, fit: FitResult) -> float:
    """Degrees of freedom of the sigma behind Δχ²; infinite where it was given."""
    if setup.noise.kind == "sampled":
        return float(max(fit.degrees_of_freedom, 0))
    return float(setup.noise.degrees_of_freedom)


def _curves(
    setup: Setup,
    fit: FitResult,
    reference_alpha: float,
    level: float,
    wanted: Sequence[str] | None,
) -> dict[str, Curve]:
    """Profiles of all quantities, through the modes of the fit."""
    problem, search = setup.problem, search_of(setup, reference_alpha)
    modes = np.array([list(mode.coordinates.values()) for mode in fit.modes])
    pool = np.concatenate([search.curve.points, modes[:1]])
    costs = np.array([mode.chi_square for mode in fit.modes])
    curves = {}
    for index, name in enumerate(imposable(problem)):
        if name in UNPROFILED or (wanted is not None and name not in wanted):
            continue
        at_modes = _values_at(problem, name, modes, reference_alpha)
        is_found = search.is_thorough and name == search.quantity
        along = partial(
            fits_along,
            problem,
            index,
            along=pool,
            reference_alpha=reference_alpha,
            level=DELTA_CHI_SQUARE if np.isinf(level) else level,
        )
        if is_found and reference_alpha == search.reference_alpha:
            curve = _weighed_anew(problem, search.curve)
        else:
            curve, _ = along(first_values(problem, name, at_modes))
        # Most modes but the best lie above the profile; the better ones are part of it.
        for k, (value, cost) in enumerate(zip(at_modes, costs, strict=True)):
            around = np.interp(value, curve.values, curve.chi_square)
            if np.isfinite(value) and not cost > around:
                at = slice(k, k + 1)
                curve = curve.joined(
                    Curve(values=at_modes[at], points=modes[at], chi_square=costs[at])
                )
        curves[name] = _with_crossings(curve, along, level)
    return curves


def _with_crossings(
    curve: Curve,
    along: Callable[[Float[np.ndarray, " g"]], tuple[Curve, Fits]],
    level: float,
) -> Curve:
    """A curve with more values where it crosses a level in one steep step."""
    delta, values = curve.chi_square - np.min(curve.chi_square), curve.values
    root = np.sqrt(delta)
    for i in np.flatnonzero(np.diff(delta <= level)):
        if STEEP < abs(root[i + 1] - root[i]) < np.inf:
            between = np.linspace(values[i], values[i + 1], N_FIRST)
            curve = curve.joined(along(between)[0])
    return curve


def _weighed_anew(problem: Problem, curve: Curve) -> Curve:
    """A curve with the sums of squares that settled noise gives its fits."""
    chi_square = costs_at(problem, curve.points)
    is_possible = np.isfinite(curve.chi_square) & np.isfinite(chi_square)
    return replace(curve, chi_square=np.where(is_possible, chi_square, np.inf))


def _values_at(
    problem: Problem,
    name: str,
    modes: Float[np.ndarray, "m q"],
    reference_alpha: float,
) -> Float[np.ndarray, " m"]:
    """Value of a quantity at each mode; NaN where it has none."""
    if name in problem.data_names:
        return modes[:, problem.data_names.index(name)]
    if name == "alpha_star":
        f1 = problem.data_names.index("f1")
        axis = np.arctan2(-modes[:, f1 + 1], -modes[:, f1]) / 2
        return np.mod(axis + np.pi / 2, np.pi) - np.pi / 2
    return critical_angles(problem, modes, reference_alpha)


def _axis_set(
    values: Float[np.ndarray, " g"],
    delta: Float[np.ndarray, " g"],
    reach: tuple[float, float],
    level: float,
) -> tuple[Float[np.ndarray, " h"], Float[np.ndarray, " h"], tuple[Piece, ...]]:
    """Values of α* [deg], Δχ² there and the set: unreachable axes count at the ends."""
    low, high = np.degrees(reach[0]), np.degrees(reach[1])
    axis = np.degrees(values)
    has_ends = not is_whole(reach)
    if not has_ends:
        # Cut the circle where the data like it least.
        low, high = float(axis[np.argmax(delta)] % 180.0), np.inf
    angle = low + np.mod(axis - low, 180.0)
    if has_ends:
        # What is beyond an end counts at it: the profile jumps there, so the axis that
        # just reaches the end needs a value of its own.
        order = np.argsort(angle)
        inside = np.array([low + JUMP, high - JUMP])
        at_ends = np.interp(inside, angle[order], delta[order], period=180.0)
        angle = np.concatenate([angle, inside])
        delta = np.concatenate([delta, at_ends])
        angle = axis_within(angle, low, high)
    order = np.lexsort((delta, angle))
    kept = order[np.diff(angle[order], prepend=-np.inf) > 0]
    angle, delta = angle[kept], delta[kept]
    pieces = pieces_below(angle, delta, level, narrowest=NARROWEST)
    if pieces != ((None, None),):
        # The ends of the reach are answers, not ends of knowledge.
        pieces = tuple(
            (angle[0] if a is None else a, angle[-1] if b is None else b)
            for a, b in pieces
        )
        # An axis starts in [0, 180).
        turns = [0.0 if has_ends else a - np.mod(a, 180.0) for a, _ in pieces]
        pieces = tuple(
            (float(a - turn), float(b - turn))
            for (a, b), turn in zip(pieces, turns, strict=True)
        )
    return angle, delta, pieces
