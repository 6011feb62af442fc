"""Coordinates in which data and prior part, and the map from them to the parameters.

All six parameters are positive, and linear forces depend on three combinations of them
(five with a stiffness ellipse). Rotating the logs so that these come first leaves the
likelihood to the first coordinates and the prior alone to the rest.
Excluded: priors and data.
"""

import equinox as eqx
import jax.numpy as jnp

from pushfit.mechanics.combinations import anisotropy_stretch, contact, support
from pushfit.mechanics.containers import Contact, Parameters, Scalar, as_float
from pushfit.mechanics.numerics import norm2


class Coordinates(eqx.Module):
    """Coordinates in which data and prior part: the first five meet linear forces.

    Args:
        ln_A: Log of the normal series stiffness [ln N/m].
        ln_B: Log of the unrolled tangential series stiffness [ln N/m].
        ln_C_rr: Log of the rolling friction coefficient.
        f1: Anisotropy of the tensor B.
        f2: Anisotropy of the tensor B.
        ln_r: Log of r = K_sn / K_dn.
        ln_s: Log of s = K_st L² / C_d.
        ln_L: Log of the distance between the contacts [ln m].
    """

    ln_A: Scalar = eqx.field(converter=as_float)
    ln_B: Scalar = eqx.field(converter=as_float)
    ln_C_rr: Scalar = eqx.field(converter=as_float)
    f1: Scalar = eqx.field(converter=as_float)
    f2: Scalar = eqx.field(converter=as_float)
    ln_r: Scalar = eqx.field(converter=as_float)
    ln_s: Scalar = eqx.field(converter=as_float)
    ln_L: Scalar = eqx.field(converter=as_float)


def coordinates(params: Parameters) -> Coordinates:
    """Coordinates of parameters; inverse of `parameters`.

        r = K_sn / K_dn,   s = K_st L² / C_d,   A, B and f as of `contact`

    Returns:
        Logs of numbers in SI units, and f [-]; f = 0 without an ellipse. All unbounded.

    References:
        Eqs. (6), (10) for A and B.
    """
    group = contact(params)
    return Coordinates(
        ln_A=jnp.log(group.A),
        ln_B=jnp.log(group.B),
        ln_C_rr=jnp.log(params.C_rr),
        f1=group.f1,
        f2=group.f2,
        ln_r=jnp.log(params.K_sn / params.K_dn),
        ln_s=jnp.log(group.s),
        ln_L=jnp.log(params.L),
    )


def parameters(coords: Coordinates) -> Parameters:
    """Parameters at given coordinates; inverse of `coordinates`.

        K_sn = A (1 + r),   K_dn = A (1 + 1/r)

    The others follow as in `pushfit.mechanics.combinations.support`.

    Returns:
        Stiffnesses above A and B [N/m], C_rr [-], C_d [N·m/rad] and L [m], all
        positive, and e [-].

    References:
        Eqs. (6), (10) solved for the springs.
    """
    A, r = jnp.exp(coords.ln_A), jnp.exp(coords.ln_r)
    group = Contact(
        A=A,
        B=jnp.exp(coords.ln_B),
        C_rr=jnp.exp(coords.ln_C_rr),
        f1=coords.f1,
        f2=coords.f2,
        L=jnp.exp(coords.ln_L),
        s=jnp.exp(coords.ln_s),
    )
    springs = support(group)
    return Parameters(
        K_sn=A * (1 + r),
        K_dn=A * (1 + 1 / r),
        K_st=springs.K_st,
        C_rr=group.C_rr,
        C_d=springs.C_d,
        L=group.L,
        e1=springs.e1,
        e2=springs.e2,
    )


def log_volume(coords: Coordinates) -> Scalar:
    """Log |det| of the map from coordinates to (six logs, e1, e2).

        ln |∂e/∂f| = ln( |e|/|f| · d|e|/d|f| )

    The six logs alone are mapped without change of volume, so this is 0 at f = 0
    only in the limit s -> 0 and is needed whenever the ellipse is free.

    Returns:
        Log volume ratio, never negative; 2 ln(1 + s) at f = 0 [-].
    """
    s = jnp.exp(coords.ln_s)
    half_f = norm2(coords.f1, coords.f2) / 2
    stretch = anisotropy_stretch(half_f, s)
    slope = 1 + s * jnp.cosh(half_f) / jnp.sqrt(1 + (s * jnp.sinh(half_f)) ** 2)
    return jnp.log(stretch) + jnp.log(slope)
