"""Pareto smoothing: against ArviZ's."""

import numpy as np
import pytest
from arviz_stats.base.array import array_stats

from pushfit.fit.sweep.tail import pareto_smoothed

# Two implementations of the same sums, of which one is a difference of averages.
SAME = 1e-9


@pytest.mark.parametrize("n", [40, 225, 4096])
@pytest.mark.parametrize("shape", [-0.4, 0.3, 0.9, 2.0])
def test_smoothed_weights_are_those_of_arviz(n, shape):
    """Weights (1 - v)^-k of uniform v, bounded where k is below 0."""
    rng = np.random.default_rng(n)
    log_weights = -shape * np.log(rng.uniform(size=n)) * np.sign(shape) + 3.0
    found, k = pareto_smoothed(log_weights)
    expected, expected_k = array_stats.psislw(-log_weights)
    np.testing.assert_allclose(found, expected, rtol=SAME, atol=SAME)
    np.testing.assert_allclose(k, expected_k, rtol=SAME)


def test_equal_weights_stay_and_have_no_tail():
    found, k = pareto_smoothed(np.full(400, 7.0))
    np.testing.assert_allclose(found, -np.log(400), rtol=SAME)
    assert k < 0


def test_a_tail_that_begins_with_one_repeated_weight_has_a_shape():
    log_weights = np.sort(np.random.default_rng(0).normal(size=400))
    log_weights[340:343] = log_weights[339]
    found, k = pareto_smoothed(log_weights)
    expected, expected_k = array_stats.psislw(-log_weights)
    np.testing.assert_allclose(found, expected, rtol=SAME, atol=SAME)
    np.testing.assert_allclose(k, expected_k, rtol=SAME)


@pytest.mark.parametrize("n", [2, 20])
def test_few_weights_tell_nothing_of_their_tail(n):
    assert pareto_smoothed(np.arange(float(n)))[1] == np.inf


def test_a_tail_of_one_weight_that_is_not_alone_tells_nothing():
    log_weights = np.zeros(400)
    log_weights[0] = 50.0
    assert pareto_smoothed(log_weights)[1] == np.inf
