"""Density of each push predicted from all others, by importance sampling of draws.

Excluded: which model predicts better (`pushfit.fit.comparison`), and fits without one
of the pushes (`pushfit.fit.checks.leave_one_out`).
"""

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from pushfit.fit.problem.encoding import encode
from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.fit.sweep.posterior import MAX_PARETO_K

# Draws of one call, so that one program serves every number of them; 51 pushes of so
# many are half a megabyte.
CHUNK = 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class PushDensities:
    """Log predictive density of each push given all others, by PSIS-LOO.

    Args:
        elpd: ln p(h_i | h_-i), all channels of a push together.
        p_loo: How far each lies below its density given all pushes.
        pareto_k: Shape of the tail of its importance weights.
        max_pareto_k: Largest shape at which the estimate is to be relied on.
    """

    elpd: Float[np.ndarray, " n"]
    p_loo: Float[np.ndarray, " n"]
    pareto_k: Float[np.ndarray, " n"]
    max_pareto_k: float

    @property
    def n_unreliable(self) -> int:
        """Pushes whose density importance sampling does not get right."""
        return int(np.sum(self.pareto_k > self.max_pareto_k))


def push_densities(
    problem: Problem,
    samples: Mapping[str, Float[np.ndarray, " m"]],
    *,
    n_pushes: int,
) -> PushDensities:
    """Leave-one-out density of each push by Pareto-smoothed importance sampling.

    Args:
        n_pushes: Columns of the problem that are not padding.

    References:
        Vehtari, Gelman & Gabry (2017), doi:10.1007/s11222-016-9696-4.
    """
    x = encode(problem, samples)
    densities = in_chunks(lambda rows: _push_log_likelihoods(problem, rows), x, CHUNK)
    by_push = [left_out_density(one) for one in densities.T[:n_pushes]]
    elpd, pareto_k, p_loo = np.asarray(by_push).T
    return PushDensities(
        elpd=elpd,
        p_loo=p_loo,
        pareto_k=pareto_k,
        # Of few draws even a lighter tail is not known well enough.
        max_pareto_k=min(1 - 1 / math.log10(len(x)), MAX_PARETO_K),
    )


def left_out_density(
    log_likelihood: Float[np.ndarray, " m"],
) -> tuple[float, float, float]:
    """Log density of one push given the others, Pareto k and effective parameters.

    Where the largest weights, or a quarter of them, are one number, as of a draw kept
    many times, there is no tail to smooth: k is minus infinity if all weights are, else
    nobody knows it and it is infinity.

    Args:
        log_likelihood: Of the push, at each draw of all of them.
    """
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - slow to load

    # "All tail values are the same", or a quarter of them, by which it divides.
    with contextlib.suppress(ValueError), np.errstate(all="ignore"):
        found = array_stats.loo(log_likelihood[None, None])
        elpd, pareto_k, p_loo = (float(np.squeeze(value)) for value in found)
        if math.isfinite(elpd):
            return elpd, pareto_k, p_loo
    log_n = math.log(log_likelihood.size)
    elpd = log_n - float(scipy.special.logsumexp(-log_likelihood))
    pareto_k = math.inf if np.ptp(log_likelihood) > 0 else -math.inf
    p_loo = float(scipy.special.logsumexp(log_likelihood)) - log_n - elpd
    return elpd, pareto_k, p_loo


@compiled
def _push_log_likelihoods(
    problem: Problem, x: Float[Array, "m p"]
) -> Float[Array, "m n"]:
    """Log density of every push, all channels together, at each draw."""

    def one(x: Float[Array, " p"]) -> Float[Array, " n"]:
        return jnp.sum(problem.log_likelihoods(problem.state(x)), axis=0)

    return jax.vmap(one)(x)
