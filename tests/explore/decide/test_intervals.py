"""Where intervals of angles lie."""

import numpy as np
import pytest

from pushfit.explore.decide.intervals import AskedAngle, shortest_interval
from tests.tolerances import EXACT


def interval(values, *, is_axis):
    target = AskedAngle(values=values, is_axis=is_axis, width=6.0, prob=0.9)
    return shortest_interval(target, np.full(values.size, 1 / values.size))


def test_an_axis_that_is_reached_all_round_has_no_ends():
    values = np.array([176.0, 177.0, 178.0, 179.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    assert interval(values, is_axis=True) == pytest.approx((176.0, 184.0), rel=EXACT)


def test_an_elevation_is_as_it_was_drawn():
    values = np.linspace(-40.0, 30.0, 10)
    found = interval(values, is_axis=False)
    assert found == pytest.approx((values[0], values[-2]), rel=EXACT)
