"""Where an object stops to roll, found from the forces of any mechanics alone.

What a push needs to be held is what it bears where rolling friction is without limit.
Excluded: mechanics that say it in closed form, or whose limit acts on a tilted face.
"""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.mechanics.combinations import contact, rolling_limits
from pushfit.mechanics.containers import Contact, Grasp, Parameters, Pushes, Vector
from pushfit.mechanics.numerics import norm2
from pushfit.mechanics.roots import falling_root

# C_rr at which nothing rolls.
NEVER_ROLLS = 1e6
# Elevations from straight down to straight up at which rolling is looked for: a range
# of rolling narrower than 2° may be missed.
N_ELEVATIONS = 91


def searched_critical_angle(
    params: Parameters | Contact, grasp: Grasp, alpha: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Highest elevation at which the object rolls.

        F_pt = C_rr F_n at θ_c,   F_pt without rolling

    With two supports |F_x| - |AB|/(2L) F_n or |F_y|, the larger, stands for F_pt.

    Returns:
        θ_c in (-π/2, π/2]; NaN where the contact never rolls [rad].

    References:
        After Eq. (11).
    """
    state = (contact(params), grasp, jnp.ravel(jnp.asarray(alpha)))

    def room(state: tuple[Contact, Grasp, Vector], descent: Vector) -> Vector:
        """What rolling friction still bears, from a push straight down on [N]."""
        group, grasp, alpha = state
        needed, normal = _needed(group, grasp, (jnp.pi / 2 - descent, alpha))
        return group.C_rr * normal - needed

    descents = jnp.linspace(0.0, jnp.pi, N_ELEVATIONS)
    rooms = jax.vmap(lambda d: room(state, jnp.full_like(state[2], d)))(descents)
    rolls = rooms < 0
    first = jnp.argmax(rolls, axis=0)
    above, below = descents[jnp.maximum(first - 1, 0)], descents[first]
    descent = falling_root(room, state, (above, below), start=(above + below) / 2)
    angle = jnp.where(jnp.any(rolls, axis=0), jnp.pi / 2 - descent, jnp.nan)
    return angle.reshape(jnp.shape(alpha))


def searched_critical_friction(
    params: Parameters | Contact,
    grasp: Grasp,
    direction: tuple[Float[Array, "*n"], Float[Array, "*n"]],
) -> Float[Array, "*n"]:
    """Rolling friction with which a push along (θ, α) just does not roll.

        C_rr = F_pt / F_n,   F_pt without rolling

    With two supports |F_x| - |AB|/(2L) F_n or |F_y|, the larger, stands for F_pt.

    Returns:
        C_rr, not negative; NaN where the push loses contact [-].

    References:
        After Eq. (8).
    """
    theta, alpha = (jnp.ravel(jnp.asarray(angle)) for angle in direction)
    needed, normal = _needed(contact(params), grasp, (theta, alpha))
    is_held = normal > 0
    friction = needed / jnp.where(is_held, normal, 1.0)
    return jnp.where(is_held, friction, jnp.nan).reshape(jnp.shape(direction[0]))


def _needed(
    group: Contact, grasp: Grasp, direction: tuple[Vector, Vector]
) -> tuple[Vector, Vector]:
    """Force that friction alone has to bear, and F_n; F_n = 0 without contact [N]."""
    unrolled = eqx.tree_at(
        lambda c: c.C_rr, group, jnp.full_like(group.C_rr, NEVER_ROLLS)
    )
    hard = dataclasses.replace(grasp, sharpness=math.inf)
    force = grasp.law.forces(unrolled, Pushes(*direction), hard)
    normal = jnp.where(force.in_contact, force.normal, 0.0)
    if grasp.support_span is None:
        return norm2(force.tangential_x, force.tangential_y), normal
    # About y the span bears its share without friction.
    along, across = rolling_limits(group, grasp.support_span)
    x = jnp.abs(force.tangential_x) - (along - across) * normal
    return jnp.maximum(x, jnp.abs(force.tangential_y)), normal
