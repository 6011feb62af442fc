"""How far a chain is from independent draws of the same posterior, in its own error."""

import numpy as np
from arviz_stats.base.array import array_stats

from pushfit.fit.problem.derived import samples_mapping

# θ_c in degrees, the others as logs: what heights see, and what they do not.
LOGS = ("A", "B", "C_rr", "K_sn", "C_d", "L")
QUANTILES = (0.05, 0.5, 0.95)


def z_values(problem, result, exact, *, alpha, reach):
    """Mean, spread and quantiles of every quantity: difference over Monte-Carlo error.

    Each is the mean of a function of the draws, so that one formula gives the error of
    all of them; at a quantile that function is whether a draw lies below it. The error
    of the chain is that of arviz, walkers as chains: several modes, rarely left, widen
    it.

    Args:
        problem: Problem of both.
        result: Posterior with a chain.
        exact: Posterior with independent draws.
        alpha: Azimuth of θ_c [rad].
        reach: Lowest and highest azimuth for α* [rad].

    Returns:
        By quantity and statistic.
    """
    # From ensembles, steps, walkers to one row of steps for each walker.
    by_walker = np.swapaxes(result.chain, 1, 2)
    points = by_walker.reshape(-1, by_walker.shape[-1])
    chain = samples_mapping(problem, points, alpha, reach=reach)
    z = {}
    for name in ("theta_c", *LOGS):
        change = np.log if name in LOGS else np.asarray
        mine = change(chain[name]).reshape(-1, by_walker.shape[2])
        theirs = change(exact.samples[name])
        for statistic, function in functions_of(theirs).items():
            one, other = function(mine), function(theirs)
            error = np.hypot(
                float(array_stats.mcse(one, method="mean")),
                other.std() / np.sqrt(other.size),
            )
            z[name, statistic] = float((one.mean() - other.mean()) / error)
    return z


def functions_of(draws):
    """Functions whose means are compared."""
    centre = draws.mean()
    ends = {q: np.quantile(draws, q) for q in QUANTILES}
    below = {
        f"{q:.0%}": lambda x, end=end: (x < end).astype(float)
        for q, end in ends.items()
    }
    return {"mean": lambda x: x, "sd": lambda x: (x - centre) ** 2} | below
