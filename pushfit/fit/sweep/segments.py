"""Densities between nodes: exponential on each segment, and draws from them.

Excluded: densities on a regular grid (`pushfit.fit.problem.priors.tabulated_density`).
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from pushfit.mechanics.numerics import expm1c, log1pc
from pushfit.model import Scalar
from pushfit.parameters import TINY

# Depth below the peak at which a log density is held: exp would return 0 soon after.
DEPTH = 600.0
# Share of the draws that a proposal has from its density to this power: they fill
# tails, whose weights are then not heavy. Without them 7 of 24 tables of one sweep
# need a fitted mixture, with them none.
TAIL_SHARE, TAIL_POWER = 0.1, 0.15


class Segments(eqx.Module):
    """A density known by its log at nodes.

    Args:
        log_density: At the nodes, 0 at its highest.
        total: Integral up to the end of each segment.
        scale: Log of what the density was divided by.
    """

    log_density: Float[Array, " n"]
    total: Float[Array, " n-1"]
    scale: Scalar

    @property
    def log_integral(self) -> Scalar:
        """Log of the integral over all segments, `scale` included."""
        return self.scale + jnp.log(self.total[-1])

    @property
    def cumulative(self) -> Float[Array, " n"]:
        """Share of the integral up to each node."""
        return jnp.concatenate([jnp.zeros(1), self.total / self.total[-1]])


class Drawn(eqx.Module):
    """A draw from segments.

    Args:
        segment: Which segment it lies on.
        share: How far along.
        log_density: Normalised log density there.
    """

    segment: Int[Array, ""]
    share: Scalar
    log_density: Scalar


def make_segments(
    nodes: Float[Array, " n"], log_density: Float[Array, " n"]
) -> Segments:
    """Segments of an unnormalised log density.

    Args:
        nodes: Ascending.
    """
    scale = jnp.max(log_density)
    level = jnp.maximum(log_density - scale, -DEPTH)
    mass = jnp.exp(level[:-1]) * jnp.diff(nodes) * expm1c(jnp.diff(level))
    return Segments(level, jnp.cumsum(mass), scale)


def with_tails(nodes: Float[Array, " n"], log_density: Float[Array, " n"]) -> Segments:
    """Segments to propose from: those of a density, and its tails more often."""
    parts = [
        (power * log_density, np.log(share))
        for power, share in ((1.0, 1 - TAIL_SHARE), (TAIL_POWER, TAIL_SHARE))
    ]
    levels = [
        level + log_share - make_segments(nodes, level).log_integral
        for level, log_share in parts
    ]
    return make_segments(nodes, jnp.logaddexp(*levels))


def draw_segment(segments: Segments, uniform: Scalar) -> Drawn:
    """The point below which a share of the integral lies.

    Args:
        uniform: The share, in (0, 1).
    """
    total = segments.total
    wanted = uniform * total[-1]
    # Comparing with all is faster than a search for so few.
    i = jnp.minimum(jnp.sum(total < wanted), total.size - 1)
    before = jnp.where(i > 0, total[i - 1], 0.0)
    own = jnp.maximum(total[i] - before, TINY)
    part = jnp.clip((wanted - before) / own, 0.0, 1.0)
    low, high = segments.log_density[i], segments.log_density[i + 1]
    rise = high - low
    # ln(1 + part (e^rise - 1)) / rise, by factors that have no 0/0 where it is flat.
    share = part * expm1c(rise) * log1pc(part * jnp.expm1(rise))
    share = jnp.clip(share, 0.0, 1.0)
    return Drawn(i, share, low + share * rise - jnp.log(total[-1]))
