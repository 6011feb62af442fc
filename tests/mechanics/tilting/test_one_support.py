"""Tilting mechanics against a scalar solver, potential energy, limits and slopes."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit import model
from pushfit.mechanics.combinations import support
from pushfit.mechanics.directions import critical_angle
from pushfit.mechanics.linear import linear_critical_angle
from pushfit.mechanics.tilting.one_support import (
    _rolled_guess,
    _tilted_by,
    _unrolled_guess,
    elastic_force,
    make_hold,
    rolling_force,
)
from pushfit.model import Grasp, Parameters, Pushes, contact
from tests.mechanics.statics import planar_forces
from tests.mechanics.tilting.unrolled import tilt_of
from tests.oracle import paper
from tests.problems import CASES, PUSH, TILTED_ELLIPSE, paper_parameters, sweep
from tests.tolerances import DIFFERENCE, EXACT, ROUTES

# Of fourth order; a difference of numbers near 1 carries about eps / STEP = 1e-12 of
# rounding.
STEP, DIFFERENCE_FLOOR = 2e-4, 1e-10
WEIGHTS = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}

# An error of first order falls tenfold with the push, but for the next order: a share
# of some ten times S_p / L, which is at most 1e-3 there.
NEXT_ORDER = 1e-2
LIMIT_DEG = 1e-2  # θ_c of pushes of 1e-4 and 1e-6 of their usual length [deg]
# A few times (S_p / L)⁵ = 3e-5 [rad]; half the push leaves a 32nd of an error, but for
# the next order.
GUESSED, FIFTH_POWER = 1e-4, 2**4.5
N_NEWTON = 8  # from half the tilt to rounding

# Clear of every critical angle below, from contact loss to a push straight down.
THETA_DEG = np.array([-60.0, -20.0, -1.0, 0.0, 2.0, 10.0, 30.0, 44.0, 60.0, 80.0, 90.0])
GRASPS = {
    "plain": {},
    "preload": {"preload": 0.4},
    "pressed": {"preload": 2.0},
    "soft": {"sharpness": 8.0},
    "soft and preload": {"sharpness": 8.0, "preload": 0.4},
}
every_ellipse = pytest.mark.parametrize(
    "ellipse",
    [
        pytest.param({}, id="round"),
        pytest.param(TILTED_ELLIPSE, id="ellipse"),
    ],
)
every_grasp = pytest.mark.parametrize("name", GRASPS)

forces = eqx.filter_jit(model.forces)
forward = eqx.filter_jit(model.forward)
angle = eqx.filter_jit(critical_angle)


def tilting(push_length=PUSH, **changes) -> Grasp:
    return Grasp(push_length=push_length, mechanics="tilting", **changes)


def along(found, alpha):
    """Signed tangential force along the azimuth."""
    return found.tangential_x * np.cos(alpha) + found.tangential_y * np.sin(alpha)


@every_grasp
@pytest.mark.parametrize("length", [0.04, 0.07])
def test_forces_are_those_of_a_scalar_solver(name, length):
    params = paper_parameters(L=length)
    grasp, pushes = tilting(**GRASPS[name]), sweep(THETA_DEG, [40.0])
    found = forces(params, pushes, grasp)
    expected = [
        planar_forces(paper.numbers(params), grasp, t) for t in pushes.theta.tolist()
    ]
    normal, tangential = np.transpose(expected)
    np.testing.assert_allclose(found.normal, normal, rtol=0, atol=ROUTES)
    got = along(found, pushes.alpha)
    np.testing.assert_allclose(got, tangential, rtol=0, atol=ROUTES)


def test_forces_are_those_of_a_scalar_solver_over_the_prior():
    """Truths a factor 14 apart in every stiffness, among them objects that slide."""
    rng = np.random.default_rng(0)
    middle = np.log([800.0, 2000.0, 400.0, 0.3, 0.5, 0.04])
    draws = np.exp(rng.normal(middle, [0.8] * 5 + [0.3], (60, 6)))
    pushes, grasp = sweep(THETA_DEG, [0.0]), tilting(preload=0.2)
    for draw in draws:
        params = Parameters(*draw)
        found = forces(params, pushes, grasp)
        expected = [
            planar_forces(paper.numbers(params), grasp, t)
            for t in pushes.theta.tolist()
        ]
        got = np.stack([found.normal, along(found, pushes.alpha)], axis=1)
        np.testing.assert_allclose(got, expected, rtol=0, atol=ROUTES)


@pytest.mark.slow
@every_ellipse
def test_an_unlimited_equilibrium_has_the_least_potential_energy(ellipse):
    """Springs alone: the minimum over both components of the tilt."""
    params = paper_parameters(C_rr=1e3, **ellipse)
    p = paper.numbers(params)
    stiffness = np.asarray(model.support_stiffness(params))
    pushes = sweep([20.0, 50.0, 75.0], [10.0, 70.0, 150.0])
    found = forces(params, pushes, tilting(preload=0.5))

    def strains(tilt, push):
        size = jnp.linalg.norm(tilt)
        sideways = push[:2] - p.L * jnp.sin(size) / size * tilt
        return sideways, push[2] - p.L * (1 - jnp.cos(size)), size

    def energy(tilt, push):
        sideways, pressing, size = strains(tilt, push)
        springs = 400 * pressing**2 + sideways @ stiffness @ sideways
        return springs / 2 + 0.5 * pressing + p.C_d * size**2 / 2

    @jax.jit
    def improved(tilt, push):
        curvature = jax.hessian(energy)(tilt, push)
        step = jnp.linalg.solve(curvature, jax.grad(energy)(tilt, push))
        return tilt - step, curvature

    for row, push in enumerate(push_vectors(pushes)):
        tilt = push[:2] / p.L / 2
        for _ in range(N_NEWTON):
            tilt, curvature = improved(tilt, push)
        assert np.all(np.linalg.eigvalsh(curvature) > 0)
        sideways, pressing, _ = strains(tilt, push)
        expected = [0.5 + 400 * pressing, *(stiffness @ sideways)]
        got = [found.normal[row], found.tangential_x[row], found.tangential_y[row]]
        np.testing.assert_allclose(got, expected, rtol=0, atol=ROUTES)


def push_vectors(pushes):
    """Push vectors as rows [m]."""
    return PUSH * np.stack(
        [
            np.cos(pushes.theta) * np.cos(pushes.alpha),
            np.cos(pushes.theta) * np.sin(pushes.alpha),
            np.sin(pushes.theta),
        ],
        axis=1,
    )


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("paper", marks=pytest.mark.slow),
        "preload",
        pytest.param("firm", marks=pytest.mark.slow),
        pytest.param("ellipse", marks=pytest.mark.slow),
        pytest.param("soft", marks=pytest.mark.slow),
    ],
)
def test_small_pushes_are_linear_with_an_error_that_falls_linearly(name):
    """(6)-(14) are the limit S_p / L -> 0, at forces scaled with the push."""
    case = CASES[name]
    scales = np.array([1e-2, 1e-3, 1e-4])
    # Clear of the hard switch, which moves in proportion to the push.
    pushes = case.pushes(np.array([8.0, 25.0, 33.0, 55.0, 70.0, 85.0]))
    errors = []
    for scale in scales:
        grasp = dataclasses.replace(
            case.grasp, push_length=scale * PUSH, preload=scale * case.grasp.preload
        )
        linear = forward(case.params, pushes, grasp)
        exact = forward(
            case.params, pushes, dataclasses.replace(grasp, mechanics="tilting")
        )
        channels = ("height_normal", "height_tangential", "height")
        gap = [getattr(exact, c) - getattr(linear, c) for c in channels]
        errors.append(np.max(np.abs(gap), axis=1) / scale)
    # The error itself is quadratic in the push, relative to the force linear: tenfold
    # less push, tenfold less error, but for a share of the push itself.
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    np.testing.assert_allclose(ratios[1], 10.0, rtol=NEXT_ORDER)
    # Of the tenfold push that share is tenfold.
    np.testing.assert_allclose(ratios[0], 10.0, rtol=10 * NEXT_ORDER)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "preload", "ellipse"])
def test_the_critical_angle_of_small_pushes_is_equation_11(name):
    case = CASES[name]
    alpha = jnp.asarray(math.radians(case.alpha_deg))
    errors = []
    for scale in (1e-3, 1e-4):
        grasp = tilting(scale * PUSH, preload=scale * case.grasp.preload)
        found = math.degrees(float(angle(case.params, grasp, alpha)))
        errors.append(found - case.critical_angle_deg)
    assert abs(errors[1]) < LIMIT_DEG
    np.testing.assert_allclose(errors[0] / errors[1], 10.0, rtol=NEXT_ORDER)


def test_the_critical_angle_of_a_push_that_never_rolls_is_nan():
    case = CASES["never_rolls"]
    grasp = tilting(preload=case.grasp.preload)
    assert np.isnan(angle(case.params, grasp, jnp.asarray(0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("preload", [0.0, 0.4, 2.1])
@every_ellipse
def test_at_the_critical_angle_torque_and_rolling_friction_are_equal(preload, ellipse):
    """C_d γ = C_rr L N, from the forces alone."""
    params, grasp = paper_parameters(**ellipse), tilting(preload=preload)
    p, alpha = paper.numbers(params), jnp.asarray(0.4)
    theta_c = angle(params, grasp, alpha)
    found = forces(params, Pushes(theta_c[None], alpha[None]), grasp)
    tilt = float(tilt_of(params, grasp, theta_c, alpha))
    normal = float(found.normal[0])
    tangential = math.hypot(float(found.tangential_x[0]), float(found.tangential_y[0]))
    across = normal * math.cos(tilt) - tangential * math.sin(tilt)
    moment = p.L * (tangential * math.cos(tilt) + normal * math.sin(tilt))
    np.testing.assert_allclose(moment, p.C_d * tilt, rtol=ROUTES)
    np.testing.assert_allclose(moment, p.C_rr * p.L * across, rtol=ROUTES)


def test_the_critical_angle_grows_with_the_push():
    """The paper's holds for vanishing pushes; at 5 mm it is degrees off."""
    params = paper_parameters()
    angles = [
        math.degrees(float(angle(params, tilting(length), jnp.asarray(0.0))))
        for length in (1e-6, 2e-3, 5e-3, 8e-3)
    ]
    assert np.all(np.diff(angles) > 1.0)
    linear = linear_critical_angle(params, tilting(), jnp.asarray(0.0))
    np.testing.assert_allclose(angles[0], math.degrees(float(linear)), atol=LIMIT_DEG)


def test_a_push_at_a_kink_is_found_where_newton_steps_go_to_and_fro():
    """The two sides of the switch send each other's steps across it for ever."""
    params = Parameters(8443.0, 1067.4, 96.87, 0.21754, 2.2673, 0.0126156)
    pushes, grasp = sweep([20.0], [0.0]), tilting(preload=0.2)
    found = forces(params, pushes, grasp)
    expected = planar_forces(paper.numbers(params), grasp, math.radians(20.0))
    got = (found.normal[0], found.tangential_x[0])
    np.testing.assert_allclose(got, expected, rtol=0, atol=ROUTES)


def test_a_push_that_lifts_the_finger_off_meets_no_force():
    pushes = sweep([-80.0, -30.0], [0.0])
    found = forces(paper_parameters(), pushes, tilting())
    assert not np.any(found.in_contact)
    for name in ("normal", "tangential_x", "tangential_y"):
        np.testing.assert_allclose(getattr(found, name), 0.0, atol=EXACT)


def test_a_push_along_the_face_lifts_off_without_a_preload():
    """At 2° the push point sinks by 0.31 mm while it is pressed by 0.17 mm."""
    pushes = sweep([2.0, 5.0], [0.0])
    found = forces(paper_parameters(), pushes, tilting())
    np.testing.assert_array_equal(found.in_contact, [False, True])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["preload", "soft and preload"])
@every_ellipse
def test_slopes_equal_differences(name, ellipse):
    grasp, pushes = tilting(**GRASPS[name]), sweep(THETA_DEG[:-1], [0.0, 65.0])
    params = paper_parameters(**ellipse)
    known = {"preload": grasp.preload}
    if math.isfinite(grasp.sharpness):
        known["sharpness"] = jnp.asarray(grasp.sharpness)
    leaves, structure = jax.tree.flatten((params, known))
    x = jnp.stack(leaves)

    @jax.jit
    def heights(x):
        scaled, numbers = jax.tree.unflatten(structure, list(x))
        at = dataclasses.replace(grasp, **numbers)
        channels = forward(scaled, pushes, at)
        return jnp.stack(
            [channels.height, channels.height_normal, channels.height_tangential]
        )

    slopes, reverse = jax.jit(jax.jacfwd(heights))(x), jax.jit(jax.jacrev(heights))(x)
    np.testing.assert_allclose(reverse, slopes, rtol=EXACT, atol=EXACT)
    for i, value in enumerate(leaves):
        step = STEP * max(abs(float(value)), 1e-2)
        shift = step * jnp.eye(x.size)[i]
        difference = sum(w * heights(x + k * shift) for k, w in WEIGHTS.items()) / step
        np.testing.assert_allclose(
            slopes[..., i], difference, rtol=DIFFERENCE, atol=DIFFERENCE_FLOOR / step
        )


@pytest.mark.slow
def test_slopes_of_the_critical_angle_equal_differences():
    grasp, alpha = tilting(preload=0.4), jnp.asarray(0.4)
    leaves, structure = jax.tree.flatten(paper_parameters(**TILTED_ELLIPSE))
    x = jnp.stack(leaves)

    @jax.jit
    def theta_c(x):
        return critical_angle(jax.tree.unflatten(structure, list(x)), grasp, alpha)

    slopes = jax.jit(jax.jacfwd(theta_c))(x)
    for i, value in enumerate(leaves):
        shift = STEP * value * jnp.eye(x.size)[i]
        difference = sum(w * theta_c(x + k * shift) for k, w in WEIGHTS.items())
        expected = difference / (STEP * value)
        np.testing.assert_allclose(slopes[i], expected, rtol=DIFFERENCE, atol=EXACT)


@pytest.mark.slow
def test_slopes_are_finite_everywhere_in_the_range():
    """Contact loss, the tie and a push straight down among them."""
    params, grasp = paper_parameters(), tilting()
    theta_c = float(angle(params, grasp, jnp.asarray(0.0)))
    theta = jnp.r_[jnp.radians(jnp.linspace(-89.9, 90.0, 60)), theta_c, 0.0]
    pushes = Pushes(theta, jnp.zeros_like(theta))

    @jax.jit
    def slopes(params, pushes):
        def values(params):
            channels = model.forward(params, pushes, grasp)
            return channels.height, channels.height_normal, channels.height_tangential

        return jax.jacfwd(values)(params)

    for leaf in jax.tree.leaves(slopes(params, pushes)):
        assert np.all(np.isfinite(leaf))


@pytest.mark.parametrize(
    ("guess", "balance"),
    [(_unrolled_guess, elastic_force), (_rolled_guess, rolling_force)],
    ids=["unrolled", "rolled"],
)
def test_the_first_guess_is_off_by_the_fifth_power_of_the_push(guess, balance):
    """Half the push, a 32nd of the error: otherwise the search takes more steps."""
    group, pushes = contact(paper_parameters()), sweep([-30.0, 15.0, 40.0, 65.0], [0.0])
    errors = []
    for length in (PUSH, PUSH / 2):
        hold = make_hold(
            group,
            tilting(length),
            elevation=pushes.elevation,
            azimuth=pushes.azimuth,
        )
        start = guess(hold)
        found = start - eqx.filter_jit(_tilted_by)(balance, hold, start)
        errors.append(np.abs(found))
    assert np.all(errors[0] < GUESSED)
    assert np.all(errors[0] / errors[1] > FIFTH_POWER)


def test_each_push_is_solved_as_if_it_were_alone():
    params, grasp, pushes = paper_parameters(), tilting(), sweep(THETA_DEG, [0.0])
    together = forces(params, pushes, grasp)
    for row in (3, 5, 8):
        alone = forces(params, sweep(THETA_DEG[row : row + 1], [0.0]), grasp)
        np.testing.assert_allclose(together.normal[row], alone.normal[0], rtol=EXACT)


def test_the_springs_come_back_from_the_combinations():
    params = paper_parameters(**TILTED_ELLIPSE)
    springs = support(contact(params))
    for name in ("K_st", "C_d", "e1", "e2"):
        np.testing.assert_allclose(
            getattr(springs, name), getattr(params, name), rtol=EXACT
        )
