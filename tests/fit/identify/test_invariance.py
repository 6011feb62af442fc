"""What must not matter to a result does not, and what must matter does so exactly.

A run killed and resumed is in tests/fit/sampler/test_emcee_posterior.py.
"""

import dataclasses

import numpy as np
import pytest

from pushfit.data.tables.merge import merge_tables
from pushfit.data.tables.peak_table import PeakTable, read_table, write_table
from pushfit.fit.problem import problem as problems
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.profiles.profiles import likelihood_profiles
from tests.fit.tables import case_table, setup_of
from tests.problems import CASES
from tests.tolerances import FEW_OPERATIONS

ALPHA = np.pi / 2
# Sums in another order move a sum of squares by a few ulp.
SAME = 1e-9
# JᵀJ is inverted: rounding times its condition number.
INVERTED = 1e-6
# Ends of a profile set are met to 1e-3 of the level.
SET_END = 1e-4
THETA_DEG = np.arange(7.0, 88.0, 5.0)


@pytest.fixture(scope="module")
def table():
    return case_table(CASES["firm"], noise=0.03, seed=4, theta_deg=THETA_DEG, repeats=1)


def fitted(table):
    return fit_least_squares(setup_of(table), reference_alpha=ALPHA)


def assert_same_optimum(other, one):
    """Equal where sums of squares are: they rise by (Δ / standard error)²."""
    resolved = np.sqrt(np.finfo(float).eps * one.chi_square) * one.standard_error
    np.testing.assert_array_less(np.abs(other.estimate - one.estimate), resolved)


def set_of_theta_c(table):
    setup = setup_of(table)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    words = {"reference_alpha": ALPHA, "reach": (0.0, np.pi)}
    return likelihood_profiles(setup, fit, prob=0.95, **words)["theta_c"].pieces


def rows(table, order):
    return dataclasses.replace(
        table, frame=table.frame.iloc[order].reset_index(drop=True)
    )


def test_the_order_of_rows_does_not_matter(table):
    shuffled = rows(table, np.random.default_rng(0).permutation(table.n_pushes))
    one, other = fitted(table), fitted(shuffled)
    assert_same_optimum(other, one)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=INVERTED)
    np.testing.assert_allclose(other.chi_square, one.chi_square, rtol=SAME)
    np.testing.assert_allclose(
        set_of_theta_c(shuffled), set_of_theta_c(table), rtol=SET_END
    )


def test_padding_does_not_matter(table, monkeypatch):
    one = fitted(table)
    monkeypatch.setattr(problems, "SMALLEST_BUCKET", 64)
    assert setup_of(table).problem.observed.shape == (1, 64)
    other = fitted(table)
    assert_same_optimum(other, one)
    np.testing.assert_allclose(other.covariance, one.covariance, rtol=INVERTED)


def test_pushes_made_twice_shrink_errors_by_the_root_of_two(table):
    """J stacked on itself: JᵀJ doubles, and the optimum stays."""
    one, other = fitted(table), fitted(merge_tables([table, table]))
    assert_same_optimum(other, one)
    np.testing.assert_allclose(
        other.standard_error * np.sqrt(2), one.standard_error, rtol=INVERTED
    )
    np.testing.assert_allclose(other.chi_square, 2 * one.chi_square, rtol=SAME)


def test_degrees_and_kilopascals_are_radians_and_pascals(table, tmp_path):
    """The same pushes under other units are the same table, and so the same fit."""
    kilopascals = PeakTable.from_arrays(
        theta=table.theta,
        alpha=table.alpha,
        heights={"height": table.heights("height")},
        unit="kpa",
        sd={"height": table.sd("height")},
    )
    write_table(kilopascals, tmp_path / "one.csv")
    one = read_table(tmp_path / "one.csv")
    text = "theta_rad,alpha_rad,height_pa,height_sd_pa\n"
    columns = (
        table.theta,
        table.alpha,
        1000 * table.heights("height"),
        1000 * table.sd("height"),
    )
    for values in zip(*columns, strict=True):
        text += ",".join(repr(float(value)) for value in values) + "\n"
    (tmp_path / "other.csv").write_text(text)
    other = read_table(tmp_path / "other.csv")
    for name in ("theta_deg", "alpha_deg", "height_kpa", "height_sd_kpa"):
        np.testing.assert_allclose(
            other.frame[name], one.frame[name], rtol=FEW_OPERATIONS
        )
    np.testing.assert_allclose(fitted(other).estimate, fitted(one).estimate, rtol=SAME)
