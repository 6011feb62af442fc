"""The combinations of the parameters that forces depend on, and the way back.

Springs in series as two numbers and a tensor, and the springs that these stand for.
Excluded: what forces make of them (`pushfit.mechanics.linear`,
`pushfit.mechanics.tilting.one_support`).

References:
    Eq. (n) is equation n of He & Zhang (2014), doi:10.1007/s11432-014-5216-3.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.mechanics.containers import Contact, Parameters, Scalar
from pushfit.mechanics.numerics import asinhc, norm2, sinhc


def support_stiffness(params: Parameters) -> Float[Array, "2 2"]:
    """Tangential stiffness tensor of the support finger.

        K = K_st expm(½ [[e1, e2], [e2, -e1]])

    Returns:
        Symmetric positive-definite matrix; K_st times the identity at e = 0 [N/m].

    References:
        The stiffness ellipse of the paper's section 3.1, static part of Eq. (1).
    """
    return params.K_st * _expm_traceless(params.e1, params.e2)


def contact(params: Parameters | Contact) -> Contact:
    """Combinations of the parameters that forces depend on.

        A = K_sn K_dn / (K_sn + K_dn),   B = (K⁻¹ + (L²/C_d) I)⁻¹,   s = K_st L² / C_d
        sinh(|f|/2) = sinh(|e|/2) / sqrt(1 + 2 s cosh(|e|/2) + s²),   f along e

    Without an ellipse B = K_st C_d / (L² K_st + C_d).

    Args:
        params: Parameters, or the combinations themselves, which pass unchanged.

    Returns:
        A below K_sn and K_dn, B below K_st, both positive [N/m]; f rounder than e [-].

    References:
        Eqs. (6), (10).
    """
    if isinstance(params, Contact):
        return params
    s = params.K_st * params.L**2 / params.C_d
    half = norm2(params.e1, params.e2) / 2
    root = jnp.sqrt(1 + 2 * s * jnp.cosh(half) + s * s)
    # Both tensors share their axes: sinh(|f|/2) = sinh(|e|/2) / root.
    scale = asinhc(jnp.sinh(half) / root) * sinhc(half) / root
    return Contact(
        A=params.K_sn * params.K_dn / (params.K_sn + params.K_dn),
        B=params.K_st / root,
        C_rr=params.C_rr,
        f1=params.e1 * scale,
        f2=params.e2 * scale,
        L=params.L,
        s=s,
    )


class Support(eqx.Module):
    """Springs that hold the object sideways: the support finger and the contact.

    Args:
        K_st: Tangential stiffness of the support finger, geometric mean [N/m].
        C_d: Rotational deformation coefficient [N·m/rad].
        e1: Ellipse shape of the support finger, along x against y [-].
        e2: Ellipse shape of the support finger, along the diagonals [-].
    """

    K_st: Scalar
    C_d: Scalar
    e1: Scalar
    e2: Scalar


def support(contact: Contact) -> Support:
    """Springs in series that the tangential combinations stand for.

        |e|/2 = |f|/2 + asinh(s sinh(|f|/2))
        K_st = B sqrt(1 + 2 s cosh(|e|/2) + s²),   C_d = K_st L² / s

    Without an ellipse K_st = B (1 + s).

    Returns:
        K_st above B [N/m], C_d [N·m/rad], and e along f, at least as long [-].

    References:
        Eq. (10) solved for the springs.
    """
    s = contact.s
    half = norm2(contact.f1, contact.f2) / 2
    stretch = anisotropy_stretch(half, s)
    K_st = contact.B * jnp.sqrt(1 + 2 * s * jnp.cosh(stretch * half) + s * s)
    return Support(
        K_st=K_st,
        C_d=K_st * contact.L**2 / s,
        e1=contact.f1 * stretch,
        e2=contact.f2 * stretch,
    )


def anisotropy_stretch(half_f: Scalar, s: Scalar) -> Scalar:
    """How much rounder turning makes the ellipse that pushes meet.

        |e| / |f| = 1 + asinh(s sinh(|f|/2)) / (|f|/2)

    Args:
        half_f: |f| / 2 [-].
        s: K_st L² / C_d [-].

    Returns:
        |e| / |f|, at least 1; 1 + s without an ellipse [-].
    """
    return 1 + s * asinhc(s * jnp.sinh(half_f)) * sinhc(half_f)


def tangential_compliance(springs: Support) -> Float[Array, "2 2"]:
    """Inverse of `support_stiffness`.

        K⁻¹ = expm(-½ [[e1, e2], [e2, -e1]]) / K_st

    Returns:
        Symmetric positive-definite matrix [m/N].
    """
    return _expm_traceless(-springs.e1, -springs.e2) / springs.K_st


def tangential_stiffness(
    contact: Contact, azimuth: Float[Array, "xy=2 *n"]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Unrolled tangential stiffness felt along an azimuth.

        B u(α),   u = (cos α, sin α),   B = |B| expm(½ [[f1, f2], [f2, -f1]])

    |B| is the number `Contact.B`; without an ellipse the tensor is |B| I.

    Returns:
        The x and y components of the force per tangential displacement [N/m].

    References:
        Eq. (10), as a tensor.
    """
    tensor = contact.B * _expm_traceless(contact.f1, contact.f2)
    x, y = azimuth
    return tensor[0, 0] * x + tensor[0, 1] * y, tensor[1, 0] * x + tensor[1, 1] * y


def rolling_limits(contact: Contact, support_span: float) -> tuple[Scalar, Scalar]:
    """Largest tangential over normal force that two supports bear without rolling.

        C_rr + |AB|/(2L) along the supports,   C_rr across them

    Returns:
        The limits along x and along y, the first never the smaller [-].

    References:
        After Eq. (8); docs/model.md, "Two supports".
    """
    return contact.C_rr + support_span / (2 * contact.L), contact.C_rr


def _expm_traceless(a: Scalar, b: Scalar) -> Float[Array, "2 2"]:
    """Expm(½ [[a, b], [b, -a]]) in closed form."""
    half = norm2(a, b) / 2
    slope = sinhc(half) / 2
    mean = jnp.cosh(half)
    return jnp.array([[mean + slope * a, slope * b], [slope * b, mean - slope * a]])
