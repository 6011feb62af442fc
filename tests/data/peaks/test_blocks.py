"""Noise of rests, by the samples next to a push."""

import numpy as np

from pushfit.data.peaks.blocks import correlation_of, scatter
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.rests import rests_of
from pushfit.data.recordings.records import Recording

RNG = 3
FLOOR = 1e-12  # of variances, far below those of these signals, 1 and more


def test_less_of_the_far_end_of_a_rest_leaves_its_nearest_blocks():
    """Each rest has four blocks of eight, and then less than one."""
    signal = np.random.default_rng(RNG).standard_normal(100)
    long = scatter(signal, np.array([[0, 39], [60, 99]]), 1, floor=FLOOR)
    short = scatter(signal, np.array([[5, 39], [60, 94]]), 1, floor=FLOOR)
    np.testing.assert_array_equal(long, short)


def test_rests_beside_another_push_say_nothing_of_the_noise():
    """The first push has too short a rest to judge by; the other has a random walk."""
    rng = np.random.default_rng(RNG)
    signal = np.concatenate(
        [rng.standard_normal(40), rng.standard_normal(400).cumsum()]
    )
    windows = np.array([[0, 17], [60, 220], [23, 40], [240, 400]])
    correlation = correlation_of(signal, windows, 2, floor=FLOOR)
    assert correlation[0] == 1.0
    assert correlation[1] > 1.0


def test_noise_is_that_of_the_samples_which_a_neighbour_leaves():
    """Of four small blocks in all, where there is room for no more beside a rest."""
    time = np.arange(0.0, 33.0, 0.06)
    y = 3.0 * np.random.default_rng(RNG).standard_normal(time.size)
    for top in (5.0, 12.8, 20.6, 28.4):
        y += 100.0 * np.clip(1 - np.abs(time - top) / 1.3, 0.0, None)

    def noise_of_third(part):
        own = Recording(time=time[part], channels={"p": y[part]}, units={"p": "n"})
        pushes = find_pushes(own)
        noise, _ = rests_of(time[part], y[part], pushes)
        return noise.sigma[[20.0 < push.t_peak < 21.2 for push in pushes]]

    # Before the third push the second has just ended, after it the fourth begins.
    whole, begin, end = map(noise_of_third, (slice(None), time > 14.2, time < 27.0))
    assert whole == begin == end
