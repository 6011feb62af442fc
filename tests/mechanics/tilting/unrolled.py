"""Tilt of the object in a push that does not roll, as at its critical angle."""

import equinox as eqx

from pushfit.mechanics.tilting.hold import make_hold
from pushfit.mechanics.tilting.one_support import unrolled_tilt
from pushfit.model import Grasp, Parameters, Scalar, contact, unit_vector


@eqx.filter_jit
def tilt_of(params: Parameters, grasp: Grasp, theta: Scalar, alpha: Scalar) -> Scalar:
    """γ of C_d γ = F L sin φ [rad]."""
    elevation, azimuth = unit_vector(theta[None]), unit_vector(alpha[None])
    hold = make_hold(contact(params), grasp, elevation=elevation, azimuth=azimuth)
    return unrolled_tilt(hold)[0]
