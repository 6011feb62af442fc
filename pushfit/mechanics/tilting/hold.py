"""What holds an object that leans: springs, friction, and the arms of the forces.

Fingertips are points of the object, or balls that roll on its faces. Excluded: which
tilt is in equilibrium (`pushfit.mechanics.tilting.one_support`).
"""

import equinox as eqx
from jaxtyping import Array, Float

from pushfit.mechanics.combinations import support, tangential_compliance
from pushfit.mechanics.containers import Contact, Grasp, Scalar, Vector
from pushfit.mechanics.numerics import sine_versine


class Hold(eqx.Module):
    """Springs, friction and pushes of an equilibrium.

    Args:
        A: Normal series stiffness [N/m].
        C_rr: Rolling friction coefficient [-].
        C_d: Rotational deformation coefficient [N·m/rad].
        L: Distance between the contacts [m].
        preload: F_0 [N].
        rolling_length: ρ, the radii of both fingertips together; None for points [m].
        compliance: Inverse of the tangential stiffness of the support, xx, xy, yy
            [m/N].
        azimuth: (cos α, sin α) of each push [-].
        along: S_p cos θ [m].
        into: S_p sin θ [m].
    """

    A: Scalar
    C_rr: Scalar
    C_d: Scalar
    L: Scalar
    preload: Scalar
    rolling_length: Scalar | None
    compliance: tuple[Scalar, Scalar, Scalar]
    azimuth: tuple[Vector, Vector]
    along: Vector
    into: Vector


class Tilt(eqx.Module):
    """A tilt with what forces need of it.

    Args:
        angle: γ [rad].
        sine: sin γ [-].
        cosine: cos γ [-].
        aside: How far the push point goes aside, X [m].
        below: How far it sinks, Z [m].
        lift: Arm of F_t about the support contact over L, X' / L [-].
        tip: Arm of F_n over L, Z' / L [-].
    """

    angle: Vector
    sine: Vector
    cosine: Vector
    aside: Vector
    below: Vector
    lift: Vector
    tip: Vector


def tilted(hold: Hold, angle: Vector) -> Tilt:
    """The tilt of an angle, at most 1.5 in size, with displacements and arms.

        X = L sin γ + ρ (sin γ - γ cos γ),   X' = L cos γ + ρ γ sin γ
        Z = L (1 - cos γ) + ρ (1 - cos γ - γ sin γ),   Z' = L sin γ - ρ γ cos γ

    Points, ρ = 0, have L sin γ, L cos γ, L (1 - cos γ) and L sin γ.

    Returns:
        X and Z as `aside` and `below` [m], X'/L and Z'/L as `lift` and `tip` [-].

    References:
        After Eq. (4); docs/model.md, "Tilting".
    """
    sine, versine = sine_versine(angle)
    cosine = 1 - versine
    aside, below, lift, tip = hold.L * sine, hold.L * versine, cosine, sine
    if hold.rolling_length is not None:
        # Rolling moves each contact along its face, by its radius times γ.
        rolled = hold.rolling_length / hold.L * angle
        aside = aside + hold.rolling_length * (sine - angle * cosine)
        below = below + hold.rolling_length * (versine - angle * sine)
        lift, tip = cosine + rolled * sine, sine - rolled * cosine
    return Tilt(
        angle=angle,
        sine=sine,
        cosine=cosine,
        aside=aside,
        below=below,
        lift=lift,
        tip=tip,
    )


def make_hold(
    group: Contact,
    grasp: Grasp,
    *,
    elevation: Float[Array, "2 n"],
    azimuth: Float[Array, "2 n"],
) -> Hold:
    """What the equilibrium of every push needs, its angles as (cos, sin)."""
    springs = support(group)
    tensor = tangential_compliance(springs)
    cosine, sin = elevation
    return Hold(
        A=group.A,
        C_rr=group.C_rr,
        C_d=springs.C_d,
        L=group.L,
        preload=grasp.preload,
        rolling_length=None if grasp.tip_radius is None else 2 * grasp.tip_radius,
        compliance=(tensor[0, 0], tensor[0, 1], tensor[1, 1]),
        azimuth=(azimuth[0], azimuth[1]),
        along=grasp.push_length * cosine,
        into=grasp.push_length * sin,
    )
