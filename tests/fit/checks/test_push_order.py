"""What the order of the pushes makes doubtful."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

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
    words = text.split(" by ")[1].split()
    assert (words[1] == "%") is in_proportion
    np.testing.assert_allclose(float(words[0]), column[0], rtol=DIGITS)


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
        ([10, 25, 40, 55], False),
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
    assert not follows_elevation(PeakTable.from_frame(again))


def test_a_drift_is_a_fault_of_the_table():
    found = {warning.code for warning in faults_of(drifting(in_a_row=True))}
    assert "drift_in_repeats" in found
