"""Draws from the posterior by emcee, run until they may be believed or not.

Four independent ensembles share every call of one vectorised log density. Starts are
cooled from the prior (`starts`), moves mix differences with a fitted proposal
(`moves`), and the verdict comes from `diagnostics`. A chain that has not converged is
returned with its problems, not raised. Excluded: what may be quoted
(`pushfit.fit.assess.reporting_rules`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from emcee.moves import Move
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.fit.results import Diagnostics, FitResult, FitStatus, PosteriorResult
from pushfit.fit.sampler.chains import Densities, Run, keep_run, resume
from pushfit.fit.sampler.checkpoint import fingerprint
from pushfit.fit.sampler.diagnostics import MIN_AUTOCORR_TIMES, diagnose
from pushfit.fit.sampler.mixture import fit_mixture
from pushfit.fit.sampler.moves import both_moves
from pushfit.fit.sampler.starts import starting_points
from pushfit.mechanics.directions import critical_angle
from pushfit.model import as_float

# Share of the steps that move along differences; the others propose from the mixture.
# A smaller one has a shorter autocorrelation time of θ_c
# (`benchmarks.inference.emcee_mixing`), but with an ellipse may leave a walker in a
# corner.
DIFFERENCE_SHARE = 0.25
# Starting points of each ensemble are 2 to the power of the coordinates and this, up to
# a limit. On the bent valley of an azimuth sweep a region that ends with 12 % of the
# posterior holds 0.3 % on the way from the prior: 256 points lose it.
LOG2_POINTS, MAX_POINTS = 4, 4096
# Steps of the first trial, from whose second half the mixture is fitted again, and the
# number of points used. A trial in which half the walkers accept less than GOOD_SHARE
# is followed by another of twice the length: one is enough for most tables, not for
# the bent valley of an azimuth sweep.
TRIAL_STEPS, N_TRIAL_POINTS = 100, 8192
MAX_TRIALS, GOOD_SHARE = 4, 0.4
# Share of the steps dropped at the start: at least 5 autocorrelation times of any chain
# that is long enough.
BURN_IN_SHARE = 0.1
# Largest progress that is shown while steps are still to come.
NEARLY_DONE = 0.99
# Steps between two looks at the chain: the first look needs enough for a first guess.
FIRST_BLOCK, SMALLEST_BLOCK, LARGEST_BLOCK = 200, 50, 500
# Draws kept: quantiles at 5 % are then good to 0.023 standard deviations.
N_DRAWS = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """How much sampling may cost.

    Args:
        n_ensembles: Independent ensembles, at least 2.
        n_walkers: Walkers in each, even and at least twice the coordinates.
        max_steps: Steps of every walker after which the run ends either way.
    """

    n_ensembles: int = 4
    # The autocorrelation time is the same from 32 to 128 walkers; below 64 the cost of
    # a call no longer shrinks, above it 50 autocorrelation times give draws to spare.
    n_walkers: int = 64
    max_steps: int = 5000


def sample_posterior(
    setup: Setup,
    fit: FitResult,
    *,
    seed: int,
    reference_alpha: float,
    reach: tuple[float, float],
    budget: Budget | None = None,
    progress: Callable[[str, float], None] | None = None,
    checkpoint: Path | None = None,
) -> PosteriorResult:
    """Draws from the posterior, with the evidence for or against them.

    Args:
        fit: Least squares of the same problem, with all its modes.
        seed: Seed of every random number: same seed, same bits.
        reference_alpha: Azimuth at which θ_c is taken [rad].
        reach: Lowest and highest azimuth for α* [rad].
        budget: How much it may cost; None for the budget of `Budget()`.
        progress: Called with a stage and the share of it that is done.
        checkpoint: File that keeps the run after every block; a run found there
            continues to the same bits.

    Returns:
        Draws without burn-in; status NOT_CONVERGED and the reasons in `diagnostics`
        where the budget was spent in vain.

    Raises:
        FitError: If no start has a finite density.
        ConvergenceError: If the density is infinite at some point.
    """
    budget = budget or Budget()
    problem = setup.problem
    report = progress or (lambda stage, share: None)
    densities = Densities(problem)
    question = fingerprint(problem, seed, budget.n_ensembles, budget.n_walkers)
    run = None if checkpoint is None else resume(checkpoint, question=question)
    if run is None:
        report("starting points", 0.0)
        run = _start(problem, fit, densities=densities, budget=budget, seed=seed)
        if checkpoint is not None:
            keep_run(run, checkpoint, question=question)
    moves = _moves(run, budget)
    while True:
        n_burn, diagnostics = _look(
            problem, run, budget=budget, reference_alpha=reference_alpha
        )
        n_more = _steps_to_go(run, diagnostics)
        n_more = min(n_more, budget.max_steps - len(run.chain))
        is_done = not diagnostics.problems or n_more <= 0
        report("sampling", 1.0 if is_done else _share(diagnostics))
        if is_done:
            break
        run.advance(densities.log_prob, moves, n_more)
        if checkpoint is not None:
            keep_run(run, checkpoint, question=question)
    tau = max(diagnostics.autocorr_time.values())
    # Half an autocorrelation time: closer states add next to nothing.
    thin = max(1, int(tau / 2)) if np.isfinite(tau) else 1
    chain, log_prob = run.chain[n_burn::thin], run.log_prob[n_burn::thin]
    rng = np.random.default_rng([seed, 2])
    points = chain.reshape(-1, chain.shape[-1])
    chosen = rng.permutation(len(points))[:N_DRAWS]
    prior = prior_x_samples(problem, rng, N_DRAWS)
    by_ensemble = chain.reshape(len(chain), diagnostics.n_ensembles, -1, len(prior[0]))
    is_converged = not diagnostics.problems
    return PosteriorResult(
        samples=samples_mapping(problem, points[chosen], reference_alpha, reach=reach),
        prior_samples=samples_mapping(problem, prior, reference_alpha, reach=reach),
        log_prob=log_prob.ravel()[chosen],
        chain=np.swapaxes(by_ensemble, 0, 1),
        chain_names=problem.names,
        thin=thin,
        engine="emcee",
        diagnostics=diagnostics,
        log_evidence=None,
        log_evidence_error=None,
        seed=seed,
        status=FitStatus.OK if is_converged else FitStatus.NOT_CONVERGED,
    )


@compiled
def _theta_c(
    problem: Problem, x: Float[Array, "n p"], alpha: Float[Array, ""]
) -> Float[Array, " n"]:
    """Critical angle at each point; a straight angle below where it never rolls."""

    def one(x: Float[Array, " p"]) -> Float[Array, ""]:
        state = problem.state(x)
        grasp = state.grasp(problem.grasp)
        angle = critical_angle(state.params, grasp, alpha)
        return jnp.where(jnp.isnan(angle), -jnp.pi, angle)

    return jax.vmap(one)(x)


def _start(
    problem: Problem, fit: FitResult, *, densities: Densities, budget: Budget, seed: int
) -> Run:
    """First block of a run, after the trial steps that its proposal is fitted to."""
    rng = np.random.default_rng(seed)
    n_points = min(2 ** (len(problem.names) + LOG2_POINTS), MAX_POINTS)
    n_points = max(n_points, budget.n_walkers)
    points = starting_points(
        problem,
        fit,
        densities,
        n_ensembles=budget.n_ensembles,
        n_points=n_points,
        rng=rng,
    )
    walkers = points.reshape(budget.n_ensembles, n_points, -1)[:, : budget.n_walkers]
    walkers = walkers.reshape(-1, points.shape[1])
    run = Run(
        chain=walkers[None],
        log_prob=densities.log_prob(walkers)[None],
        random=np.random.RandomState(np.random.MT19937(rng.integers(2**63))),
        mixture=fit_mixture(rng.permutation(points)[:N_TRIAL_POINTS], rng),
    )
    for trial in range(MAX_TRIALS):
        run.advance(densities.log_prob, _moves(run, budget), TRIAL_STEPS * 2**trial)
        seen = run.chain[len(run.chain) // 2 :].reshape(-1, points.shape[1])
        has_moved = np.any(run.chain[1:] != run.chain[:-1], axis=2)
        run = Run(
            chain=run.chain[-1:],
            log_prob=run.log_prob[-1:],
            random=run.random,
            mixture=fit_mixture(rng.permutation(seen)[:N_TRIAL_POINTS], rng),
        )
        if np.median(np.mean(has_moved, axis=0)) >= GOOD_SHARE:
            break
    n_steps = min(FIRST_BLOCK, budget.max_steps)
    run.advance(densities.log_prob, _moves(run, budget), n_steps)
    return run


def _moves(run: Run, budget: Budget) -> list[tuple[Move, float]]:
    """Moves of the chain and their shares."""
    return both_moves(budget.n_ensembles, run.mixture, DIFFERENCE_SHARE)


def _look(
    problem: Problem, run: Run, *, budget: Budget, reference_alpha: float
) -> tuple[int, Diagnostics]:
    """Burn-in of a run, and the checks of what follows it."""
    alpha = as_float(reference_alpha)
    n_steps, _, n_dim = run.chain.shape
    flat = run.chain.reshape(-1, n_dim)
    angle = in_chunks(lambda rows: _theta_c(problem, rows, alpha), flat, 4096)
    shape = (n_steps, budget.n_ensembles, budget.n_walkers)
    traces = {
        name: run.chain[..., i].reshape(shape) for i, name in enumerate(problem.names)
    }
    traces |= {"theta_c": angle.reshape(shape), "log_prob": run.log_prob.reshape(shape)}
    n_burn = math.ceil(BURN_IN_SHARE * n_steps)
    kept = run.chain[n_burn:].reshape(-1, *shape[1:], n_dim)
    return n_burn, diagnose(kept, {n: trace[n_burn:] for n, trace in traces.items()})


def _steps_to_go(run: Run, diagnostics: Diagnostics) -> int:
    """Steps until the next look: as many as the autocorrelation time asks for."""
    tau = max(diagnostics.autocorr_time.values())
    if not np.isfinite(tau):
        return LARGEST_BLOCK
    # A tenth more, because the estimate grows with the chain.
    needed = 1.1 * MIN_AUTOCORR_TIMES / (1 - BURN_IN_SHARE) * tau - len(run.chain)
    return int(np.clip(needed, SMALLEST_BLOCK, LARGEST_BLOCK))


def _share(diagnostics: Diagnostics) -> float:
    """Share of the steps needed that are there."""
    tau = max(diagnostics.autocorr_time.values())
    share = diagnostics.n_steps / (MIN_AUTOCORR_TIMES * tau)
    return float(min(share, NEARLY_DONE)) if np.isfinite(share) else 0.0
