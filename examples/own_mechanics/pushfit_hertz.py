"""Hertz's contact: a fingertip that grows stiffer the deeper it is pressed.

    F_n = A S_p^(-1/2) d^(3/2),   d = d_0 + S_p sin θ

d_0 is how deep the preload has pressed it. A is then the stiffness of a push straight
down that begins without a preload. Rolling and the tangential springs are the paper's.
"""

import jax.numpy as jnp

from pushfit.mechanics.linear import limited_tangential
from pushfit.mechanics.registry import Mechanics
from pushfit.model import Forces, contact


def hertz_forces(params, pushes, grasp):
    """Contact forces of every push."""
    group = contact(params)
    cosine, sine = pushes.elevation
    scale = group.A / jnp.sqrt(grasp.push_length)
    is_squeezed = grasp.preload > 0
    # 0^(2/3) has no derivative, and jnp.where would hand that on.
    preload = jnp.where(is_squeezed, grasp.preload, 1.0)
    before = jnp.where(is_squeezed, (preload / scale) ** (2 / 3), 0.0)
    depth = before + grasp.push_length * sine
    normal = scale * jnp.abs(depth) ** 1.5
    x, y = limited_tangential(
        group,
        grasp,
        displacement=grasp.push_length * cosine,
        azimuth=pushes.azimuth,
        normal=normal,
    )
    return Forces(
        normal=normal,
        tangential_x=x,
        tangential_y=y,
        in_contact=~is_squeezed | (depth >= 0),
    )


MECHANICS = Mechanics(
    title="equations of Hertz's contact",
    summary="a fingertip that grows stiffer the deeper it is pressed",
    forces=hertz_forces,
)
