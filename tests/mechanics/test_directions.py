"""Critical angle and best direction against root finding, search and cases by hand."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st

from pushfit.mechanics import directions
from pushfit.mechanics.directions import soft_axis
from pushfit.model import Grasp, Parameters
from tests.oracle import paper
from tests.problems import (
    CASES,
    PLAIN,
    PUSH,
    TILTED_ELLIPSE,
    ellipse,
    paper_parameters,
)
from tests.tolerances import DIFFERENCE, EXACT

ROOT = 1e-11  # brentq at its own xtol of 2e-12
STEP = np.finfo(float).eps ** (1 / 3)
# Half a degree of grid and the quartic term that the parabola ignores.
GRID_DEG = 0.02
TURN = (0.0, 2 * math.pi)

relaxed = settings(max_examples=40)
critical_angle = eqx.filter_jit(directions.critical_angle)
best_direction = eqx.filter_jit(directions.best_direction)


@pytest.mark.parametrize(
    "name", [n for n, case in CASES.items() if "no_closed_form" not in case.tags]
)
def test_critical_angle_is_the_one_worked_out_by_hand(name):
    case = CASES[name]
    alpha = jnp.radians(case.alpha_deg)
    angle = critical_angle(case.params, case.grasp, alpha)
    np.testing.assert_allclose(np.degrees(angle), case.critical_angle_deg, rtol=EXACT)


@relaxed
@given(logs=st.lists(st.floats(-5, 5), min_size=6, max_size=6))
def test_critical_angle_is_the_printed_one(logs):
    """Eq. (11), whatever the parameters."""
    params = Parameters(*np.exp(logs))
    angle = critical_angle(params, PLAIN, jnp.zeros(()))
    expected = paper.critical_angle(paper.numbers(params))
    np.testing.assert_allclose(angle, expected, rtol=EXACT)


def force_excess(params, grasp, alpha):
    """Unrolled force minus rolling limit as a function of θ."""
    p, F_0 = paper.numbers(params), float(grasp.preload)
    azimuth = np.array([math.cos(alpha), math.sin(alpha)])
    stiffness = np.linalg.norm(paper.series_tensor(p) @ azimuth)

    def excess(theta):
        normal = F_0 + paper.normal_force(p, PUSH, theta)
        return stiffness * PUSH * math.cos(theta) - p.C_rr * normal

    return excess


@pytest.mark.parametrize("preload", [0.0, 0.1, 1.0, 1.7])
@pytest.mark.parametrize("alpha", [0.0, 0.7, 2.5])
def test_critical_angle_is_where_both_forces_are_equal(preload, alpha):
    """The rolling limit exceeds the elastic force at 90° and not at the bottom."""
    params = paper_parameters(**TILTED_ELLIPSE)
    grasp = Grasp(PUSH, preload)
    excess = force_excess(params, grasp, alpha)
    grid = np.radians(np.arange(-90, 91))
    above = np.flatnonzero([excess(theta) > 0 for theta in grid])[-1]
    root = scipy.optimize.brentq(excess, grid[above], grid[above + 1])
    angle = critical_angle(params, grasp, jnp.asarray(alpha))
    np.testing.assert_allclose(angle, root, rtol=0, atol=ROOT)


def test_a_contact_that_never_rolls_has_no_critical_angle():
    """C_rr F_0 > S_p R: the rolling limit is above the elastic force at every θ."""
    case = CASES["never_rolls"]
    excess = force_excess(case.params, case.grasp, 0.0)
    assert all(excess(theta) < 0 for theta in np.linspace(-np.pi / 2, np.pi / 2, 181))
    assert np.isnan(critical_angle(case.params, case.grasp, jnp.zeros(())))


def test_critical_angle_is_differentiable_without_friction():
    """θ_c = 90° and ∂θ_c/∂C_rr = -A/B."""
    angle, gradient = jax.value_and_grad(directions.critical_angle)(
        paper_parameters(C_rr=0.0), PLAIN, jnp.zeros(())
    )
    np.testing.assert_allclose(angle, math.pi / 2, rtol=EXACT)
    np.testing.assert_allclose(gradient.C_rr, -4, rtol=EXACT)


@pytest.mark.parametrize("name", ["preload", "everything"])
def test_slope_of_the_critical_angle_matches_central_differences(name):
    case = CASES[name]
    alpha = jnp.asarray(1.1)

    @jax.jit
    def angle(x):
        return directions.critical_angle(Parameters(*x), case.grasp, alpha)

    start = np.array(jax.tree.leaves(case.params))
    gradient = jax.grad(angle)(start)
    steps = STEP * np.where(start == 0, 1.0, start)
    for i, h in enumerate(steps):
        shift = h * np.eye(8)[i]
        difference = (angle(start + shift) - angle(start - shift)) / (2 * h)
        # A difference of angles near 1 carries about eps / h of rounding.
        floor = 1e-9 * abs(STEP / h)
        np.testing.assert_allclose(gradient[i], difference, rtol=DIFFERENCE, atol=floor)


@pytest.mark.parametrize(("alpha_deg", "tangent"), [(0, 0.25), (90, 1), (80, None)])
def test_two_supports_stop_rolling_about_both_axes(alpha_deg, tangent):
    """tan θ_c is B |u_x| / (A (C_rr + |AB|/2L)) or B |u_y| / (A C_rr), the larger."""
    alpha = math.radians(alpha_deg)
    if tangent is None:
        tangent = math.sin(alpha)
    case = CASES["two_supports"]
    angle = critical_angle(case.params, case.grasp, jnp.asarray(alpha))
    np.testing.assert_allclose(angle, math.atan(tangent), rtol=EXACT)


@pytest.mark.parametrize("stiff_deg", [0.0, 30.0, 89.0, 90.0, 90.5, 179.0])
def test_soft_axis_is_the_weak_eigenvector(stiff_deg):
    params = paper_parameters(**ellipse(3.0, stiff_deg))
    values, vectors = np.linalg.eigh(paper.series_tensor(paper.numbers(params)))
    weak = vectors[:, np.argmin(values)]
    axis = float(soft_axis(params))
    assert 0 <= axis < math.pi
    aligned = abs(weak @ [math.cos(axis), math.sin(axis)])
    np.testing.assert_allclose(aligned, 1, rtol=EXACT)


# The soft axis of the ellipse case is 120°, alias -60° and 300°; 30° is the stiff one.
REACHES = [
    ((0, 180), 120),
    ((100, 130), 120),
    ((-70, -50), -60),
    ((290, 310), 300),
    ((0, 360), 120),
    ((0, 100), 100),
    ((-20, 40), -20),
    ((130, 200), 130),
    ((-10, 30), -10),
    ((31, 31), 31),
]


@pytest.mark.parametrize(("reach_deg", "expected_deg"), REACHES)
def test_best_direction_is_the_soft_axis_or_the_softer_end(reach_deg, expected_deg):
    case = CASES["ellipse"]
    low, high = map(math.radians, reach_deg)
    best = directions.best_direction(case.params, case.grasp, 1.2, reach=(low, high))
    np.testing.assert_allclose(math.degrees(best), expected_deg, rtol=EXACT)


def reference_direction(params, grasp, theta, reach):
    """Lowest height of the printed equations: a scan, then Brent's search."""
    p, grasp = paper.numbers(params), paper.numbers(grasp)

    def height(alpha):
        return paper.height(p, grasp, (theta, alpha))

    scan = np.linspace(*reach, 121)
    best, step = scan[np.argmin([height(a) for a in scan])], scan[1] - scan[0]
    nearby = np.clip([best - step, best + step], *reach)
    return scipy.optimize.minimize_scalar(height, bounds=nearby, method="bounded").x


@pytest.mark.parametrize("reach_deg", [(0, 180), (100, 175), (20, 80)])
@pytest.mark.parametrize("theta_deg", [20, 75])
@pytest.mark.parametrize("shape", [TILTED_ELLIPSE, ellipse(2.0, 100.0)])
def test_best_direction_with_two_supports_is_the_lowest_resistance(
    shape, theta_deg, reach_deg
):
    grasp = CASES["everything"].grasp
    params = paper_parameters(**shape)
    theta = math.radians(theta_deg)
    reach = tuple(map(math.radians, reach_deg))
    best = best_direction(params, grasp, jnp.asarray(theta), reach=reach)
    expected = reference_direction(params, grasp, theta, reach)
    # On the half circle 0 and π are one direction.
    apart = math.remainder(float(best) - expected, math.pi)
    assert abs(math.degrees(apart)) < GRID_DEG


def test_a_rolling_box_on_two_supports_is_pushed_across_them():
    """Along the supports it cannot roll: α* = 90° although the finger is isotropic."""
    case = CASES["two_supports"]
    best = best_direction(case.params, case.grasp, jnp.radians(15.0), reach=TURN)
    np.testing.assert_allclose(math.degrees(best), 90, atol=GRID_DEG)


def test_search_and_closed_form_agree_where_nothing_rolls():
    """A span so wide, and a C_rr so high, that the limit plays no part."""
    params = paper_parameters(C_rr=50.0, **TILTED_ELLIPSE)
    grasp = dataclasses.replace(PLAIN, support_span=10.0)
    searched = best_direction(params, grasp, jnp.asarray(1.0), reach=TURN)
    np.testing.assert_allclose(math.degrees(searched), 120, atol=GRID_DEG)
