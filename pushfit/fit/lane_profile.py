"""Profile likelihood of θ_c for many tables at once.

At given θ_c the best A is known in closed form and the best C_rr by a screen and a few
steps, so the profile is computed where it is wanted instead of by a constrained solver.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.lane_fit import LaneFit, NormalPrior, climb, least_misfit
from pushfit.fit.lanes import Lane
from pushfit.fit.profiles import THETA_GRID
from pushfit.fit.programs import compiled
from pushfit.fit.scan import LN_C_RR
from pushfit.model import Scalar

# Places around each of the best modes, in standard deviations of ln tan θ_c.
N_MODES = 3
OFFSETS = np.array([0.25, 0.5, 0.8, 1.1, 1.4, 1.65, 1.9, 2.2, 2.6, 3.2, 4.0, 6.0])
# Values between the neighbours of the best one.
N_CLOSER = 24
# All but no prior, so that a flat valley has a bottom.
WEAK = 1e-6
# Outer values that share the processor's cache.
BATCH = 8


class LaneProfile(eqx.Module):
    """Best fit at values of u = ln tan θ_c, ascending.

    Args:
        u: Values.
        c: ln C_rr of the best fit at each.
        a: ln A of it.
        misfit: Its misfit Q.
    """

    u: Float[Array, " g"]
    c: Float[Array, " g"]
    a: Float[Array, " g"]
    misfit: Float[Array, " g"]


def profile_lane(lane: Lane, fit: LaneFit) -> LaneProfile:
    """Profile of θ_c.

    Args:
        lane: Table.
        fit: Its modes.

    Returns:
        Profile on the grid of single tables, at the pushed elevations, where an optimum
        may sit on a kink, around the modes, and around the best of all these.
    """
    offsets = jnp.asarray(np.concatenate([-OFFSETS[::-1], [0.0], OFFSETS]))
    around = fit.u[:N_MODES, None] + fit.width[:N_MODES, None] * offsets[None]
    grid = jnp.log(jnp.tan(jnp.asarray(THETA_GRID)))
    theta = jnp.clip(jnp.abs(lane.pushes.theta), THETA_GRID[0], THETA_GRID[-1])
    wanted = jnp.concatenate([grid, around.ravel(), jnp.log(jnp.tan(theta))])
    first = _best_fits(lane, jnp.sort(jnp.clip(wanted, grid[0], grid[-1])))
    best, last = jnp.argmin(first.misfit), first.u.size - 1
    low = first.u[jnp.maximum(best - 1, 0)]
    high = first.u[jnp.minimum(best + 1, last)]
    closer = _best_fits(lane, jnp.linspace(low, high, N_CLOSER))
    both = jax.tree.map(lambda x, y: jnp.concatenate([x, y]), first, closer)
    order = jnp.argsort(both.u)
    return jax.tree.map(lambda values: values[order], both)


def _best_fits(lane: Lane, u: Float[Array, " g"]) -> LaneProfile:
    """The best fit at each of several u."""

    def one(u: Scalar) -> tuple[Scalar, Scalar, Scalar]:
        face = lane.face(u)
        misfit, a = jax.vmap(lambda c: least_misfit(lane, face, c))(
            jnp.asarray(LN_C_RR)
        )
        misfit = jnp.where(jnp.isfinite(misfit), misfit, jnp.inf)
        best = jnp.argmin(misfit)
        c = jnp.asarray(LN_C_RR)[best]
        prior = NormalPrior(jnp.stack([c, a[best], c + a[best]]), jnp.full(3, WEAK))
        refined, _, _ = climb(lane, face, (c, a[best]), prior)
        polished, at = least_misfit(lane, face, refined)
        is_better = polished < misfit[best]
        chosen = (refined, at, polished), (c, a[best], misfit[best])
        return jax.tree.map(lambda x, y: jnp.where(is_better, x, y), *chosen)

    c, a, misfit = jax.lax.map(one, u, batch_size=BATCH)
    return LaneProfile(u, c, a, misfit)


@compiled
def profile_lanes(lanes: Lane, fits: LaneFit) -> LaneProfile:
    """`profile_lane` of stacked lanes and their fits."""
    return jax.vmap(profile_lane)(lanes, fits)
