"""Noise inside quadrature: known, or summed over values of sigma.

Excluded: where sigma comes from, which `pushfit.fit.problem.noise` decides.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float

from pushfit.fit.problem.priors.distributions import log_prior_at
from pushfit.fit.problem.problem import Problem
from pushfit.model import Scalar

# Grid of a sampled sigma: steps of one conditional standard deviation integrate a bell
# to 1e-8, and the grid reaches nine of them beyond either end.
SIGMA_MARGIN = 9.0
SMALLEST_SIGMA_GRID = 32


class NoiseGrid(eqx.Module):
    """Sampled noise as a sum over values of sigma, or known noise as the only one.

        ln L = Σ_c ln Σ_k exp( constant_ck - ½ Σ_i weight_cki r_ci² )

    Args:
        ln_sigma: Grid of each channel; one dummy value where sigma is known.
        weight: On the squared residuals of the problem.
        constant: Logs of normalisation, prior and grid step.
    """

    ln_sigma: Float[Array, "c k"]
    weight: Float[Array, "c k n"]
    constant: Float[Array, "c k"]

    def log_likelihood(self, squares: Float[Array, "c k"]) -> Scalar:
        """Log likelihood from the weighted sums of squares, sigma integrated out."""
        return jnp.sum(logsumexp(self.constant - squares / 2, axis=1))


def make_noise_grid(problem: Problem) -> NoiseGrid:
    """Noise of a problem, for quadrature.

    Args:
        problem: Problem with its noise weights settled.

    Returns:
        Noise as known, or a grid of sigma for each channel.
    """
    mask, sd = np.asarray(problem.mask), np.asarray(problem.sd)
    reference = np.asarray(problem.reference_sigma)
    if f"sigma_{problem.channels[0]}" not in problem.priors:
        state = problem.data_state(jnp.zeros(len(problem.data_names)))
        deviance = jnp.sum(problem.residuals(state) ** 2)
        # What the likelihood adds to the sum of squares does not depend on the point.
        constant = problem.log_likelihood(state) + deviance / 2
        shares = np.zeros((len(problem.channels), 1))
        shares[0] = float(constant)
        return NoiseGrid(
            ln_sigma=jnp.zeros(shares.shape),
            weight=jnp.asarray(mask[:, None, :].astype(float)),
            constant=jnp.asarray(shares),
        )
    grids = [_sigma_grid(problem, c) for c in range(len(problem.channels))]
    size = max(grid.size for grid in grids)
    ln_sigma = np.stack([np.linspace(g[0], g[-1], size) for g in grids])
    square = sd[:, None, :] ** 2 + np.exp(2 * ln_sigma)[:, :, None]
    weight = np.where(mask[:, None, :], reference[:, None, :] ** 2 / square, 0.0)
    norm = np.where(mask[:, None, :], np.log(2 * np.pi * square) / 2, 0.0)
    prior = np.stack(
        [
            np.asarray(log_prior_at(problem.priors[f"sigma_{name}"], jnp.asarray(grid)))
            for name, grid in zip(problem.channels, ln_sigma, strict=True)
        ]
    )
    step = np.log(ln_sigma[:, 1] - ln_sigma[:, 0])[:, None]
    return NoiseGrid(
        ln_sigma=jnp.asarray(ln_sigma),
        weight=jnp.asarray(weight),
        constant=jnp.asarray(prior + step - np.sum(norm, axis=2)),
    )


def _sigma_grid(problem: Problem, channel: int) -> Float[np.ndarray, " k"]:
    """Grid of ln sigma from below the best fit's to above that of no fit at all."""
    prior = problem.priors[f"sigma_{problem.channels[channel]}"]
    probe = prior.sample(np.random.default_rng(0), 999)
    centre, spread = float(np.median(probe)), float(np.std(probe))
    mask = np.asarray(problem.mask)[channel]
    n = int(mask.sum())
    if n == 0:
        low, high, width = centre, centre, spread
    else:
        sigma = np.asarray(problem.reference_sigma)[channel, mask]
        heights = np.asarray(problem.observed)[channel, mask]
        width = 1 / np.sqrt(2 * n + 1 / spread**2)
        low = float(np.log(np.min(sigma)))
        high = max(low, float(np.log(np.sqrt(np.mean(heights**2)) + 1e-300)))
    low, high = low - SIGMA_MARGIN * width, high + SIGMA_MARGIN * width
    wanted = max((high - low) / width, SMALLEST_SIGMA_GRID)
    # Powers of two: few shapes, few compilations.
    return np.linspace(low, high, 1 << int(np.ceil(np.log2(wanted))))
