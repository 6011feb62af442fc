"""The push model against the printed equations, limits, symmetries and differences."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pushfit import model
from pushfit.errors import ConfigError
from pushfit.model import (
    Grasp,
    Parameters,
    Pushes,
    contact,
    support_stiffness,
    tangential_stiffness,
)
from tests.oracle import paper
from tests.problems import (
    CASES,
    PLAIN,
    PUSH,
    SMOOTH_THETA_DEG,
    TILTED_ELLIPSE,
    paper_parameters,
    sweep,
)
from tests.tolerances import DIFFERENCE, EXACT, ROUNDING, ROUTES

STEP = np.finfo(float).eps ** (1 / 3)
# A central difference of numbers near 1 carries about eps / STEP = 4e-11 of rounding.
DIFFERENCE_FLOOR = 1e-9

SPRINGS = {"K_sn": 600.0, "K_dn": 300.0, "K_st": 400.0}
SIX = {**SPRINGS, "C_rr": 0.5, "C_d": 0.25, "L": 0.025}

relaxed = settings(max_examples=20)
# Compiled once per case; that eager agrees is a test of its own.
forces = eqx.filter_jit(model.forces)
forward = eqx.filter_jit(model.forward)
push_resistance = eqx.filter_jit(model.push_resistance)
every_case = pytest.mark.parametrize("name", CASES)


def pushes_at(theta_deg: float, alpha_deg: float = 90.0) -> Pushes:
    return sweep([theta_deg], [alpha_deg])


def directions(pushes: Pushes) -> list[tuple[float, float]]:
    return list(zip(pushes.theta, pushes.alpha, strict=True))


@every_case
def test_combinations_are_the_ones_worked_out_by_hand(name):
    case = CASES[name]
    group = contact(case.params)
    np.testing.assert_allclose([group.A, group.B], [case.A, case.B], rtol=EXACT)


@every_case
def test_forces_are_the_printed_equations(name):
    case = CASES[name]
    pushes = case.pushes()
    result = forces(case.params, pushes, case.grasp)
    for row, direction in enumerate(directions(pushes)):
        normal, tangential = paper.force(case.params, case.grasp, direction)
        got = [result.tangential_x[row], result.tangential_y[row]]
        np.testing.assert_allclose(result.normal[row], normal, rtol=ROUTES)
        # cos 90° is 6e-17 and not 0: a component that vanishes is compared with 1 N.
        np.testing.assert_allclose(got, tangential, rtol=ROUTES, atol=EXACT)


@every_case
def test_heights_are_the_printed_equations(name):
    case = CASES[name]
    pushes = case.pushes()
    expected = [paper.height(case.params, case.grasp, d) for d in directions(pushes)]
    height = forward(case.params, pushes, case.grasp).height
    np.testing.assert_allclose(height, expected, rtol=ROUTES)


def test_resistance_is_rolled_below_the_critical_angle_and_unrolled_above():
    params = paper_parameters()
    for degrees in (1, 20, 44, 46, 70, 89):
        theta = math.radians(degrees)
        case = paper.rolled_resistance if degrees < 45 else paper.unrolled_resistance
        resistance = push_resistance(params, pushes_at(degrees), PLAIN)
        np.testing.assert_allclose(
            resistance, [case(paper.numbers(params), theta)], rtol=EXACT
        )


def test_resistance_ignores_gain_and_offset():
    """Neither belongs to the mechanics."""
    case = CASES["sensor_units"]
    pushes = case.pushes()
    expected = push_resistance(case.params, pushes, PLAIN)
    resistance = push_resistance(case.params, pushes, case.grasp)
    np.testing.assert_allclose(resistance, expected, rtol=EXACT)


def test_channels_are_the_parts_of_the_magnitude():
    case = CASES["preload"]
    channels = forward(case.params, case.pushes(), case.grasp)
    F_0 = case.grasp.preload
    magnitude = np.hypot(channels.height_normal + F_0, channels.height_tangential)
    np.testing.assert_allclose(channels.height, magnitude - F_0, rtol=EXACT)


@pytest.mark.parametrize("ratio", [1.0, 1.001, 4.0, 400.0])
def test_the_tensor_is_two_springs_in_series(ratio):
    half = math.log(ratio) / 2
    params = paper_parameters(e1=2 * half * 0.6, e2=-2 * half * 0.8)
    expected = paper.series_tensor(paper.numbers(params))
    # The columns of the tensor are the forces along both axes.
    x, y = tangential_stiffness(contact(params), jnp.eye(2))
    np.testing.assert_allclose([x, y], expected, rtol=ROUTES, atol=EXACT)


def test_the_support_ellipse_has_the_axes_it_is_named_after():
    """Ratio 4 at K_st = 300: 600 N/m along 30°, 150 N/m along 120°."""
    tensor = support_stiffness(paper_parameters(**TILTED_ELLIPSE))
    for stiffness, degrees in ((600, 30), (150, 120)):
        axis = np.array(
            [math.cos(math.radians(degrees)), math.sin(math.radians(degrees))]
        )
        np.testing.assert_allclose(tensor @ axis, stiffness * axis, rtol=EXACT)


def test_combinations_stay_finite_for_an_absurd_ellipse():
    """A walker may go there; along the soft axis only the support is left in series."""
    group = contact(paper_parameters(e1=80.0))
    soft = np.linalg.norm(group.B) * math.exp(-float(group.f1) / 2)
    np.testing.assert_allclose(soft, 300 * math.exp(-40), rtol=ROUTES)


def test_force_is_continuous_at_the_critical_angle():
    """One ulp-sized step to either side of 45° where A C_rr = B."""
    angle = np.radians(45) + np.array([-1e-12, 0.0, 1e-12])
    channels = forward(paper_parameters(), Pushes(angle, np.zeros(3)), PLAIN)
    # 1e-12 rad moves a force of slope 1 by 1e-12 of itself.
    np.testing.assert_allclose(np.ptp(channels.height_tangential), 0, atol=EXACT)


@pytest.mark.parametrize("name", ["preload", "ellipse", "everything"])
def test_autodiff_matches_central_differences(name):
    case = CASES[name]
    pushes = case.pushes(SMOOTH_THETA_DEG)
    start = np.array([*jax.tree.leaves(case.params), case.grasp.preload])

    @jax.jit
    def channels(x):
        params = Parameters(*x[:8])
        grasp = eqx.tree_at(lambda g: g.preload, case.grasp, x[8])
        result = model.forward(params, pushes, grasp)
        return jnp.stack(jax.tree.leaves(result)[:3])

    step = STEP * np.where(start == 0, 1.0, np.abs(start))
    jacobian = jax.jit(jax.jacrev(channels))(start)
    scale = float(np.abs(channels(start)).max())
    for i, h in enumerate(step):
        shift = h * np.eye(9)[i]
        difference = (channels(start + shift) - channels(start - shift)) / (2 * h)
        floor = DIFFERENCE_FLOOR * scale * STEP / h
        np.testing.assert_allclose(
            jacobian[..., i], difference, rtol=DIFFERENCE, atol=floor
        )


@eqx.filter_jit
def channels_and_gradients(params, grasp, push):
    """Each channel of one push, and its gradient by every parameter."""

    def one(p):
        channels = model.forward(p, push, grasp)
        names = ("height", "height_normal", "height_tangential")
        return {name: getattr(channels, name)[0] for name in names}

    values, gradients = one(params), jax.jacrev(one)(params)
    return {name: (values[name], gradients[name]) for name in values}


@pytest.mark.parametrize("sharpness", [7.5, math.inf])
def test_nothing_is_felt_along_the_surface_and_nothing_is_learned(sharpness):
    """θ = 0 without preload: no normal force, hence no rolling limit and no force."""
    grasp = Grasp(push_length=PUSH, sharpness=sharpness)
    params = paper_parameters(**TILTED_ELLIPSE)
    result = channels_and_gradients(params, grasp, pushes_at(0.0, 20.0))
    height, gradient = result["height"]
    assert float(height) == 0.0
    assert all(float(leaf) == 0.0 for leaf in jax.tree.leaves(gradient))


@pytest.mark.parametrize("sharpness", [7.5, math.inf])
def test_a_push_along_the_normal_feels_only_the_normal_springs(sharpness):
    """θ = 90°: height A S_p, ∂height/∂K_sn = S_p (A/K_sn)²."""
    grasp = Grasp(push_length=PUSH, sharpness=sharpness)
    result = channels_and_gradients(paper_parameters(), grasp, pushes_at(90.0))
    height, gradient = result["height"]
    np.testing.assert_allclose(height, 400 * PUSH, rtol=EXACT)
    slopes = np.array(jax.tree.leaves(gradient))
    np.testing.assert_allclose(slopes[:2], [PUSH / 9, PUSH * 4 / 9], rtol=EXACT)
    others = slopes[2:]
    np.testing.assert_allclose(others, 0, atol=ROUNDING)  # cos 90° is 6e-17


@pytest.mark.parametrize("sharpness", [1.0, 7.5, math.inf])
def test_both_cases_share_the_gradient_at_the_critical_angle(sharpness):
    """Eqs. (8) and (10) are equal there, so each weighs half."""
    grasp = Grasp(push_length=PUSH, sharpness=sharpness)
    result = channels_and_gradients(paper_parameters(), grasp, pushes_at(45.0))
    tangential, slope = result["height_tangential"]
    force = 100 * PUSH * math.sqrt(0.5)
    factor = 2 ** (-1 / sharpness)
    np.testing.assert_allclose(tangential, factor * force, rtol=EXACT)
    if math.isinf(sharpness):
        # Rounding decides on which side of the kink 45° lies, and either slope is one.
        share = float(slope.C_rr) * 0.25 / force
        assert 0 <= share <= 1 + EXACT
    else:
        np.testing.assert_allclose(
            [slope.C_rr * 0.25, slope.C_d * 0.24 / (2 / 3)],
            [factor * force / 2] * 2,
            rtol=EXACT,
        )


@pytest.mark.parametrize("sharpness", [7.5, math.inf])
def test_the_frictionless_contact_is_a_legal_start(sharpness):
    """C_rr = 0 leaves the normal springs, to which C_rr adds only its square."""
    grasp = Grasp(push_length=PUSH, sharpness=sharpness)
    params = paper_parameters(C_rr=0.0)
    result = channels_and_gradients(params, grasp, pushes_at(30.0))
    height, gradient = result["height"]
    np.testing.assert_allclose(height, 400 * PUSH / 2, rtol=EXACT)
    assert float(gradient.C_rr) == 0.0
    assert np.isfinite(jax.tree.leaves(result)).all()


@pytest.mark.parametrize(
    ("alpha_deg", "by_e1", "by_e2"), [(0.0, 1, 0), (90.0, -1, 0), (45.0, 0, 1)]
)
def test_the_circle_has_the_slope_of_the_series_spring(alpha_deg, by_e1, by_e2):
    """∂ ln B/∂e = ½ B/K_st = 1/6 along an axis of the deformation, 0 at 45° to it."""
    push = pushes_at(80.0, alpha_deg)
    result = channels_and_gradients(paper_parameters(), PLAIN, push)
    _, gradient = result["height_tangential"]
    force = 100 * PUSH * math.cos(math.radians(80))
    slopes = [gradient.e1, gradient.e2]
    expected = np.array([by_e1, by_e2]) * force / 6
    np.testing.assert_allclose(slopes, expected, rtol=EXACT, atol=EXACT * force)


@pytest.mark.parametrize("alpha_deg", [0.0, 90.0])
def test_two_supports_pass_the_slope_across_a_push_along_an_axis(alpha_deg):
    """Unrolled, F = B u S_p cos θ: the turn of the force with α is B S_p cos θ."""
    grasp = Grasp(push_length=PUSH, support_span=0.06)
    theta = np.radians([80.0])

    def turned(alpha):
        force = model.forces(paper_parameters(), Pushes(theta, alpha[None]), grasp)
        return jnp.stack([force.tangential_x[0], force.tangential_y[0]])

    alpha = np.radians(alpha_deg)
    slope = jax.jacfwd(turned)(jnp.asarray(alpha))
    size = 100 * PUSH * math.cos(theta[0])
    expected = size * np.array([-math.sin(alpha), math.cos(alpha)])
    np.testing.assert_allclose(slope, expected, rtol=EXACT, atol=EXACT * size)


@pytest.mark.parametrize("name", ["soft", "preload", "everything"])
def test_a_sharp_transition_approaches_the_hard_switch(name):
    case = CASES[name]
    pushes = case.pushes()
    sharpness = 1e7
    values = []
    for p in (sharpness, math.inf):
        grasp = Grasp(PUSH, case.grasp.preload, 1, 0, p, case.grasp.support_span)
        values.append(forward(case.params, pushes, grasp).height_tangential)
    # The gap of a soft minimum is at most ln 2 / p of it.
    np.testing.assert_allclose(values[0], values[1], rtol=math.log(2) / sharpness)


@every_case
def test_an_unloaded_contact_is_even_in_elevation(name):
    """Eqs. (12)-(14) hold no sign of θ."""
    case = CASES[name]
    grasp = eqx.tree_at(lambda g: g.preload, case.grasp, jnp.zeros(()))
    pushes = case.pushes()
    mirrored = Pushes(-pushes.theta, pushes.alpha)
    heights = [forward(case.params, p, grasp).height for p in (pushes, mirrored)]
    np.testing.assert_allclose(heights[0], heights[1], rtol=EXACT)


@every_case
def test_a_direction_has_two_names_and_one_force(name):
    """(θ, α) and (180° - θ, α + 180°) are the same push."""
    case = CASES[name]
    pushes = case.pushes()
    renamed = Pushes(np.pi - pushes.theta, pushes.alpha + np.pi)
    results = [forces(case.params, p, case.grasp) for p in (pushes, renamed)]
    for one, other in zip(*map(jax.tree.leaves, results), strict=True):
        # The rounding of π is 1e-16 of forces near 1 N.
        np.testing.assert_allclose(one, other, rtol=EXACT, atol=EXACT)


def test_a_strongly_preloaded_contact_is_nearly_linear_and_signed():
    """Heights follow A S_p sin θ up to F_pt²/(2 (F_0 + F_pn)), Figure 10."""
    params = paper_parameters()
    F_0 = 1000.0
    pushes = sweep(np.linspace(-60, 60, 13), [90.0])
    height = forward(params, pushes, Grasp(PUSH, F_0)).height
    largest_tangential = 100 * PUSH
    bound = largest_tangential**2 / (2 * (F_0 - 400 * PUSH))
    np.testing.assert_allclose(height, 400 * PUSH * np.sin(pushes.theta), atol=bound)


def test_a_lifted_finger_is_flagged():
    """Contact ends where A S_p sin θ = -F_0, here at θ = -30°."""
    pushes = sweep([-80.0, -31.0, -29.0, 0.0, 50.0], [90.0])
    grasp = Grasp(PUSH, preload=1.0)
    flags = forward(paper_parameters(), pushes, grasp).in_contact
    np.testing.assert_array_equal(flags, [False, False, True, True, True])
    # Without preload a negative angle is a push on the other side, not a loss.
    assert forward(paper_parameters(), pushes, PLAIN).in_contact.all()


@relaxed
@given(factor=st.floats(1e-3, 1e3), name=st.sampled_from(["paper", "everything"]))
def test_stiffer_springs_scale_heights(factor, name):
    """All of K_sn, K_dn, K_st, C_d and F_0 times c: every force times c."""
    case = CASES[name]
    p, grasp = case.params, case.grasp
    stiffer = eqx.tree_at(
        lambda q: (q.K_sn, q.K_dn, q.K_st, q.C_d),
        p,
        replace=tuple(factor * x for x in (p.K_sn, p.K_dn, p.K_st, p.C_d)),
    )
    loaded = eqx.tree_at(lambda g: g.preload, grasp, factor * grasp.preload)
    pushes = case.pushes(SMOOTH_THETA_DEG)
    expected = forward(p, pushes, grasp).height - grasp.offset
    height = forward(stiffer, pushes, loaded).height - grasp.offset
    np.testing.assert_allclose(height, factor * expected, rtol=ROUTES)


@relaxed
@given(turn=st.floats(-10, 10))
def test_turning_ellipse_and_push_together_changes_nothing(turn):
    case = CASES["ellipse"]
    p, pushes = case.params, case.pushes(SMOOTH_THETA_DEG)
    cos, sin = math.cos(2 * turn), math.sin(2 * turn)
    turned = eqx.tree_at(
        lambda q: (q.e1, q.e2), p, (cos * p.e1 - sin * p.e2, sin * p.e1 + cos * p.e2)
    )
    expected = forward(p, pushes, case.grasp).height
    height = forward(
        turned, Pushes(pushes.theta, pushes.alpha + turn), case.grasp
    ).height
    np.testing.assert_allclose(height, expected, rtol=ROUTES)


@relaxed
@given(L=st.floats(1e-3, 1.0), r=st.floats(0.01, 100))
def test_heights_see_only_the_combinations(L, r):
    """C_d ∝ L² and K_sn against K_dn at fixed A leave every height alone."""
    p = paper_parameters()
    same = Parameters(400 * (1 + r), 400 * (1 + 1 / r), 300, 0.25, 150 * L**2, L)
    pushes = CASES["paper"].pushes()
    heights = [forward(q, pushes, PLAIN).height for q in (p, same)]
    np.testing.assert_allclose(heights[0], heights[1], rtol=EXACT)


def test_every_array_is_double_precision():
    params = Parameters(*np.ones(8, dtype=np.float32))
    grasp = Grasp(push_length=np.float32(1))
    pushes = Pushes(np.ones(2, dtype=np.float32), np.ones(2, dtype=np.float32))
    result = forward(params, pushes, grasp), forces(params, pushes, grasp)
    leaves = jax.tree.leaves((params, grasp, pushes, contact(params), result))
    # A sharpness that no program traces stays a number.
    assert {np.asarray(leaf).dtype.name for leaf in leaves} == {"float64", "bool"}


@pytest.mark.parametrize(
    ("name", "value"),
    [*((name, 0.0) for name in SIX if name != "C_rr"), ("C_rr", -0.1), ("L", np.nan)],
)
def test_what_no_contact_has_is_refused(name, value):
    with pytest.raises(ConfigError, match=f"{name} = {value:g}: must be "):
        Parameters(**SIX | {name: value})
    with pytest.raises(ConfigError, match=f"{name} = -0.1: must be "):
        Parameters(**SIX | {name: -0.1})


def test_a_contact_that_always_rolls_has_no_rolling_friction():
    assert float(Parameters(**SIX | {"C_rr": 0.0}).C_rr) == 0.0


def test_traced_parameters_are_not_judged():
    made = jax.jit(lambda value: Parameters(**SIX | {"K_sn": value}).K_sn)
    assert float(made(-1.0)) == -1.0


def test_known_parameters_are_judged_in_a_trace_as_well():
    known = jnp.asarray(0.0, dtype=float)
    with pytest.raises(ConfigError, match="L = 0: must be above 0"):
        jax.jit(lambda value: Parameters(**SIX | {"K_sn": value, "L": known}))(1.0)
