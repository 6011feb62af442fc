"""Where intervals of angles lie."""

import numpy as np
import pytest

from pushfit.explore.decide.intervals import (
    AskedAngle,
    column_widths,
    shortest_interval,
)
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


def test_an_axis_is_the_same_half_a_turn_further():
    rng = np.random.default_rng(1)
    values = rng.normal(175.0, 10.0, 200)
    turned = values + 180.0 * rng.integers(-2, 3, 200)
    one, other = interval(values, is_axis=True), interval(turned, is_axis=True)
    assert other == pytest.approx(one, rel=EXACT)


@pytest.mark.parametrize(("first", "is_axis"), [(4, False), (355, True)])
def test_of_even_probability_the_shortest_interval_is_its_share(first, is_axis):
    """Of ten bins of half a degree 85 % are 4.25°, also beyond the end of an axis.

    A fifth of the weight elsewhere lengthens it, and on no angle leaves none.
    """
    table = np.zeros((360, 3))
    table[np.arange(first, first + 10) % 360] = [0.1, 0.08, 0.08]
    table[180, 1] = 0.2
    columns = table[:, :2] if is_axis else table
    whole, parted, *partial = column_widths(columns, 0.85, step=0.5, is_axis=is_axis)
    assert whole == pytest.approx(4.25, rel=EXACT)
    assert 5.0 < parted < 180.0
    assert all(np.isposinf(partial))
