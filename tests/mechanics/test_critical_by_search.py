"""Where rolling ends by forces alone, against closed forms of the paper's equations."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.mechanics import critical_by_search, linear
from pushfit.mechanics.linear import critical_C_rr, linear_critical_angle
from pushfit.model import Contact, Grasp, contact
from tests.problems import CASES, PUSH, TILTED_ELLIPSE, paper_parameters
from tests.tolerances import EXACT

SLOPE = 1e-6  # `falling_root` promises derivatives to 1e-7
AZIMUTHS = jnp.radians(jnp.array([0.0, 20.0, 75.0, 90.0, 160.0]))

search = eqx.filter_jit(critical_by_search.searched_critical_angle)
friction = eqx.filter_jit(critical_by_search.searched_critical_friction)


@pytest.mark.parametrize("name", CASES)
def test_the_search_finds_the_angle_of_the_closed_form(name):
    params, grasp = CASES[name].params, CASES[name].grasp
    expected = linear_critical_angle(params, grasp, AZIMUTHS)
    np.testing.assert_allclose(
        search(params, grasp, AZIMUTHS), expected, rtol=EXACT, atol=EXACT
    )


def test_without_friction_everything_rolls():
    params = paper_parameters(C_rr=0.0)
    assert search(params, Grasp(PUSH), jnp.asarray(0.3)) == math.pi / 2


@pytest.mark.parametrize("preload", [0.0, 1.0])
def test_the_angle_has_the_slopes_of_the_closed_form(preload):
    grasp = Grasp(PUSH, preload)
    group = contact(paper_parameters(**TILTED_ELLIPSE))
    found, expected = (
        eqx.filter_jit(jax.grad(lambda g, f=f: f(g, grasp, jnp.asarray(0.7))))(group)
        for f in (critical_by_search.searched_critical_angle, linear_critical_angle)
    )
    for name in ("A", "B", "C_rr", "f1", "f2"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), rtol=SLOPE, err_msg=name
        )


@pytest.mark.parametrize("span", [None, 0.02])
def test_the_friction_that_holds_is_that_of_the_closed_form(span):
    grasp = Grasp(PUSH, 0.5, support_span=span)
    group: Contact = contact(paper_parameters(**TILTED_ELLIPSE))
    for alpha in AZIMUTHS:
        direction = (jnp.asarray(0.6), alpha)
        expected = critical_C_rr(group, grasp, direction)
        np.testing.assert_allclose(
            friction(group, grasp, direction), expected, rtol=EXACT
        )


@pytest.mark.parametrize(
    ("name", "span"),
    [("A", None), ("B", None), ("B", 0.01), ("C_rr", None), ("C_rr", 0.01)],
)
def test_a_contact_made_to_just_not_roll_has_that_critical_angle(name, span):
    grasp = Grasp(PUSH, 0.5, support_span=span)
    group = contact(paper_parameters(**TILTED_ELLIPSE))
    theta, alpha = jnp.asarray(0.4), jnp.asarray(0.7)
    value = getattr(linear, f"critical_{name}")(group, grasp, (theta, alpha))
    held = dataclasses.replace(group, **{name: value})
    np.testing.assert_allclose(
        linear_critical_angle(held, grasp, alpha), theta, rtol=EXACT
    )
    assert linear.is_upper_tie(held, grasp, theta)


@pytest.mark.parametrize(
    ("alpha_deg", "span", "by_f1"), [(0.0, 0.02, -1), (90.0, 0, 1)]
)
def test_a_push_along_an_axis_of_two_supports_ties_by_that_axis_alone(
    alpha_deg, span, by_f1
):
    """B = C (F_0/S_p + A sin θ)/cos θ · e^(∓f1/2), C the limit of the axis."""
    grasp = Grasp(PUSH, 0.5, support_span=0.02)
    group, theta = contact(paper_parameters()), 0.4
    direction = (jnp.asarray(theta), jnp.asarray(math.radians(alpha_deg)))
    B, slopes = jax.value_and_grad(linear.critical_B)(group, grasp, direction)
    pressed = (0.5 / PUSH + group.A * math.sin(theta)) / math.cos(theta)
    limit = group.C_rr + span / (2 * group.L)
    np.testing.assert_allclose(B, limit * pressed, rtol=EXACT)
    found = [slopes.A, slopes.C_rr, slopes.f1]
    expected = [limit * math.tan(theta), pressed, by_f1 * B / 2]
    np.testing.assert_allclose(found, expected, rtol=EXACT)
    assert np.isfinite(slopes.f2)


def test_a_push_that_lifts_off_is_held_by_no_friction():
    direction = (jnp.asarray(-1.2), jnp.asarray(0.0))
    assert np.isnan(friction(paper_parameters(), Grasp(PUSH, 0.5), direction))


def test_friction_does_not_depend_on_how_soft_the_transition_is():
    direction = (jnp.asarray(0.6), jnp.asarray(0.0))
    grasp = Grasp(PUSH, 0.5)
    soft = dataclasses.replace(grasp, sharpness=2.0)
    assert friction(paper_parameters(), soft, direction) == friction(
        paper_parameters(), grasp, direction
    )
