"""Pushes that can show nothing are refused with those that could."""

import numpy as np
import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError
from pushfit.fit.problem.setup import build_problem
from tests.fit.tables import config

PRELOAD = "[grasp]\npreload_n = 2.0\n"


def pushes(theta_deg, heights) -> PeakTable:
    """Pushes at one azimuth, without sd."""
    theta = np.radians(theta_deg)
    columns = {"height": heights} if not isinstance(heights, dict) else heights
    return PeakTable.from_arrays(
        theta=theta, alpha=np.full(theta.size, 1.5), heights=columns, unit="n"
    )


def test_heights_that_are_all_zero_show_no_stiffness():
    with pytest.raises(
        DataError, match=r"height holds only zeros.*push further"
    ) as caught:
        build_problem(pushes(np.arange(5.0, 86.0, 5.0), np.zeros(17)), config())
    assert caught.value.code == "no_height"


def test_a_channel_of_zeros_is_named():
    heights = {"height": np.ones(5), "height_tangential": np.zeros(5)}
    with pytest.raises(DataError, match="height_tangential"):
        build_problem(pushes(np.arange(10.0, 60.0, 10.0), heights), config())


def test_pushes_along_the_surface_show_nothing_without_a_preload():
    table = pushes(np.zeros(8), 1.0 + 0.01 * np.arange(8))
    with pytest.raises(DataError, match=r"θ = 0°.*push at several") as caught:
        build_problem(table, config())
    assert caught.value.code == "no_elevation"
    assert build_problem(table, config(PRELOAD)).problem.names
