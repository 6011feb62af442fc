"""The push model of He & Zhang (2014): stiffnesses and a push in, contact forces out.

Pure JAX functions of small containers, float64, safe under jit, vmap and grad wherever
the physics is defined. Everything outside this module meets the mechanics through one
function, `forward`. Excluded: files, units other than SI (angles in radians), noise,
and estimation. Extensions of the paper (preload, soft transition, stiffness ellipse,
two supports, tilting) are neutral unless asked for.

References:
    Eq. (n) is equation n of He & Zhang (2014), doi:10.1007/s11432-014-5216-3.
"""

import numpy as np

from pushfit.arguments import checked
from pushfit.mechanics.combinations import contact as contact
from pushfit.mechanics.combinations import rolling_limits as rolling_limits
from pushfit.mechanics.combinations import support_stiffness as support_stiffness
from pushfit.mechanics.combinations import tangential_stiffness as tangential_stiffness
from pushfit.mechanics.containers import Channels as Channels
from pushfit.mechanics.containers import Contact as Contact
from pushfit.mechanics.containers import Forces as Forces
from pushfit.mechanics.containers import Grasp as Grasp
from pushfit.mechanics.containers import Parameters as Parameters
from pushfit.mechanics.containers import Pushes as Pushes
from pushfit.mechanics.containers import Scalar as Scalar
from pushfit.mechanics.containers import Vector as Vector
from pushfit.mechanics.containers import as_float as as_float
from pushfit.mechanics.containers import unit_vector as unit_vector
from pushfit.mechanics.numerics import norm2
from pushfit.mechanics.ranges import check_together


def forces(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Forces:
    """Contact forces at the end of every push, by the mechanics that the grasp names.

    Their equations are with those: `linear_forces`, `tilting_forces`.

    Returns:
        F_n with the preload, never negative, and both components of F_pt [N].

    References:
        Eqs. (6)-(10).
    """
    return grasp.law.forces(params, pushes, grasp)


@checked
def forward(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Channels:
    """What the sensors report: the one way from parameters to predictions.

        height = gain (sqrt(F_pt² + F_n²) - F_0) + offset

    With F_0 = 0, gain 1 and offset 0 this is S_p P_r of Eq. (12). Where objects tilt
    each call is compiled anew, unless it comes from a function that is compiled, such
    as `equinox.filter_jit(forward)`.

    Args:
        params: Parameters, or the combinations that forces depend on.
        pushes: Directions.
        grasp: Push length, preload and sensor.

    Returns:
        Heights of every push [table unit], and whether the finger stays in contact.

    Raises:
        ConfigError: Arrays of other lengths than the pushes, as draws of parameters,
            which `jax.vmap` takes (`input_shape`).

    Examples:
        >>> import numpy as np
        >>> springs = {"K_sn": 600, "K_dn": 300, "K_st": 400}  # A = 200 N/m
        >>> params = Parameters(**springs, C_rr=0.5, C_d=0.25, L=0.025)
        >>> straight = Pushes(np.array([np.pi / 2]), np.zeros(1))
        >>> forward(params, straight, Grasp(push_length=5e-3)).height.round(6).tolist()
        [1.0]

    References:
        Eqs. (12)-(14).
    """
    numbers = {**vars(params), **vars(grasp)}
    arrays = {name: own for name, own in numbers.items() if np.ndim(own)}
    check_together("forward", theta=pushes.theta, **arrays)
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
    """Force change per push length, whatever gain and offset of the sensor.

        P_r = (|F_p| - F_0) / S_p

    Returns:
        P_r of every push; negative only where there is a preload [N/m].

    References:
        Eqs. (12)-(14).
    """
    channels = forward(params, pushes, grasp)
    return (channels.height - grasp.offset) / (grasp.gain * grasp.push_length)
