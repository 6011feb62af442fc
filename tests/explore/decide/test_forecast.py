"""Forecasts of an angle that readings tell, against the normal formula.

An angle of prior sd s that is read n times with noise σ is known to 1 / √(1/s² + n/σ²).
"""

import numpy as np
import pytest
from scipy.stats import norm

from pushfit.explore.decide.forecast import imagine, p_decided
from pushfit.explore.decide.intervals import AskedAngle

# Half of a central interval of 90 % [sd].
HALF = 1.645
PRIOR, NOISE = 3.0, 4.0  # [deg]
# Intervals by some tens of draws are that far off, and those of few truths farther.
OFF, MOST, FEW = 1.3, 0.8, 0.2


def expected_width(n_pushes, *, noise=NOISE):
    return 2 * HALF / np.sqrt(1 / PRIOR**2 + n_pushes / noise**2)


def ways(values, *, tells, noise=NOISE, rows=None, weights=None):
    """Imagined pushes, each of which tells the angle or nothing, in one channel."""
    n = values.size
    heights = np.asarray(tells)[:, None, None] * values
    return imagine(
        np.concatenate([heights, np.zeros_like(heights)], axis=1),
        np.full(n, 1 / n) if weights is None else weights,
        np.array([noise, 100 * noise]),
        rows=np.arange(len(tells)) if rows is None else rows,
        gains=np.asarray(tells, dtype=float),
        rng=np.random.default_rng(1),
    )


def drawn(n=8192):
    return 45 + PRIOR * np.random.default_rng(2).standard_normal(n)


def chance(found, values, width, *, n_pushes, is_axis=False, weights=None):
    targets = tuple(
        AskedAngle(values=each, is_axis=is_axis, width=width, prob=0.9)
        for each in (values if isinstance(values, tuple) else (values,))
    )
    n = targets[0].values.size
    weights = np.full(n, 1 / n) if weights is None else weights
    return p_decided(found, weights, targets, n_pushes=n_pushes)


@pytest.mark.parametrize(
    ("n_draws", "n_pushes"),
    [
        (8192, 8),
        # So many pushes leave too few draws, and the rate of fewer is carried on.
        (500, 2000),
    ],
)
@pytest.mark.parametrize("is_axis", [False, True])
def test_a_width_is_decided_where_the_formula_says_so(n_draws, n_pushes, is_axis):
    values = drawn(n_draws)
    found = ways(values, tells=np.ones(4))
    # An axis that is 45° from the other one, across its end, and any half turn of it.
    turns = np.random.default_rng(3).integers(-1, 2, n_draws)
    values = values - 45 + 180 * turns if is_axis else values
    width = expected_width(n_pushes)
    given = {"n_pushes": n_pushes, "is_axis": is_axis}
    assert chance(found, values, OFF * width, **given) > MOST
    assert chance(found, values, width / OFF, **given) < FEW


def test_draws_of_another_weight_forecast_the_same():
    values = 45 + 2 * PRIOR * np.random.default_rng(4).standard_normal(8192)
    weights = norm.pdf(values, 45, PRIOR) / norm.pdf(values, 45, 2 * PRIOR)
    weights /= weights.sum()
    found = ways(values, tells=np.ones(4), weights=weights)
    given = {"n_pushes": 4, "weights": weights}
    assert chance(found, values, 1.1 * expected_width(4), **given) > MOST
    assert chance(found, values, expected_width(4) / 1.1, **given) < FEW


def test_the_better_of_two_ways_counts():
    """Of a hundred directions four tell of the angle, and two of them are allowed."""
    values, rows = drawn(), np.arange(0, 100, 2)
    tells = np.zeros(100)
    tells[[40, 60, 61, 63]] = 1.0
    found = ways(values, tells=tells, rows=rows)
    # Two of the best four say nothing.
    width = OFF * expected_width(10)
    assert chance(found, values, width, n_pushes=20) > MOST
    # All directions tell, but the best four least of all of a second angle.
    other = drawn()[::-1].copy()
    assert chance(found, other, width, n_pushes=20) < FEW
    spread, best = found
    assert chance((spread,), values, width, n_pushes=20) < FEW
    assert chance((best, spread), values, width, n_pushes=20) > MOST


def test_every_angle_is_to_be_decided():
    values = drawn()
    other = drawn()[::-1].copy()
    found, width = ways(values, tells=np.ones(4)), OFF * expected_width(8)
    assert chance(found, (values, values), width, n_pushes=8) > MOST
    assert chance(found, (values, other), width, n_pushes=8) < FEW


def test_one_draw_far_off_changes_no_forecast():
    """Bins are of the width that is asked for, not of the range of the draws."""
    values, noise = drawn(), 0.2
    width = OFF * expected_width(8, noise=noise)
    values[0] = -90.0
    found = ways(values, tells=np.ones(4), noise=noise)
    assert chance(found, values, width, n_pushes=8) > MOST


def test_directions_are_spread_over_all_that_are_allowed():
    """The last third alone tells of the angle."""
    values = drawn()
    spread, _ = ways(values, tells=np.repeat([0.0, 1.0], [80, 40]))
    assert chance((spread,), values, OFF * expected_width(8), n_pushes=24) > MOST
    assert chance((spread,), values, expected_width(8) / OFF, n_pushes=24) < FEW


@pytest.mark.parametrize("n_pushes", [0, -1])
def test_without_a_push_nothing_is_decided(n_pushes):
    values = drawn()
    assert chance(ways(values, tells=np.ones(4)), values, 90.0, n_pushes=n_pushes) == 0


def test_an_angle_of_one_value_or_of_none_is_no_division_by_nothing():
    values = drawn()
    found = ways(values, tells=np.ones(4))
    one, none = np.full(values.size, 40.0), np.full(values.size, np.nan)
    assert chance(found, one, 6.0, n_pushes=8) == 1.0
    assert chance(found, none, 6.0, n_pushes=8) == 0.0


def test_a_reading_that_leaves_hardly_a_draw_decides():
    """Also of a thousandth of a push: the nearest draws are closer than is asked."""
    values = drawn()
    found = ways(values, tells=np.ones(4), noise=1e-6)
    assert chance(found, values, 1.0, n_pushes=4) > MOST
