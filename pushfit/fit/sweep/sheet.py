"""Conditional modes on a grid over outer and inner coordinate, and their masses.

At every outer node the inner coordinate is followed from its conditional mode to both
ends of its prior, in steps that grow like sinh: a peak of width 1e-3 and a tail as wide
as the prior share a few nodes. The other coordinates are Gaussian around their mode
there; where ln s is drawn from its prior, once for each stratum of it. Excluded:
placing the outer nodes (`pushfit.fit.sweep.outer_nodes`).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtri
from jaxtyping import Array, Bool, Float, Int

from pushfit.fit.sweep.cholesky import (
    back_solve,
    cholesky,
    half_solve,
    log_diagonal,
)
from pushfit.fit.sweep.outer_nodes import (
    N_ROUNDS,
    REACH,
    ascending,
    begun,
    first_round,
    later_round,
    ridge_slope,
    schur,
    without_s,
)
from pushfit.fit.sweep.search import Round, in_rounds, unknown_expansion
from pushfit.fit.sweep.segments import Segments, make_segments, with_tails
from pushfit.fit.sweep.target import Expansion, Target
from pushfit.model import Scalar

# Nodes to each side of the conditional mode, and steps from one to the next: fewer are
# faster in proportion.
N_SIDE, N_STEPS = 8, 3
# Innermost distance of the nodes, about, in conditional standard deviations: at half of
# it the log evidences of some tables move.
STRETCH = 0.7
# Equally probable parts of the prior of ln s given B: an integral over them takes so
# many factorisations. Not tuned further.
N_STRATA = 8
# Furthest that the inner coordinate follows the ridge between nodes, in its own sd: at
# a quarter fewer draws count.
FOLLOWED = 2.0
# Longest move of the others from one inner node to the next, in logs.
MAX_INNER_MOVE = 1.0


class Scale(eqx.Module):
    """The inner coordinate at each outer node: centre + width sinh(stretch t).

    Args:
        centre: Its conditional mode.
        width: Its unit.
        below: Stretch below the mode.
        above: Stretch above it.
    """

    centre: Float[Array, "*j"]
    width: Float[Array, "*j"]
    below: Float[Array, "*j"]
    above: Float[Array, "*j"]

    def at(self, t: Scalar) -> tuple[Float[Array, "*j"], Float[Array, "*j"]]:
        """Inner coordinate at t, and the log of its slope."""
        stretch = jnp.where(t < 0, self.below, self.above)
        value = self.centre + self.width * jnp.sinh(stretch * t)
        return value, jnp.log(self.width * stretch * jnp.cosh(stretch * t))


class Sheet(eqx.Module):
    """Where the mass of a posterior is.

    Args:
        outer: Density by which u is proposed.
        inner: That of t at each outer node.
        scale: What t stands for there.
        nodes: Conditional modes, by outer and inner node.
        strata: Share of every stratum of ln s at each of them.
        ridge: Change of the inner coordinate per unit of u at each, and how far it may
            be followed.
    """

    outer: Segments
    inner: Segments
    scale: Scale
    nodes: Expansion
    strata: Float[Array, "j k s"]
    ridge: Float[Array, "j k 2"]

    @property
    def u(self) -> Float[Array, " j"]:
        """Coordinate u at each outer node."""
        return self.nodes.y[:, 0, 0]


# Inner nodes in the units of t.
SIDE = np.arange(1, N_SIDE + 1) / N_SIDE
T = np.concatenate([-SIDE[::-1], [0.0], SIDE])
# The same in the order in which they are met, from the middle to either end.
MET = np.concatenate([-SIDE, SIDE])


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


def make_sheet(target: Target) -> Sheet:
    """Sweep the outer coordinate, and the inner one at every node of it."""
    scale, nodes = _swept(target)
    volumes = jax.vmap(jax.vmap(lambda node: log_volumes(target, node)))(nodes)
    _, log_slope = jax.vmap(scale.at, out_axes=1)(jnp.asarray(T))
    level = logsumexp(volumes, axis=2) + log_slope
    t = jnp.asarray(T)
    mass = jax.vmap(lambda values: make_segments(t, values).log_integral)(level)
    return Sheet(
        outer=with_tails(nodes.y[:, 0, 0], mass),
        inner=jax.vmap(lambda values: with_tails(t, values))(level),
        scale=scale,
        nodes=nodes,
        strata=jax.nn.softmax(volumes, axis=2),
        ridge=jax.vmap(jax.vmap(lambda h: _inner_ridge(target, h)))(nodes.hessian),
    )


def _swept(target: Target) -> tuple[Scale, Expansion]:
    """Conditional modes by outer and inner node.

    Once the outer nodes are settled, each round goes on to the next inner ones.
    """
    is_free = jnp.arange(target.mean.size) >= target.roles.n_held

    def again(number: Int[Array, ""], nodes: Expansion, _: Expansion) -> Round:
        return later_round(target, nodes, number)

    def across(number: Int[Array, ""], nodes: Expansion, outer: Expansion) -> Round:
        index = number - (N_ROUNDS - 1)
        values, _ = _scale(target, outer).at(jnp.asarray(MET)[index])
        near = _chosen(index % N_SIDE == 0, outer, nodes)
        starts = jax.vmap(lambda node, value: _moved(target, node, value))(near, values)
        return begun(starts, is_free, N_STEPS - 1)

    def onward(
        number: Int[Array, ""], ends: Expansion, outer: Expansion
    ) -> tuple[Expansion, Round, Expansion]:
        nodes = ascending(ends)
        outer = _chosen(number < N_ROUNDS, nodes, outer)
        is_settled = number >= N_ROUNDS - 1
        following = jax.lax.cond(is_settled, across, again, number, nodes, outer)
        return nodes, following, outer

    first = first_round(target)
    numbers = jnp.arange(N_ROUNDS + MET.size)
    outer, found = in_rounds(
        lambda _: target,
        numbers,
        first,
        state=unknown_expansion(first.starts[:, 0]),
        onward=onward,
    )
    # The outer nodes are the middle of the inner ones.
    met = np.argsort(np.append(0.0, MET), kind="stable") + N_ROUNDS - 1
    nodes = jax.tree.map(lambda a: a[met].swapaxes(0, 1), found)
    return _scale(target, outer), nodes


def _chosen(
    is_first: Bool[Array, ""], first: Expansion, second: Expansion
) -> Expansion:
    return jax.tree.map(lambda a, b: jnp.where(is_first, a, b), first, second)


def _scale(target: Target, outer: Expansion) -> Scale:
    """From the conditional mode to both ends of the prior."""
    information = jax.vmap(lambda h: without_s(target, h + target.precision))
    sd = 1 / jnp.sqrt(jax.vmap(schur)(information(outer.hessian)[:, 1:, 1:]))
    inner_sd = jnp.sqrt(target.covariance[1, 1])
    centre = outer.y[:, 1]
    width = STRETCH * jnp.minimum(sd, inner_sd)
    low = jnp.minimum(target.mean[1] - REACH * inner_sd, centre - 3 * width)
    high = jnp.maximum(target.mean[1] + REACH * inner_sd, centre + 3 * width)
    return Scale(
        centre=centre,
        width=width,
        below=jnp.arcsinh((centre - low) / width),
        above=jnp.arcsinh((high - centre) / width),
    )


def _moved(target: Target, node: Expansion, value: Scalar) -> Float[Array, " q"]:
    """The mode at another value of the inner coordinate, by the ridge of a node."""
    n_held, q = target.roles.n_held, target.mean.size
    y = node.y.at[1].set(value)
    information = node.hessian + target.precision
    order = np.array([1, *range(n_held, q)])
    slope = ridge_slope(information[order][:, order])
    move = jnp.clip(slope * (value - node.y[1]), -MAX_INNER_MOVE, MAX_INNER_MOVE)
    return y.at[n_held:].add(move)


def _inner_ridge(target: Target, hessian: Float[Array, "q q"]) -> Float[Array, " 2"]:
    """Slope of the inner mode against u, and how far it may follow."""
    information = without_s(target, hessian + target.precision)
    limit = FOLLOWED / jnp.sqrt(schur(information[1:, 1:]))
    return jnp.stack([ridge_slope(information)[0], limit])


def log_volumes(target: Target, node: Expansion) -> Float[Array, " s"]:
    """Log of the integral over the others, for every stratum of ln s."""
    if not target.roles.has_s:
        return local(target, node, node.y[:2]).log_volume[None]
    B = target.seen(node.y)["ln_B"]

    def one(score: Scalar) -> Scalar:
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
