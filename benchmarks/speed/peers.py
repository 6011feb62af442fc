"""How a user of lmfit, SciPy or numpyro would do what pushfit does, with its model.

Local fits are of A, B and C_rr in logs from the medians of the priors, which hides
their ambiguity and is to the advantage of the peers. The sampler of lmfit gets all six
parameters in logs with the priors of pushfit as further residuals, so that its
posterior is the same. NUTS of numpyro gets the density of pushfit itself, in its
coordinates for sampling.
"""

import jax
import jax.numpy as jnp
import lmfit
import numpy as np
from arviz_stats.base.array import array_stats
from jaxtyping import Float
from numpyro.infer import MCMC, NUTS
from scipy import optimize

from benchmarks.tables import NAMES, PUSH_LENGTH
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.problem.problem import Problem
from pushfit.fit.sampler.diagnostics import autocorr_time

# Some ten for each coordinate, as emcee advises at least two.
N_WALKERS = 64
# Chains of NUTS, and steps of each.
N_CHAINS, N_WARMUP, N_KEPT = 4, 1000, 2000
# Medians and spreads of the default priors, in logs, as peers are told them.
PRIORS = default_priors(None)
MEDIANS = np.array([np.log(float(PRIORS[name].first)) for name in NAMES])
SPREADS = np.array([float(PRIORS[name].second) for name in NAMES])


def combined(logs: Float[np.ndarray, "*n 6"]) -> Float[np.ndarray, "*n 3"]:
    """Logs of A, B and C_rr, Eqs. (12) and (13) of the paper."""
    K_sn, K_dn, K_st, C_rr, C_d, L = np.exp(np.moveaxis(logs, -1, 0))
    A, B = K_sn * K_dn / (K_sn + K_dn), K_st * C_d / (L**2 * K_st + C_d)
    return np.log(np.stack([A, B, C_rr], axis=-1))


def residuals(
    logs: Float[np.ndarray, " 3"], table: tuple[np.ndarray, ...]
) -> Float[np.ndarray, " n"]:
    """Weighted residuals at logs of A, B and C_rr, Eq. (14) of the paper."""
    sine, cosine, heights, sd = table
    A, B, C_rr = np.exp(logs)
    normal = A * sine
    return (np.hypot(normal, np.minimum(C_rr * normal, B * cosine)) - heights) / sd


def posterior_residuals(
    logs: Float[np.ndarray, " 6"], table: tuple[np.ndarray, ...]
) -> Float[np.ndarray, " m"]:
    """Residuals of all six parameters, priors included."""
    pulls = (logs - MEDIANS) / SPREADS
    return np.concatenate([residuals(combined(logs), table), pulls])


def arrays(table: PeakTable) -> tuple[np.ndarray, ...]:
    """What the residuals need of a table."""
    depth, width = PUSH_LENGTH * np.sin(table.theta), PUSH_LENGTH * np.cos(table.theta)
    sd = table.sd("height")
    assert sd is not None
    return depth, width, table.heights("height"), sd


def fit_by_scipy(table: tuple[np.ndarray, ...]) -> float:
    """Half the chi-square that `least_squares` finds."""
    start = combined(MEDIANS)
    return float(optimize.least_squares(residuals, start, args=(table,)).cost)


def fit_by_lmfit(table: tuple[np.ndarray, ...]) -> float:
    """Half the chi-square that `minimize` finds."""
    params = lmfit.Parameters()
    for name, start in zip(("ln_A", "ln_B", "ln_C_rr"), combined(MEDIANS), strict=True):
        params.add(name, value=start)

    def function(params: lmfit.Parameters) -> Float[np.ndarray, " n"]:
        values = params.valuesdict()
        return residuals(np.array(list(values.values())), table)

    return float(lmfit.minimize(function, params, method="leastsq").chisqr) / 2


def sample_by_lmfit(
    table: tuple[np.ndarray, ...], starts: Float[np.ndarray, "w 6"], n_steps: int
) -> float:
    """Effective draws of θ_c that `emcee` of lmfit makes."""
    params = lmfit.Parameters()
    for name, start in zip(NAMES, np.median(starts, axis=0), strict=True):
        params.add(name, value=start)

    def function(params: lmfit.Parameters) -> Float[np.ndarray, " n"]:
        return posterior_residuals(np.array(list(params.valuesdict().values())), table)

    found = lmfit.minimize(
        function,
        params,
        method="emcee",
        nan_policy="omit",
        nwalkers=N_WALKERS,
        steps=n_steps,
        pos=starts,
        progress=False,
        is_weighted=True,
        seed=0,
    )
    A, B, C_rr = np.moveaxis(combined(found.chain), -1, 0)
    trace = np.arctan(np.exp(B - A - C_rr))[:, None, :]
    return trace.size / autocorr_time(trace)


def sample_by_nuts(problem: Problem, reach: tuple[float, float]) -> float:
    """Effective draws of θ_c that NUTS of numpyro makes from starts in the prior."""
    run = MCMC(
        NUTS(potential_fn=lambda x: -problem.log_prob(x)),
        num_warmup=N_WARMUP,
        num_samples=N_KEPT,
        num_chains=N_CHAINS,
        chain_method="vectorized",
        progress_bar=False,
    )
    starts = prior_x_samples(problem, np.random.default_rng(0), N_CHAINS)
    run.run(jax.random.PRNGKey(0), init_params=jnp.asarray(starts))
    points = np.asarray(run.get_samples())
    theta_c = samples_mapping(problem, points, 0.0, reach=reach)["theta_c"]
    chains = theta_c.reshape(N_CHAINS, N_KEPT)
    return float(array_stats.ess(chains, chain_axis=0, draw_axis=1, method="mean"))
