"""Noise of rests, by the samples next to a push."""

import numpy as np

from pushfit.data.peaks.blocks import correlation_of, scatter

RNG = 3
FLOOR = 1e-12  # of variances, far below those of these signals, 1 and more


def test_less_of_the_far_end_of_a_rest_leaves_its_nearest_blocks():
    """Each rest has four blocks of eight, and then less than one."""
    signal = np.random.default_rng(RNG).standard_normal(100)
    long = scatter(signal, np.array([[0, 39], [60, 99]]), 1, FLOOR)
    short = scatter(signal, np.array([[5, 39], [60, 94]]), 1, FLOOR)
    np.testing.assert_array_equal(long, short)


def test_rests_beside_another_push_say_nothing_of_the_noise():
    """The first push has too short a rest to judge by; the other has a random walk."""
    rng = np.random.default_rng(RNG)
    signal = np.concatenate(
        [rng.standard_normal(40), rng.standard_normal(400).cumsum()]
    )
    windows = np.array([[0, 17], [60, 220], [23, 40], [240, 400]])
    correlation = correlation_of(signal, windows, 2, FLOOR)
    assert correlation[0] == 1.0
    assert correlation[1] > 1.0
