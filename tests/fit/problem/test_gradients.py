"""Derivatives that every estimator leans on, at truths from the whole prior.

Differences of fourth order, (8 (f₁ - f₋₁) - (f₂ - f₋₂)) / 12 h. Across the hard switch
there is no derivative to compare with: what holds at the critical angle itself is
tested in tests/mechanics/test_model.py.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.mechanics.directions import critical_angle
from tests.fit.tables import case_table, setup_of
from tests.problems import CASES
from tests.tolerances import DIFFERENCE

N_DRAWS = 1000
# Coordinates are logs: fifth derivatives cost (h p)⁴ / 30 with a transition of
# sharpness p, here 1e-12, and (h / f)⁴ where the ellipse is nearly round; rounding
# costs eps / h.
STEP = 2e-4
OFFSETS = np.array([-2.0, -1.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12
# Forward and in reverse, sums of slopes up to 1e5, most of which may cancel.
REVERSED = 1e-9
# Smaller slopes are judged as if they were of this size: what differences round off
# does not shrink with them.
SMALLEST = 1e-3
SOFT = "[transition]\nsharpness = 12.0\n"
# All draws of p are below 50, so that h p is no larger than with the others.
OPEN = '[transition]\nsharpness = "auto"\n[parameters.p]\n'
OPEN += "lognormal = { median = 8.0, sd_log = 0.4 }\n"
PROBLEMS = {
    "six parameters": ("firm", ""),
    "a soft switch": ("firm", SOFT),
    "sampled noise": ("firm", '[noise]\nsigma = "sampled"\n'),
    "heavy tails": ("firm", '[noise]\nlikelihood = "student_t"\n'),
    "an unknown preload": ("preload", '[grasp]\npreload_n = "estimate"\n'),
    "an unknown sharpness": ("firm", OPEN),
    "an ellipse": ("ellipse", ""),
}


def stencil(x):
    """Points about x: by coordinate and offset."""
    shifts = STEP * OFFSETS[:, None] * np.eye(x.size)[:, None, :]
    return jnp.broadcast_to(x, shifts.shape) + jnp.asarray(shifts)


def branches(problem, x):
    """Which pushes are above the critical angle of their azimuth."""
    state = problem.state(x)
    grasp = eqx.tree_at(lambda g: g.preload, problem.grasp, state.preload)
    angles = jax.vmap(lambda alpha: critical_angle(state.params, grasp, alpha))
    return problem.pushes.theta > angles(problem.pushes.alpha)


@eqx.filter_jit
def derivatives(problem, x):
    """By name: slopes by autodiff and by differences, for every draw.

    Also the gradient in reverse mode, and whether no push changes its branch within
    the reach of the differences.
    """

    def functions(x):
        state = problem.state(x)
        return {
            "log prior": problem.log_prior(x),
            "log likelihood": problem.log_likelihood(state),
            "log posterior": problem.log_prob(x),
            "residuals": problem.residuals(state),
        }

    def one(x):
        slopes = jax.jacfwd(functions)(x)
        around = jax.vmap(jax.vmap(functions))(stencil(x))
        differences = {
            name: jnp.tensordot(WEIGHTS, jnp.moveaxis(values, 1, 0), 1).T / STEP
            for name, values in around.items()
        }
        here = branches(problem, x)
        near = jax.vmap(jax.vmap(lambda point: branches(problem, point)))(stencil(x))
        is_smooth = jnp.all(near == jnp.broadcast_to(here, near.shape))
        return slopes, differences, jax.grad(problem.log_prob)(x), is_smooth

    return jax.lax.map(one, x, batch_size=50)


def worst(slope, expected):
    """Largest error, relative to the largest slope of the same number at that draw.

    Prior and likelihood are judged apart, so neither hides in the size of the other.
    """
    size = np.max(np.abs(expected), axis=-1, keepdims=True)
    return np.max(np.abs(slope - expected) / np.maximum(size, SMALLEST))


@pytest.mark.slow
@pytest.mark.parametrize("name", PROBLEMS)
def test_derivatives_equal_differences_all_over_the_prior(name):
    case, text = PROBLEMS[name]
    problem = setup_of(case_table(CASES[case], noise=0.05), text).problem
    x = prior_x_samples(problem, np.random.default_rng(7), N_DRAWS)
    slopes, differences, reverse, is_smooth = derivatives(problem, jnp.asarray(x))
    is_smooth = np.asarray(is_smooth) | bool(np.isfinite(problem.grasp.sharpness))
    # Few draws have a push within 0.2 % of the critical angle.
    assert is_smooth.mean() > 0.6
    np.testing.assert_allclose(
        reverse, slopes["log posterior"], rtol=REVERSED, atol=REVERSED
    )
    for function, values in slopes.items():
        slope, expected = np.asarray(values), np.asarray(differences[function])
        assert np.all(np.isfinite(slope)), function
        assert worst(slope[is_smooth], expected[is_smooth]) < DIFFERENCE, function
