"""Fingertips that roll on a tilted object, against statics written without JAX."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit import model
from pushfit.mechanics.directions import critical_angle
from pushfit.mechanics.tilting.critical_tilt import critical_friction
from pushfit.model import Grasp, support_stiffness
from tests.mechanics.statics import Slab
from tests.mechanics.tilting.unrolled import tilt_of
from tests.problems import PUSH, TILTED_ELLIPSE, paper_parameters, sweep
from tests.tolerances import DIFFERENCE, EXACT

STATICS = 1e-9  # root finders to 1e-11 N, of forces of about a newton
ENERGY = 1e-6  # a minimum is known to the root of the rounding of its depth
RADII = [0.001, 0.008, 0.03]
# Below some 4° a push without a preload loses contact, which the statics cannot.
THETA_DEG = np.array([10.0, 20.0, 35.0, 50.0, 70.0, 85.0])

forces = eqx.filter_jit(model.forces)
angle = eqx.filter_jit(critical_angle)


def tipped(radius, **changes) -> Grasp:
    return Grasp(PUSH, mechanics="tilting", tip_radius=radius, **changes)


@pytest.mark.parametrize(
    ("sharpness", "span"),
    [
        (math.inf, None),
        pytest.param(math.inf, 0.06, marks=pytest.mark.slow),
        pytest.param(6.0, None, marks=pytest.mark.slow),
        pytest.param(6.0, 0.06, marks=pytest.mark.slow),
    ],
)
def test_tips_of_no_radius_are_points(span, sharpness):
    """One support to the last digit but one, and so its critical angle."""
    params = paper_parameters(**TILTED_ELLIPSE)
    changes = {"preload": 0.4, "support_span": span, "sharpness": sharpness}
    # Six at a time, as in the tests below: one program serves.
    for theta_deg in np.arange(0.0, 91.0, 10.0).reshape(5, 2):
        pushes = sweep(theta_deg, [0.0, 40.0, 90.0])
        found = forces(params, pushes, tipped(0.0, **changes))
        points = forces(params, pushes, tipped(None, **changes))
        for name in ("normal", "tangential_x", "tangential_y"):
            np.testing.assert_allclose(
                getattr(found, name), getattr(points, name), rtol=EXACT, atol=EXACT
            )
    alpha = jnp.radians(jnp.array([0.0, 40.0, 90.0]))
    np.testing.assert_allclose(
        angle(params, tipped(0.0, **changes), alpha),
        angle(params, tipped(None, **changes), alpha),
        rtol=EXACT,
    )


@pytest.mark.parametrize("span", [None, 0.06])
@pytest.mark.parametrize("preload", [0.0, 1.0])
@pytest.mark.parametrize("friction", [0.25, 0.8])
@pytest.mark.parametrize("radius", RADII)
def test_forces_are_those_of_a_slab_at_rest(radius, friction, preload, span):
    """Across two supports the object rolls as on one."""
    slab = Slab(radius=radius, C_rr=friction, F_0=preload)
    params = paper_parameters(C_rr=friction)
    grasp = tipped(radius, preload=preload, support_span=span)
    found = forces(params, sweep(THETA_DEG, [90.0]), grasp)
    expected = np.array([slab.pushed(t, PUSH)[:2] for t in np.radians(THETA_DEG)])
    np.testing.assert_allclose(found.normal, expected[:, 0], rtol=0, atol=STATICS)
    np.testing.assert_allclose(found.tangential_y, expected[:, 1], rtol=0, atol=STATICS)


@pytest.mark.parametrize("span", [None, 0.06])
@pytest.mark.parametrize("alpha_deg", [0.0, 40.0, 110.0])
def test_an_object_that_does_not_roll_has_the_least_energy(alpha_deg, span):
    params = paper_parameters(C_rr=1e3, **TILTED_ELLIPSE)
    slab = Slab(radius=0.008, F_0=0.5)
    grasp = tipped(0.008, preload=0.5, support_span=span)
    found = forces(params, sweep([15.0, 50.0], [alpha_deg]), grasp)
    stiffness = np.asarray(support_stiffness(params))
    expected = np.array(
        [
            slab.leaned(stiffness, math.radians(t), PUSH, math.radians(alpha_deg))
            for t in (15.0, 50.0)
        ]
    )
    got = np.stack([found.normal, found.tangential_x, found.tangential_y], axis=1)
    np.testing.assert_allclose(got, expected, rtol=0, atol=ENERGY)


@pytest.mark.parametrize("span", [None, pytest.param(0.06, marks=pytest.mark.slow)])
@pytest.mark.parametrize("preload", [0.0, 0.4])
@pytest.mark.parametrize("radius", RADII)
def test_the_critical_angle_is_that_of_the_statics(radius, preload, span):
    slab = Slab(radius=radius, C_rr=0.3, F_0=preload)
    grasp = tipped(radius, preload=preload, support_span=span)
    params, alpha = paper_parameters(C_rr=0.3), jnp.asarray(math.pi / 2)
    expected = slab.critical_angle(PUSH)
    np.testing.assert_allclose(angle(params, grasp, alpha), expected, rtol=STATICS)
    tilt = Slab(**{**vars(slab), "C_rr": 1e6}).pushed(expected, PUSH)[2]
    found = tilt_of(params, grasp, jnp.asarray(expected), alpha)
    np.testing.assert_allclose(found, tilt, rtol=STATICS)
    friction = critical_friction(params, grasp, (jnp.asarray(expected), alpha))
    np.testing.assert_allclose(friction, 0.3, rtol=STATICS)


def test_tips_that_roll_right_the_object():
    """The larger they are, the more force a lean takes."""
    pushes = sweep(THETA_DEG, [0.0])
    sizes = [
        forces(paper_parameters(C_rr=1e3), pushes, tipped(r)).tangential_x
        for r in (None, *RADII)
    ]
    assert np.all(np.diff(sizes, axis=0) > 0)


@pytest.mark.parametrize("span", [None, pytest.param(0.06, marks=pytest.mark.slow)])
def test_forces_have_the_slope_of_their_differences_in_the_radius(span):
    params, pushes = paper_parameters(), sweep([20.0, 60.0], [90.0])

    @eqx.filter_jit
    def sizes(radius):
        found = model.forces(params, pushes, tipped(radius, support_span=span))
        return found.tangential_y + found.normal

    step = 1e-6
    difference = (sizes(0.008 + step) - sizes(0.008 - step)) / (2 * step)
    slopes = eqx.filter_jit(jax.jacrev(sizes))(0.008)
    np.testing.assert_allclose(slopes, difference, rtol=DIFFERENCE)
