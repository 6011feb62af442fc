"""Tilting on two supports against one support, energy, a root finder and limits."""

import dataclasses
import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize

from benchmarks.speed import tilting_cost
from pushfit import model
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.mechanics.directions import best_direction, critical_angle
from pushfit.mechanics.tilting.critical_tilt import critical_friction
from pushfit.mechanics.tilting.two_supports import balanced_lean, make_frame
from pushfit.mechanics.tilting.two_supports import unbalanced as unborne
from pushfit.model import Grasp, Parameters, Pushes
from tests.mechanics.tilting.unrolled import tilt_of
from tests.oracle import paper
from tests.problems import PUSH, TILTED_ELLIPSE, ellipse, paper_parameters, sweep
from tests.tolerances import DIFFERENCE, EXACT, ROUTES

# What is left of a ratio between errors of pushes a decade apart: terms of the next
# order, at a hundredth and at a thousandth of a push.
SECOND_ORDER = (1e-1, 1e-2)
# The same of a push of a ten-thousandth, where a gap is compared with its limit.
SMALL = 1e-3

# Moments that SciPy's root finder leaves [N m]: over L, a quarter of `ROUTES`.
UNBALANCED = 1e-12
# Share of pushes over the prior whose search ends; 5 or 6 of 10 000 do not here.
FOUND = 0.998
# Of forces, where a tenth of a push tilts by up to S_p / 10 L = 0.0125.
OF_A_TENTH = 5e-3

# Differences are of fourth order.
STEP, DIFFERENCE_FLOOR = 2e-4, 1e-10
WEIGHTS = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
SPAN = 0.06
THETA_DEG = np.array([-60.0, -20.0, -1.0, 0.0, 2.0, 10.0, 30.0, 44.0, 60.0, 80.0, 90.0])
# Growing pushes that lead the root finder to the equilibrium a real push reaches.
N_GROWTH = 12
CHANNELS = ("normal", "tangential_x", "tangential_y")

forces = eqx.filter_jit(model.forces)
forward = eqx.filter_jit(model.forward)
angle = eqx.filter_jit(critical_angle)


def held(push_length=PUSH, **changes) -> Grasp:
    """A grasp by two supports."""
    words = {"support_span": SPAN} | changes
    return Grasp(push_length=push_length, mechanics="tilting", **words)


def stacked(found):
    return np.stack([getattr(found, name) for name in CHANNELS], axis=1)


def strains(lean, push, L):
    """Sideways and normal displacement of finger and contact."""
    size = math.hypot(*lean)
    along = L * np.sinc(size / math.pi) * lean
    return push[:2] - along, push[2] - L * (1 - math.cos(size)), size


def unbalanced(lean, push, p, stiffness, grasp):
    """Moments that nothing bears, and forces, from sines of the lean."""
    series = p.K_sn * p.K_dn / (p.K_sn + p.K_dn)
    sideways, pressing, size = strains(lean, push, p.L)
    n = lean / size if size > 0 else np.zeros(2)
    force = stiffness @ sideways
    normal = max(float(grasp.preload) + series * pressing, 0.0)
    # ∂(sin γ n)/∂q: cos γ along n, sin γ / γ across it.
    turned = np.sinc(size / math.pi) * (np.eye(2) - np.outer(n, n))
    turned += math.cos(size) * np.outer(n, n)
    moment = p.L * (turned @ force + normal * math.sin(size) * n)
    across = max(normal * math.cos(size) - force @ n * math.sin(size), 0.0)
    limits = p.C_rr + np.array([grasp.support_span / (2 * p.L), 0.0])
    rotation = p.L**2 * np.diag(np.linalg.inv(stiffness)) ** -1
    share = p.C_d / (p.C_d + rotation)
    elastic = share * moment + (1 - share) * p.C_d * lean
    limit = limits * p.L * across
    if math.isinf(grasp.sharpness):
        # Plainly, without the share.
        borne = np.clip(p.C_d * lean, -limit, limit)
    else:
        power = grasp.sharpness
        with np.errstate(divide="ignore"):
            soft = (np.abs(elastic) ** -power + limit**-power) ** (-1 / power)
        borne = np.sign(elastic) * soft
    return moment - borne, np.array([normal, *force])


def forces_by_growth(p, stiffness, grasp, push):
    """Forces of one push, followed from nothing by SciPy's root finder."""
    lean = np.zeros(2)
    for part in np.linspace(0, 1, N_GROWTH + 1)[1:]:
        found = optimize.root(
            lambda q, s: unbalanced(q, s * push, p, stiffness, grasp)[0],
            lean,
            args=(part,),
            tol=1e-15,
        )
        lean = found.x
    left, force = unbalanced(lean, push, p, stiffness, grasp)
    assert np.max(np.abs(left)) < UNBALANCED
    return force


def push_vectors(pushes):
    """Push vectors as rows [m]."""
    theta, alpha = np.asarray(pushes.theta), np.asarray(pushes.alpha)
    level = np.cos(theta)
    parts = [level * np.cos(alpha), level * np.sin(alpha), np.sin(theta)]
    return PUSH * np.stack(parts, axis=1)


@pytest.mark.parametrize("preload", [0.0, 0.4, 2.0])
def test_across_the_supports_the_equilibrium_is_that_of_one_support(preload):
    params, pushes = paper_parameters(), sweep(THETA_DEG, [90.0])
    two = forces(params, pushes, held(preload=preload))
    one = forces(params, pushes, held(preload=preload, support_span=None))
    np.testing.assert_allclose(stacked(two), stacked(one), rtol=0, atol=ROUTES)
    np.testing.assert_array_equal(two.in_contact, one.in_contact)


@pytest.mark.slow
def test_an_unlimited_equilibrium_has_the_least_potential_energy():
    """Springs alone: SciPy's minimum over both components of the lean."""
    params = paper_parameters(C_rr=1e3, **TILTED_ELLIPSE)
    p, stiffness = paper.numbers(params), np.asarray(model.support_stiffness(params))
    pushes = sweep([20.0, 50.0, 75.0], [10.0, 70.0, 150.0])
    found = stacked(forces(params, pushes, held(preload=0.5)))

    @jax.jit
    def energy(tilt, push):
        square = tilt @ tilt
        size = jnp.sqrt(square)
        sideways = push[:2] - p.L * jnp.sin(size) / size * tilt
        pressing = push[2] - p.L * (1 - jnp.cos(size))
        springs = 400 * pressing**2 + sideways @ stiffness @ sideways
        return springs / 2 + 0.5 * pressing + p.C_d * square / 2

    slope, curvature = jax.jit(jax.grad(energy)), jax.jit(jax.hessian(energy))
    for row, push in enumerate(push_vectors(pushes)):
        least = optimize.minimize(
            energy,
            push[:2] / p.L / 2,
            (push,),
            method="trust-exact",
            jac=slope,
            hess=curvature,
            options={"gtol": 1e-14},
        )
        # To rounding, which the energy itself cannot tell.
        tilt = least.x - np.linalg.solve(curvature(least.x, push), slope(least.x, push))
        sideways, pressing, _ = strains(tilt, push, p.L)
        expected = [0.5 + 400 * pressing, *(stiffness @ sideways)]
        np.testing.assert_allclose(found[row], expected, rtol=ROUTES)


@pytest.mark.parametrize(
    "sharpness", [math.inf, pytest.param(8.0, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "n_draws", [2, pytest.param(20, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_forces_are_those_of_a_root_finder_that_follows_the_push(sharpness, n_draws):
    """Ellipses askew, one axis or both rolling, truths a factor 4 apart."""
    rng = np.random.default_rng(3)
    middle = np.log([800.0, 2000.0, 400.0, 0.3, 0.5, 0.04])
    pushes = sweep([-1.0, 5.0, 20.0, 45.0, 70.0], [5.0, 40.0, 100.0, 165.0])
    grasp = held(preload=0.3, sharpness=sharpness)
    for _ in range(n_draws):
        draw = np.exp(rng.normal(middle, [0.4] * 5 + [0.2]))
        params = Parameters(*draw, *rng.normal(0, 0.7, 2))
        p = paper.numbers(params)
        stiffness = np.asarray(model.support_stiffness(params))
        found = forces(params, pushes, grasp)
        got = stacked(found)
        for row, push in enumerate(push_vectors(pushes)):
            if found.in_contact[row]:
                expected = forces_by_growth(p, stiffness, grasp, push)
                np.testing.assert_allclose(got[row], expected, rtol=0, atol=ROUTES)


@pytest.mark.slow
@pytest.mark.parametrize("sharpness", [math.inf, 8.0])
@pytest.mark.parametrize("shape", [{}, ellipse(4.0, 0.0)], ids=["round", "aligned"])
def test_small_pushes_are_linear_with_an_error_that_falls_linearly(sharpness, shape):
    """The box of limits per axis is the limit S_p / L -> 0."""
    params = paper_parameters(**shape)
    # Clear of the hard switches, which move in proportion to the push.
    pushes = sweep([4.0, 20.0, 33.0, 55.0, 70.0, 85.0], [10.0, 46.0, 82.0, 154.0])
    errors = []
    for scale in (1e-2, 1e-3, 1e-4):
        grasp = held(scale * PUSH, sharpness=sharpness, preload=0.2 * scale)
        linear = forces(params, pushes, dataclasses.replace(grasp, mechanics="linear"))
        gap = stacked(forces(params, pushes, grasp)) - stacked(linear)
        errors.append(np.max(np.abs(gap), axis=0) / scale)
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    np.testing.assert_allclose(ratios[1], 10.0, rtol=SECOND_ORDER[1])
    np.testing.assert_allclose(ratios[0], 10.0, rtol=SECOND_ORDER[0])


@pytest.mark.slow
def test_an_ellipse_askew_lets_a_rolling_axis_pull_on_the_other():
    """Linear mechanics limit each axis by itself; the gap outlasts S_p / L -> 0."""
    params = paper_parameters(**TILTED_ELLIPSE)
    pushes = sweep([16.0, 70.0], [60.0])
    grasp = held(1e-4 * PUSH)
    linear = stacked(
        forces(params, pushes, dataclasses.replace(grasp, mechanics="linear"))
    )
    gap = stacked(forces(params, pushes, grasp)) - linear
    scale = np.max(np.abs(linear[:, 1:]))
    # By (K⁻¹ + L²/C_d): what y no longer bears deflects x by K⁻¹_xy.
    compliance = np.linalg.inv(np.asarray(model.support_stiffness(params)))
    p = paper.numbers(params)
    lost = linear[0, 2] - unlimited(params, pushes, grasp)[0, 2]
    expected = -compliance[0, 1] * lost / (compliance[0, 0] + p.L**2 / p.C_d)
    np.testing.assert_allclose(gap[0, 1], expected, rtol=SMALL)
    assert abs(gap[0, 1]) > 0.01 * scale
    np.testing.assert_allclose(gap[1], 0.0, atol=SMALL * scale)


def unlimited(params, pushes, grasp):
    """Linear forces without any rolling."""
    firm = dataclasses.replace(params, C_rr=1e3)
    return stacked(forces(firm, pushes, dataclasses.replace(grasp, mechanics="linear")))


@pytest.mark.slow
def test_a_soft_transition_is_that_of_one_support_up_to_the_size_of_the_tilt():
    params, pushes = paper_parameters(), sweep(THETA_DEG[5:], [90.0])
    gaps = []
    for scale in (1e-1, 1e-2, 1e-3):
        grasp = held(scale * PUSH, sharpness=8.0)
        two = stacked(forces(params, pushes, grasp))
        one = stacked(
            forces(params, pushes, dataclasses.replace(grasp, support_span=None))
        )
        gaps.append(np.max(np.abs(two - one)) / np.max(one[:, 2]))
    assert gaps[0] < OF_A_TENTH
    np.testing.assert_allclose(gaps[1] / gaps[2], 10.0, rtol=SECOND_ORDER[0])


@pytest.mark.slow
@pytest.mark.parametrize("alpha_deg", [20.0, 65.0, 90.0])
def test_at_the_critical_angle_one_axis_just_bears_its_moment(alpha_deg):
    """C_d |q_i| = c_i L N about one axis and less about the other, from the forces."""
    params, grasp = paper_parameters(**TILTED_ELLIPSE), held(preload=0.4)
    p, alpha = paper.numbers(params), jnp.asarray(math.radians(alpha_deg))
    theta_c = angle(params, grasp, alpha)
    normal, *tangential = stacked(
        forces(params, Pushes(theta_c[None], alpha[None]), grasp)
    )[0]
    tilt = float(tilt_of(params, grasp, theta_c, alpha))
    size = math.hypot(*tangential)
    across = normal * math.cos(tilt) - size * math.sin(tilt)
    moment = p.L * (size * math.cos(tilt) + normal * math.sin(tilt))
    np.testing.assert_allclose(moment, p.C_d * tilt, rtol=ROUTES)
    limits = np.array([p.C_rr + SPAN / (2 * p.L), p.C_rr]) * p.L * across
    spare = limits / (moment * np.abs(tangential) / size)
    np.testing.assert_allclose(np.min(spare), 1.0, rtol=ROUTES)
    friction = critical_friction(params, grasp, (theta_c, alpha))
    np.testing.assert_allclose(friction, p.C_rr, rtol=ROUTES)


@pytest.mark.slow
def test_the_critical_angle_of_small_pushes_is_the_linear_one():
    params = paper_parameters(**TILTED_ELLIPSE)
    alpha = jnp.radians(jnp.array([10.0, 60.0, 90.0, 140.0]))
    errors = []
    for scale in (1e-3, 1e-4):
        grasp = held(scale * PUSH, preload=0.4 * scale)
        linear = critical_angle(
            params, dataclasses.replace(grasp, mechanics="linear"), alpha
        )
        errors.append(np.asarray(angle(params, grasp, alpha) - linear))
    np.testing.assert_allclose(errors[0] / errors[1], 10.0, rtol=SECOND_ORDER[1])


@pytest.mark.slow
def test_where_neither_axis_rolls_there_is_no_critical_angle():
    grasp = held(preload=4.0)
    assert np.isnan(angle(paper_parameters(), grasp, jnp.asarray(0.3)))


@pytest.mark.slow
def test_resistance_is_least_where_a_fine_grid_has_it_least():
    params, grasp, theta = paper_parameters(), held(sharpness=8.0), math.radians(20.0)
    alpha = np.radians(np.arange(0.0, 180.0, 0.05))
    pushes = Pushes(np.full(alpha.size, theta), alpha)
    expected = alpha[np.argmin(forward(params, pushes, grasp).height)]
    found = eqx.filter_jit(best_direction)(params, grasp, theta, reach=(0.0, math.pi))
    np.testing.assert_allclose(found, expected, atol=math.radians(0.05))


@pytest.mark.slow
def test_an_object_that_slides_away_meets_no_force():
    """The normal force turns a rolled object over sooner than the support holds it."""
    params = paper_parameters(K_st=20.0, C_rr=0.05)
    found = forces(params, sweep([20.0], [90.0]), held(preload=4.0))
    assert not found.in_contact[0]
    np.testing.assert_array_equal(stacked(found), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize("sharpness", [math.inf, 8.0])
def test_over_the_prior_nothing_is_left_unbalanced(sharpness):
    """100 000 pushes; of these few slide away."""
    rng, n = np.random.default_rng(5), 12500
    posed = tilting_cost.problem("tilting")
    x = jnp.asarray(prior_x_samples(posed, rng, n))
    theta = jnp.asarray(np.radians(rng.uniform(-20, 90, (n, 8))))
    alpha = jnp.asarray(rng.uniform(0, math.pi, (n, 8)))
    shape = jnp.asarray(rng.normal(0, 0.7, (n, 2)))
    preload = jnp.asarray(rng.choice([0.0, 0.3, 2.0], n))

    @jax.jit
    @jax.vmap
    def left(x, theta, alpha, shape, preload):
        params = posed.state(x).params
        params = dataclasses.replace(params, e1=shape[0], e2=shape[1])
        grasp, pushes = held(preload=preload), Pushes(theta, alpha)
        frame = make_frame(
            model.contact(params),
            grasp,
            elevation=pushes.elevation,
            azimuth=pushes.azimuth,
        )
        lean, is_found = balanced_lean(frame, sharpness)
        return jnp.hypot(*unborne(frame, lean, sharpness)), is_found

    residual, is_found = left(x, theta, alpha, shape, preload)
    assert np.max(np.asarray(residual)[np.asarray(is_found)]) < EXACT
    assert np.mean(np.asarray(is_found)) > FOUND


@pytest.mark.slow
@pytest.mark.parametrize("sharpness", [math.inf, 8.0])
def test_slopes_equal_differences(sharpness):
    grasp = held(preload=0.4, sharpness=sharpness)
    pushes = sweep(THETA_DEG[:-1], [0.0, 65.0])
    params = paper_parameters(**TILTED_ELLIPSE)
    known = {"preload": grasp.preload}
    if math.isfinite(sharpness):
        known["sharpness"] = jnp.asarray(sharpness)
    leaves, structure = jax.tree.flatten((params, known))
    x = jnp.stack(leaves)

    @jax.jit
    def values(x):
        scaled, numbers = jax.tree.unflatten(structure, list(x))
        at = dataclasses.replace(grasp, **numbers)
        found = model.forces(scaled, pushes, at)
        theta_c = critical_angle(scaled, at, jnp.asarray(0.4))
        return jnp.concatenate([*(getattr(found, n) for n in CHANNELS), theta_c[None]])

    slopes, reverse = jax.jit(jax.jacfwd(values))(x), jax.jit(jax.jacrev(values))(x)
    np.testing.assert_allclose(reverse, slopes, rtol=EXACT, atol=EXACT)
    for i, value in enumerate(leaves):
        step = STEP * max(abs(float(value)), 1e-2)
        shift = step * jnp.eye(x.size)[i]
        difference = sum(w * values(x + k * shift) for k, w in WEIGHTS.items()) / step
        np.testing.assert_allclose(
            slopes[..., i], difference, rtol=DIFFERENCE, atol=DIFFERENCE_FLOOR / step
        )


@pytest.mark.slow
def test_slopes_are_finite_everywhere_in_the_range():
    """Contact loss, both ties, an object that slides away, a push straight down."""
    grasp = held()
    for params in (paper_parameters(), paper_parameters(K_st=20.0, C_rr=0.05)):
        ties = np.asarray(angle(params, grasp, jnp.array([0.0, 0.3, math.pi / 2])))
        theta = jnp.r_[jnp.radians(jnp.linspace(-89.9, 90.0, 60)), ties, 0.0]
        pushes = Pushes(theta, jnp.full_like(theta, 0.3))

        @jax.jit
        def slopes(params, pushes):
            return jax.jacfwd(lambda p: traced(model.forces(p, pushes, grasp)))(params)

        for leaf in jax.tree.leaves(slopes(params, pushes)):
            assert np.all(np.isfinite(leaf))


def traced(found):
    return jnp.stack([getattr(found, name) for name in CHANNELS])
