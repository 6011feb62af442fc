"""Where intervals of angles lie."""

import numpy as np
import pytest

from pushfit.explore.decide.intervals import AskedAngle, shortest_interval
from tests.tolerances import EXACT


def interval(values, reach, *, name="alpha_star"):
    target = AskedAngle.of(name, values, reach=reach, width=6.0, prob=0.9)
    return shortest_interval(target, np.full(values.size, 1 / values.size))


@pytest.mark.parametrize("reach", [(0.0, 150.0), (-30.0, 60.0), (200.0, 260.0)])
def test_an_interval_of_the_best_direction_lies_within_the_reach(reach):
    """Draws at both ends of it, as folded into [0°, 180°): nothing lies between."""
    low, high = reach
    ends = np.concatenate([np.linspace(low, low + 2, 50), np.linspace(high - 2, high)])
    found = interval(np.mod(ends, 180.0), reach)
    assert low <= found[0] < low + 2
    assert high - 2 < found[1] <= high


def test_an_axis_that_is_reached_all_round_has_no_ends():
    values = np.array([176.0, 177.0, 178.0, 179.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert interval(values, (0.0, 180.0)) == pytest.approx((176.0, 184.0), rel=EXACT)


def test_an_elevation_is_as_it_was_drawn():
    values = np.linspace(-40.0, 30.0, 10)
    found = interval(values, (0.0, 150.0), name="theta_c")
    assert found == pytest.approx((values[0], values[-2]), rel=EXACT)
