"""Tilting mechanics: an object that leans while it is pushed, instead of only turning.

Equations (6)-(11) hold for vanishing pushes. A real push tilts the object by some
degrees: the normal force then acts off the axis, the push point sinks, and rolling
friction acts along the tilted face. Each push is one scalar equilibrium for the tilt γ,

    F_n = max( F_0 + A (S_p sin θ - L (1 - cos γ)), 0 )
    F_t = K_st (S_p cos θ - L sin γ)
    F_t L cos γ + F_n L sin γ = min( C_d γ, C_rr L N ),   N = F_n cos γ - F_t sin γ

where the fingertips are points; round ones roll (`pushfit.mechanics.tilting.hold`). It
is solved here once with each argument of the minimum. Since F_t falls with γ, the
smaller of the two forces is the equilibrium, and `softmin` of them is the soft
transition. A support with a stiffness ellipse deflects along a direction of its own,
but the object leans along its tangential force, so the equilibrium stays scalar.
Excluded: two supports, whose limits differ (`pushfit.mechanics.tilting.two_supports`).
"""

from collections.abc import Callable

import jax.numpy as jnp

from pushfit.mechanics.combinations import contact
from pushfit.mechanics.containers import (
    Contact,
    Forces,
    Grasp,
    Parameters,
    Pushes,
    Scalar,
    Vector,
)
from pushfit.mechanics.numerics import (
    Sharpness,
    is_hard,
    norm2,
    positive_part,
    softmin,
)
from pushfit.mechanics.roots import falling_root
from pushfit.mechanics.tilting.hold import Hold, Tilt, make_hold, tilted

# Largest tilt, 82° [rad]: an object that leans further has fallen over.
MAX_TILT = 1.43
# Newton steps on polynomials, cheap beside those on the equilibrium.
N_GUESSES = 2


def one_support_forces(
    params: Parameters | Contact, pushes: Pushes, grasp: Grasp
) -> Forces:
    """Contact forces of pushes that tilt an object with one rolling limit.

        F_n = max(F_0 + A (S_p sin θ - Z), 0),   S_p cos θ u = (F_t K⁻¹ + X) n
        F_t X' + F_n Z' = min(C_d γ, C_rr L N),   N = F_n cos γ - F_t sin γ

    X, Z, X' and Z' are those of `tilted`. A soft transition softens the minimum of
    forces, see `equilibrium`. Without an ellipse n = u and K = K_st; without a preload
    pushes of small θ lose contact.

    Returns:
        Forces of every push, in the frame that does not tilt; F_n is never negative
        [N]. Negative F_t, where the support pulls an object back that would lean
        further, keeps its direction.

    References:
        After Eqs. (6)-(10), the limit S_p / L → 0; docs/model.md, "Tilting".
    """
    hold = make_hold(
        contact(params), grasp, elevation=pushes.elevation, azimuth=pushes.azimuth
    )
    angle, force = equilibrium(hold, grasp.sharpness)
    tilt = tilted(hold, angle)
    lean_x, lean_y = lean_direction(hold, force, tilt)
    pressed = pressed_force(hold, tilt)
    return Forces(
        normal=positive_part(pressed),
        tangential_x=force * lean_x,
        tangential_y=force * lean_y,
        in_contact=pressed >= 0,
    )


def equilibrium(hold: Hold, sharpness: Sharpness) -> tuple[Vector, Vector]:
    """Tilt and tangential force of every push.

        F_t = softmin(F_unrolled, F_rolled)

    The two are `elastic_force` and `rolling_force`, each at the tilt of its own at
    which the push has its length; γ is the tilt at which F_t has it.

    Returns:
        γ in [0, MAX_TILT] [rad] and F_t along the lean [N]; F_t is negative where the
        object leans beyond the push.

    References:
        After Eqs. (8) and (10).
    """
    if is_hard(sharpness):

        def smaller(hold: Hold, tilt: Tilt) -> Vector:
            return jnp.minimum(elastic_force(hold, tilt), rolling_force(hold, tilt))

        start = jnp.maximum(_unrolled_guess(hold), _rolled_guess(hold))
        angle = _tilted_by(smaller, hold, start)
        return angle, smaller(hold, tilted(hold, angle))
    unrolled = unrolled_tilt(hold)
    rolled = _tilted_by(rolling_force, hold, _rolled_guess(hold))
    elastic = elastic_force(hold, tilted(hold, unrolled))
    limit = rolling_force(hold, tilted(hold, rolled))
    start = jnp.maximum(unrolled, rolled)
    smallest = jnp.minimum(elastic, limit)
    # A force that turns negative is the smaller one by far: nothing is left to soften.
    is_soft = smallest > 0
    a, b = jnp.where(is_soft, elastic, 1.0), jnp.where(is_soft, limit, 1.0)
    force = jnp.where(is_soft, softmin(a, b, sharpness), smallest)

    def given(state: tuple[Hold, Vector], angle: Vector) -> Vector:
        return state[0].along - displacement(
            state[0], state[1], tilted(state[0], angle)
        )

    return falling_root(given, (hold, force), _bracket(hold), start=start), force


def unrolled_tilt(hold: Hold) -> Vector:
    """Tilt at which the deformed contact balances the forces: nothing rolls.

        F_t X' + F_n Z' = C_d γ

    Returns:
        γ of every push in [0, MAX_TILT] [rad].

    References:
        After Eq. (9).
    """
    return _tilted_by(elastic_force, hold, _unrolled_guess(hold))


def _tilted_by(
    balance: Callable[[Hold, Tilt], Vector], hold: Hold, start: Vector
) -> Vector:
    """Tilt at which the push has just the length that the forces need."""

    def excess(hold: Hold, angle: Vector) -> Vector:
        tilt = tilted(hold, angle)
        return hold.along - displacement(hold, balance(hold, tilt), tilt)

    return falling_root(excess, hold, _bracket(hold), start=start)


def _unrolled_guess(hold: Hold) -> Vector:
    """Tilt of a push that deforms the contact, but for its fifth power [rad].

    With a stiffness ellipse the mean compliance stands for that along the lean.
    """
    compliance, pressed, sinking = _upright(hold)
    turning = hold.C_d / hold.L - pressed + _righting(hold, pressed)
    third = compliance * (turning / 2 + pressed / 6 + sinking) - hold.L / 6
    zero = jnp.zeros_like(pressed)
    return _reached(hold, (zero, hold.L + compliance * turning, zero, third))


def _rolled_guess(hold: Hold) -> Vector:
    """Tilt of a push that rolls, but for its fifth power; negative if none [rad]."""
    compliance, pressed, sinking = _upright(hold)
    mu = hold.C_rr
    # Powers of γ in F_n tan(φ - γ) where tan φ = μ.
    slope = 1 + mu**2
    steep = slope * (1 + 3 * mu**2) / 3
    steeper = mu * slope * (2 + 3 * mu**2) / 3
    force = (
        pressed * mu,
        -pressed * slope + _righting(hold, pressed),
        (pressed * slope - sinking) * mu,
        sinking * slope - pressed * steep,
        pressed * steeper + sinking * mu * (1 / 12 - slope),
    )
    leaning = (0.0, hold.L, 0.0, -hold.L / 6, 0.0)
    return _reached(
        hold, tuple(l + compliance * f for l, f in zip(leaning, force, strict=True))
    )


def _upright(hold: Hold) -> tuple[Scalar, Vector, Vector]:
    """Mean compliance [m/N], F_n before any tilt, and what γ² takes of it [N]."""
    pressed = positive_part(hold.preload + hold.A * hold.into)
    sinking = jnp.where(pressed > 0, hold.A * hold.L / 2, 0.0)
    return (hold.compliance[0] + hold.compliance[2]) / 2, pressed, sinking


def _righting(hold: Hold, pressed: Vector) -> Vector:
    """Slope of the moment by which tips that roll right the object, over L [N]."""
    length = hold.rolling_length
    return jnp.zeros_like(pressed) if length is None else pressed * length / hold.L


def _reached(hold: Hold, displacement: tuple[Vector, ...]) -> Vector:
    """Tilt of a push whose displacement is a polynomial in it [rad]."""
    powers = jnp.broadcast_arrays(*displacement)
    # As steep as that everywhere, so that no step leads far off.
    floor = hold.L / 4
    tilt = (hold.along - powers[0]) / jnp.maximum(powers[1], floor)
    for _ in range(N_GUESSES):
        tilt = jnp.clip(tilt, 0.0, MAX_TILT)
        value, slope = powers[-1], jnp.zeros_like(tilt)
        for power in powers[-2::-1]:
            value, slope = value * tilt + power, slope * tilt + value
        tilt = tilt + (hold.along - value) / jnp.maximum(slope, floor)
    return tilt


def pressed_force(hold: Hold, tilt: Tilt) -> Vector:
    """Normal force of a push at a tilt.

        F_0 + A (S_p sin θ - Z)

    Returns:
        F_n with the preload; negative where contact is lost [N].

    References:
        After Eq. (6).
    """
    return hold.preload + hold.A * (hold.into - tilt.below)


def elastic_force(hold: Hold, tilt: Tilt) -> Vector:
    """Tangential force at which the deformed contact balances the moments.

        F_t = (C_d γ - F_n Z') / X'

    Returns:
        F_t along the lean, of either sign [N].

    References:
        After Eq. (9).
    """
    normal = positive_part(pressed_force(hold, tilt))
    torque = hold.C_d / hold.L * tilt.angle
    return (torque - normal * tilt.tip) / tilt.lift


def rolling_force(hold: Hold, tilt: Tilt) -> Vector:
    """Tangential force at which rolling friction balances the moments.

        F_t X' + F_n Z' = C_rr L N,   N = F_n cos γ - F_t sin γ
        F_t = F_n (C_rr cos γ - Z'/L) / (X'/L + C_rr sin γ)

    This is F_n tan(φ - γ): the resultant leans by φ from the normal of the tilted face,
    tan φ = C_rr + ργ/L with ρ the radii of both tips, 0 for points.

    Returns:
        F_t along the lean [N]; negative where γ > φ, 0 where contact is lost.

    References:
        After Eqs. (7) and (8).
    """
    normal = positive_part(pressed_force(hold, tilt))
    held = hold.C_rr * tilt.cosine - tilt.tip
    return normal * held / (tilt.lift + hold.C_rr * tilt.sine)


def displacement(hold: Hold, force: Vector, tilt: Tilt) -> Vector:
    """How far a push must go along its azimuth for a force and a tilt along one line.

        S_p cos θ u = (F_t K⁻¹ + X) n,   |n| = 1

    Returns:
        S_p cos θ; F_t / K_st + X without an ellipse [m].

    References:
        After Eqs. (3) and (4).
    """
    (x, y), determinant, trace = _solved_lean(hold, force, tilt)
    size = norm2(x, y)
    is_stable = (trace > 0) & (size > 0)
    # Where the support would pull more than the object leans no push leads there; half
    # the trace keeps the sign and the slope for the search.
    ratio = determinant / jnp.where(is_stable, size, 1.0)
    return jnp.where(is_stable, ratio, trace / 2)


def lean_direction(hold: Hold, force: Vector, tilt: Tilt) -> tuple[Vector, Vector]:
    """Direction n in which the object leans.

        (F_t K⁻¹ + X) n = S_p cos θ u,   |n| = 1

    Returns:
        Components along and across the supports; those of u without an ellipse [-].
    """
    (x, y), _, _ = _solved_lean(hold, force, tilt)
    size = norm2(x, y)
    is_known = size > 0
    safe = jnp.where(is_known, size, 1.0)
    # An object that neither leans nor is pulled would lean along the push.
    along_x, along_y = hold.azimuth
    return jnp.where(is_known, x / safe, along_x), jnp.where(
        is_known, y / safe, along_y
    )


def _solved_lean(
    hold: Hold, force: Vector, tilt: Tilt
) -> tuple[tuple[Vector, Vector], Vector, Vector]:
    """Adj(M) u, det M and tr M of M = F_t K⁻¹ + X."""
    xx, xy, yy = (force * c for c in hold.compliance)
    xx, yy = xx + tilt.aside, yy + tilt.aside
    u_x, u_y = hold.azimuth
    return (yy * u_x - xy * u_y, xx * u_y - xy * u_x), xx * yy - xy * xy, xx + yy


def _bracket(hold: Hold) -> tuple[Vector, Vector]:
    """Angles between which a tilt is sought."""
    return jnp.zeros_like(hold.into), jnp.full_like(hold.into, MAX_TILT)
