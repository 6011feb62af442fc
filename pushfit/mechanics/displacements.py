"""How the finger, the contact and the object share a push: the paper's Eqs. (2)-(5).

Explains the forces of `pushfit.model` and says when a push is too large for them.
Excluded: mechanics other than the linear one.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.mechanics.containers import (
    Grasp,
    Parameters,
    Pushes,
    Vector,
    contact,
    support_stiffness,
)
from pushfit.mechanics.linear import linear_forces
from pushfit.mechanics.numerics import norm2


class Displacements(eqx.Module):
    """Where the push goes: S_pn = S_sn + S_dn and S_pt = S_st + S_rt.

    Args:
        S_sn: Normal displacement of the support finger [m].
        S_dn: Normal deformation of the contact [m].
        S_st: Tangential displacement of the support finger, rows x and y [m].
        S_rt: Tangential displacement by tilting of the object, rows x and y [m].
        tilt: γ, angle by which the object tilts [rad].
        torque: T, moment about the support contact [N·m].
    """

    S_sn: Vector
    S_dn: Vector
    S_st: Float[Array, "2 n"]
    S_rt: Float[Array, "2 n"]
    tilt: Vector
    torque: Vector


def displacements(params: Parameters, pushes: Pushes, grasp: Grasp) -> Displacements:
    """How finger, contact and object share the push in the linear mechanics.

        S_sn = F_pn / K_sn,   S_dn = F_pn / K_dn,   S_st = K⁻¹ F_pt
        S_rt = S_pt - S_st,   γ = |S_rt| / L,   T = |F_pt| L

    Unrolled T = C_d γ; rolled γ is larger, by what the object has rolled. A tilt above
    about 2° says that the push is too large for linear mechanics.

    References:
        Eqs. (2)-(5), (7), (9), with S_dt = 0.
    """
    group = contact(params)
    force = linear_forces(params, pushes, grasp)
    pressing = group.A * grasp.push_length * pushes.elevation[1]
    tangential = jnp.stack([force.tangential_x, force.tangential_y])
    reach = grasp.push_length * pushes.elevation[0]
    S_pt = reach[None] * pushes.azimuth
    S_st = jnp.linalg.solve(support_stiffness(params), tangential)
    S_rt = S_pt - S_st
    return Displacements(
        S_sn=pressing / params.K_sn,
        S_dn=pressing / params.K_dn,
        S_st=S_st,
        S_rt=S_rt,
        tilt=norm2(S_rt[0], S_rt[1]) / params.L,
        torque=norm2(tangential[0], tangential[1]) * params.L,
    )
