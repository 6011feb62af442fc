"""From many tables to their identifications, through lanes.

Tables of equal shape are stacked in chunks of fixed size, so that a table's numbers do
not depend on its neighbours, and what the compiled programs return becomes the same
records that a single table gives. Posteriors come from the sweep, as everywhere; a
table whose draws are not to be trusted is left to emcee. Excluded: tables that fit
into no lane.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.identify import (
    Fitted,
    conclude,
    fit_notices,
    prepared,
    reach_of,
    reference_azimuth,
    with_sigma,
)
from pushfit.fit.lane_fit import LaneFit, fit_lanes
from pushfit.fit.lane_profile import LaneProfile, profile_lanes
from pushfit.fit.lanes import Lane, make_lane, why_not_lane
from pushfit.fit.least_squares import fit_result, with_noise_of
from pushfit.fit.notices import scatter_notice
from pushfit.fit.problem import Problem
from pushfit.fit.profile_sets import pieces_below, threshold, verdict_of
from pushfit.fit.profiles import degrees_of_freedom
from pushfit.fit.programs import compiled
from pushfit.fit.results import (
    FitResult,
    FitStatus,
    Identification,
    LikelihoodProfile,
    Notice,
    PosteriorResult,
)
from pushfit.fit.setup import Setup, build_problem
from pushfit.fit.shared_priors import SharedPrior, shared_prior
from pushfit.fit.sweep.posterior import sweep_posterior

# Lanes of one call: always so many, the last one repeated.
N_LANES = 32
# Two searches whose sums of squares differ by less than this agree.
AGREED = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """A table on its way into a lane.

    Args:
        table: Peak heights.
        given: Configuration as it was given.
        config: Configuration in force.
        setup: Problem.
        lane: Its lane.
        prior: Its prior, noise aside.
        reference_alpha: Azimuth at which θ_c is quoted [rad].
        notices: What came up on the way.
        seed: Seed of the draws.
    """

    table: PeakTable
    given: GraspConfig
    config: GraspConfig
    setup: Setup
    lane: Lane
    prior: SharedPrior
    reference_alpha: float
    notices: tuple[Notice, ...]
    seed: int


def ready(table: PeakTable, config: GraspConfig, *, seed: int) -> Ready | None:
    """A table with its lane; None if it fits into none.

    Args:
        table: Peak heights.
        config: Configuration as it was given.
        seed: Seed of the draws.

    Returns:
        The table, ready to be stacked.

    Raises:
        DataError: If no usable push is left.
        ConfigError: If the configuration does not fit the table.
    """
    in_force, notices = prepared(table, config)
    setup = build_problem(table, in_force)
    if why_not_lane(setup.problem) is not None:
        return None
    prior = shared_prior(setup.problem)
    return Ready(
        table=table,
        given=config,
        config=in_force,
        setup=setup,
        lane=make_lane(setup.problem, prior.tables),
        prior=prior,
        reference_alpha=reference_azimuth(table, config),
        notices=notices,
        seed=seed,
    )


def identify_lanes(items: Sequence[Ready]) -> list[Identification | None]:
    """Identify tables side by side.

    Args:
        items: Tables in their lanes.

    Returns:
        Identifications; None where the fit or the draws are not to be trusted.
    """
    found: list[Identification | None] = [None] * len(items)
    fits: dict[int, tuple[FitResult, LaneProfile]] = {}
    settled: list[tuple[int, Ready]] = []
    again = list(enumerate(items))
    while again:
        fitted = [pair for chunk in _chunks(again) for pair in _fitted(chunk)]
        again = []
        for index, item, fit, profile in fitted:
            excess = None
            if item.config.noise.sigma == "auto":
                excess = scatter_notice(item.setup, fit)
            if excess is None:
                fits[index] = fit, profile
                settled.append((index, item))
                continue
            sampled = with_sigma(item.config, "sampled")
            other = ready(item.table, sampled, seed=item.seed)
            if other is not None:
                notices = (*item.notices, excess)
                again.append((index, replace(other, given=item.given, notices=notices)))
    for index, item in settled:
        posterior = sweep_posterior(
            item.setup,
            seed=item.seed,
            reference_alpha=item.reference_alpha,
            reach=reach_of(item.config),
        )
        if posterior.status is FitStatus.OK:
            found[index] = _concluded(item, *fits[index], posterior)
    return found


def _chunks(
    items: Sequence[tuple[int, Ready]],
) -> list[list[tuple[int, Ready]]]:
    """Items of equal shapes together, at most `N_LANES` at a time."""
    groups = defaultdict(list)
    for index, item in items:
        leaves, structure = jax.tree.flatten(item.lane)
        groups[structure, tuple(np.shape(leaf) for leaf in leaves)].append(
            (index, item)
        )
    return [
        group[first : first + N_LANES]
        for group in groups.values()
        for first in range(0, len(group), N_LANES)
    ]


def _stacked(chunk: Sequence[tuple[int, Ready]]) -> Lane:
    """Lanes of a chunk as one, the last one repeated to the full number."""
    lanes = [item.lane for _, item in chunk]
    lanes += lanes[-1:] * (N_LANES - len(lanes))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *lanes)


def _fitted(
    chunk: Sequence[tuple[int, Ready]],
) -> list[tuple[int, Ready, FitResult, LaneProfile]]:
    """Least squares of a chunk; items without a finite misfit are left out."""
    lanes = _stacked(chunk)
    fits = fit_lanes(lanes)
    both = jax.tree.map(np.asarray, (fits, profile_lanes(lanes, fits)))
    found = []
    for lane, (index, item) in enumerate(chunk):
        optima, profile = jax.tree.map(lambda leaf, lane=lane: leaf[lane], both)
        fitted = _described(item, optima, profile)
        if fitted is not None:
            found.append((index, *fitted, profile))
    return found


def _described(
    item: Ready, optima: LaneFit, profile: LaneProfile
) -> tuple[Ready, FitResult] | None:
    """The fit of one table as a record, its noise settled."""
    setup, problem = item.setup, item.setup.problem
    # An optimum on a kink, which a solver of smooth problems stops short of.
    best = int(np.argmin(profile.misfit))
    u, c, a = (
        np.append(getattr(profile, name)[best], getattr(optima, name))
        for name in ("u", "c", "a")
    )
    values = {"ln_A": a, "ln_B": u + c + a, "ln_C_rr": c}
    points = np.stack([values[name] for name in problem.data_names], axis=1)
    if not np.all(np.isfinite(points[0])):
        return None
    if setup.noise.kind == "sampled":
        problem = with_noise_of(problem, jnp.asarray(points[0]))
        setup = replace(setup, problem=problem, best_point=points[0])
    costs = np.asarray(_costs(problem, jnp.asarray(points)))
    costs = np.where(np.isfinite(costs), costs, np.inf)
    order = np.argsort(costs, kind="stable")
    # Two searches that agree have arrived.
    is_done = np.append(True, optima.is_done) | (costs > costs[0] - AGREED)
    fit = fit_result(
        setup,
        (points[order], costs[order], is_done[order]),
        reference_alpha=item.reference_alpha,
        throw=False,
    )
    if fit.status is not FitStatus.OK:
        return None
    return replace(item, setup=setup), fit


def _concluded(
    item: Ready, fit: FitResult, profile: LaneProfile, posterior: PosteriorResult
) -> Identification:
    """The identification of one table."""
    problem = item.setup.problem
    # Lanes of sampled noise measure misfit in units of the heights.
    is_sampled = item.setup.noise.kind == "sampled"
    mask = np.asarray(problem.mask)
    sigma = np.asarray(problem.reference_sigma)[mask][0] if is_sampled else 1.0
    # Rounding aside, the best of the profile is the best fit.
    chi_square = np.maximum(profile.misfit / sigma**2, fit.chi_square)
    theta_c = _profile(item, fit, np.degrees(np.arctan(np.exp(profile.u))), chi_square)
    fitted = Fitted(
        table=item.table,
        config=item.config,
        setup=item.setup,
        fit=fit,
        reference_alpha=item.reference_alpha,
        notices=(*item.notices, *fit_notices(item.setup, fit)),
    )
    return conclude(
        fitted,
        {"theta_c": theta_c},
        posterior,
        config=item.given,
        seed=item.seed,
        is_brief=True,
    )


def _profile(
    item: Ready,
    fit: FitResult,
    values: Float[np.ndarray, " g"],
    chi_square: Float[np.ndarray, " g"],
) -> LikelihoodProfile:
    """Likelihood profile of θ_c."""
    keep = np.r_[True, np.diff(values) > 0]
    values, delta = values[keep], chi_square[keep] - fit.chi_square
    dof = degrees_of_freedom(item.setup, fit)
    prob = item.given.report.prob
    pieces = pieces_below(values, delta, threshold(prob, dof))
    return LikelihoodProfile(
        name="theta_c",
        unit="deg",
        values=values,
        delta_chi_square=delta,
        pieces=pieces,
        prob=prob,
        verdict=verdict_of(pieces),
        degrees_of_freedom=dof,
    )


@compiled
def _costs(problem: Problem, points: Float[Array, "k q"]) -> Float[Array, " k"]:
    return jax.vmap(lambda y: jnp.sum(problem.data_residuals(y) ** 2))(points)
