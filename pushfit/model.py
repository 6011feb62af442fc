"""The push model of He & Zhang (2014): stiffnesses and a push in, contact forces out.

Pure JAX functions of small containers, float64, safe under jit, vmap and grad wherever
the physics is defined. Everything outside this module meets the mechanics through one
function, `forward`. Excluded: files, units other than SI (angles in radians), noise,
and estimation. Extensions of the paper (preload, soft transition, stiffness ellipse,
two supports, tilting) are neutral unless asked for.

References:
    Eq. (n) is equation n of He & Zhang (2014), doi:10.1007/s11432-014-5216-3.
"""

import jax.numpy as jnp

from pushfit.mechanics.containers import Channels as Channels
from pushfit.mechanics.containers import Contact as Contact
from pushfit.mechanics.containers import Forces as Forces
from pushfit.mechanics.containers import Grasp as Grasp
from pushfit.mechanics.containers import Parameters as Parameters
from pushfit.mechanics.containers import Pushes as Pushes
from pushfit.mechanics.containers import Scalar as Scalar
from pushfit.mechanics.containers import Vector as Vector
from pushfit.mechanics.containers import as_float as as_float
from pushfit.mechanics.containers import contact as contact
from pushfit.mechanics.containers import rolling_limits as rolling_limits
from pushfit.mechanics.containers import support_stiffness as support_stiffness
from pushfit.mechanics.containers import tangential_stiffness as tangential_stiffness
from pushfit.mechanics.containers import unit_vector as unit_vector
from pushfit.mechanics.numerics import norm2, softclip
from pushfit.mechanics.tilting import one_support_forces
from pushfit.mechanics.two_supports import two_support_forces


def linear_forces(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Forces:
    """Contact forces of small pushes.

        F_n = |F_0 + A S_p sin θ|
        F_pt = softmin(C_rr F_n, |B u(α)| S_p cos θ)

    With `Grasp.support_span` the limit is a box: C_rr F_n across the supports and
    (C_rr + |AB|/(2L)) F_n along them, taken per component.

    Args:
        params: Parameters.
        pushes: Push directions.
        grasp: Grasp and sensor.

    Returns:
        Forces of every push.

    References:
        Eqs. (6), (8), (10).
    """
    group = contact(params)
    cosine, sine = pushes.elevation
    pressed = grasp.preload + group.A * grasp.push_length * sine
    # |.| makes an unloaded contact even in θ, as Eqs. (12)-(14) are.
    normal = jnp.abs(pressed)
    reach = grasp.push_length * cosine
    stiffness_x, stiffness_y = tangential_stiffness(group, pushes.azimuth)
    if grasp.support_span is None:
        stiffness = norm2(stiffness_x, stiffness_y)
        limit = group.C_rr * normal
        ratio = softclip(stiffness * reach, limit, grasp.sharpness) / stiffness
        x, y = ratio * stiffness_x, ratio * stiffness_y
    else:
        limit_x, limit_y = rolling_limits(group, grasp.support_span)
        x = softclip(stiffness_x * reach, limit_x * normal, grasp.sharpness)
        y = softclip(stiffness_y * reach, limit_y * normal, grasp.sharpness)
    return Forces(
        normal=normal,
        tangential_x=x,
        tangential_y=y,
        in_contact=(grasp.preload <= 0) | (pressed >= 0),
    )


def tilting_forces(
    params: Parameters | Contact, pushes: Pushes, grasp: Grasp
) -> Forces:
    """Contact forces of pushes that tilt the object.

    Args:
        params: Parameters.
        pushes: Push directions.
        grasp: Grasp and sensor.

    Returns:
        Forces of every push, in the frame that does not tilt.
    """
    is_single = grasp.support_span is None
    solve = one_support_forces if is_single else two_support_forces
    return solve(params, pushes, grasp)


MECHANICS = {"linear": linear_forces, "tilting": tilting_forces}


def forces(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Forces:
    """Contact forces by the mechanics that the grasp names.

    Args:
        params: Parameters.
        pushes: Push directions.
        grasp: Grasp and sensor.

    Returns:
        Forces of every push.
    """
    return MECHANICS[grasp.mechanics](params, pushes, grasp)


def forward(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Channels:
    """What the sensors report: the one way from parameters to predictions.

        height = gain (sqrt(F_pt² + F_n²) - F_0) + offset

    With F_0 = 0, gain 1 and offset 0 this is S_p P_r of Eq. (12).

    Args:
        params: Parameters.
        pushes: Push directions.
        grasp: Grasp and sensor.

    Returns:
        One value per push and channel.

    References:
        Eqs. (12)-(14).
    """
    force = forces(params, pushes, grasp)
    tangential = norm2(force.tangential_x, force.tangential_y)
    magnitude = norm2(tangential, force.normal)
    return Channels(
        height=grasp.gain * (magnitude - grasp.preload) + grasp.offset,
        height_normal=grasp.gain * (force.normal - grasp.preload),
        height_tangential=grasp.gain * tangential,
        in_contact=force.in_contact,
    )


def push_resistance(params: Parameters, pushes: Pushes, grasp: Grasp) -> Vector:
    """Force change per push length.

        P_r = (|F_p| - F_0) / S_p

    Args:
        params: Parameters.
        pushes: Push directions.
        grasp: Grasp and sensor; gain and offset play no part.

    Returns:
        Resistance of every push [N/m].

    References:
        Eqs. (12)-(14).
    """
    channels = forward(params, pushes, grasp)
    return (channels.height - grasp.offset) / (grasp.gain * grasp.push_length)
