"""What the order of the pushes makes doubtful."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import scipy

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.push_order import drift_in_repeats, follows_elevation
from pushfit.fit.checks.table_checks import faults_of
from tests.fit.tables import case_table
from tests.problems import CASES

# Printed digits of a slope, relative.
DIGITS = 0.05


def drifting(*, in_a_row: bool, in_proportion: bool = False) -> PeakTable:
    """Pushes that lose 0.03, or as much of their height, from each to the next.

    All repeats of a direction come before the next one or not.
    """
    table = case_table(CASES["firm"], noise=0.02, repeats=3)
    frame = table.frame
    order = frame.sort_values(["theta_deg", "repeat"] if in_a_row else ["repeat"])
    order = order.assign(push=np.arange(1, len(order) + 1))
    loss = 0.03 * order["push"] * (order["height_n"] / 2 if in_proportion else 1)
    return type(table).from_frame(order.assign(height_n=order["height_n"] - loss))


@pytest.mark.parametrize("in_proportion", [False, True])
def test_a_drift_that_repeats_in_a_row_show_is_that_of_least_squares(in_proportion):
    table = drifting(in_a_row=True, in_proportion=in_proportion)
    (text,) = [warning.text for warning in drift_in_repeats(table)]
    push, direction = table.frame["push"].to_numpy(dtype=float), table.groups
    dummies = (direction[:, None] == np.unique(direction)).astype(float)
    heights = table.heights("height")
    means = dummies @ np.linalg.lstsq(dummies, heights)[0]
    centred = push - dummies @ np.linalg.lstsq(dummies, push)[0]
    column = (
        100 * np.linalg.lstsq((centred * means)[:, None], heights - means)[0]
        if in_proportion
        else np.linalg.lstsq(np.c_[push, dummies], heights)[0]
    )
    assert ("%" in text) is in_proportion
    step, whole = (float(word) for word in re.findall(r" ([+-]\S+) ", text))
    np.testing.assert_allclose(step, column[0], rtol=DIGITS)
    np.testing.assert_allclose(whole, (push.size - 1) * column[0], rtol=DIGITS)


def pushes(theta_deg, push, heights) -> PeakTable:
    """Of one azimuth, by their numbers."""
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(len(theta_deg), 0.5),
        heights={"height": np.asarray(heights)},
        unit="n",
    )
    return PeakTable.from_frame(table.frame.assign(push=push))


@pytest.mark.parametrize(("chance", "is_said"), [(0.007, False), (0.0035, True)])
def test_two_directions_pushed_twice_have_one_degree_of_freedom(chance, is_said):
    """Of rises a and b by push, t = (a + b) / |a - b| with one degree of freedom."""
    apart = 1.1 / scipy.stats.t.isf(chance / 2, 1)
    half = np.array([1.1 + apart, 1.1 - apart]) / 4
    heights = 5.0 + np.ravel([-half, half], order="F")
    table = pushes([20.0, 20.0, 60.0, 60.0], [1, 2, 9, 10], heights)
    assert bool(list(drift_in_repeats(table))) is is_said


def test_pairs_of_directions_in_turn_are_not_pushed_in_a_row():
    """A fifth of the spread of their numbers lies within directions."""
    order = np.arange(1, 9)
    theta_deg = 20.0 * np.array([1, 2, 1, 2, 3, 4, 3, 4])
    table = pushes(theta_deg, order, 5 - 0.1 * order + 1e-3 * (order % 3))
    assert not list(drift_in_repeats(table))


def test_thrice_in_a_row_is_in_a_row_of_few_directions_too():
    """Of five 4 % of the spread of their numbers lies within; 14 steps are between."""
    order = np.arange(1, 16)
    theta_deg = np.repeat(np.arange(10.0, 60.0, 10.0), 3)
    table = pushes(theta_deg, order, 5 - 0.1 * order + 1e-3 * (order % 2))
    (warning,) = drift_in_repeats(table)
    assert "by -0.1 from push to push; if all pushes do, -1.4 from" in warning.text


def test_a_table_of_which_all_is_left_out_drifts_nowhere():
    table = drifting(in_a_row=True)
    assert not list(drift_in_repeats(table.with_flag(range(table.n_pushes), "gap")))


def test_a_drift_is_not_said_without_one_or_where_sweeps_are_repeated():
    """Between whole sweeps each is given an effect of its own."""
    assert not list(drift_in_repeats(drifting(in_a_row=False)))
    steady = case_table(CASES["firm"], noise=0.02, repeats=3)
    assert not list(drift_in_repeats(steady))
    nothing = drifting(in_a_row=True).frame.assign(height_n=0.0)
    assert not list(drift_in_repeats(PeakTable.from_frame(nothing)))


def test_noise_of_repeats_drifts_in_one_table_of_a_hundred_at_most():
    """More than 8 of 200 tables would be so once in 2000 times, 2 are expected."""
    table = drifting(in_a_row=True)
    rng, found = np.random.default_rng(0), 0
    for _ in range(200):
        # Its rows were checked with the first.
        frame = table.frame.assign(height_n=2 + rng.standard_normal(table.n_pushes))
        found += bool(list(drift_in_repeats(replace(table, frame=frame))))
    assert found <= 8


@pytest.mark.parametrize(
    ("theta_deg", "is_ordered"),
    [
        ([10, 25, 40, 55, 70], True),
        ([70, 55, 40, 25, 10], True),
        ([10, 25, 40, 55], False),
        # One of four, but for the rounding of radians.
        ([10, 10 + 1e-7, 25, 40, 55], False),
        ([10, 40, 25, 70, 55], False),
    ],
)
def test_few_elevations_or_those_that_change_places_are_in_no_order(
    theta_deg, is_ordered
):
    """Of the last Spearman's correlation is 0.8."""
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(len(theta_deg), 0.5),
        heights={"height": np.linspace(1.0, 2.0, len(theta_deg))},
        unit="n",
    )
    assert follows_elevation(table) is is_ordered


@pytest.mark.parametrize(
    ("by", "is_ordered"),
    [
        (["theta_deg", "repeat"], True),
        (["repeat", "theta_deg"], False),
        (["mixed"], False),
    ],
)
def test_elevations_in_order_are_known_from_sweeps_and_from_a_random_order(
    by, is_ordered
):
    frame = case_table(CASES["firm"], noise=0.02, repeats=3).frame
    frame = frame.assign(mixed=np.random.default_rng(0).permutation(len(frame)))
    pushed = frame.sort_values(by).drop(columns="mixed")
    table = PeakTable.from_frame(pushed.assign(push=np.arange(1, len(frame) + 1)))
    assert follows_elevation(table) is is_ordered


def test_one_direction_that_is_pushed_again_at_the_end_would_show_a_drift():
    frame = case_table(CASES["firm"], noise=0.02, repeats=9).frame
    frame = frame.sort_values(["theta_deg", "repeat"])
    in_order = frame.assign(push=np.arange(1, len(frame) + 1))
    assert follows_elevation(PeakTable.from_frame(in_order))
    again = pd.concat([frame.iloc[1:], frame.iloc[:1]])
    again = again.assign(push=np.arange(1, len(frame) + 1))
    table = PeakTable.from_frame(again)
    assert not follows_elevation(table)
    assert follows_elevation(table.with_flag([len(frame) - 1], "gap"))


@pytest.mark.parametrize(("share", "is_ordered"), [(0.4, True), (0.6, False)])
def test_a_direction_again_after_half_of_the_pushes_would_show_a_drift(
    share, is_ordered
):
    theta_deg = np.linspace(5.0, 85.0, 60)
    again = np.insert(theta_deg, round(60 * share), theta_deg[0])
    table = pushes(again, np.arange(1, 62), np.linspace(1.0, 2.0, 61))
    assert follows_elevation(table) is is_ordered


def test_a_drift_is_a_fault_of_the_table():
    found = {warning.code for warning in faults_of(drifting(in_a_row=True))}
    assert "drift_in_repeats" in found
