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
from pushfit.fit.scan import LN_C_RR
from pushfit.model import Scalar

# Places around each of the best modes, in standard deviations of ln tan θ_c.
N_MODES = 3
OFFSETS = np.array([0.25, 0.5, 0.8, 1.1, 1.4, 1.65, 1.9, 2.2, 2.6, 3.2, 4.0, 6.0])
# All but no prior, so that a flat valley has a bottom.
WEAK = 1e-6
# Outer values that share the processor's cache.
BATCH = 8


class LaneProfile(eqx.Module):
    """Least misfit Q at values of u = ln tan θ_c, ascending."""

    u: Float[Array, " g"]
    misfit: Float[Array, " g"]


def profile_lane(lane: Lane, fit: LaneFit) -> LaneProfile:
    """Profile of θ_c.

    Args:
        lane: Table.
        fit: Its modes.

    Returns:
        Profile on the grid of single tables, with more values around the modes.
    """
    offsets = jnp.asarray(np.concatenate([-OFFSETS[::-1], [0.0], OFFSETS]))
    around = fit.u[:N_MODES, None] + fit.width[:N_MODES, None] * offsets
    grid = jnp.log(jnp.tan(jnp.asarray(THETA_GRID)))
    u = jnp.sort(jnp.concatenate([grid, jnp.clip(around.ravel(), grid[0], grid[-1])]))

    def least(u: Scalar) -> Scalar:
        face = lane.face(u)
        misfit, a = jax.vmap(lambda c: least_misfit(lane, face, c))(
            jnp.asarray(LN_C_RR)
        )
        misfit = jnp.where(jnp.isfinite(misfit), misfit, jnp.inf)
        best = jnp.argmin(misfit)
        c = jnp.asarray(LN_C_RR)[best]
        prior = NormalPrior(jnp.stack([c, a[best], c + a[best]]), jnp.full(3, WEAK))
        refined, _, _ = climb(lane, face, (c, a[best]), prior)
        polished, _ = least_misfit(lane, face, refined)
        return jnp.minimum(misfit[best], jnp.nan_to_num(polished, nan=jnp.inf))

    return LaneProfile(u, jax.lax.map(least, u, batch_size=BATCH))


@eqx.filter_jit
def profile_lanes(lanes: Lane, fits: LaneFit) -> LaneProfile:
    """`profile_lane` of stacked lanes and their fits."""
    return jax.vmap(profile_lane)(lanes, fits)
