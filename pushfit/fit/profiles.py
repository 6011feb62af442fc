"""Likelihood sets of every quantity, in as many pieces and as open as they are.

The profile likelihood of a quantity is the best fit that each of its values allows. No
standard error enters: sets come from thresholds on the profile alone, so two separate
critical angles stay two, and an end that no push bounds stays open.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.constrained import ConstrainedFit
from pushfit.fit.derived import critical_angle_at
from pushfit.fit.implied import implied_profiles
from pushfit.fit.priors import UNITS
from pushfit.fit.problem import Problem
from pushfit.fit.profile_sets import pieces_below, threshold, verdict_of
from pushfit.fit.programs import compiled
from pushfit.fit.results import FitResult, LikelihoodProfile
from pushfit.fit.scan import starting_points
from pushfit.fit.setup import Setup
from pushfit.fit.starts import prior_x_samples
from pushfit.model import contact

# Nodes every 2° see each basin of θ_c; the outer ones stand for the ends of the range.
THETA_GRID = np.radians(np.r_[0.05, np.arange(1.0, 90.0, 2.0), 89.95])
PRELOADED_GRID = np.radians(np.r_[np.arange(-89.0, 0.0, 4.0), THETA_GRID * 180 / np.pi])
AXIS_GRID = np.radians(np.arange(-90.0, 90.1, 5.0))
# Distances from the modes at which logs are tried; 8 is a factor 3000 and stands for
# the end of the range.
LOG_OFFSETS = np.array([0.02, 0.06, 0.15, 0.3, 0.6, 1.0, 1.6, 2.4, 3.5, 5.0, 8.0])
# The ellipse is reported by its axis; s and L are bounded by their priors alone.
UNPROFILED = ("f1", "f2", "ln_s", "ln_L")
# Rounds of secant steps towards each end of a set, and the share of the threshold to
# which Δχ² meets it there.
N_ROUNDS, LEVEL_TOLERANCE = 6, 2e-3
# With fewer elevations valleys are flat and no grid sees where they lead: every value
# is also tried from draws from the prior, three at a time.
MIN_ELEVATIONS, N_TRIALS, N_PER_TRIAL = 3, 17, 3
# A bad point is mended from its neighbours, and two bad neighbours by the next sweep.
N_SWEEPS = 2
# Distance from the end of the reach that stands for none [deg].
JUMP = 1e-6
# Values added inside each piece, for other levels and for figures.
N_FILL = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Profile of one quantity in the making.

    Args:
        values: Values so far, ascending [ln unit, or rad].
        points: Data coordinates of the best fit at each value.
        chi_square: Its sum of squared residuals.
    """

    values: Float[np.ndarray, " g"]
    points: Float[np.ndarray, "g q"]
    chi_square: Float[np.ndarray, " g"]

    def joined(self, other: "Curve") -> "Curve":
        """Both curves as one; of equal values the better fit stays."""
        values = np.concatenate([self.values, other.values])
        chi_square = np.concatenate([self.chi_square, other.chi_square])
        points = np.concatenate([self.points, other.points])
        order = np.lexsort((chi_square, values))
        is_first = np.diff(values[order], prepend=-np.inf) > 0
        kept = order[is_first]
        return Curve(
            values=values[kept], points=points[kept], chi_square=chi_square[kept]
        )


def likelihood_profiles(
    setup: Setup,
    fit: FitResult,
    *,
    reference_alpha: float,
    prob: float,
    reach: tuple[float, float],
) -> dict[str, LikelihoodProfile]:
    """Profile likelihood of everything that the data may tell.

        Δχ²(v) = min over all else of χ² given the value v, minus the least χ²

    Thresholds are those of one quantity: chi-square where sigma is known, F where it
    was estimated.

    Args:
        setup: Problem with its noise weights settled.
        fit: Least squares of it.
        reference_alpha: Azimuth of θ_c [rad].
        prob: Level of the sets.
        reach: Lowest and highest azimuth for α* [rad].

    Returns:
        Profiles of theta_c [deg], alpha_star [deg], A, B, C_rr, F_0 and of the free
        parameters of the six, as far as each exists.
    """
    dof = degrees_of_freedom(setup, fit)
    level = threshold(prob, dof)
    curves = _curves(setup.problem, fit, reference_alpha, level)
    words = {"prob": prob, "degrees_of_freedom": dof}
    profiles = {}
    for name, curve in curves.items():
        delta = curve.chi_square - np.min(curve.chi_square)
        if name == "alpha_star":
            profiles[name] = _axis_profile(curve.values, delta, reach, level, words)
            continue
        is_angle = name == "theta_c"
        short = name.removeprefix("ln_")
        values = np.degrees(curve.values) if is_angle else np.exp(curve.values)
        pieces = pieces_below(values, delta, level)
        profiles[short] = LikelihoodProfile(
            name=short,
            unit="deg" if is_angle else _unit(short, setup),
            values=values,
            delta_chi_square=delta,
            pieces=pieces,
            verdict=verdict_of(pieces),
            **words,
        )
    return profiles | implied_profiles(
        setup.problem, profiles, unit=lambda name: _unit(name, setup)
    )


def degrees_of_freedom(setup: Setup, fit: FitResult) -> float:
    """Degrees of freedom of the sigma behind Δχ²; infinite where it was given."""
    if setup.noise.kind == "sampled":
        return float(max(fit.degrees_of_freedom, 1))
    return float(setup.noise.degrees_of_freedom)


def _unit(name: str, setup: Setup) -> str:
    plain = UNITS.get(name, "N/m")
    return plain if setup.is_calibrated else plain.replace("N", "sensor unit")


def _curves(
    problem: Problem, fit: FitResult, reference_alpha: float, level: float
) -> dict[str, Curve]:
    """Profiles of all quantities, refined around the ends of their sets."""
    if not problem.data_names:
        return {}
    modes = np.array([list(mode.coordinates.values()) for mode in fit.modes])
    pool = np.concatenate([starting_points(problem), modes[:1]])
    solver = ConstrainedFit(problem, jnp.asarray(pool), reference_alpha)
    wanted = [name for name in solver.quantities if name not in UNPROFILED]
    at_modes = {name: _values_at(solver, name, modes) for name in wanted}
    costs = np.array([mode.chi_square for mode in fit.modes])
    grids = {name: _grid(problem, name, v) for name, v in at_modes.items()}
    curves = _solved(solver, grids, None)
    for starts in _scattered(problem):
        n_values = sum(grid.size for grid in grids.values())
        again = _solved(solver, grids, np.tile(starts, (n_values, 1, 1)))
        curves = {name: curve.joined(again[name]) for name, curve in curves.items()}
    for name, values in at_modes.items():
        known = np.isfinite(values)
        order = np.argsort(values[known])
        exact = Curve(
            values=values[known][order],
            points=modes[known][order],
            chi_square=costs[known][order],
        )
        curves[name] = curves[name].joined(exact)
    for _ in range(N_SWEEPS):
        curves = _swept(solver, curves)
    for _ in range(N_ROUNDS):
        requests = {n: _secants(curve, level) for n, curve in curves.items()}
        if not any(r.size for r in requests.values()):
            break
        curves = _refined(solver, curves, requests)
    fill = {name: _filling(curve, level) for name, curve in curves.items()}
    return _swept(solver, _refined(solver, curves, fill))


def _scattered(problem: Problem) -> Float[np.ndarray, "t s q"]:
    """Data coordinates of draws from the prior, for trials from each value.

    The screen keeps what is best before any step; a valley of the best fits may lie
    where no draw is good by itself.
    """
    used = np.any(np.asarray(problem.mask), axis=0)
    theta = np.round(np.abs(np.degrees(problem.pushes.theta)[used]), 1)
    if np.unique(theta).size >= MIN_ELEVATIONS:
        return np.zeros((0, N_PER_TRIAL, len(problem.data_names)))
    rng = np.random.default_rng(0)
    draws = prior_x_samples(problem, rng, N_TRIALS * N_PER_TRIAL)
    points = np.asarray(_data_points(problem, jnp.asarray(draws)))
    return points.reshape(N_TRIALS, N_PER_TRIAL, -1)


@compiled
def _data_points(problem: Problem, x: Float[Array, "n p"]) -> Float[Array, "n q"]:
    """Data coordinates of points in sampling coordinates."""

    def one(x: Float[Array, " p"]) -> Float[Array, " q"]:
        state = problem.state(x)
        group = contact(state.params)
        values = {
            "ln_A": jnp.log(group.A),
            "ln_B": jnp.log(group.B),
            "ln_C_rr": jnp.log(group.C_rr),
            "f1": group.f1,
            "f2": group.f2,
            "ln_F_0": jnp.log(state.preload),
            "ln_s": jnp.log(group.s),
            "ln_L": jnp.log(group.L),
        }
        return jnp.stack([values[name] for name in problem.data_names])

    return jax.vmap(one)(x)


def _values_at(
    solver: ConstrainedFit, name: str, modes: Float[np.ndarray, "m q"]
) -> Float[np.ndarray, " m"]:
    """Value of a quantity at each mode; NaN where it has none."""
    problem = solver.problem
    if name in problem.data_names:
        return modes[:, problem.data_names.index(name)]
    if name == "alpha_star":
        f1 = problem.data_names.index("f1")
        return _wrapped(np.arctan2(-modes[:, f1 + 1], -modes[:, f1]) / 2)
    alpha = solver.reference_alpha
    angles = [critical_angle_at(problem, jnp.asarray(mode), alpha) for mode in modes]
    return np.array(angles)


def _grid(
    problem: Problem, name: str, at_modes: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " g"]:
    """First values to try."""
    if name == "theta_c":
        is_preloaded = (
            "ln_F_0" in problem.data_names or float(problem.grasp.preload) > 0
        )
        return PRELOADED_GRID if is_preloaded else THETA_GRID
    if name == "alpha_star":
        return AXIS_GRID
    low, high = np.min(at_modes), np.max(at_modes)
    between = np.linspace(low, high, LOG_OFFSETS.size)
    return np.unique(np.r_[low - LOG_OFFSETS, between, high + LOG_OFFSETS])


def _solved(
    solver: ConstrainedFit,
    requests: Mapping[str, Float[np.ndarray, " _"]],
    starts: Float[np.ndarray, "k s q"] | None,
) -> dict[str, Curve]:
    """Curves through the requested values, all in one run of the solver."""
    names = tuple(n for n, values in requests.items() for _ in values)
    flat = np.concatenate(list(requests.values()))
    solutions = solver.solve(names, flat, starts)
    curves, first = {}, 0
    for name, values in requests.items():
        part = slice(first, first + values.size)
        first += values.size
        curves[name] = Curve(
            values=values,
            points=solutions.points[part],
            chi_square=solutions.chi_square[part],
        )
    return curves


def _refined(
    solver: ConstrainedFit,
    curves: Mapping[str, Curve],
    requests: Mapping[str, Float[np.ndarray, " _"]],
) -> dict[str, Curve]:
    """Curves with more values, each solved from the solutions on either side."""
    starts = []
    for name, values in requests.items():
        curve = curves[name]
        right = np.clip(np.searchsorted(curve.values, values), 1, curve.values.size - 1)
        a, b = curve.points[right - 1], curve.points[right]
        starts.append(np.stack([a, b, (a + b) / 2], axis=1))
    if not any(values.size for values in requests.values()):
        return dict(curves)
    added = _solved(solver, requests, np.concatenate(starts))
    return {name: curve.joined(added[name]) for name, curve in curves.items()}


def _swept(solver: ConstrainedFit, curves: Mapping[str, Curve]) -> dict[str, Curve]:
    """Curves whose every value was tried again from the solutions on either side.

    On the kinks of the hard switch a solver may stop early; left alone, such a point
    would cut a set in two.
    """
    starts = []
    for curve in curves.values():
        left = np.concatenate([curve.points[:1], curve.points[:-1]])
        right = np.concatenate([curve.points[1:], curve.points[-1:]])
        starts.append(np.stack([left, right, (left + right) / 2], axis=1))
    requests = {name: curve.values for name, curve in curves.items()}
    again = _solved(solver, requests, np.concatenate(starts))
    return {name: curve.joined(again[name]) for name, curve in curves.items()}


def _secants(curve: Curve, level: float) -> Float[np.ndarray, " k"]:
    """Where the profile should next be asked to find where it crosses the level."""
    root = np.sqrt(curve.chi_square - np.min(curve.chi_square))
    target = np.sqrt(level)
    is_inside = root <= target
    wanted = []
    for i in np.flatnonzero(is_inside[1:] != is_inside[:-1]):
        inner, outer = (i, i + 1) if is_inside[i] else (i + 1, i)
        near = np.abs(root[[inner, outer]] ** 2 - level)
        width = curve.values[outer] - curve.values[inner]
        resolution = 1e-12 * max(1.0, abs(curve.values[inner]))
        if np.min(near) < LEVEL_TOLERANCE * level or abs(width) < resolution:
            continue
        share = 0.5
        if np.isfinite(root[outer]):
            share = (target - root[inner]) / (root[outer] - root[inner])
        # The neighbours of the secant's guess close the bracket where it is good.
        shares = share + np.array([-0.1, 0.0, 0.1]) * min(share, 1 - share)
        wanted.append(curve.values[inner] + shares * width)
    return np.concatenate(wanted) if wanted else np.zeros(0)


def _filling(curve: Curve, level: float) -> Float[np.ndarray, " k"]:
    """Values spread over every closed piece and a little beyond."""
    delta = curve.chi_square - np.min(curve.chi_square)
    wanted = [np.zeros(0)]
    for low, high in pieces_below(curve.values, delta, level):
        if low is not None and high is not None and high > low:
            margin = (high - low) / (2 * N_FILL)
            wanted.append(np.linspace(low - margin, high + margin, N_FILL))
    return np.concatenate(wanted)


def _axis_profile(
    values: Float[np.ndarray, " g"],
    delta: Float[np.ndarray, " g"],
    reach: tuple[float, float],
    level: float,
    words: Mapping[str, float],
) -> LikelihoodProfile:
    """Profile of α* from that of the soft axis: unreachable axes count at the ends."""
    low, high = np.degrees(reach[0]), np.degrees(reach[1])
    axis = np.degrees(values)
    if high - low >= 180.0:
        # Cut the circle where the data like it least.
        low, high = float(axis[np.argmax(delta)] % 180.0), np.inf
    angle = low + np.mod(axis - low, 180.0)
    if not np.isinf(high):
        # What is beyond an end counts at it: the profile jumps there, so the axis that
        # just reaches the end needs a value of its own.
        order = np.argsort(angle)
        inside = np.array([low + JUMP, high - JUMP])
        at_ends = np.interp(inside, angle[order], delta[order], period=180.0)
        angle = np.concatenate([angle, inside])
        delta = np.concatenate([delta, at_ends])
        to_low = low + 180.0 - angle < angle - high
        angle = np.where(angle <= high, angle, np.where(to_low, low, high))
    order = np.lexsort((delta, angle))
    kept = order[np.diff(angle[order], prepend=-np.inf) > 0]
    angle, delta = angle[kept], delta[kept]
    pieces = pieces_below(angle, delta, level)
    if pieces != ((None, None),):
        # The ends of the reach are answers, not ends of knowledge.
        pieces = tuple(
            (angle[0] if a is None else a, angle[-1] if b is None else b)
            for a, b in pieces
        )
        pieces = tuple(
            (float(np.mod(a, 180.0)), float(b - a + np.mod(a, 180.0)))
            for a, b in pieces
        )
    return LikelihoodProfile(
        name="alpha_star",
        unit="deg",
        values=angle,
        delta_chi_square=delta,
        pieces=pieces,
        verdict=verdict_of(pieces),
        **words,
    )


def _wrapped(angle: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
    """Axis in [-90°, 90°), the range of the grid."""
    return np.mod(angle + np.pi / 2, np.pi) - np.pi / 2
