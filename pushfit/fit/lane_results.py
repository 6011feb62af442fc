"""From many tables to their identifications, through lanes.

Tables of equal shape are stacked in chunks of fixed size, so that a table's numbers do
not depend on its neighbours, and what the compiled programs return becomes the same
records that a single table gives. A table on which a lane is not exact enough is left
to the engines for single tables. Excluded: tables that fit into no lane.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.config import GraspConfig
from pushfit.data.table import PeakTable
from pushfit.fit.exact import posterior_of_draws
from pushfit.fit.fibre import Fibre, make_fibre
from pushfit.fit.identify import (
    Fitted,
    conclude,
    fit_notices,
    prepared,
    reach_of,
    reference_azimuth,
    with_sigma,
)
from pushfit.fit.lane_draws import LaneDraws, draw_lanes
from pushfit.fit.lane_fit import LaneFit, fit_lanes
from pushfit.fit.lane_posterior import integrate_lanes
from pushfit.fit.lane_profile import LaneProfile, profile_lanes
from pushfit.fit.lanes import Lane, make_lane, prior_tables, why_not_lane
from pushfit.fit.least_squares import fit_result, with_noise_of
from pushfit.fit.log_density import Table
from pushfit.fit.noise_grid import make_noise_grid
from pushfit.fit.notices import scatter_notice
from pushfit.fit.problem import Problem
from pushfit.fit.profile_sets import pieces_below, threshold, verdict_of
from pushfit.fit.profiles import degrees_of_freedom
from pushfit.fit.quadrature import draw_from_nodes
from pushfit.fit.results import (
    FitResult,
    FitStatus,
    Identification,
    LikelihoodProfile,
    Notice,
    PosteriorResult,
)
from pushfit.fit.setup import Setup, build_problem
from pushfit.fit.starts import encode

# Lanes of one call: always so many, the last one repeated.
N_LANES = 32
# Draws per table, stratified in θ_c.
N_DRAWS = 1000
# A lane whose evidence is known less well than this is done again by itself.
MAX_ERROR = 2e-3
# Two searches whose sums of squares differ by less than this agree.
AGREED = 1e-3
# Stiffnesses whose priors scale with the unit of the heights.
SCALED = ("K_sn", "K_dn", "K_st", "C_d")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ready:
    """A table on its way into a lane.

    Args:
        table: Peak heights.
        given: Configuration as it was given.
        config: Configuration in force.
        setup: Problem.
        lane: Its lane.
        fibre: Prior of the parameters given A and B, stiffnesses divided by `scale`.
        scale: Unit of stiffness in the fibre.
        notices: What came up on the way.
        seed: Seed of the draws.
    """

    table: PeakTable
    given: GraspConfig
    config: GraspConfig
    setup: Setup
    lane: Lane
    fibre: Fibre
    scale: float
    notices: tuple[Notice, ...]
    seed: int


class Fibres:
    """Fibres and their tables, one for all priors that differ in scale alone."""

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._known: dict[tuple, tuple[Fibre, dict[str, Table]]] = {}

    def of(self, problem: Problem) -> tuple[Fibre, dict[str, Table], float]:
        """Fibre in units of a stiffness, its `prior_tables` without, and that unit."""
        priors = {n: p for n, p in problem.priors.items() if n[:6] != "sigma_"}
        stiff = [priors.get(name) for name in SCALED]
        can_scale = all(p is not None and p.kind == "lognormal" for p in stiff)
        scale = float(priors["K_sn"].first) if can_scale else 1.0
        for name in SCALED if can_scale else ():
            # Nine digits, so that rounding cannot make two fibres of one.
            median = float(f"{float(priors[name].first) / scale:.9g}")
            priors[name] = eqx.tree_at(
                lambda p: p.first, priors[name], jnp.asarray(median)
            )
        key = tuple(
            (name, p.kind, float(p.first), float(p.second))
            for name, p in sorted(priors.items())
        ) + tuple((name, float(v)) for name, v in sorted(problem.fixed.items()))
        if key not in self._known:
            fibre = make_fibre(priors, problem.fixed)
            self._known[key] = fibre, prior_tables(fibre)
        fibre, tables = self._known[key]
        by = {"A": np.log(scale), "B": np.log(scale), "C_rr": 0.0}
        return fibre, {n: t.shifted(by[n]) for n, t in tables.items()}, scale


def ready(
    table: PeakTable, config: GraspConfig, fibres: Fibres, *, seed: int
) -> Ready | None:
    """A table with its lane; None if it fits into none.

    Args:
        table: Peak heights.
        config: Configuration as it was given.
        fibres: Fibres met so far.
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
    fibre, tables, scale = fibres.of(setup.problem)
    return Ready(
        table=table,
        given=config,
        config=in_force,
        setup=setup,
        lane=make_lane(setup.problem, tables),
        fibre=fibre,
        scale=scale,
        notices=notices,
        seed=seed,
    )


def identify_lanes(
    items: Sequence[Ready], fibres: Fibres
) -> list[Identification | None]:
    """Identify tables side by side.

    Args:
        items: Tables in their lanes.
        fibres: Fibres met so far.

    Returns:
        Identifications; None where a lane was not exact enough.
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
            other = ready(item.table, sampled, fibres, seed=item.seed)
            if other is not None:
                notices = (*item.notices, excess)
                again.append((index, replace(other, given=item.given, notices=notices)))
    for chunk in _chunks(settled):
        for index, item, posterior in _integrated(chunk):
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
        reference_alpha=reference_azimuth(item.table, item.config),
        throw=False,
    )
    if fit.status is not FitStatus.OK:
        return None
    return replace(item, setup=setup), fit


def _integrated(
    chunk: Sequence[tuple[int, Ready]],
) -> list[tuple[int, Ready, PosteriorResult]]:
    """Posteriors of a chunk, those left out that are not exact enough."""
    lanes = _stacked(chunk)
    posteriors = integrate_lanes(lanes, fit_lanes(lanes))
    rngs = [np.random.default_rng(item.seed) for _, item in chunk]
    uniform = np.full((N_LANES, N_DRAWS, 4), 0.5)
    for lane, rng in enumerate(rngs):
        uniform[lane] = rng.uniform(size=(N_DRAWS, 4))
        # In random order, so that any part of the draws is a sample of the whole.
        strata = rng.permutation(N_DRAWS)
        uniform[lane, :, 0] = (strata + uniform[lane, :, 0]) / N_DRAWS
    draws = draw_lanes(lanes, posteriors, jnp.asarray(uniform))
    draws = jax.tree.map(np.asarray, draws)
    evidence = np.asarray(posteriors.log_evidence)
    error = np.asarray(posteriors.error)
    found = []
    for lane, ((index, item), rng) in enumerate(zip(chunk, rngs, strict=True)):
        if error[lane] < MAX_ERROR and np.isfinite(evidence[lane]):
            one = jax.tree.map(lambda leaf, lane=lane: leaf[lane], draws)
            known = float(evidence[lane]), float(error[lane])
            found.append((index, item, _posterior(item, one, known, rng)))
    return found


def _posterior(
    item: Ready,
    draws: LaneDraws,
    evidence: tuple[float, float],
    rng: np.random.Generator,
) -> PosteriorResult:
    """Draws of all parameters: those behind A and B follow from their prior."""
    problem, ln_scale = item.setup.problem, np.log(item.scale)
    ln_A, ln_B = draws.a - ln_scale, draws.u + draws.c + draws.a - ln_scale
    scores = rng.standard_normal((3, draws.u.size))
    logs = item.fibre.split(ln_A, ln_B, scores) | {"C_rr": draws.c}
    logs = {n: v + ln_scale if n in SCALED else v for n, v in logs.items()}
    if item.setup.noise.kind == "sampled":
        noise = make_noise_grid(problem)
        for i, channel in enumerate(problem.channels):
            ln_sigma = np.asarray(noise.ln_sigma)[i]
            # Q is in units of the heights, the constants of the grid know the rest.
            density = np.asarray(noise.constant)[i] - draws.squares[:, i, None] / (
                2 * np.exp(2 * ln_sigma)
            )
            rows = np.broadcast_to(ln_sigma, density.shape)
            uniform = rng.uniform(size=(draws.u.size, 1))
            logs[f"sigma_{channel}"] = draw_from_nodes(rows, density, uniform)[:, 0]
    x = encode(problem, {name: np.exp(values) for name, values in logs.items()})
    return posterior_of_draws(
        problem,
        x,
        rng=rng,
        evidence=evidence,
        seed=item.seed,
        reference_alpha=reference_azimuth(item.table, item.config),
        reach=reach_of(item.config),
    )


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
        reference_alpha=reference_azimuth(item.table, item.config),
        notices=(*item.notices, *fit_notices(item.setup, fit)),
    )
    return conclude(
        fitted,
        {"theta_c": theta_c},
        posterior,
        config=item.given,
        seed=item.seed,
        with_sets=False,
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


@eqx.filter_jit
def _costs(problem: Problem, points: Float[Array, "k q"]) -> Float[Array, " k"]:
    return jax.vmap(lambda y: jnp.sum(problem.data_residuals(y) ** 2))(points)
