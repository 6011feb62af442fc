"""Directions that the model singles out: where rolling ends, where pushing is easy.

Excluded: estimates of a direction from heights, and uncertainties.
"""

import math

import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.arguments import checked
from pushfit.errors import ConfigError
from pushfit.mechanics.combinations import contact, tangential_stiffness
from pushfit.mechanics.containers import (
    Contact,
    Grasp,
    Parameters,
    Pushes,
    Scalar,
    as_float,
    unit_vector,
)
from pushfit.mechanics.numerics import norm2
from pushfit.mechanics.ranges import check_angles

# Azimuths over the reach: at most half a degree apart, so that the parabola through the
# lowest three finds a smooth minimum to about 0.01 degrees.
N_AZIMUTHS = 361
# Of the ends of a reach [rad].
ROUNDING = 1e-9


@checked
def critical_angle(
    params: Parameters | Contact, grasp: Grasp, alpha: Float[Array, "*n"] | float
) -> Float[Array, "*n"]:
    """Elevation below which the object rolls, by the mechanics that the grasp names.

    By tilting mechanics it belongs to the push length of the grasp.

    Args:
        params: Parameters, or the combinations that forces depend on.
        grasp: Names the mechanics; its preload moves the angle.
        alpha: Azimuth of the push [rad].

    Returns:
        θ_c in (-π/2, π/2]; π/2 in the frictionless limit; NaN where the contact never
        rolls [rad].

    Raises:
        ConfigError: An azimuth that is known is over two turns, as if in degrees.

    Examples:
        >>> springs = {"K_sn": 600, "K_dn": 300, "K_st": 400}  # A = B = 200 N/m
        >>> params = Parameters(**springs, C_rr=0.5, C_d=0.25, L=0.025)
        >>> theta_c = critical_angle(params, Grasp(push_length=5e-3), 0.0)
        >>> round(math.tan(theta_c), 6)
        2.0
    """
    alpha = as_float(alpha)
    check_angles("critical_angle: alpha", alpha, most=4 * math.pi)
    return grasp.law.critical_angle(params, grasp, alpha)


def soft_axis(params: Parameters) -> Scalar:
    """Azimuth of least tangential stiffness.

        α = (π + atan2(e2, e1)) / 2   modulo π

    Returns:
        Azimuth in [0, π), arbitrary where e = 0 [rad].
    """
    return _half_turn((jnp.pi + jnp.arctan2(params.e2, params.e1)) / 2)


@checked
def best_direction(
    params: Parameters,
    grasp: Grasp,
    theta: float | Scalar,
    *,
    reach: tuple[float, float],
) -> Scalar:
    """Azimuth of least push resistance that the finger can reach.

        α* = argmin over reachable α of P_r(θ, α)

    Resistance of pushes that do not roll grows with |B u(α)|, so α* is the soft axis
    or, out of reach of it, the softer end of the reach. Pushes that roll tell nothing
    of it, but those that tilt the object, which resist most there. With two supports it
    is searched on a grid. Arbitrary where the resistance does not depend on α.

    Args:
        params: Parameters; the ellipse has the soft axis.
        grasp: Matters only where it has two supports.
        theta: Elevation of the push [rad].
        reach: Lowest and highest azimuth of the finger [rad].

    Returns:
        α* within the reach; of all azimuths, in [0, π): a push and its opposite are
        alike [rad].

    Raises:
        ConfigError: The reach ends before it begins, or after more than a turn.

    Examples:
        >>> springs = {"K_sn": 600, "K_dn": 300, "K_st": 400}
        >>> params = Parameters(**springs, C_rr=0.5, C_d=0.25, L=0.025, e1=0.8)
        >>> grasp, right = Grasp(push_length=5e-3), math.radians(90.0)
        >>> alpha = best_direction(params, grasp, 0.2, reach=(0.0, math.pi))
        >>> round(math.degrees(alpha), 6)
        90.0
        >>> alpha = best_direction(params, grasp, 0.2, reach=(0.0, right / 3))
        >>> round(math.degrees(alpha), 6)  # as far as the finger reaches
        30.0
    """
    low, high = reach
    if not low <= high <= low + 2 * math.pi + ROUNDING:
        raise ConfigError(
            f"best_direction: reach = ({low:g}, {high:g}): must be (low, high) with "
            "low <= high <= low + 2 pi, in radians",
            code="input_range",
        )
    if grasp.support_span is not None:
        return _least_resistance(params, grasp, theta, reach=reach)
    axis = soft_axis(params)
    if is_whole(reach):
        return axis
    ends = jnp.asarray(reach)
    stiffness = norm2(*tangential_stiffness(contact(params), unit_vector(ends)))
    softer_end = ends[jnp.argmin(stiffness)]
    axis = low + _half_turn(axis - low)
    return jnp.where(axis <= high, axis, softer_end)


def is_whole(reach: tuple[float, float]) -> bool:
    """Whether a finger reaches every axis, pushing one way or the other [rad]."""
    low, high = reach
    return bool(high - low >= math.pi - ROUNDING)


def _least_resistance(
    params: Parameters,
    grasp: Grasp,
    theta: float | Scalar,
    *,
    reach: tuple[float, float],
) -> Scalar:
    """Azimuth of the lowest grid point, moved to the vertex of the local parabola."""
    low, high = reach
    width = min(high - low, math.pi)
    step = width / (N_AZIMUTHS - 1)

    def force(alpha: Float[Array, " n"]) -> Float[Array, " n"]:
        # P_r is a straight line in it.
        pushes = Pushes(theta=jnp.full(alpha.shape, theta), alpha=alpha)
        found = grasp.law.forces(params, pushes, grasp)
        return norm2(norm2(found.tangential_x, found.tangential_y), found.normal)

    grid = jnp.linspace(low, low + width, N_AZIMUTHS)
    best = grid[jnp.argmin(force(grid))]
    left, middle, right = force(best + step * jnp.array([-1.0, 0.0, 1.0]))
    curvature = left - 2 * middle + right
    # At an end of the reach the lowest point need not be a minimum, and where the
    # force is flat there is no vertex: the grid point stays.
    is_vertex = (left >= middle) & (right >= middle) & (curvature > 0)
    shift = (left - right) / (2 * jnp.where(is_vertex, curvature, 1.0))
    refined = best + step * jnp.where(is_vertex, shift, 0.0)
    if is_whole(reach):
        return _half_turn(refined)
    return jnp.clip(refined, low, high)


def _half_turn(angle: Scalar) -> Scalar:
    """Angle modulo π, in [0, π) also where rounding returns π itself."""
    folded = jnp.mod(angle, jnp.pi)
    return jnp.where(folded >= jnp.pi, 0.0, folded)
