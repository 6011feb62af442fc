"""Where walkers start: from the prior, cooled to the posterior, with every mode seen.

Draws from the prior become draws from the posterior in a few steps of increasing
weight of the data, so modes are populated in proportion and nothing is asked of a
covariance that flat valleys do not have. Every mode of least squares is checked
against the outcome, and populated where it matters. Excluded: judging convergence.
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float, Int

from pushfit.errors import FitError
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import Problem
from pushfit.fit.results import FitResult
from pushfit.fit.sampler.chains import advance
from pushfit.fit.sampler.mixture import fit_mixture
from pushfit.fit.sampler.moves import both_moves
from pushfit.model import as_float
from pushfit.parameters import PARAMETERS, POSITIVE

# Share of the points that a step of the cooling may leave without weight, and steps of
# the walkers after each, whose proposals are fitted to so many points: mode weights
# are then right within a factor of a few, which the chain settles.
KEPT_SHARE = 0.3
STEPS_PER_STAGE, N_MIXTURE_POINTS = 6, 4096
# Steps of a search for the length of a stage, from all of the way down by decades; and
# the share of a step that is as good as all of it.
MAX_HALVINGS, SAME_STEP = 60, 0.95
# No table needs more than some 60: each stage multiplies the information by a factor.
MAX_STAGES = 500
# Prior draws tried for each mode.
N_MODE_DRAWS = 128

# Log prior and log likelihood of points.
LogDensities = Callable[
    [np.ndarray], tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]
]


def starting_points(
    problem: Problem,
    fit: FitResult,
    log_densities: LogDensities,
    *,
    n_ensembles: int,
    n_points: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "k p"]:
    """Independent ensembles of points that resemble draws from the posterior.

    Returns:
        Points, one ensemble after the other; the first of each are at the modes.

    Raises:
        FitError: If no draw from the prior gives the data a finite likelihood.
    """
    points = prior_x_samples(problem, rng, n_ensembles * n_points)
    _check_finite(problem, points, log_densities)
    points = _cool(points, log_densities, n_ensembles=n_ensembles, rng=rng)
    missed = _missed_modes(
        problem, fit, log_densities=log_densities, points=points, rng=rng
    )
    # First in line: the caller starts walkers at the first points of each ensemble.
    points.reshape(n_ensembles, n_points, -1)[:, : len(missed)] = missed
    return points


def _check_finite(
    problem: Problem, points: Float[np.ndarray, "k p"], log_densities: LogDensities
) -> None:
    """Raise with one offending start in full if there is no finite one."""
    log_prior, log_likelihood = log_densities(points)
    if np.any(np.isfinite(log_prior + log_likelihood)):
        return
    worst = "prior density" if not np.isfinite(log_prior[0]) else "likelihood"
    params = problem.state(as_float(points[0])).params
    free = [n for n in problem.priors if n in POSITIVE and hasattr(params, n)]
    values = ", ".join(
        f"{n} = {float(getattr(params, n)):.4g} {PARAMETERS[n].unit} "
        f"(prior: {problem.priors[n].describe()})"
        for n in free
    )
    raise FitError(
        f"no start for the sampler: the {worst} is not finite at any of "
        f"{len(points)} draws from the prior, for example at {values}; check the "
        "heights, their standard deviations and the priors in grasp.toml",
        code="no_finite_start",
    )


def _cool(
    points: Float[np.ndarray, "k p"],
    log_densities: LogDensities,
    *,
    n_ensembles: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "k p"]:
    """Points of prior x likelihood^β, for β from 0 to 1 (sequential Monte Carlo).

    References:
        Del Moral, Doucet & Jasra (2006), doi:10.1111/j.1467-9868.2006.00553.x.
    """
    random = np.random.RandomState(np.random.MT19937(rng.integers(2**63)))
    beta = 0.0
    _, log_likelihood = log_densities(points)
    for _ in range(MAX_STAGES):
        groups = log_likelihood.reshape(n_ensembles, -1)
        step = _largest_step(groups, 1.0 - beta)
        beta = 1.0 if step >= 1.0 - beta else beta + step
        cloud = points[_resample(groups, step, random)]
        # One proposal for all: a region that one ensemble has found, the others reach.
        mixture = fit_mixture(rng.permutation(cloud)[:N_MIXTURE_POINTS], rng)
        moves = both_moves(n_ensembles, mixture)
        power = beta

        def log_prob(
            x: Float[np.ndarray, "n p"], power: float = power
        ) -> Float[np.ndarray, " n"]:
            log_prior, log_likelihood = log_densities(x)
            return log_prior + power * log_likelihood

        chain, _ = advance(log_prob, cloud, STEPS_PER_STAGE, moves=moves, random=random)
        points = chain[-1]
        if beta == 1.0:
            return points
        _, log_likelihood = log_densities(points)
    raise FitError(
        f"the sampler found no way from the prior to the data in {MAX_STAGES} stages "
        f"(stopped at {beta:.1e} of the way); the standard deviations of the heights "
        "are probably too small: raise them, or leave their columns out",
        code="no_start_found",
    )


def _largest_step(groups: Float[np.ndarray, "e n"], rest: float) -> float:
    """Largest step in β that leaves `KEPT_SHARE` effective points to each ensemble."""

    def is_kept(step: float) -> bool:
        # Kish's effective number of points over their number.
        squares = np.sum(_weights(groups, step) ** 2, axis=1)
        return bool(np.all(1 / (squares * groups.shape[1]) >= KEPT_SHARE))

    if is_kept(rest):
        return rest
    low, high = 0.0, rest
    # In the log: the first step may be a billionth of the way.
    for _ in range(MAX_HALVINGS):
        middle = np.sqrt(low * high) if low > 0 else high / 10
        low, high = (middle, high) if is_kept(middle) else (low, middle)
        if low > SAME_STEP * high:
            break
    return high if low == 0 else low


def _weights(groups: Float[np.ndarray, "e n"], step: float) -> Float[np.ndarray, "e n"]:
    """Weights within each ensemble for a step in β."""
    weights = np.exp(step * (groups - np.max(groups, axis=1, keepdims=True)))
    return weights / np.sum(weights, axis=1, keepdims=True)


def _resample(
    groups: Float[np.ndarray, "e n"], step: float, random: np.random.RandomState
) -> Int[np.ndarray, " k"]:
    """Rows to continue with, in proportion to their weights (systematic)."""
    n_ensembles, n = groups.shape
    ticks = (np.arange(n) + random.rand(n_ensembles, 1)) / n
    cumulative = np.cumsum(_weights(groups, step), axis=1)
    chosen = [np.searchsorted(c, t) for c, t in zip(cumulative, ticks, strict=True)]
    within = np.minimum(np.stack(chosen), n - 1)
    return (within + n * np.arange(n_ensembles)[:, None]).ravel()


def _missed_modes(
    problem: Problem,
    fit: FitResult,
    *,
    log_densities: LogDensities,
    points: Float[np.ndarray, "k p"],
    rng: np.random.Generator,
) -> Float[np.ndarray, "m p"]:
    """A point in every mode that is as probable as the cloud's own points."""
    log_prior, log_likelihood = log_densities(points)
    typical = np.median(log_prior + log_likelihood)
    missed = []
    from_prior = prior_x_samples(problem, rng, N_MODE_DRAWS)
    for mode in fit.modes:
        draws = from_prior.copy()
        for name, value in mode.coordinates.items():
            if name in problem.names:
                draws[:, problem.names.index(name)] = value
        log_prior, log_likelihood = log_densities(draws)
        log_prob = log_prior + log_likelihood
        if np.max(log_prob) > typical:
            missed.append(draws[np.argmax(log_prob)])
    return np.asarray(missed).reshape(-1, len(problem.names))
