"""What the push model is told and what it says: parameters, pushes, grasp, forces.

Excluded: how parameters make the combinations that forces depend on
(`pushfit.mechanics.combinations`).

References:
    Eq. (n) is equation n of He & Zhang (2014), doi:10.1007/s11432-014-5216-3.
"""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, ArrayLike, Bool, Float

from pushfit.arguments import checked
from pushfit.errors import ConfigError
from pushfit.mechanics import ranges
from pushfit.mechanics.registry import Mechanics, mechanics_named

jax.config.update("jax_enable_x64", True)

Scalar = Float[Array, ""]
Vector = Float[Array, " n"]


def as_float(value: ArrayLike) -> Float[Array, "..."]:
    """Converter of container fields: any number becomes a float64 array.

    Raises:
        ConfigError: It is text.
    """
    if not isinstance(value, Array):
        value = np.asarray(value)
        if value.dtype.kind == "U":
            raise ConfigError(
                f"{value.tolist()!r} is text: give a number, without quotes",
                code="input_type",
            )
        value = np.asarray(value, dtype=np.float64)
    elif value.dtype == np.float64 and not value.weak_type:
        return value  # ten times as fast as converting what is one already
    # Without the type JAX compiles a program for each shape.
    return jnp.asarray(value, dtype=jnp.float64)


def _if_given(value: ArrayLike | None) -> Float[Array, "..."] | None:
    """`as_float` of what is not None."""
    return None if value is None else as_float(value)


def unit_vector(angle: Float[Array, "*n"]) -> Float[Array, "xy=2 *n"]:
    """(cos, sin) of an angle, along a first axis.

    Args:
        angle: Azimuth or elevation [rad].

    Returns:
        Components in [-1, 1] [-].
    """
    if isinstance(angle, Tracer):
        return jnp.stack([jnp.cos(angle), jnp.sin(angle)])
    # Every operation of JAX outside of a program is a program of its own.
    return as_float(np.stack([np.cos(angle), np.sin(angle)]))


class Parameters(eqx.Module):
    """The six parameters of the paper and the shape of the stiffness ellipse.

    All six are above 0, but C_rr, which may be 0. Of values that are traced, as under
    `jit`, nothing here checks it: of others the model gives numbers without a meaning.

    Args:
        K_sn: Normal stiffness of the support finger, Eqs. (5), (6) [N/m].
        K_dn: Normal contact stiffness, Eqs. (5), (6) [N/m].
        K_st: Tangential stiffness of the support finger, geometric mean of the two
            axes of the ellipse, Eq. (10) [N/m].
        C_rr: Rolling friction coefficient, Eq. (7) [-].
        C_d: Rotational deformation coefficient, Eq. (9) [N·m/rad].
        L: Distance between push contact and support contact, Eqs. (4), (7) [m].
        e1: Ellipse shape along x against y; |e| is the log ratio of the axes [-].
        e2: Ellipse shape along the diagonals; atan2(e2, e1)/2 is the stiff axis [-].

    Raises:
        ConfigError: One of the six is not above 0, or C_rr is below.
    """

    K_sn: Scalar = eqx.field(converter=as_float)
    K_dn: Scalar = eqx.field(converter=as_float)
    K_st: Scalar = eqx.field(converter=as_float)
    C_rr: Scalar = eqx.field(converter=as_float)
    C_d: Scalar = eqx.field(converter=as_float)
    L: Scalar = eqx.field(converter=as_float)
    e1: Scalar = eqx.field(converter=as_float, default=0.0)
    e2: Scalar = eqx.field(converter=as_float, default=0.0)

    def __check_init__(self) -> None:
        """Refuse what no contact has."""
        ranges.check_fields(self, ranges.OF_CONTACT)


class Pushes(eqx.Module):
    """Directions of pushes in the push frame.

    Cosines and sines are kept, as rows of `elevation` and `azimuth`: they are the same
    for every set of parameters, and cost more than all else in `forward`.

    Args:
        theta: Elevation out of the tangential plane [rad].
        alpha: Azimuth inside it, from the line through the supports [rad].

    Raises:
        ConfigError: An angle that is known is over two turns, as if in degrees, or
            theta and alpha are not as many.
    """

    theta: Vector
    alpha: Vector
    elevation: Float[Array, "2 n"]
    azimuth: Float[Array, "2 n"]

    @checked
    def __init__(self, theta: ArrayLike, alpha: ArrayLike) -> None:
        """Keep the angles and their unit vectors (cos, sin)."""
        self.theta, self.alpha = as_float(theta), as_float(alpha)
        self.elevation = unit_vector(self.theta)
        self.azimuth = unit_vector(self.alpha)

    def __check_init__(self) -> None:
        """Refuse what is no direction, such as degrees."""
        ranges.check_together("Pushes", theta=self.theta, alpha=self.alpha)
        for name in ("theta", "alpha"):
            # A direction may be turned, by a turn at most.
            angles = getattr(self, name)
            ranges.check_angles(f"Pushes: {name}", angles, most=4 * math.pi)


class Grasp(eqx.Module):
    """What is known about the grasp and the sensor, the same for every push.

    Args:
        push_length: S_p [m].
        preload: F_0, normal force before the push [N].
        gain: Sensor units per newton.
        offset: Sensor reading added to the magnitude `height` [table unit].
        sharpness: p of the soft transition, at least 1; the number infinity is the
            paper's hard switch [-].
        support_span: |AB|, distance between two supports [m]; None is the paper's
            single limit.
        tip_radius: Radius of the fingertips, pushing and supporting; matters where the
            object tilts [m]. None is a point.
        mechanics: Name of the mechanics, as in `pushfit.mechanics.registry`.

    Raises:
        ConfigError: A number that is known is none of a grasp, such as millimetres.
    """

    push_length: Scalar = eqx.field(converter=as_float)
    preload: Scalar = eqx.field(converter=as_float, default=0.0)
    gain: Scalar = eqx.field(converter=as_float, default=1.0)
    offset: Scalar = eqx.field(converter=as_float, default=0.0)
    sharpness: float | Scalar = math.inf
    support_span: float | None = eqx.field(static=True, default=None)
    tip_radius: Scalar | None = eqx.field(converter=_if_given, default=None)
    mechanics: str = eqx.field(static=True, default="linear")

    def __check_init__(self) -> None:
        """Refuse what no grasp has."""
        ranges.check_fields(self, ranges.OF_GRASP)
        try:
            self.law  # noqa: B018 - looked up
        except LookupError as error:
            raise ConfigError(
                f'Grasp: mechanics = "{self.mechanics}": {error}', code="mechanics"
            ) from error

    @property
    def law(self) -> Mechanics:
        """The mechanics; by name above, so that programs are told apart by it."""
        return mechanics_named(self.mechanics)


class Contact(eqx.Module):
    """The combinations of the parameters that forces depend on.

    Linear forces depend on the first five, and on L with two supports.

    Args:
        A: Normal series stiffness [N/m].
        B: Unrolled tangential series stiffness, geometric mean over azimuth [N/m].
        C_rr: Rolling friction coefficient [-].
        f1: Anisotropy of the tensor B, built as `Parameters.e1` is for the support.
        f2: Anisotropy of the tensor B, built as `Parameters.e2` is for the support.
        L: Distance between the contacts; enters with two supports and with tilting
            mechanics [m].
        s: K_st L² / C_d; enters with tilting mechanics only [-].
    """

    A: Scalar = eqx.field(converter=as_float)
    B: Scalar = eqx.field(converter=as_float)
    C_rr: Scalar = eqx.field(converter=as_float)
    f1: Scalar = eqx.field(converter=as_float, default=0.0)
    f2: Scalar = eqx.field(converter=as_float, default=0.0)
    L: Scalar = eqx.field(converter=as_float, default=1.0)
    s: Scalar = eqx.field(converter=as_float, default=1.0)


# Their constructors are made by Equinox, which converts what they are given.
for _record in (Parameters, Grasp):
    _record.__init__ = checked(_record.__init__)  # pyright: ignore


class Forces(eqx.Module):
    """Contact forces at the end of a push.

    Args:
        normal: Normal force with the preload, F_0 + F_pn [N].
        tangential_x: Component of F_pt along the supports [N].
        tangential_y: Component of F_pt across the supports [N].
        in_contact: False where F_0 > 0 and the push has lifted the finger off.
    """

    normal: Vector
    tangential_x: Vector
    tangential_y: Vector
    in_contact: Bool[Array, " n"]


class Channels(eqx.Module):
    """What sensors would report for each push, as changes from before the push.

    Args:
        height: Magnitude, gain (|F| - F_0) + offset [table unit].
        height_normal: Normal component, gain (F_n - F_0) [table unit].
        height_tangential: Tangential magnitude, gain F_pt [table unit].
        in_contact: False where the push has lifted the finger off.
    """

    height: Vector
    height_normal: Vector
    height_tangential: Vector
    in_contact: Bool[Array, " n"]
