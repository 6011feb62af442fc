"""Priors that tables share: what scales with the unit of the heights, and what not."""

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.setup import build_problem
from pushfit.fit.shared_priors import shared_prior
from tests.fit.tables import case_table, config
from tests.problems import CASES

FACTOR = 250.0
# Rounding of medians to nine digits.
SAME_SHAPE = 1e-8


@pytest.fixture(scope="module")
def problems():
    """Heights in the sensor's own unit, and in one that is smaller by a factor."""
    table = case_table(CASES["firm"], noise=0.02)
    found = []
    for factor in (1.0, FACTOR):
        frame = table.frame.drop(columns=["push", "repeat"])
        frame = frame.rename(
            columns=lambda name: (
                name.removesuffix("_n") + "_au" if name.startswith("height") else name
            )
        )
        heights = [name for name in frame if name.startswith("height")]
        frame[heights] *= factor
        found.append(build_problem(type(table).from_frame(frame), config()).problem)
    return found


def test_problems_that_differ_in_unit_share_everything_but_the_scale(problems):
    one, other = (shared_prior(problem) for problem in problems)
    assert one.shape is other.shape
    assert other.scale == pytest.approx(FACTOR * one.scale, rel=SAME_SHAPE)
    for name, values in one.samples().items():
        factor = FACTOR if name in ("K_sn", "K_dn", "K_st", "C_d", "A", "B") else 1.0
        scaled = other.samples()[name]
        np.testing.assert_allclose(scaled, factor * values, rtol=SAME_SHAPE)


def test_draws_are_those_of_the_prior(problems):
    prior = shared_prior(problems[1])
    draws = prior.samples()
    for name in ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L"):
        own = problems[1].priors[name]
        z = np.log(draws[name] / float(own.first)) / float(own.second)
        assert stats.kstest(z, "norm").pvalue > 1e-4
    A = 1 / (1 / draws["K_sn"] + 1 / draws["K_dn"])
    B = 1 / (1 / draws["K_st"] + draws["L"] ** 2 / draws["C_d"])
    np.testing.assert_allclose(draws["A"], A, rtol=1e-12)
    np.testing.assert_allclose(draws["B"], B, rtol=1e-12)
    theta_c = np.degrees(np.arctan(B / (A * draws["C_rr"])))
    np.testing.assert_allclose(draws["theta_c"], theta_c, rtol=1e-12)


def test_tables_are_densities_of_the_draws(problems):
    prior = shared_prior(problems[1])
    for name, table in prior.tables.items():
        logs = np.log(prior.samples()[name])
        # Four standard errors of the mean of 4000 draws.
        assert np.mean(logs) == pytest.approx(
            float(table.mean), abs=4 * float(table.sd) / np.sqrt(logs.size)
        )
        assert np.std(logs) == pytest.approx(float(table.sd), rel=0.06)
