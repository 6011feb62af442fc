"""Where an object that tilts stops to roll: critical angle, tilt and friction.

All belong to pushes of one length. Above θ_c nothing rolls, so that all follow from the
unrolled equilibrium, which is scalar also with two supports. Excluded: forces
(`pushfit.mechanics.tilting.one_support`, `pushfit.mechanics.tilting.two_supports`).

References:
    An extension of Eq. (11) of He & Zhang (2014), doi:10.1007/s11432-014-5216-3, which
    is the limit S_p / L → 0; derived in docs/model.md, "Tilting".
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from pushfit.mechanics.combinations import contact, rolling_limits, tangential_stiffness
from pushfit.mechanics.containers import (
    Contact,
    Grasp,
    Parameters,
    Scalar,
    Vector,
    unit_vector,
)
from pushfit.mechanics.numerics import norm2
from pushfit.mechanics.roots import falling_root
from pushfit.mechanics.tilting.hold import Hold, make_hold, tilted
from pushfit.mechanics.tilting.one_support import (
    MAX_TILT,
    displacement,
    elastic_force,
    lean_direction,
    pressed_force,
    unrolled_tilt,
)

# Range of the resultant force in which a critical tilt is sought, as a multiple of the
# normal force of a push straight down: the force there leans by at most 60° from it.
FORCE_RANGE = 2.0

Tie = tuple[Hold, Scalar, Scalar]


def tilting_critical_angle(
    params: Parameters | Contact, grasp: Grasp, alpha: Float[Array, "*n"]
) -> Float[Array, "*n"]:
    """Elevation below which the object rolls, of pushes of one length.

        F_t = F sin(φ - γ),   F_n = F cos(φ - γ),   γ = F L sin φ / C_d,   φ = atan C_rr
        S_p cos θ_c = F_t / K_st + L sin γ
        S_p sin θ_c = (F_n - F_0) / A + L (1 - cos γ)

    At θ_c both arguments of the minimum are equal: the resultant F leans by φ from the
    normal of the tilted face, and its moment is C_d γ. The two displacements are those
    of one push where the sum of their squares is S_p², which fixes F. Fingertips that
    roll add F cos φ ργ/L along the face, with which γ stays as it is, and have X and Z
    of `tilted` for L sin γ and L (1 - cos γ); with an ellipse S_p cos θ_c is that of
    `displacement`. With two supports θ_c is the larger of the angles at which
    C_d γ |n_i| = c_i L N about either axis.

    Returns:
        θ_c in (-π/2, π/2], the paper's for S_p / L → 0; NaN where the contact never
        rolls [rad].

    References:
        After Eq. (11); docs/model.md, "Tilting".
    """
    if grasp.support_span is not None:
        about_y, about_x = _axis_angles(params, grasp, jnp.ravel(jnp.asarray(alpha)))
        return jnp.fmax(about_y, about_x).reshape(jnp.shape(alpha))
    state, force, exists = _critical_force(params, grasp, jnp.asarray(alpha))
    along, into = _critical_displacement(state[0], state[1], force)
    angle = jnp.arctan2(jnp.where(exists, into, 0.0), jnp.where(exists, along, 1.0))
    return jnp.where(exists, angle, jnp.nan).reshape(jnp.shape(alpha))


def critical_friction(
    params: Parameters | Contact,
    grasp: Grasp,
    direction: tuple[Float[Array, "*n"], Float[Array, "*n"]],
) -> Float[Array, "*n"]:
    """Rolling friction with which a push along (θ, α) just does not roll.

        C_rr = C_d γ / (L N),   γ the tilt without rolling

    With two supports neither axis may roll, and along them the span bears its share:

        C_rr = max(C_d γ |n_x| / (L N) - |AB|/(2L), C_d γ |n_y| / (L N))

    Returns:
        C_rr, not negative; NaN where the push loses contact [-].

    References:
        After Eqs. (7) and (9).
    """
    theta, alpha = (jnp.ravel(jnp.asarray(angle)) for angle in direction)
    hold = make_hold(
        contact(params),
        grasp,
        elevation=unit_vector(theta),
        azimuth=unit_vector(alpha),
    )
    moments, across = _unrolled_moments(hold)
    is_held = across > 0
    needed = [moment / jnp.where(is_held, across, 1.0) for moment in moments]
    if grasp.support_span is None:
        friction = norm2(*needed)
    else:
        # About y the span bears its share without friction.
        span = grasp.support_span / (2 * hold.L)
        friction = jnp.maximum(needed[0] - span, needed[1])
    return jnp.where(is_held, friction, jnp.nan).reshape(jnp.shape(direction[0]))


def _unrolled_moments(hold: Hold) -> tuple[tuple[Vector, Vector], Vector]:
    """|C_d q_i| / L of an object that does not roll, and N; N = 0 without contact."""
    tilt = tilted(hold, unrolled_tilt(hold))
    tangential = elastic_force(hold, tilt)
    direction = lean_direction(hold, tangential, tilt)
    normal = pressed_force(hold, tilt)
    across = normal * tilt.cosine - tangential * tilt.sine
    torque = hold.C_d * tilt.angle / hold.L
    moments = (torque * jnp.abs(direction[0]), torque * jnp.abs(direction[1]))
    return moments, jnp.where(normal > 0, across, 0.0)


def _axis_angles(
    params: Parameters | Contact, grasp: Grasp, alpha: Vector
) -> tuple[Vector, Vector]:
    """Elevation of the tie about y and about x; NaN where there is none."""
    group, span = contact(params), grasp.support_span or 0.0
    # Both axes in one search, which then compiles once.
    is_about_y = jnp.arange(2 * alpha.size) < alpha.size
    azimuth = unit_vector(jnp.tile(alpha, 2))

    def room(
        state: tuple[Contact, Grasp, Float[Array, "xy n"]], descent: Vector
    ) -> Vector:
        """What an axis still bears, from a push straight down to a lower one."""
        group, grasp, azimuth = state
        elevation = jnp.stack([jnp.sin(descent), jnp.cos(descent)])
        hold = make_hold(group, grasp, elevation=elevation, azimuth=azimuth)
        moments, across = _unrolled_moments(hold)
        limits = rolling_limits(group, span)
        return jnp.where(
            is_about_y, limits[0] * across - moments[0], limits[1] * across - moments[1]
        )

    # By linear mechanics least is left a right angle below the tie without a preload.
    x, y = tangential_stiffness(group, azimuth)
    limits = rolling_limits(group, span)
    stiffness = jnp.where(is_about_y, jnp.abs(x), jnp.abs(y))
    tie = jnp.arctan2(stiffness, group.A * jnp.where(is_about_y, *limits))
    lowest = jnp.pi - tie
    state = (group, grasp, azimuth)
    bracket = (jnp.zeros_like(tie), lowest)
    descent = falling_root(room, state, bracket, start=jnp.pi / 2 - tie)
    angle = jnp.where(descent < lowest, jnp.pi / 2 - descent, jnp.nan)
    return angle[: alpha.size], angle[alpha.size :]


def _critical_force(
    params: Parameters | Contact, grasp: Grasp, alpha: Float[Array, "*n"]
) -> tuple[Tie, Vector, Bool[Array, " n"]]:
    """Resultant at the tie with what it depends on, and whether there is a tie."""
    group = contact(params)
    azimuth = unit_vector(jnp.ravel(alpha))
    hold = make_hold(group, grasp, elevation=jnp.zeros_like(azimuth), azimuth=azimuth)
    lean = jnp.arctan(group.C_rr)
    zero = jnp.zeros_like(hold.into)
    straight = hold.preload + hold.A * grasp.push_length
    fallen = MAX_TILT * hold.C_d / hold.L
    # Divided only where it is the smaller: C_rr = 0 has no largest force.
    is_limited = fallen * jnp.cos(lean) < FORCE_RANGE * straight * jnp.sin(lean)
    upper = zero + jnp.where(
        is_limited,
        fallen / jnp.where(is_limited, jnp.sin(lean), 1.0),
        FORCE_RANGE * straight / jnp.cos(lean),
    )

    def room(state: Tie, force: Vector) -> Vector:
        """By how much the squares fall short of S_p², as a share of it."""
        along, into = _critical_displacement(state[0], state[1], force)
        return 1 - (along**2 + into**2) / state[2] ** 2

    def closing(state: Tie, force: Vector) -> Vector:
        return jax.jvp(lambda f: room(state, f), (force,), (jnp.ones_like(force),))[1]

    state = (hold, lean, grasp.push_length)
    # With a preload the least force that a push can reach may be above zero; θ_c is
    # where the push leaves the range, not where it enters it.
    closest = jax.lax.stop_gradient(
        falling_root(closing, state, (zero, upper), start=zero)
    )
    force = falling_root(room, state, (closest, upper), start=upper)
    return state, force, (room(state, closest) > 0) & (room(state, upper) < 0)


def _critical_displacement(
    hold: Hold, lean: Scalar, force: Vector
) -> tuple[Vector, Vector]:
    """Displacement along and into the object of a push that ends at the tie."""
    tilt = tilted(hold, force * hold.L * jnp.sin(lean) / hold.C_d)
    tangential = force * jnp.sin(lean - tilt.angle)
    normal = force * jnp.cos(lean - tilt.angle)
    if hold.rolling_length is not None:
        # Off the support contact N has an arm of its own, which more force opposes.
        share = hold.rolling_length / hold.L * tilt.angle * jnp.cos(lean)
        tangential = tangential + share * force * tilt.cosine
        normal = normal + share * force * tilt.sine
    along = displacement(hold, tangential, tilt)
    return along, (normal - hold.preload) / hold.A + tilt.below
