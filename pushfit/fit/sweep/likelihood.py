"""Sampled noise, integrated out on a grid: likelihood, weights and draws of ln σ.

Given the predictions every σ is known by one number per channel, so that neither the
search nor the other draws need it as a coordinate of their own. A difference is a
prediction less the mean height [table unit]. Excluded: the likelihood at points that
state the noise (`pushfit.fit.problem.problem`).
"""

import math
from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from pushfit.fit.problem.problem import STUDENT_DOF, STUDENT_SCALE
from pushfit.fit.problem.repeats.pooling import Pooled
from pushfit.model import Scalar

# Nodes of ln σ: with a stretch by asinh from 1/sqrt(n) to the range of the prior they
# are at most two thirds of a standard deviation apart at the peak.
N_NODES = 25
# Standard deviations of the log that the nodes reach from the prior's median.
REACH = 6.0
# Steps towards the spread of a Student-t sample; each at least halves the distance.
N_SCALE_STEPS = 8
# Factors of a product of which one log is taken; buckets are multiples of it.
FACTORS = 8
# Smallest mean square: its ratios to squares stay finite in the steps above.
LEAST_SQUARE = 1e-60
# Share of the given variance at which nodes are centred where nothing is left beyond
# it.
WELL_BELOW = 0.1
# Distance of the centre of the nodes from either end of their range [ln unit], so that
# on neither side they all coincide. Not tuned.
OFF_END = 0.1
LN_2PI = math.log(2 * math.pi)
# ν times the squared scale of a Student-t variable of unit variance.
STUDENT_SQUARE = STUDENT_DOF * STUDENT_SCALE**2
# Of its density at 0.
LN_STUDENT = (
    math.lgamma((STUDENT_DOF + 1) / 2)
    - math.lgamma(STUDENT_DOF / 2)
    - math.log(STUDENT_SQUARE * math.pi) / 2
)


class NoiseTerms(eqx.Module):
    """What a set of predictions makes of the noise.

    Args:
        log_likelihood: With every sampled σ integrated out over its prior.
        weights: Of the squared differences in a local quadratic form
            [1/table unit²]; 0 for padding.
    """

    log_likelihood: Scalar
    weights: Float[Array, "c n"]


def is_sampled(pooled: Pooled, channel: int) -> bool:
    """Whether the noise of a channel is a parameter."""
    return f"sigma_{pooled.problem.channels[channel]}" in pooled.problem.priors


def channel_log_likelihood(
    pooled: Pooled,
    channel: int,
    difference: Float[Array, " n"],
    *,
    variance: Float[Array, " n"],
) -> Scalar:
    """Log density of the heights of a channel.

    Args:
        variance: Of the noise of each row [table unit²].
    """
    problem, count = pooled.problem, pooled.count[channel]
    variance = jnp.where(problem.mask[channel], variance, 1.0)
    square = difference**2 / variance
    if problem.likelihood != "normal":
        logs = log_product(variance)
        logs = logs + (STUDENT_DOF + 1) * log_product(1 + square / STUDENT_SQUARE)
        return jnp.sum(count) * LN_STUDENT - logs / 2
    if pooled.is_single:
        logs = log_product(variance)
    else:
        logs = jnp.sum(count * jnp.log(variance))
    squares = jnp.sum(count * square + pooled.sum_of_squares[channel] / variance)
    return -(jnp.sum(count) * LN_2PI + logs + squares) / 2


def log_product(values: Float[Array, " n"]) -> Scalar:
    """Sum of logs, taken of products of some: a log takes longer than these."""
    return jnp.sum(jnp.log(jnp.prod(values.reshape(-1, FACTORS), axis=1)))


def log_likelihood_of_sigma(
    pooled: Pooled,
    channel: int,
    difference: Float[Array, " n"],
    *,
    ln_sigma: Float[Array, " k"],
) -> Float[Array, " k"]:
    """Log likelihood of a channel at several values of its sampled noise."""
    sd, count = pooled.problem.sd[channel], pooled.count[channel]
    if pooled.problem.likelihood == "normal" and not pooled.has_sd:
        squares = jnp.sum(count * difference**2 + pooled.sum_of_squares[channel])
        constant = jnp.sum(count) * (ln_sigma + LN_2PI / 2)
        return -constant - squares / 2 * jnp.exp(-2 * ln_sigma)

    def one(ln_sigma: Scalar) -> Scalar:
        variance = sd**2 + jnp.exp(2 * ln_sigma)
        return channel_log_likelihood(pooled, channel, difference, variance=variance)

    return jax.vmap(one)(ln_sigma)


def log_likelihood(
    pooled: Pooled,
    difference: Float[Array, "c n"],
    ln_sigma: Mapping[str, Scalar],
) -> Scalar:
    """Log likelihood with every sampled noise given.

    Args:
        ln_sigma: Sampled noise by "ln_sigma_<channel>" [ln table unit].
    """
    total = pooled.problem.log_determinant
    for channel, name in enumerate(pooled.problem.channels):
        variance = pooled.problem.reference_sigma[channel] ** 2
        if is_sampled(pooled, channel):
            sampled = jnp.exp(2 * ln_sigma[f"ln_sigma_{name}"])
            variance = pooled.problem.sd[channel] ** 2 + sampled
        own = difference[channel]
        total = total + channel_log_likelihood(pooled, channel, own, variance=variance)
    return total


def sigma_nodes(
    pooled: Pooled, channel: int, difference: Float[Array, " n"]
) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """Nodes of ln σ and the unnormalised log posterior density at them."""
    problem = pooled.problem
    prior = problem.priors[f"sigma_{problem.channels[channel]}"]
    median, spread = jnp.log(prior.first), REACH * prior.second
    low, high = median - spread, median + spread
    centre = _ln_scale(pooled, channel, difference)
    centre = jnp.clip(centre, low + OFF_END, high - OFF_END)
    # The posterior sd of ln σ is about 1/sqrt(2 n), twice that for heavy tails.
    width = 1 / jnp.sqrt(jnp.maximum(jnp.sum(pooled.count[channel]), 1.0))
    share = jnp.linspace(-1.0, 1.0, N_NODES)
    below, above = (
        jnp.arcsinh((centre - low) / width),
        jnp.arcsinh((high - centre) / width),
    )
    stretch = jnp.where(share < 0, below, above)
    ln_sigma = centre + width * jnp.sinh(stretch * share)
    level = log_likelihood_of_sigma(pooled, channel, difference, ln_sigma=ln_sigma)
    return ln_sigma, level + prior.log_prob(ln_sigma)


def noise_terms(pooled: Pooled, difference: Float[Array, "c n"]) -> NoiseTerms:
    """Log likelihood of predictions, and the weights of their squares."""
    total, weights = pooled.problem.log_determinant, []
    for channel in range(len(pooled.problem.channels)):
        own = difference[channel]
        if is_sampled(pooled, channel):
            ln_sigma, level = sigma_nodes(pooled, channel, own)
            highest = jnp.max(level)
            masses = jnp.exp(level - highest) * _gaps(ln_sigma)
            mass = jnp.sum(masses)
            total = total + highest + jnp.log(mass)
            weights_of = _sampled_weights(pooled, channel, own, ln_sigma)
            rows = masses @ weights_of / mass
        else:
            variance = pooled.problem.reference_sigma[channel] ** 2
            rows = _weights(pooled, channel, own, variance)
            total = total + channel_log_likelihood(
                pooled, channel, own, variance=variance
            )
        weights.append(jnp.where(pooled.problem.mask[channel], rows, 0.0))
    return NoiseTerms(total, jnp.stack(weights))


def _weights(
    pooled: Pooled,
    channel: int,
    difference: Float[Array, " n"],
    variance: Float[Array, " n"],
) -> Float[Array, " n"]:
    """Weights of least squares that have the slope of the log likelihood."""
    if pooled.problem.likelihood == "normal":
        return pooled.count[channel] / variance
    return (STUDENT_DOF + 1) / (STUDENT_SQUARE * variance + difference**2)


def _sampled_weights(
    pooled: Pooled,
    channel: int,
    difference: Float[Array, " n"],
    ln_sigma: Float[Array, " k"],
) -> Float[Array, "k n"]:
    """The same at each value of the sampled noise."""
    sd = pooled.problem.sd[channel]
    if pooled.problem.likelihood == "normal" and not pooled.has_sd:
        return pooled.count[channel][None] * jnp.exp(-2 * ln_sigma)[:, None]
    return jax.vmap(
        lambda ln_sigma: _weights(
            pooled, channel, difference, sd**2 + jnp.exp(2 * ln_sigma)
        )
    )(ln_sigma)


def _ln_scale(pooled: Pooled, channel: int, difference: Float[Array, " n"]) -> Scalar:
    """About the most likely ln σ: the scatter beyond what is given."""
    count, sd = pooled.count[channel], pooled.problem.sd[channel]
    n = jnp.maximum(jnp.sum(count), 1.0)
    squares = count * difference**2 + pooled.sum_of_squares[channel]
    mask = pooled.problem.mask[channel]
    square = jnp.maximum(jnp.sum(squares) / n, LEAST_SQUARE)
    if pooled.problem.likelihood != "normal":

        def step(_: Int[Array, ""], square: Scalar) -> Scalar:
            weight = (STUDENT_DOF + 1) / (STUDENT_SQUARE + difference**2 / square)
            return jnp.maximum(
                jnp.sum(jnp.where(mask, weight * difference**2, 0.0)) / n, LEAST_SQUARE
            )

        square = jax.lax.fori_loop(0, N_SCALE_STEPS, step, square)
    given = jnp.sum(count * sd**2) / n
    # Where nothing is left beyond it, any σ well below the given sd is as likely.
    return jnp.log(jnp.maximum(square - given, WELL_BELOW * given + LEAST_SQUARE)) / 2


def _gaps(nodes: Float[Array, " k"]) -> Float[Array, " k"]:
    """Width that belongs to each node."""
    gap = jnp.diff(nodes)
    edge = jnp.zeros(1)
    return (jnp.concatenate([gap, edge]) + jnp.concatenate([edge, gap])) / 2
