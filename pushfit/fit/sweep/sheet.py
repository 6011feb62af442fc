"""Conditional modes on a grid over outer and inner coordinate, and their masses.

At every outer node the inner coordinate is followed from its conditional mode to both
ends of its prior, in steps that grow like sinh: a peak of width 1e-3 and a tail as wide
as the prior share a few nodes. The other coordinates are Gaussian around their mode
there; where ln s is drawn from its prior, once for each stratum of it.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtri
from jaxtyping import Array, Float, Int

from pushfit.fit.sweep.cholesky import (
    back_solve,
    cholesky,
    half_solve,
    log_diagonal,
)
from pushfit.fit.sweep.outer import REACH, prior_sd, ridge_slope, schur, without_s
from pushfit.fit.sweep.search import descend
from pushfit.fit.sweep.segments import Segments, make_segments
from pushfit.fit.sweep.target import Expansion, Target
from pushfit.model import Scalar

# Nodes to each side of the conditional mode, and steps from one to the next.
N_SIDE, N_STEPS = 8, 3
# Innermost distance of the nodes, about, in conditional standard deviations.
STRETCH = 0.7
# Equally probable parts of the prior of ln s given B.
N_STRATA = 8
# Furthest that the inner coordinate follows the ridge between nodes, in its own sd.
FOLLOWED = 2.0
# Longest move of the others from one inner node to the next, in logs.
MAX_MOVE = 1.0


class Sheet(eqx.Module):
    """Where the mass of a posterior is.

    Args:
        outer: Density of u.
        inner: Density of t at each outer node; the inner coordinate is
            centre + width sinh(stretch t), with a stretch of its own on either side.
        centre: Conditional mode of the inner coordinate at each outer node.
        width: Scale of the inner coordinate.
        below: Stretch below the mode.
        above: Stretch above it.
        nodes: Conditional modes, by outer and inner node.
        strata: Share of every stratum of ln s at each of them.
        ridge: Change of the inner coordinate per unit of u at each, and how far it may
            be followed.
    """

    outer: Segments
    inner: Segments
    centre: Float[Array, " j"]
    width: Float[Array, " j"]
    below: Float[Array, " j"]
    above: Float[Array, " j"]
    nodes: Expansion
    strata: Float[Array, "j k s"]
    ridge: Float[Array, "j k 2"]

    @property
    def u(self) -> Float[Array, " j"]:
        """Outer nodes."""
        return self.nodes.y[:, 0, 0]

    def inner_at(self, node: Int[Array, ""], t: Scalar) -> tuple[Scalar, Scalar]:
        """Inner coordinate at t, and the log of its slope."""
        stretch = jnp.where(t < 0, self.below[node], self.above[node])
        value = self.centre[node] + self.width[node] * jnp.sinh(stretch * t)
        slope = self.width[node] * stretch * jnp.cosh(stretch * t)
        return value, jnp.log(slope)


# Inner nodes in the units of t.
SIDE = np.arange(1, N_SIDE + 1) / N_SIDE
T = np.concatenate([-SIDE[::-1], [0.0], SIDE])


class Local(eqx.Module):
    """Gaussian that stands for the coordinates that are not held.

    Args:
        centre: Their conditional mode.
        factor: Cholesky factor of their information.
        log_volume: Log of the integral over them.
    """

    centre: Float[Array, " k"]
    factor: Float[Array, "k k"]
    log_volume: Scalar


def make_sheet(target: Target, outer: Expansion) -> Sheet:
    """Sweep the inner coordinate at every outer node.

    Args:
        outer: Conditional modes at nodes of u.
    """
    information = jax.vmap(lambda h: without_s(target, h + target.precision))
    sd = 1 / jnp.sqrt(jax.vmap(schur)(information(outer.hessian)[:, 1:, 1:]))
    inner_sd = prior_sd(target, 1)
    centre = outer.y[:, 1]
    width = STRETCH * jnp.minimum(sd, inner_sd)
    low = jnp.minimum(target.mean[1] - REACH * inner_sd, centre - 3 * width)
    high = jnp.maximum(target.mean[1] + REACH * inner_sd, centre + 3 * width)
    below = jnp.arcsinh((centre - low) / width)
    above = jnp.arcsinh((high - centre) / width)
    left = centre[None] - width[None] * jnp.sinh(below[None] * SIDE[:, None])
    right = centre[None] + width[None] * jnp.sinh(above[None] * SIDE[:, None])
    both = jax.tree.map(lambda a: jnp.concatenate([a, a]), outer)
    sides = _followed(target, both, jnp.concatenate([left, right], axis=1))
    n = centre.size
    nodes = jax.tree.map(
        lambda side, middle: jnp.concatenate(
            [side[::-1, :n], middle[None], side[:, n:]]
        ).swapaxes(0, 1),
        sides,
        outer,
    )
    volumes = jax.vmap(jax.vmap(lambda node: log_volumes(target, node)))(nodes)
    level = logsumexp(volumes, axis=2)
    stretch = jnp.where(T[None] < 0, below[:, None], above[:, None])
    slope = width[:, None] * stretch * jnp.cosh(stretch * T[None])
    level = level + jnp.log(slope)
    inner = jax.vmap(lambda values: make_segments(jnp.asarray(T), values))(level)
    mass = jax.vmap(lambda segments: segments.log_integral)(inner)
    return Sheet(
        outer=make_segments(outer.y[:, 0], mass),
        inner=inner,
        centre=centre,
        width=width,
        below=below,
        above=above,
        nodes=nodes,
        strata=jax.nn.softmax(volumes, axis=2),
        ridge=jax.vmap(jax.vmap(lambda h: _ridge(target, h)))(nodes.hessian),
    )


def _ridge(target: Target, hessian: Float[Array, "q q"]) -> Float[Array, " 2"]:
    """Slope of the inner mode against u, and how far it may follow."""
    information = without_s(target, hessian + target.precision)
    limit = FOLLOWED / jnp.sqrt(schur(information[1:, 1:]))
    return jnp.stack([ridge_slope(information)[0], limit])


def log_volumes(target: Target, node: Expansion) -> Float[Array, " s"]:
    """Log of the integral over the others, for every stratum of ln s."""
    if not target.roles.has_s:
        return local(target, node, node.y[:2]).log_volume[None]
    B = target.seen(node.y)["ln_B"]

    def one(score: Array) -> Array:
        ln_s, _ = target.tables["ln_s"].draw(B, score)
        held = jnp.concatenate([node.y[:2], ln_s[None]])
        return local(target, node, held).log_volume

    return jax.vmap(one)(ndtri((jnp.arange(N_STRATA) + 0.5) / N_STRATA))


def local(target: Target, node: Expansion, held: Float[Array, " h"]) -> Local:
    """The others given the held coordinates, by the expansion of a node near them."""
    n = held.size
    precision, mean, log_norm = prior_given(target, held)
    y = jnp.concatenate([held, node.y[n:]])
    step = y - node.y
    bend = node.hessian @ step
    pull = precision @ (y - mean)
    misfit = node.misfit + node.gradient @ step + step @ bend / 2
    cost = misfit + (y - mean) @ pull / 2
    factor = cholesky((node.hessian + precision)[n:, n:])
    half = half_solve(factor, -(node.gradient + bend + pull)[n:])
    gain = jnp.sum(half**2) / 2
    size = (y.size - n) * np.log(2 * np.pi) / 2
    return Local(
        centre=y[n:] + back_solve(factor, half),
        factor=factor,
        log_volume=log_norm - cost + gain - log_diagonal(factor) + size,
    )


def prior_given(
    target: Target, held: Float[Array, " h"]
) -> tuple[Float[Array, "q q"], Float[Array, " q"], Scalar]:
    """Normal prior of all coordinates given ln s: precision, mean, log normaliser.

    The softer the contact against the finger, the rounder the ellipse that pushes meet:
    for small ones |e| = (1 + s) |f|, so that f is the narrower the larger s.
    """
    if held.size == 2:
        return target.precision, target.mean, jnp.zeros(())
    names = target.roles.names
    is_s = np.array([name == "ln_s" for name in names])
    is_f = np.array([name in ("f1", "f2") for name in names])
    apart = is_s | is_f
    precision = jnp.where(apart[:, None] | apart, 0.0, target.precision)
    ratio = (1 + jnp.exp(held[2])) / target.shape_sd
    precision = precision + jnp.diag(jnp.where(is_f, ratio**2, 0.0))
    return precision, target.mean, np.sum(is_f) * jnp.log(ratio)


def _followed(
    target: Target, start: Expansion, inner: Float[Array, "k m"]
) -> Expansion:
    """Conditional modes along the inner coordinate, each from the one before."""
    n_held, q = target.roles.n_held, target.mean.size
    is_free = jnp.arange(q) >= n_held

    def one(node: Expansion, value: Scalar) -> Expansion:
        y = node.y.at[1].set(value)
        if n_held < q:
            information = node.hessian + target.precision
            order = np.array([1, *range(n_held, q)])
            slope = ridge_slope(information[order][:, order])
            move = jnp.clip(slope * (value - node.y[1]), -MAX_MOVE, MAX_MOVE)
            y = y.at[n_held:].add(move)
        return descend(target, y[None], is_free, N_STEPS - 1)

    def step(
        nodes: Expansion, values: Float[Array, " m"]
    ) -> tuple[Expansion, Expansion]:
        moved = jax.vmap(one)(nodes, values)
        return moved, moved

    _, nodes = jax.lax.scan(step, start, inner)
    return nodes
