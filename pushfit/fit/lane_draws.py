"""Draws from the posteriors of many tables, from the nodes of their integrals.

θ_c is drawn from its marginal, C_rr from its density at the nearer node, moved along
the ridge, and A from its density given both, computed anew. Excluded: integrating.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.lane_posterior import N_A, REACH_A, LanePosterior, nodes_of_A
from pushfit.fit.lanes import Lane
from pushfit.fit.programs import compiled
from pushfit.model import Scalar

# A log density that rises by less than this over a segment is flat there.
FLAT = 1e-9
# A ridge that moves by more than so many of its widths from node to node has jumped.
JUMP = 3.0


class LaneDraws(eqx.Module):
    """Independent draws from the posterior of a table.

    Args:
        u: ln tan θ_c.
        c: ln C_rr.
        a: ln A.
        squares: Misfit Q of every channel.
    """

    u: Float[Array, " d"]
    c: Float[Array, " d"]
    a: Float[Array, " d"]
    squares: Float[Array, "d c"]


def draw_lane(
    lane: Lane, posterior: LanePosterior, uniform: Float[Array, "d 4"]
) -> LaneDraws:
    """Draws from an integrated posterior.

    Args:
        lane: Table.
        posterior: Its posterior on nodes.
        uniform: Numbers in (0, 1); the first column has one in each stratum of its
            length, which makes the draws of θ_c all but exact.

    Returns:
        As many draws as there are rows.
    """
    gap = jnp.where(posterior.is_joined[:-1], jnp.diff(posterior.u), 0.0)
    outer = _segments(posterior.log_density, gap)
    node, share = jax.vmap(lambda v: _drawn(outer, v))(uniform[:, 0])
    u = posterior.u[node] + share * (posterior.u[node + 1] - posterior.u[node])
    # Of the two nodes around it, the nearer one more often.
    chosen = jnp.where(uniform[:, 1] < share, node + 1, node)
    inner = jax.vmap(_segments)(posterior.log_inner, jnp.diff(posterior.t))

    def one(u: Scalar, node: Array, k: Array, v: Float[Array, " 2"]):
        i, share = _drawn(jax.tree.map(lambda x: x[k], inner), v[0])
        t = posterior.t[k, i] + share * (posterior.t[k, i + 1] - posterior.t[k, i])
        centre, scale = _ridge_at(posterior, u, node, k)
        c = centre + scale * jnp.sinh(t)
        c = jnp.clip(c, lane.prior_C.start, lane.prior_C.end)
        parabola = lane.parabola(lane.shape(lane.face(u), c))
        log_f, ln_A = nodes_of_A(lane, parabola, u + c)
        step = 2 * REACH_A / (N_A - 1)
        i, share = _drawn(_segments(jnp.stack(log_f), jnp.full(N_A - 1, step)), v[1])
        t = step * (i + share) - REACH_A
        middle, above = ln_A[N_A // 2], ln_A[N_A // 2 + 1]
        a = middle + (above - middle) * jnp.sinh(t) / float(np.sinh(step))
        return c, a, jnp.stack(parabola.squares(jnp.exp(a)))

    c, a, squares = jax.vmap(one)(u, node, chosen, uniform[:, 2:])
    return LaneDraws(u, c, a, squares)


class Segments(eqx.Module):
    """A density that is exponential between neighbouring nodes.

    Args:
        mass: Integral over each segment.
        total: Cumulative sum of it.
        rise: Increase of the log density over each.
    """

    mass: Float[Array, " s"]
    total: Float[Array, " s"]
    rise: Float[Array, " s"]


def _segments(log_f: Float[Array, " n"], gap: Float[Array, " n-1"]) -> Segments:
    """Segments of a log density at nodes, their widths given."""
    log_f = jnp.maximum(log_f - jnp.max(log_f), -700.0)
    rise = jnp.diff(log_f)
    is_flat = jnp.abs(rise) < FLAT
    safe = jnp.where(is_flat, 1.0, rise)
    mass = jnp.exp(log_f[:-1]) * gap * jnp.where(is_flat, 1.0, jnp.expm1(safe) / safe)
    return Segments(mass, jnp.cumsum(mass), rise)


def _drawn(segments: Segments, uniform: Scalar) -> tuple[Array, Scalar]:
    """The segment of a draw, and the share of the way through it."""
    wanted = uniform * segments.total[-1]
    last = segments.mass.size - 1
    # Comparing with all is faster than a search for so few.
    i = jnp.minimum(jnp.sum(segments.total < wanted), last)
    before = jnp.where(i > 0, segments.total[i - 1], 0.0)
    part = (wanted - before) / jnp.maximum(segments.mass[i], 1e-300)
    part, rise = jnp.clip(part, 0.0, 1.0), segments.rise[i]
    is_flat = jnp.abs(rise) < FLAT
    safe = jnp.where(is_flat, 1.0, rise)
    share = jnp.where(is_flat, part, jnp.log1p(part * jnp.expm1(safe)) / safe)
    return i, jnp.clip(share, 0.0, 1.0)


def _ridge_at(
    posterior: LanePosterior, u: Scalar, node: Array, chosen: Array
) -> tuple[Scalar, Scalar]:
    """Centre and scale of the ridge between two nodes, or at the chosen one."""
    centre, scale = posterior.centre, posterior.scale
    share = (u - posterior.u[node]) / (posterior.u[node + 1] - posterior.u[node])
    smaller = jnp.minimum(scale[node], scale[node + 1])
    # A ridge that jumps from one optimum to another is not to be interpolated.
    is_one = jnp.abs(centre[node + 1] - centre[node]) < JUMP * smaller
    between = centre[node] + share * (centre[node + 1] - centre[node])
    ratio = scale[node + 1] / scale[node]
    stretched = scale[node] * ratio**share
    return (
        jnp.where(is_one, between, centre[chosen]),
        jnp.where(is_one, stretched, scale[chosen]),
    )


@compiled
def draw_lanes(
    lanes: Lane, posteriors: LanePosterior, uniform: Float[Array, "l d 4"]
) -> LaneDraws:
    """`draw_lane` of stacked lanes."""
    return jax.lax.map(lambda parts: draw_lane(*parts), (lanes, posteriors, uniform))
