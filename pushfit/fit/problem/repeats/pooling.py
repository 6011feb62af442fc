"""Repeated pushes pooled: fewer rows and fewer predictions, the same likelihood.

Heights of one direction with one standard deviation enter a normal likelihood through
their number, their mean and their scatter alone. Other heights of a direction stay
apart, as do all of a Student-t likelihood, those that have something in common with
other directions, and those with a part of their noise known and another sampled, whose
logarithms are taken of many rows at once; what they share is one prediction. Excluded:
finding what repeats have in common (`pushfit.fit.problem.repeats.effects`).
"""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from pushfit.fit.problem.problem import Problem, padded
from pushfit.model import Pushes, as_float
from pushfit.parameters import TINY

# Pushes closer than this in both angles, and in the log of their sd, are repeats.
SAME = 1e-9


class Pooled(eqx.Module):
    """A problem whose rows are means of repeats.

    Args:
        problem: Its `observed` are means; padded rows are masked.
        count: Number of heights behind each mean; 0 for padding.
        sum_of_squares: Of the heights about their mean [table unit²].
        has_sd: Whether any height has a known part of its noise.
        is_single: Whether each row is one height.
    """

    problem: Problem
    count: Float[Array, "c n"]
    sum_of_squares: Float[Array, "c n"]
    has_sd: bool = eqx.field(static=True)
    is_single: bool = eqx.field(static=True)


def pool_repeats(problem: Problem) -> Pooled:
    """Pool the rows of a problem."""
    used = np.any(np.asarray(problem.mask), axis=0)
    observed = np.asarray(problem.observed)[:, used]
    sd = np.asarray(problem.sd)[:, used]
    sigma = np.asarray(problem.reference_sigma)[:, used]
    angles = np.stack([problem.pushes.theta, problem.pushes.alpha])[:, used]
    has_sd = bool(np.any(sd > 0))
    is_sampled = any(f"sigma_{name}" in problem.priors for name in problem.channels)
    is_even = problem.shared is None and not (has_sd and is_sampled)
    is_single = problem.likelihood != "normal" or not is_even
    if not is_single:
        key = np.concatenate([angles, np.log(np.maximum(sd, TINY)), np.log(sigma)])
        first, group = _alike(key)
    else:
        first = group = np.arange(angles.shape[1])
    n = first.size
    at, direction = _alike(angles[:, first])
    theta, alpha = angles[:, first[at]]
    count = np.bincount(group, minlength=n).astype(float)
    mean = np.stack([np.bincount(group, row, minlength=n) / count for row in observed])
    squares = (observed - mean[:, group]) ** 2
    squares = np.stack([np.bincount(group, row, minlength=n) for row in squares])

    pushes = Pushes(padded(theta, 0.5), padded(alpha, 0.0))
    repeats = np.arange(pushes.theta.size)[:, None] == direction
    mask = padded(np.ones(mean.shape), 0.0) > 0
    pooled = replace(
        problem,
        pushes=pushes,
        repeats=as_float(padded(repeats.astype(float), 0.0)),
        observed=padded(mean, 0.0),
        sd=padded(sd[:, first], 0.0),
        reference_sigma=padded(sigma[:, first], 1.0),
        mask=jnp.asarray(mask),
        shared=None
        if problem.shared is None
        else as_float(padded(np.asarray(problem.shared)[:, :, used], 0.0)),
    )
    return Pooled(
        pooled,
        as_float(np.where(mask, padded(count, 0.0), 0.0)),
        as_float(padded(squares, 0.0)),
        has_sd=has_sd,
        is_single=is_single,
    )


def _alike(
    key: Float[np.ndarray, "k n"],
) -> tuple[Int[np.ndarray, " g"], Int[np.ndarray, " n"]]:
    """First column of each group of equal ones, and the group of every column."""
    _, first, group = np.unique(
        np.rint(key / SAME), axis=1, return_index=True, return_inverse=True
    )
    return first, group
