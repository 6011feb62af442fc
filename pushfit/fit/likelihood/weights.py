"""Weights of least squares where sigma is sampled: chi-square is then n - p."""

from dataclasses import replace

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.fit.problem.problem import Problem
from pushfit.model import as_float


def with_noise_of(problem: Problem, predicted: Float[np.ndarray, "c n"]) -> Problem:
    """The problem with sigma of each channel estimated from the errors of a fit.

    Args:
        problem: Problem whose noise is sampled.
        predicted: Heights of the fit [table unit].

    Returns:
        The problem with other weights.
    """
    mask, sd = np.asarray(problem.mask), np.asarray(problem.sd)
    observed = np.asarray(problem.observed)
    errors = predicted - observed
    n_free = len(problem.data_names) - problem.n_constraints
    share = max(1.0 - n_free / mask.sum(), 1.0 / mask.sum())
    sigma = np.array(problem.reference_sigma)
    for c in range(len(problem.channels)):
        r, s = errors[c, mask[c]], sd[c, mask[c]]
        target = share * r.size
        # Noise-free heights: keep weights finite at a sigma too small to matter.
        floor = 1e-9 * np.max(np.abs(observed[c]))
        high = np.sqrt(np.sum(r**2) / target) + floor

        def excess(extra: float, r=r, s=s, target=target) -> float:
            return float(np.sum(r**2 / (s**2 + extra**2)) - target)

        extra = high
        if excess(floor) <= 0:
            extra = floor
        elif excess(high) < 0:
            extra = float(np.asarray(scipy.optimize.brentq(excess, floor, high)))
        sigma[c, mask[c]] = np.hypot(s, extra)
    return replace(problem, reference_sigma=as_float(sigma))
