"""Coordinates in which data and prior part, and the map from them to the parameters.

All six parameters are positive, and linear forces depend on three combinations of them
(five with a stiffness ellipse). Rotating the logs so that these come first leaves the
likelihood to the first coordinates and the prior alone to the rest, the fibre.
Excluded: priors and data.
"""

import equinox as eqx
import jax.numpy as jnp

from pushfit.model import Parameters, Scalar, as_float, contact
from pushfit.numerics import asinhc, norm2, sinhc


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
    """Fitting coordinates of a set of parameters; inverse of `parameters`.

    Args:
        params: Parameters, the first six positive.

    Returns:
        Coordinates.
    """
    group = contact(params)
    return Coordinates(
        ln_A=jnp.log(group.A),
        ln_B=jnp.log(group.B),
        ln_C_rr=jnp.log(params.C_rr),
        f1=group.f1,
        f2=group.f2,
        ln_r=jnp.log(params.K_sn / params.K_dn),
        ln_s=jnp.log(params.K_st * params.L**2 / params.C_d),
        ln_L=jnp.log(params.L),
    )


def parameters(coords: Coordinates) -> Parameters:
    """Parameters at given fitting coordinates; inverse of `coordinates`.

        K_sn = A (1 + r),   K_dn = A (1 + 1/r)
        |e|/2 = |f|/2 + asinh(s sinh(|f|/2))
        K_st = B sqrt(1 + 2 s cosh(|e|/2) + s²),   C_d = K_st L² / s

    Without an ellipse K_st = B (1 + s).

    Args:
        coords: Coordinates.

    Returns:
        Parameters.
    """
    A, B, r, s = (
        jnp.exp(x) for x in (coords.ln_A, coords.ln_B, coords.ln_r, coords.ln_s)
    )
    stretch, half_f = _stretch(coords.f1, coords.f2, s)
    K_st = B * jnp.sqrt(1 + 2 * s * jnp.cosh(stretch * half_f) + s * s)
    L = jnp.exp(coords.ln_L)
    return Parameters(
        K_sn=A * (1 + r),
        K_dn=A * (1 + 1 / r),
        K_st=K_st,
        C_rr=jnp.exp(coords.ln_C_rr),
        C_d=K_st * L**2 / s,
        L=L,
        e1=coords.f1 * stretch,
        e2=coords.f2 * stretch,
    )


def log_volume(coords: Coordinates) -> Scalar:
    """Log |det| of the map from coordinates to (six logs, e1, e2).

        ln |∂e/∂f| = ln( |e|/|f| · d|e|/d|f| )

    The six logs alone are mapped without change of volume, so this is 0 at f = 0
    only in the limit s -> 0 and is needed whenever the ellipse is free.

    Args:
        coords: Coordinates.

    Returns:
        Log volume ratio, never negative.
    """
    s = jnp.exp(coords.ln_s)
    stretch, half_f = _stretch(coords.f1, coords.f2, s)
    slope = 1 + s * jnp.cosh(half_f) / jnp.sqrt(1 + (s * jnp.sinh(half_f)) ** 2)
    return jnp.log(stretch) + jnp.log(slope)


def _stretch(f1: Scalar, f2: Scalar, s: Scalar) -> tuple[Scalar, Scalar]:
    """|e| / |f| and |f| / 2."""
    half = norm2(f1, f2) / 2
    return 1 + s * asinhc(s * jnp.sinh(half)) * sinhc(half), half
