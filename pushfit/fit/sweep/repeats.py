"""Repeated pushes pooled: fewer rows, the same likelihood.

Heights of one direction with one standard deviation enter a normal likelihood through
their number, their mean and their scatter alone. A Student-t likelihood has no such
sums, so that its rows stay apart.
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.model import Pushes, as_float

# Pushes closer than this in both angles, and in the log of their sd, are repeats.
SAME = 1e-9
# Rows come in multiples of this, so that few programs serve all tables.
PADDING = 8


class Pooled(eqx.Module):
    """A problem whose rows are means of repeats.

    Args:
        problem: Its `observed` are means; padded rows are masked.
        count: Number of heights behind each mean; 0 for padding.
        scatter: Sum of squares of the heights about their mean [table unit²].
        has_sd: Whether any height has a known part of its noise.
    """

    problem: Problem
    count: Float[Array, "c n"]
    scatter: Float[Array, "c n"]
    has_sd: bool = eqx.field(static=True)


def pool_repeats(problem: Problem) -> Pooled:
    """Pool the rows of a problem.

    Args:
        problem: Problem with its noise weights settled.
    """
    used = np.any(np.asarray(problem.mask), axis=0)
    observed = np.asarray(problem.observed)[:, used]
    sd = np.asarray(problem.sd)[:, used]
    sigma = np.asarray(problem.reference_sigma)[:, used]
    theta = np.asarray(problem.pushes.theta)[used]
    alpha = np.asarray(problem.pushes.alpha)[used]
    if problem.likelihood == "normal":
        key = np.concatenate([[theta, alpha], np.log(np.maximum(sd, 1e-300))])
        key = np.rint(np.concatenate([key, np.log(sigma)]) / SAME)
        _, first, group = np.unique(key, axis=1, return_index=True, return_inverse=True)
    else:
        first = group = np.arange(theta.size)
    n, size = first.size, -(-first.size // PADDING) * PADDING
    count = np.bincount(group, minlength=n).astype(float)
    mean = np.stack([np.bincount(group, row, minlength=n) / count for row in observed])
    scatter = (observed - mean[:, group]) ** 2
    scatter = np.stack([np.bincount(group, row, minlength=n) for row in scatter])
    channels = len(problem.channels)

    def padded(values: np.ndarray, fill: float) -> np.ndarray:
        ends = np.full((*values.shape[:-1], size - n), fill)
        return np.concatenate([values, ends], axis=-1)

    pooled = replace(
        problem,
        pushes=Pushes(padded(theta[first], 0.5), padded(alpha[first], 0.0)),
        observed=padded(mean, 0.0),
        sd=padded(sd[:, first], 0.0),
        reference_sigma=padded(sigma[:, first], 1.0),
        mask=jnp.asarray(np.tile(np.arange(size) < n, (channels, 1)), dtype=bool),
    )
    return Pooled(
        pooled,
        as_float(np.tile(padded(count, 0.0), (channels, 1))),
        as_float(padded(scatter, 0.0)),
        has_sd=bool(np.any(sd > 0)),
    )
