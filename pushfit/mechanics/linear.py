"""The paper's Eqs. (6)-(11): forces of small pushes, and where rolling ends.

Excluded: objects that tilt (`pushfit.mechanics.tilting.one_support`).

References:
    Eq. (n) is equation n of He & Zhang (2014), doi:10.1007/s11432-014-5216-3.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from pushfit.mechanics.combinations import (
    contact,
    rolling_limits,
    support_stiffness,
    tangential_stiffness,
)
from pushfit.mechanics.containers import (
    Contact,
    Forces,
    Grasp,
    Parameters,
    Pushes,
    Scalar,
    Vector,
    unit_vector,
)
from pushfit.mechanics.numerics import norm2, softclip

# θ and α of one push [rad].
PushAngles = tuple[Scalar, Scalar]


def linear_forces(params: Parameters | Contact, pushes: Pushes, grasp: Grasp) -> Forces:
    """Contact forces of small pushes.

        F_n = |F_0 + A S_p sin θ|
        F_pt = softmin(C_rr F_n, |B u(α)| S_p cos θ)   along B u(α)

    With a hard transition softmin is the plain minimum, without an ellipse |B u| = B.
    With `Grasp.support_span` the limit is a box: C_rr F_n across the supports and
    (C_rr + |AB|/(2L)) F_n along them, taken per component.

    Returns:
        Forces of every push; F_n is never negative [N]. Without a preload all pushes
        are in contact, with one those whose F_0 + A S_p sin θ is not negative.

    References:
        Eqs. (6), (8), (10).
    """
    group = contact(params)
    cosine, sine = pushes.elevation
    pressed = grasp.preload + group.A * grasp.push_length * sine
    # |.| makes an unloaded contact even in θ, as Eqs. (12)-(14) are.
    normal = jnp.abs(pressed)
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
        in_contact=(grasp.preload <= 0) | (pressed >= 0),
    )


def limited_tangential(
    group: Contact,
    grasp: Grasp,
    *,
    displacement: Float[Array, " n"],
    azimuth: Float[Array, "xy=2 n"],
    normal: Float[Array, " n"],
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Tangential force of springs B that rolling limits.

        F_pt = softmin(C_rr F_n, |B u(α)| d)   along B u(α)

    With two supports each component has the limit of its axis, `rolling_limits`.

    Args:
        displacement: d, tangential displacement of each push [m].
        normal: F_n, not negative, which sets the limit [N].

    Returns:
        Components along and across the supports, signed as those of d B u(α) [N].

    References:
        Eqs. (8), (10).
    """
    stiffness_x, stiffness_y = tangential_stiffness(group, azimuth)
    if grasp.support_span is None:
        stiffness = norm2(stiffness_x, stiffness_y)
        limit = group.C_rr * normal
        ratio = softclip(stiffness * displacement, limit, grasp.sharpness) / stiffness
        return ratio * stiffness_x, ratio * stiffness_y
    limit_x, limit_y = rolling_limits(group, grasp.support_span)
    return (
        softclip(stiffness_x * displacement, limit_x * normal, grasp.sharpness),
        softclip(stiffness_y * displacement, limit_y * normal, grasp.sharpness),
    )


def linear_critical_angle(
    params: Parameters | Contact, grasp: Grasp, alpha: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Elevation below which the object rolls in small pushes.

        θ_c = atan(|B u(α)| / (A C_rr)) - arcsin(C_rr F_0 / (S_p R))
        R = sqrt(|B u(α)|² + (A C_rr)²)

    The first term is the paper's, the second moves it by the preload. With two supports
    it is the larger of the angles about the two axes: below it one of them rolls.

    Returns:
        θ_c in (-π/2, π/2]; π/2 in the frictionless limit; NaN where the contact never
        rolls because C_rr F_0 > S_p R [rad].

    References:
        Eq. (11).
    """
    group = contact(params)
    x, y = tangential_stiffness(group, unit_vector(alpha))
    if grasp.support_span is None:
        return _switch_angle(norm2(x, y), group.C_rr, A=group.A, grasp=grasp)
    limit_x, limit_y = rolling_limits(group, grasp.support_span)
    about_y = _switch_angle(jnp.abs(x), limit_x, A=group.A, grasp=grasp)
    about_x = _switch_angle(jnp.abs(y), limit_y, A=group.A, grasp=grasp)
    return jnp.fmax(about_y, about_x)


def implied_tilt(params: Parameters, pushes: Pushes, grasp: Grasp) -> Vector:
    """Tilt of the object that the linear solution implies.

        γ = |S_pt - K⁻¹ F_pt| / L,   S_pt = S_p cos θ u(α)

    K is that of `support_stiffness`. Unrolled it bends the contact, T = C_d γ; rolled
    it is larger, by what the object has rolled. Above about 2° the push is too large
    for linear mechanics.

    Returns:
        γ of every push, not negative [rad].

    References:
        Eqs. (3)-(5), (9), with S_dt = 0.
    """
    force = linear_forces(params, pushes, grasp)
    tangential = jnp.stack([force.tangential_x, force.tangential_y])
    displacement = grasp.push_length * pushes.elevation[0]
    S_pt = displacement[None] * pushes.azimuth
    S_rt = S_pt - jnp.linalg.solve(support_stiffness(params), tangential)
    return norm2(*S_rt) / params.L


def critical_B(group: Contact, grasp: Grasp, direction: PushAngles) -> Scalar:
    """B with which a push just does not roll.

        B = C_rr (F_0/S_p + A sin θ) / (|u_e| cos θ)
        u_e = expm(½ [[f1, f2], [f2, -f1]]) u(α)

    u_e is u(α) without an ellipse. With two supports it is the smaller of the B of the
    two axes, with |u_e| one component and C_rr the limit of that axis.

    Returns:
        B, not positive where no spring is soft enough [N/m].

    References:
        Eq. (11) solved for B.
    """
    x, y = _unit_stiffness(group, direction)
    pressed = _pressed(group, grasp, direction)
    if grasp.support_span is None:
        return pressed * group.C_rr / norm2(x, y)
    limit_x, limit_y = rolling_limits(group, grasp.support_span)
    # θ_c is the larger of the angles about both axes. Along one the other needs
    # nothing, and its limit over nothing would have no slope.
    return pressed / jnp.maximum(jnp.abs(x) / limit_x, jnp.abs(y) / limit_y)


def critical_C_rr(group: Contact, grasp: Grasp, direction: PushAngles) -> Scalar:
    """Rolling friction with which a push just does not roll.

        C_rr = q |u_e|,   q = B cos θ / (F_0/S_p + A sin θ),   u_e as in `critical_B`

    With two supports neither axis may roll, and along them the span bears its share:

        C_rr = max(q |u_ex| - |AB|/(2L), q |u_ey|)

    Without a preload it has no bound towards θ = 0, and no slope there.

    Returns:
        C_rr, negative where the push has lost contact, q < 0 [-].

    References:
        Eq. (11) solved for C_rr.
    """
    x, y = _unit_stiffness(group, direction)
    pressed = _pressed(group, grasp, direction)
    if grasp.support_span is None:
        return group.B * norm2(x, y) / pressed
    limit_x, _ = rolling_limits(group, grasp.support_span)
    needed = group.B / pressed
    return jnp.maximum(
        needed * jnp.abs(x) - (limit_x - group.C_rr), needed * jnp.abs(y)
    )


def critical_A(group: Contact, grasp: Grasp, direction: PushAngles) -> Scalar:
    """A with which a push on one support just does not roll.

        A = (B |u_e| cos θ / C_rr - F_0/S_p) / sin θ,   u_e as in `critical_B`

    It has no bound towards θ = 0, and no slope there.

    Returns:
        A, not positive where no spring makes the push tie [N/m].

    References:
        Eq. (11) solved for A.
    """
    x, y = _unit_stiffness(group, direction)
    sine, cosine = jnp.sin(direction[0]), jnp.cos(direction[0])
    ratio = group.B * norm2(x, y) * cosine / group.C_rr
    return (ratio - grasp.preload / grasp.push_length) / sine


def is_upper_tie(group: Contact, grasp: Grasp, theta: Scalar) -> Bool[Array, ""]:
    """Whether a tie at an elevation is θ_c: not beyond lift-off, nor the lower one.

    F_0/S_p + A sin θ > 0,   A + F_0/S_p sin θ ≥ 0
    """
    A, F = group.A, grasp.preload / grasp.push_length
    sine = jnp.sin(theta)
    # Below the second bound the angle is the lower end of the rolling range.
    return (F + A * sine > 0) & (A + F * sine >= 0)


def _unit_stiffness(group: Contact, direction: PushAngles) -> tuple[Scalar, Scalar]:
    """B u(α) / B [-]."""
    unit = eqx.tree_at(lambda c: c.B, group, jnp.ones_like(group.B))
    return tangential_stiffness(unit, unit_vector(direction[1]))


def _pressed(group: Contact, grasp: Grasp, direction: PushAngles) -> Scalar:
    """Normal force over the tangential displacement of a push [N/m]."""
    sine, cosine = jnp.sin(direction[0]), jnp.cos(direction[0])
    return (grasp.preload / grasp.push_length + group.A * sine) / cosine


def _switch_angle(
    stiffness: Float[Array, "*n"], limit: Scalar, *, A: Scalar, grasp: Grasp
) -> Float[Array, "*n"]:
    """Elevation at which the unrolled force equals the rolling limit."""
    radius = jnp.sqrt(stiffness**2 + (A * limit) ** 2)
    sine = limit * grasp.preload / (grasp.push_length * radius)
    never_rolls = sine > 1
    lowered = jnp.arcsin(jnp.where(never_rolls, 0.0, sine))
    # arctan2, not arctan of the ratio: finite value and gradient at C_rr = 0.
    angle = jnp.arctan2(stiffness, A * limit) - lowered
    return jnp.where(never_rolls, jnp.nan, angle)
