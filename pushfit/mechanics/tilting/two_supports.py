"""Tilting mechanics of an object on two supports: a lean about both axes at once.

Two supports bear more moment about y than about x, so the object may roll about one
axis and hold about the other, and its lean need not point along the force. The lean is
the rotation vector q = γ n in the tangential plane; the push point sits at
p = L (sin γ n, cos γ), and the push exerts along ∂p/∂q_i the moments

    Q_i = L (F_t · ∂(sin γ n)/∂q_i + F_n sin γ n_i)
    F_t = K (S_p cos θ u - L sin γ n)
    F_n = max( F_0 + A (S_p sin θ - L (1 - cos γ)), 0 )

for fingertips that are points; round ones roll, as in `pushfit.mechanics.tilting.hold`.
With a hard transition each axis bears the smaller of C_d q_i and its rolling limit,

    Q_i = min( C_d |q_i|, c_i L N ) sign q_i,   N = F_n cos γ - F_t·n sin γ
    c_x = C_rr + |AB| / (2 L),   c_y = C_rr

A soft one needs the moment Q_i would have had without rolling, which q_i no longer
tells: the soft minimum is of E_i = w_i Q_i + (1 - w_i) C_d q_i and c_i L N, where w_i
is the share of the support in the compliance of axis i. For small pushes L⁻¹ E is the
elastic force of `pushfit.mechanics.linear`; where nothing rolls E_i = Q_i = C_d q_i
whatever w_i is, so that the hard transition does not depend on it. Excluded: where an
object stops to roll (`pushfit.mechanics.tilting.critical_tilt`).

References:
    An extension of He & Zhang (2014), doi:10.1007/s11432-014-5216-3, whose Eqs.
    (6)-(14) are the limit S_p / L → 0; derived in docs/model.md, "Tilting".
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Complex, Float, Int

from pushfit.mechanics.combinations import contact, rolling_limits
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
    lean_factors,
    norm2,
    positive_part,
    softclip,
)
from pushfit.mechanics.tilting.hold import Hold, make_hold
from pushfit.mechanics.tilting.one_support import MAX_TILT, one_support_forces

# Relative step at which the search ends: that step leaves about its square, and the one
# after it, which also carries the derivatives, the square of that. Ten times as long,
# one in 100 000 pushes is off by 4e-11 N where the soft transition is narrow.
RTOL = 1e-6
# Steps of a push, as many as of a search with one support (`pushfit.mechanics.roots`);
# one that takes more is called not found. Not tuned further.
MAX_STEPS = 60
# Shortest share of a Newton step that must lower the residual; a shorter one is taken
# in any case, because at a kink no share may lower it.
SHORTEST = 1 / 64
# Smallest determinant of the slopes, as a share of its two products: below it these
# cancel to rounding and what is left of it, which is that of a fold.
SMALLEST_DETERMINANT = 1e-9

# Components along x and y, for every push.
PlaneVectors = tuple[Vector, Vector]
# The same as one complex number.
PlaneNumbers = Complex[Array, " n"]


class Frame(eqx.Module):
    """Springs, friction and pushes of an equilibrium on two supports.

    Args:
        hold: As with one support.
        stiffness: Tangential stiffness of the support, xx, xy, yy [N/m].
        limits: c_x and c_y, rolling limits over normal force [-].
        share: w_x and w_y, share of the support in the compliance of each axis [-].
    """

    hold: Hold
    stiffness: tuple[Scalar, Scalar, Scalar]
    limits: tuple[Scalar, Scalar]
    share: tuple[Scalar, Scalar]


class Lean(eqx.Module):
    """State of an object that leans by q.

    Args:
        pressed: F_n, negative where contact is lost [N].
        tangential: F_t [N].
        moment: Q [N·m].
        across: N, force normal to the tilted face [N].
    """

    pressed: Vector
    tangential: PlaneVectors
    moment: PlaneVectors
    across: Vector


def tilting_forces(
    params: Parameters | Contact, pushes: Pushes, grasp: Grasp
) -> Forces:
    """Contact forces of pushes that tilt an object, on one support or on two.

        F_t = K (S_p cos θ u - X n),   F_n = max(F_0 + A (S_p sin θ - Z), 0)

    at the lean q = γ n that both axes bear, see `balanced_lean`; X and Z are those of
    `tilted`, for points L sin γ and L (1 - cos γ). Those on one support are
    `one_support_forces`.

    Returns:
        Forces of every push, in the frame that does not tilt; F_n is never negative
        [N]. Where no lean was found that bears the push: no force, and not in contact.

    References:
        After Eqs. (6)-(10), the limit S_p / L → 0; docs/model.md, "Tilting".
    """
    if grasp.support_span is None:
        return one_support_forces(params, pushes, grasp)
    group = contact(params)
    frame = make_frame(group, grasp, elevation=pushes.elevation, azimuth=pushes.azimuth)
    lean, is_found = balanced_lean(frame, grasp.sharpness)
    state = leaned(frame, lean)
    x, y = state.tangential
    return Forces(
        normal=jnp.where(is_found, positive_part(state.pressed), 0.0),
        tangential_x=jnp.where(is_found, x, 0.0),
        tangential_y=jnp.where(is_found, y, 0.0),
        in_contact=is_found & (state.pressed >= 0),
    )


def make_frame(
    group: Contact,
    grasp: Grasp,
    *,
    elevation: Float[Array, "2 n"],
    azimuth: Float[Array, "2 n"],
) -> Frame:
    """What the equilibrium of every push needs, its angles as (cos, sin).

        c_x = C_rr + |AB| / (2 L),   c_y = C_rr,   w_i = 1 / (1 + L² K_ii / C_d)

    K_ii is here the inverse of the compliance of the support along axis i [N/m].

    Returns:
        Springs, limits c_i of at least C_rr and shares w_i in (0, 1).
    """
    hold = make_hold(group, grasp, elevation=elevation, azimuth=azimuth)
    xx, xy, yy = hold.compliance
    determinant = xx * yy - xy * xy
    rotation = hold.L**2 / hold.C_d
    return Frame(
        hold=hold,
        stiffness=(yy / determinant, -xy / determinant, xx / determinant),
        limits=rolling_limits(group, grasp.support_span or 0.0),
        share=(xx / (xx + rotation), yy / (yy + rotation)),
    )


def leaned(frame: Frame, lean: PlaneVectors) -> Lean:
    """Forces and moments of pushes after which the object leans by q, |q| ≤ 1.5.

        Q_i = F_t · ∂(X n)/∂q_i + F_n Z' n_i,   N = F_n cos γ - F_t · n sin γ

    with X, Z, X' and Z' of `tilted`, and F_t and F_n as in `tilting_forces`. The
    names in the code are these without powers of γ, so that q = 0 divides nothing:

        X = L γ `aside`,   X' = L (`aside` + γ² `bend`)
        Z = L γ² `below`,   Z' = L γ `tip`

    `tip` is thus `Tilt.tip` / γ; X' is L times `Tilt.lift`.

    Returns:
        F_n, negative where contact is lost, while Q_i and N have it at 0 there; F_t
        and N of either sign [N]; Q_i [N·m].

    References:
        After Eqs. (4) to (6); docs/model.md, "Tilting".
    """
    hold = frame.hold
    x, y = lean
    square = x * x + y * y
    sine, sink, turn = lean_factors(square)
    cosine = 1 - sink * square
    # X, Z and their slopes over L, but for powers of γ.
    aside, below, bend, tip = sine, sink, turn, sine
    if hold.rolling_length is not None:
        rolled = hold.rolling_length / hold.L
        aside, below = aside + rolled * (sine - cosine), below + rolled * (sink - sine)
        bend, tip = bend + rolled * (turn + sine), tip - rolled * cosine
    stretch_x = hold.along * hold.azimuth[0] - hold.L * aside * x
    stretch_y = hold.along * hold.azimuth[1] - hold.L * aside * y
    xx, xy, yy = frame.stiffness
    force_x = xx * stretch_x + xy * stretch_y
    force_y = xy * stretch_x + yy * stretch_y
    pressed = hold.preload + hold.A * (hold.into - hold.L * below * square)
    normal = positive_part(pressed)
    drawn = force_x * x + force_y * y
    outward = bend * drawn + tip * normal
    return Lean(
        pressed=pressed,
        tangential=(force_x, force_y),
        moment=(
            hold.L * (aside * force_x + outward * x),
            hold.L * (aside * force_y + outward * y),
        ),
        across=normal * cosine - sine * drawn,
    )


def unbalanced(frame: Frame, lean: PlaneVectors, sharpness: Sharpness) -> PlaneVectors:
    """Moment about each axis that nothing bears, over L; N below 0 counts as 0.

        (Q_i - softmin(|E_i|, c_i L N) sign E_i) / L
        E_i = w_i Q_i + (1 - w_i) C_d q_i

    Returns:
        About y (index x) and about x (index y); 0 in equilibrium [N].

    References:
        After Eqs. (7) and (9).
    """
    state = leaned(frame, lean)
    hold = frame.hold
    across = positive_part(state.across)
    found = []
    for i in (0, 1):
        moment = state.moment[i] / hold.L
        share = frame.share[i]
        elastic = share * moment + (1 - share) * (hold.C_d / hold.L) * lean[i]
        borne = softclip(elastic, frame.limits[i] * across, sharpness)
        found.append(moment - borne)
    return found[0], found[1]


class _Tried(eqx.Module):
    """A lean that was tried.

    Args:
        lean: q_x + i q_y [rad].
        size: Of the moments that nothing bears there, over L [N].
        step: Newton step from there [rad].
    """

    lean: PlaneNumbers
    size: Vector
    step: PlaneNumbers

    @property
    def is_settled(self) -> Bool[Array, " n"]:
        """Whether the step is short."""
        return _length(self.step) <= RTOL * _length(self.lean)

    @property
    def is_over(self) -> Bool[Array, " n"]:
        """Whether the step is short, or nothing there is a number."""
        return self.is_settled | jnp.isnan(self.size)


class _LeanSearch(eqx.Module):
    """State of a search.

    Args:
        best: What came nearest so far.
        tried: What the last step led to.
        part: Share of the Newton step from the best that was taken to it.
        n_steps: Steps taken.
    """

    best: _Tried
    tried: _Tried
    part: Vector
    n_steps: Int[Array, ""]

    def judged(self) -> tuple[_Tried, Vector]:
        """What came nearest, and the share of the Newton step to take from there."""
        is_worse = (self.tried.size >= self.best.size) & (self.part > SHORTEST)
        # Pushes whose search is over stay, so that none depends on its neighbours.
        is_taken = ~(is_worse | self.best.is_over)
        best = jax.tree.map(partial(jnp.where, is_taken), self.tried, self.best)
        return best, jnp.where(is_taken, 1.0, self.part / 2)


def balanced_lean(
    frame: Frame, sharpness: Sharpness
) -> tuple[PlaneVectors, Bool[Array, " n"]]:
    """Lean at which the supports bear every moment.

        Q_i = softmin(|E_i|, c_i L N) sign E_i,   E_i as in `unbalanced`

    Newton steps, each shortened until it lowers what is not borne. The last of them
    leaves q as it is and gives it the derivatives of the implicit function theorem.

    Returns:
        q_x and q_y to about 1e-15 of their size [rad], and whether they were found;
        without derivatives where they were not.
    """
    frozen, steady = jax.lax.stop_gradient(frame), sharpness
    if isinstance(sharpness, jax.Array):
        steady = jax.lax.stop_gradient(sharpness)

    def tried(lean: PlaneNumbers) -> _Tried:
        (x, y), residual = _newton(frozen, (lean.real, lean.imag), steady)
        # One number: the compiler would work out the slopes anew for each array.
        return _Tried(lean, norm2(*residual), x + 1j * y)

    def advance(search: _LeanSearch) -> _LeanSearch:
        best, part = search.judged()
        after = tried(_within_reach(best.lean + part * best.step))
        return _LeanSearch(best, after, part, search.n_steps + 1)

    linear = _start(frozen, steady)
    far = jnp.full(linear.shape, jnp.inf)
    upright = _Tried(jnp.zeros_like(linear), far, linear)
    # The first share is halved to a whole step: that of linear mechanics.
    first = _LeanSearch(upright, upright, jnp.full_like(far, 2.0), jnp.zeros((), int))
    last = jax.lax.while_loop(
        lambda search: (
            ~jnp.all(search.judged()[0].is_over) & (search.n_steps < MAX_STEPS)
        ),
        advance,
        first,
    )
    best, _ = last.judged()
    is_found = best.is_settled & ~jnp.isnan(best.size)
    # An object that was not found is put upright, where every slope is finite.
    found = jnp.where(is_found, _within_reach(best.lean + best.step), 0.0)
    lean = found.real, found.imag
    step, _ = _newton(frame, lean, sharpness)
    x, y = (q + jnp.where(is_found, s, 0.0) for q, s in zip(lean, step, strict=True))
    return (x, y), is_found


def _newton(
    frame: Frame, lean: PlaneVectors, sharpness: Sharpness
) -> tuple[PlaneVectors, PlaneVectors]:
    """Newton step and the moments that are not borne."""

    def residual(x: Vector, y: Vector) -> PlaneVectors:
        return unbalanced(frame, (x, y), sharpness)

    zero, one = jnp.zeros_like(lean[0]), jnp.ones_like(lean[0])
    (r_x, r_y), (xx, yx) = jax.jvp(residual, lean, (one, zero))
    _, (xy, yy) = jax.jvp(residual, lean, (zero, one))
    xx, xy, yx, yy = jax.lax.stop_gradient((xx, xy, yx, yy))
    determinant = xx * yy - xy * yx
    smallest = SMALLEST_DETERMINANT * (jnp.abs(xx * yy) + jnp.abs(xy * yx))
    is_regular = jnp.abs(determinant) > smallest
    # At a fold the derivative of the lean is infinite, and one that large serves
    # nobody.
    safe = jnp.where(is_regular, determinant, jnp.where(smallest > 0, smallest, 1.0))
    return ((xy * r_y - yy * r_x) / safe, (yx * r_x - xx * r_y) / safe), (r_x, r_y)


def _start(frame: Frame, sharpness: Sharpness) -> PlaneNumbers:
    """Lean of a small push, as linear mechanics have it."""
    hold = frame.hold
    xx, xy, yy = frame.hold.compliance
    rotation = hold.L**2 / hold.C_d
    u_x, u_y = (hold.along * u for u in hold.azimuth)
    determinant = (xx + rotation) * (yy + rotation) - xy * xy
    normal = positive_part(hold.preload + hold.A * hold.into)
    elastic = (
        ((yy + rotation) * u_x - xy * u_y) / determinant,
        ((xx + rotation) * u_y - xy * u_x) / determinant,
    )
    force_x, force_y = (
        softclip(elastic[i], frame.limits[i] * normal, sharpness) for i in (0, 1)
    )
    x = u_x - xx * force_x - xy * force_y
    y = u_y - xy * force_x - yy * force_y
    return _within_reach((x + 1j * y) / hold.L)


def _within_reach(lean: PlaneNumbers) -> PlaneNumbers:
    """The lean, or the largest one of its direction."""
    size = _length(lean)
    is_far = size > MAX_TILT
    return jnp.where(is_far, MAX_TILT / jnp.where(is_far, size, 1.0), 1.0) * lean


def _length(vector: PlaneNumbers) -> Vector:
    return norm2(vector.real, vector.imag)
