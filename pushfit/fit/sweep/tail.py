"""Pareto smoothing: how heavy the tail of importance weights is, and taming it.

ArviZ has the same; importing it takes longer than a whole sweep.
"""

import numpy as np
from jaxtyping import Float

# All of Vehtari et al. (2024): largest share of the draws that make the tail, fewest of
# them, and the prior of the shape, so many draws at a half.
MAX_SHARE, MIN_TAIL = 0.2, 5
PRIOR_DRAWS, PRIOR_SHAPE = 10, 0.5
# Zhang & Stephens' prior of the scale is this many times as wide as its quartile.
PRIOR_WIDTH = 3
# Shape where all weights of the tail are one: that of a distribution with an end.
FLAT = -1.0


def pareto_smoothed(
    log_weights: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, " n"], float]:
    """Logs of weights with the largest replaced by quantiles of a fitted tail.

    Args:
        log_weights: Finite logs of weights, up to a constant.

    Returns:
        Logs of smoothed weights, which sum to 1; and the shape k of the generalized
        Pareto distribution of the tail, infinite where it is too short to be told.

    References:
        Vehtari et al. (2024), arXiv:1507.02646.
    """
    smoothed = log_weights - np.max(log_weights)
    n_tail = int(min(MAX_SHARE * smoothed.size, 3 * np.sqrt(smoothed.size)))
    if n_tail < MIN_TAIL:
        return _normalised(smoothed), np.inf
    order = np.argsort(smoothed)
    rows, cutoff = order[-n_tail:], np.exp(smoothed[order[-n_tail - 1]])
    excess = np.exp(smoothed[rows]) - cutoff
    if excess[-1] <= excess[0]:
        return _normalised(smoothed), FLAT
    if excess[n_tail // 4] <= 0:
        return _normalised(smoothed), np.inf
    k, sigma = _fitted(excess)
    probs = (np.arange(n_tail) + 0.5) / n_tail
    quantiles = cutoff + sigma * np.expm1(-k * np.log1p(-probs)) / k
    smoothed[rows] = np.minimum(np.log(quantiles), 0.0)
    return _normalised(smoothed), k


def _normalised(log_weights: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    return log_weights - np.logaddexp.reduce(log_weights)


def _fitted(excess: Float[np.ndarray, " t"]) -> tuple[float, float]:
    """Shape and scale of a generalized Pareto distribution, from ascending values.

    Posterior means over a grid of b = k/sigma.

    References:
        Zhang & Stephens (2009), doi:10.1198/tech.2009.08017.
    """
    n = excess.size
    size = 30 + int(np.sqrt(n))
    quartile = excess[int(n / 4 + 0.5) - 1]
    b = (1 - np.sqrt(size / (np.arange(size) + 0.5))) / (PRIOR_WIDTH * quartile)
    b = b + 1 / excess[-1]
    k = np.mean(np.log1p(-b[:, None] * excess), axis=1)
    log_likelihood = n * (np.log(-b / k) - k - 1)
    weights = np.exp(log_likelihood - np.logaddexp.reduce(log_likelihood))
    mean = float(np.sum(weights * b) / np.sum(weights))
    k_mean = float(np.mean(np.log1p(-mean * excess)))
    shape = (n * k_mean + PRIOR_DRAWS * PRIOR_SHAPE) / (n + PRIOR_DRAWS)
    return shape, -k_mean / mean
