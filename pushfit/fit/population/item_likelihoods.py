"""Posteriors of single items as likelihoods, their own priors undone.

The likelihood that an item with draws φ_j and prior π gives to a population of φ,
normal with a mean and a spread, is

    L(mean, spread) ∝ average over j of N(φ_j | mean, spread²) / π(φ_j)

A kernel round each draw, as wide as the density of the draws allows, keeps the average
smooth where the spread is smaller than the distance of the draws. Excluded: the
population itself (`pushfit.fit.population.pooling`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

# An item that has no value in more than this share of its posterior is left out.
MAX_MISSING = 0.05
# Nodes in which draws are gathered: finer than the kernel, which is about a quarter of
# a standard deviation.
N_NODES = 64
# From quartile to quartile of a normal distribution, in standard deviations.
QUARTILE_RANGE = 1.349
# Items side by side in one step: a few megabytes.
CHUNK = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemDraws:
    """Posterior of one item.

    Args:
        name: Name of the item.
        draws: Draws of φ; NaN where it has no value.
        log_prior: Log prior density of each draw, up to a constant.
    """

    name: str
    draws: Float[np.ndarray, " n"]
    log_prior: Float[np.ndarray, " n"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Likelihoods:
    """Items without their priors: normal kernels round nodes, and their moments.

    Args:
        nodes: Nodes of each item [unit of φ].
        log_weights: Logs of the weights of the nodes, which sum to 1.
        kernel: Standard deviation of the kernel of each item.
        mean: Mean of each item, as if the prior of φ were flat.
        sd: Standard deviation of each item, likewise.
    """

    nodes: Float[np.ndarray, "n m"]
    log_weights: Float[np.ndarray, "n m"]
    kernel: Float[np.ndarray, " n"]
    mean: Float[np.ndarray, " n"]
    sd: Float[np.ndarray, " n"]

    def take(self, which: Bool[np.ndarray, " n"]) -> "Likelihoods":
        """Likelihoods of the items that are marked, in order."""
        return Likelihoods(
            nodes=self.nodes[which],
            log_weights=self.log_weights[which],
            kernel=self.kernel[which],
            mean=self.mean[which],
            sd=self.sd[which],
        )

    def at(
        self, mean: Float[np.ndarray, "t s"], ln_spread: Float[np.ndarray, " s"]
    ) -> Float[np.ndarray, "t s"]:
        """Log likelihood of all items together.

        Args:
            mean: Means of the population, a column for each spread.
            ln_spread: Logs of its standard deviation.
        """
        found = np.zeros(mean.shape)
        for first in range(0, self.mean.size, CHUNK):
            part = slice(first, first + CHUNK)
            nodes, kernel = self.nodes[part, None], self.kernel[part, None, None]
            weights = self.log_weights[part, None]
            for k, spread in enumerate(np.exp(ln_spread)):
                variance = kernel**2 + spread**2
                squares = (mean[:, k, None] - nodes) ** 2
                log_terms = weights - squares / (2 * variance)
                # Half the time of SciPy's logsumexp.
                top = np.max(log_terms, axis=2, keepdims=True)
                total = np.sum(np.exp(log_terms - top), axis=2)
                log_terms = top[..., 0] + np.log(total) - np.log(variance)[..., 0] / 2
                found[:, k] += np.sum(log_terms, axis=0)
        return found


def is_present(item: ItemDraws) -> bool:
    """Whether φ has a value, and not one alone, in nearly all of the posterior."""
    is_known = np.isfinite(item.draws) & np.isfinite(item.log_prior)
    enough = item.draws.size > 0 and np.mean(is_known) >= 1 - MAX_MISSING
    return bool(enough and np.ptp(item.draws[is_known]) > 0)


def likelihoods(items: Sequence[ItemDraws]) -> Likelihoods:
    """Draws of present items in nodes, moved so that kernels keep their variance."""
    parts = [_one(*_reweighted(item)) for item in items]
    nodes, log_weights, kernel, mean, sd = (
        np.array(column) for column in zip(*parts, strict=True)
    )
    return Likelihoods(
        nodes=nodes, log_weights=log_weights, kernel=kernel, mean=mean, sd=sd
    )


def _reweighted(
    item: ItemDraws,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
    """Draws that have a value, and their log weights without the prior."""
    is_known = np.isfinite(item.draws) & np.isfinite(item.log_prior)
    return item.draws[is_known], -item.log_prior[is_known]


def _one(
    draws: Float[np.ndarray, " k"], log_weights: Float[np.ndarray, " k"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"], float, float, float]:
    """Nodes, log weights, kernel, mean and sd of one item."""
    weights = normalised(log_weights)
    mean = float(np.sum(weights * draws))
    sd = float(np.sqrt(np.sum(weights * (draws - mean) ** 2)))
    low, high = np.quantile(draws, [0.25, 0.75])
    # Silverman's rule; the quartiles keep several modes apart.
    width = min(sd, (high - low) / QUARTILE_RANGE) or sd
    kernel = 0.9 * width * np.sum(weights**2) ** 0.2
    # West (1993): drawn together so far that kernel and draws have the old variance.
    draws = mean + np.sqrt(max(1 - (kernel / sd) ** 2, 0.0)) * (draws - mean)
    start, step = np.min(draws), np.ptp(draws) / N_NODES
    place = np.minimum(((draws - start) / step).astype(int), N_NODES - 1)
    mass = np.bincount(place, weights, N_NODES)
    total = np.bincount(place, weights * draws, N_NODES)
    nodes = np.where(mass > 0, total / np.where(mass > 0, mass, 1.0), mean)
    with np.errstate(divide="ignore"):
        return nodes, np.log(mass), kernel, mean, sd


def effective_draws(
    items: Sequence[ItemDraws], known: Likelihoods, *, mean: float, spread: float
) -> Float[np.ndarray, " n"]:
    """Draws that count in the average over each item's, by Kish's rule.

        (sum of w)² / (sum of w²)

    Args:
        mean: Of the quantity over items.
        spread: Standard deviation of the same; infinite to weigh by the prior alone.

    References:
        Kish (1965), Survey Sampling.
    """
    found = np.empty(len(items))
    for i, item in enumerate(items):
        draws, log_weights = _reweighted(item)
        z = (draws - mean) / np.hypot(spread, known.kernel[i])
        found[i] = 1 / np.sum(normalised(log_weights - z**2 / 2) ** 2)
    return found


def normalised(log_values: Float[np.ndarray, "..."]) -> Float[np.ndarray, "..."]:
    """Numbers that sum to one, from their logs up to a constant."""
    return np.exp(log_values - logsumexp(log_values))
