"""A posterior by the sweep: weighted draws, their honesty, and draws of equal weight.

Batches of draws are added until enough of them count. What stays short of that, or has
weights with too heavy a tail, says so. Excluded: emcee, to which the caller then turns
(`pushfit.fit.sampler.emcee_posterior`).
"""

import functools
from collections.abc import Callable
from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.setup import Setup
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.fit.results import FitStatus, PosteriorResult
from pushfit.fit.sampler.mixture import Mixture, fit_mixture
from pushfit.fit.sweep.draws import Draw, draw, n_uniforms
from pushfit.fit.sweep.prior import make_target, prior_points
from pushfit.fit.sweep.sheet import Sheet, make_sheet
from pushfit.fit.sweep.target import Target
from pushfit.model import Scalar, as_float
from pushfit.parameters import TINY

LogProb = Callable[[Float[np.ndarray, "n p"]], Float[np.ndarray, " n"]]

# Draws of one call, and effective draws that are enough: the mean of any quantity is
# then good to 0.03 of its standard deviation.
N_DRAWS, ENOUGH = 4096, 2000.0
# Calls of one proposal at most.
MAX_CALLS = 4
# Below so many effective draws, or with a heavier tail of the weights, averages are not
# to be trusted. The second is the limit of Vehtari et al. (2024), arXiv:1507.02646.
TOO_FEW, MAX_PARETO_K = 400.0, 0.7
# Weights with a heavier tail have no variance, and draws that took a second call to be
# enough may lack a region: a mixture is tried. Without it log evidences may be off by
# many of their errors.
HEAVY_PARETO_K = 0.5
# Times that a mixture is fitted to the draws at most: until both they and what it was
# fitted to are to be trusted. A tail that the one lacks the other may lack, unseen.
MAX_REFINEMENTS = 6
# Its components, the draws that it is fitted to, and how many effective ones are enough
# for that.
N_COMPONENTS, N_FITTED, ENOUGH_TO_FIT = 8, 2048, 500.0
# Power of the weights that these are drawn by: a fit to a few of them leaves out tails.
FITTED_POWER = 0.5
# Another is fitted to them after so many steps of emcee in the posterior to this power,
# half of them by the first: it fills far tails, where the sweep had few draws or none.
# Without it standard deviations may be too small (`benchmarks.inference.agreement`);
# alone it leaves a third of the effective draws of wide posteriors. From draws that are
# not to be trusted it has farther to go.
N_STEPS, N_FAR_STEPS, SPREADING_POWER = 12, 36, 0.5
# Densities of one call: half the walkers move at a time.
N_ROWS = N_FITTED // 2
# Draws of equal weight that are returned.
N_RETURNED = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class WeightedDraws:
    """Draws with weights.

    Args:
        x: Sampling coordinates, by rising ln tan θ_c.
        log_prob: Unnormalised log posterior densities.
        log_weights: Smoothed logs of the weights, which sum to 1.
        log_evidence: Log marginal likelihood.
        log_evidence_error: Its standard error.
        ess: Effective number of draws.
        pareto_k: Shape of the tail of the weights.
        n_refinements: Times that a mixture was fitted to the draws before.
    """

    x: Float[np.ndarray, "n p"]
    log_prob: Float[np.ndarray, " n"]
    log_weights: Float[np.ndarray, " n"]
    log_evidence: float
    log_evidence_error: float
    ess: float
    pareto_k: float
    n_refinements: int = 0

    @property
    def is_trusted(self) -> bool:
        """Whether averages over the draws mean what they say."""
        return self.ess >= TOO_FEW and self.pareto_k <= MAX_PARETO_K

    def resampled(
        self, n: int, rng: np.random.Generator, *, power: float = 1.0
    ) -> tuple[Float[np.ndarray, "n p"], Float[np.ndarray, " n"]]:
        """Draws of equal weight in random order, and their log densities.

        Args:
            power: Of the weights; below 1 tails get more than their share.
        """
        ends = np.cumsum(np.exp(power * self.log_weights))
        ticks = (np.arange(n) + rng.uniform()) / n
        rows = np.searchsorted(ends, ticks * ends[-1])
        rows = rng.permutation(np.minimum(rows, ends.size - 1))
        return self.x[rows], self.log_prob[rows]


def sweep_posterior(
    setup: Setup,
    *,
    seed: int,
    reference_alpha: float,
    reach: tuple[float, float],
) -> PosteriorResult:
    """Draws from the posterior of a table, and its evidence.

    Args:
        reference_alpha: Azimuth of θ_c [rad].
        reach: Lowest and highest azimuth for α* [rad].

    Returns:
        Posterior with engine "sweep"; its status is NOT_CONVERGED where too few draws
        count or the weights have too heavy a tail.
    """
    problem = setup.problem
    rng = np.random.default_rng(seed)
    target = make_target(problem, reference_alpha)
    weighted = weighted_draws(target, seed=seed)
    x, log_prob = weighted.resampled(N_RETURNED, rng)
    prior = prior_points(problem, reference_alpha, rng)
    both = samples_mapping(
        problem, np.concatenate([x, prior]), reference_alpha, reach=reach
    )
    return PosteriorResult(
        samples={name: values[:N_RETURNED] for name, values in both.items()},
        prior_samples={name: values[N_RETURNED:] for name, values in both.items()},
        log_prob=log_prob,
        chain=None,
        chain_names=(),
        thin=1,
        engine="sweep",
        diagnostics=None,
        log_evidence=weighted.log_evidence,
        log_evidence_error=weighted.log_evidence_error,
        ess=weighted.ess,
        pareto_k=weighted.pareto_k,
        seed=seed,
        status=FitStatus.OK if weighted.is_trusted else FitStatus.NOT_CONVERGED,
    )


def weighted_draws(target: Target, *, seed: int) -> WeightedDraws:
    """Draws with weights, as many as it takes."""
    rng = np.random.default_rng([seed, 1])
    found = _swept(target, rng)
    was_enough = found.ess >= ENOUGH and len(found.x) == N_DRAWS
    if was_enough and found.pareto_k <= HEAVY_PARETO_K:
        return found
    random = np.random.RandomState(np.random.MT19937(rng.integers(2**63)))
    tried, mixtures = [found], []
    for n in range(1, MAX_REFINEMENTS + 1):
        # The sweep follows ridges far; what is fitted to its draws is nearest to it.
        mixtures = [*mixtures[:1], _mixture(target, found, rng, random)]
        proposal = functools.reduce(lambda a, b: a.beside(b), mixtures)
        found = _proposed(target, proposal, random)
        tried.append(replace(found, n_refinements=n))
        if all(draws.is_trusted for draws in tried[-2:]):
            return tried[-1]
    return min(tried, key=lambda draws: (not draws.is_trusted, draws.pareto_k))


def _swept(target: Target, rng: np.random.Generator) -> WeightedDraws:
    """Draws proposed by the sweep."""
    sheet = _sheet(target)

    def batch() -> Draw:
        shift = as_float(rng.uniform(size=n_uniforms(target)))
        return jax.tree.map(np.asarray, _draws(target, sheet, shift))

    return _drawn(batch, ENOUGH_TO_FIT)


def _mixture(
    target: Target,
    found: WeightedDraws,
    rng: np.random.Generator,
    random: np.random.RandomState,
) -> Mixture:
    """A mixture that resembles draws of the posterior."""
    x, _ = found.resampled(N_FITTED, rng, power=FITTED_POWER)
    mixture = fit_mixture(x, rng, n_components=N_COMPONENTS)
    n_steps = N_STEPS if found.is_trusted else N_FAR_STEPS
    log_prob = functools.partial(_log_probs_of, target)
    spread = _spread(log_prob, x, n_steps, mixture, random)
    return mixture.beside(fit_mixture(spread, rng, n_components=N_COMPONENTS))


def _proposed(
    target: Target, mixture: Mixture, random: np.random.RandomState
) -> WeightedDraws:
    """Draws proposed by a mixture."""

    def batch() -> Draw:
        x = mixture.sample(random, N_DRAWS)
        log_probs = _log_probs_of(target, x)
        return Draw(
            x=as_float(x),
            log_weight=as_float(log_probs - mixture.log_density(x)),
            log_prob=as_float(log_probs),
            outer=as_float(x[:, 0]),  # any coordinate orders them
        )

    return _drawn(batch, ENOUGH)


def _spread(
    log_prob: LogProb,
    x: Float[np.ndarray, "n p"],
    n_steps: int,
    mixture: Mixture,
    random: np.random.RandomState,
) -> Float[np.ndarray, "n p"]:
    """Draws of a posterior, moved to where a power of it has its mass."""
    # Slow to load, and not every table needs them.
    from pushfit.fit.sampler.chains import advance  # noqa: PLC0415
    from pushfit.fit.sampler.moves import both_moves  # noqa: PLC0415

    chain, _ = advance(
        lambda x: SPREADING_POWER * log_prob(x),
        x,
        n_steps,
        moves=both_moves(1, mixture),
        random=random,
    )
    return chain[-1]


def _drawn(batch: Callable[[], Draw], enough: float) -> WeightedDraws:
    """Batches of draws, until so many effective ones are among them."""
    parts: list[Draw] = []
    while True:
        parts.append(batch())
        ess = _ess(np.concatenate([part.log_weight for part in parts]))
        if ess >= enough or len(parts) == MAX_CALLS:
            break
    draws = jax.tree.map(lambda *arrays: np.concatenate(arrays), *parts)
    order = np.argsort(draws.outer, kind="stable")
    return _weighed(draws.x[order], draws.log_prob[order], draws.log_weight[order])


def _weighed(
    x: Float[np.ndarray, "n p"],
    log_prob: Float[np.ndarray, " n"],
    log_weight: Float[np.ndarray, " n"],
) -> WeightedDraws:
    """Draws with smoothed weights, and what these are worth."""
    n, ess = log_weight.size, _ess(log_weight)
    smoothed, pareto_k = log_weight, np.asarray(np.inf)
    if ess > 0:
        smoothed, pareto_k = map(np.asarray, _smoothed(as_float(log_weight)))
    return WeightedDraws(
        x=x,
        log_prob=log_prob,
        log_weights=smoothed,
        log_evidence=_log_sum(log_weight) - float(np.log(n)),
        log_evidence_error=float(np.sqrt(max(1 / max(ess, TINY) - 1 / n, 0.0))),
        ess=ess,
        pareto_k=float(pareto_k),
    )


def _ess(log_weight: Float[np.ndarray, " n"]) -> float:
    """Effective number of draws by Kish's rule, (Σ w)² / Σ w²."""
    if not np.any(np.isfinite(log_weight)):
        return 0.0
    return float(np.exp(2 * _log_sum(log_weight) - _log_sum(2 * log_weight)))


def _log_sum(log_values: Float[np.ndarray, " n"]) -> float:
    top = np.max(log_values)
    # Where nothing is finite there is nothing to subtract.
    if not np.isfinite(top):
        return float(top)
    return float(top + np.log(np.sum(np.exp(log_values - top))))


@functools.lru_cache(maxsize=16)
def _points(n: int) -> Float[np.ndarray, "d n"]:
    """Even points in a cube: the first of Sobol's sequence."""
    return scipy.stats.qmc.Sobol(n, scramble=False).random(N_DRAWS)


@compiled
def _sheet(target: Target) -> Sheet:
    return make_sheet(target)


@compiled
def _draws(target: Target, sheet: Sheet, shift: Float[Array, " n"]) -> Draw:
    # A shift modulo 1 makes every point uniform and keeps them even.
    uniform = jnp.mod(jnp.asarray(_points(shift.size)) + shift[None], 1.0)
    return jax.vmap(lambda row: draw(target, sheet, row))(uniform)


@compiled
def _smoothed(log_weight: Float[Array, " n"]) -> tuple[Float[Array, " n"], Scalar]:
    """Pareto smoothing: logs of weights that sum to 1, and the shape of their tail."""
    from blackjax.diagnostics import psis_weights  # noqa: PLC0415 - slow to load

    return psis_weights(log_weight)


def _log_probs_of(
    target: Target, x: Float[np.ndarray, "n p"]
) -> Float[np.ndarray, " n"]:
    """Log densities of any number of points."""
    return in_chunks(lambda rows: _log_probs(target, rows), x, N_ROWS)


@compiled
def _log_probs(target: Target, x: Float[Array, "n p"]) -> Float[Array, " n"]:
    return jax.vmap(target.log_prob)(x)
