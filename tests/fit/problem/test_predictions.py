"""Predictions of many points and pushes against the model, one at a time."""

import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.predictions import (
    N_POINTS,
    N_PUSHES,
    N_TOGETHER,
    predict_draws,
    predict_points,
)
from pushfit.fit.problem.setup import build_problem
from pushfit.model import Parameters, Pushes, forward
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

ESTIMATED = '[grasp]\npreload_n = "estimate"\n'


@pytest.fixture(scope="module")
def problem():
    table = case_table(CASES["ellipse"], noise=0.02)
    return build_problem(table, config(ESTIMATED)).problem


@pytest.fixture(scope="module")
def pushes():
    rng = np.random.default_rng(1)
    n = N_PUSHES + 9
    return Pushes(rng.uniform(0.1, 1.5, n), rng.uniform(0.0, np.pi, n))


def test_points_are_predicted_as_one_by_one(problem, pushes):
    """More points and pushes than one call takes, in their order."""
    rng = np.random.default_rng(2)
    points = rng.normal(0.0, 0.3, (N_POINTS + 5, len(problem.data_names)))
    angles = np.stack([pushes.theta, pushes.alpha])
    found = predict_points(problem, points, angles)
    assert found.heights.shape == (len(points), 1, pushes.theta.size)
    for i in (0, N_TOGETHER, N_POINTS - 1, N_POINTS, len(points) - 1):
        state = problem.data_state(jnp.asarray(points[i]))
        one = forward(state.params, pushes, state.grasp(problem.grasp))
        np.testing.assert_allclose(found.heights[i, 0], one.height, rtol=EXACT)
        np.testing.assert_array_equal(found.in_contact[i], one.in_contact)


def test_draws_are_predicted_with_what_is_fixed_and_unknown(problem, pushes):
    x = prior_x_samples(problem, np.random.default_rng(3), 4)
    samples = samples_mapping(problem, x, np.pi / 2, reach=(0.0, np.pi))
    angles = np.stack([pushes.theta, pushes.alpha])
    heights = predict_draws(problem, samples, angles).heights
    for i in range(len(x)):
        state = problem.state(jnp.asarray(x[i]))
        assert isinstance(state.params, Parameters)
        one = forward(state.params, pushes, state.grasp(problem.grasp))
        np.testing.assert_allclose(heights[i, 0], one.height, rtol=ROUTES)
