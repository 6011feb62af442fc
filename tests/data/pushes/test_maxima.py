"""Maxima and means as SciPy computes them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.ndimage import uniform_filter1d
from scipy.signal import find_peaks

from pushfit.data.pushes.maxima import mean_of_three, prominent_maxima

# Few levels, so that tops are flat and equally high.
LEVELS = st.lists(st.integers(0, 6), min_size=3, max_size=60)
# The running sum of SciPy rounds at each of some 60 steps.
ROUNDING = 1e-13


@given(LEVELS, st.sampled_from([0.5, 1.0, 2.0, 4.0]))
def test_maxima_are_those_of_scipy(levels, prominence):
    y = np.array(levels, dtype=float)
    expected, _ = find_peaks(y, prominence=prominence)
    np.testing.assert_array_equal(prominent_maxima(y, prominence), expected)


def test_a_noisy_signal_has_the_maxima_of_scipy():
    y = np.cumsum(np.random.default_rng(0).normal(size=20_000))
    expected, _ = find_peaks(y, prominence=3.0)
    assert len(expected) > 100
    np.testing.assert_array_equal(prominent_maxima(y, 3.0), expected)


@given(LEVELS)
def test_the_mean_of_three_is_that_of_scipy(levels):
    y = np.array([levels, levels[::-1]], dtype=float)
    expected = uniform_filter1d(y, 3, axis=1, mode="nearest")
    np.testing.assert_allclose(mean_of_three(y), expected, rtol=0, atol=ROUNDING)
