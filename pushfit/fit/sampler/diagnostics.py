"""Whether a chain of independent ensembles may be believed: numbers and a verdict.

Walkers of one ensemble are not independent chains. R-hat across them raises false
alarms (1.12 on a perfect Gaussian), and an effective sample size from the flattened
chain is 40 to 200 times too large; so ensembles are compared with each other, and the
sample size follows from the autocorrelation time. Pure functions of arrays. Excluded:
weighted draws (`pushfit.fit.sweep.posterior`).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from emcee import autocorr
from jaxtyping import Float
from scipy.special import chdtrc

from pushfit.fit.results import Diagnostics

# Below 50 autocorrelation times emcee's estimate of that time is itself too short.
MIN_AUTOCORR_TIMES = 50
# One per cent above 1: ensemble means scatter by 0.14 standard deviations.
MAX_RHAT = 1.01
# Outside, a walker is stuck or the density is flat where it should not be.
ACCEPTANCE = (0.05, 0.95)
# Chance of a false alarm per name when ensembles are compared with the scatter that
# the autocorrelation time predicts; it notices rare swaps between modes, to which
# that time is blind.
DISAGREEMENT_LEVEL = 1e-6
# R-hat needs far fewer steps than are kept; ranking is what costs.
MAX_RHAT_STEPS = 200

# Quantities by step, ensemble and walker.
Traces = Mapping[str, Float[np.ndarray, "t e w"]]


def autocorr_time(trace: Float[np.ndarray, "t e w"]) -> float:
    """Integrated autocorrelation time, averaged over all walkers [steps].

    Returns:
        At least about 1; NaN if a walker never moves.
    """
    series = trace.reshape(trace.shape[0], -1)
    # Its autocorrelation is 0/0, of which rounding makes a number.
    if np.any(np.ptp(series, axis=0) == 0):
        return float("nan")
    # tol=0 keeps emcee from judging the length: `judge` does.
    tau = np.asarray(autocorr.integrated_time(series, tol=0), dtype=np.float64)
    return float(tau[0])


def ess(trace: Float[np.ndarray, "t e w"], autocorr_time: float) -> float:
    """Effective sample size: values kept, over the autocorrelation time."""
    return trace.size / autocorr_time


def nested_rhat(trace: Float[np.ndarray, "t e w"]) -> float:
    """Nested R-hat of the ensembles, each as one superchain; rank-normalised.

        sqrt(1 + between ensembles / within ensembles)

    Returns:
        1 for identical ensembles, larger where they disagree in centre or width; NaN
        if nothing varies.

    References:
        Margossian et al. (2024), doi:10.1214/24-BA1453.
    """
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - slow to load

    if np.ptp(trace) == 0:
        return float("nan")
    n_steps, n_ensembles, n_walkers = trace.shape
    thin = max(1, n_steps // MAX_RHAT_STEPS)
    chains = trace[::thin].reshape(-1, n_ensembles * n_walkers).T
    superchains = np.repeat(np.arange(n_ensembles), n_walkers)
    rhat = array_stats.rhat_nested(chains, superchain_ids=superchains)
    return float(np.asarray(rhat, dtype=np.float64))


def disagreement(trace: Float[np.ndarray, "t e w"], autocorr_time: float) -> float:
    """Chance that ensemble means differ this much if the chain is what it seems.

    Returns:
        p-value of Σ (m_e - m)² / (variance / ESS per ensemble) against chi-square; NaN
        where the time is.
    """
    n_steps, n_ensembles, n_walkers = trace.shape
    means = trace.mean(axis=(0, 2))
    error = trace.var() * autocorr_time / (n_steps * n_walkers)
    excess = np.sum((means - means.mean()) ** 2) / error
    return float(chdtrc(n_ensembles - 1, excess))


def acceptance_fraction(
    chain: Float[np.ndarray, "t e w p"],
) -> Float[np.ndarray, "e w"]:
    """Share of the steps at which each walker moved."""
    return np.mean(np.any(np.diff(chain, axis=0) != 0, axis=-1), axis=0)


def diagnose(chain: Float[np.ndarray, "t e w p"], traces: Traces) -> Diagnostics:
    """Numbers of a chain without burn-in, and the sentences of failed checks.

    Args:
        chain: Every kept step, not thinned.
    """
    times = {name: autocorr_time(trace) for name, trace in traces.items()}
    n_steps, n_ensembles, n_walkers, _ = chain.shape
    found = Diagnostics(
        autocorr_time=times,
        ess={name: ess(trace, times[name]) for name, trace in traces.items()},
        rhat={name: nested_rhat(trace) for name, trace in traces.items()},
        acceptance_fraction=acceptance_fraction(chain),
        n_steps=n_steps,
        n_ensembles=n_ensembles,
        n_walkers=n_walkers,
        problems=(),
    )
    chances = {n: disagreement(trace, times[n]) for n, trace in traces.items()}
    return replace(found, problems=judge(found, chances))


def judge(found: Diagnostics, chances: Mapping[str, float]) -> tuple[str, ...]:
    """Sentences of the checks that failed, one per check; none means converged.

    Args:
        chances: p-values of `disagreement` by name.
    """
    problems = []
    n_steps, times = found.n_steps, found.autocorr_time
    unknown = [name for name, tau in times.items() if not np.isfinite(tau)]
    if unknown:
        problems.append(
            f"the autocorrelation time of {', '.join(unknown)} is not finite: a walker "
            "or a quantity never moves"
        )
    name, tau = _largest(times)
    if not n_steps >= MIN_AUTOCORR_TIMES * tau:
        problems.append(
            f"{n_steps} steps are fewer than {MIN_AUTOCORR_TIMES} autocorrelation "
            f"times of {name} ({tau:.1f} steps, {found.ess[name]:.0f} effective draws)"
        )
    name, value = _largest(found.rhat)
    if not value <= MAX_RHAT:
        problems.append(
            f"nested R-hat of {name} across {found.n_ensembles} ensembles is "
            f"{value:.3f}, above {MAX_RHAT}"
        )
    name, surprise = _largest({n: -p for n, p in chances.items()})
    if not surprise <= -DISAGREEMENT_LEVEL:
        problems.append(
            f"the ensembles disagree about the mean of {name} (p = {-surprise:.1e})"
        )
    share, (low, high) = found.acceptance_fraction, ACCEPTANCE
    is_odd = ~((share >= low) & (share <= high))
    if np.any(is_odd):
        ensemble, walker = np.argwhere(is_odd)[0]
        value = share[ensemble, walker]
        problems.append(
            f"{np.sum(is_odd)} of {share.size} walkers accept a share of "
            f"proposals outside {low} to {high}; walker {walker} of ensemble "
            f"{ensemble}: {value:.2f}"
        )
    return tuple(problems)


def _largest(values: Mapping[str, float]) -> tuple[str, float]:
    """Name and value of the largest; NaN counts as larger than any number."""
    name = max(values, key=lambda n: np.nan_to_num(values[n], nan=np.inf))
    return name, values[name]
