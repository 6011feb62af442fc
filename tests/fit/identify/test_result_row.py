"""Prior densities that travel with the draws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.identify.result_row import (
    prior_of_angle,
    row_values,
    tabulated_prior,
)
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.sweep.prior import marginal_priors
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.report.makers import make_angle, make_whole

# Four standard errors of a kernel density of 3900 draws, and its bias, in the bulk.
KERNEL_TOL = 0.2


@pytest.fixture(scope="module")
def tables():
    table = case_table(CASES["firm"], noise=0.02)
    return marginal_priors(build_problem(table, config()).problem)


@pytest.mark.parametrize("name", ["A", "C_rr"])
def test_tables_of_priors_are_densities_of_the_log(name, tables):
    """Against draws of the parameters behind them."""
    rng, n = np.random.default_rng(0), 200_000
    priors = {
        k: np.exp(p.sample(rng, n))
        for k, p in default_priors(None).items()
        if k in ("K_sn", "K_dn", "C_rr")
    }
    series = 1 / (1 / priors["K_sn"] + 1 / priors["K_dn"])
    draws = np.log(series if name == "A" else priors["C_rr"])
    low, high = np.quantile(draws, [0.1, 0.9])
    grid = np.linspace(low, high, 401)
    mass = np.trapezoid(np.exp(tabulated_prior(tables[name], grid)), grid)
    # Four standard deviations of the share of 200 000 draws.
    np.testing.assert_allclose(mass, 0.8, rtol=0, atol=4 * np.sqrt(0.16 / n))


def test_the_prior_of_the_angle_is_a_density_in_degrees():
    """With u = ln tan θ normal, p(θ) = N(u) 2 / sin 2θ per radian."""
    rng = np.random.default_rng(0)
    prior = np.degrees(np.arctan(np.exp(0.3 + 1.5 * rng.normal(size=4000))))
    prior[:100] = np.nan
    theta = np.linspace(10.0, 85.0, 16)
    found = prior_of_angle(theta, prior)
    assert found is not None
    u = np.log(np.tan(np.radians(theta)))
    slope = 2 / np.sin(2 * np.radians(theta)) * np.pi / 180
    expected = stats.norm.logpdf(u, 0.3, 1.5) + np.log(slope)
    np.testing.assert_allclose(found, expected, rtol=0, atol=KERNEL_TOL)


@pytest.mark.parametrize(("estimate", "on_axis"), [(178.0, 178.0), (3.0, 183.0)])
def test_an_axis_lies_between_the_ends_of_its_interval(estimate, on_axis):
    axis = make_angle("alpha_star", estimate, interval=(174.0, 187.0))
    row = row_values(replace(make_whole(with_alpha=True), alpha_star=axis))
    assert row["alpha_star_deg"] == on_axis
    assert row["alpha_star_low_deg"] < on_axis < row["alpha_star_high_deg"]


@pytest.mark.parametrize(
    ("alpha_deg", "period"), [((100.0, 260.0), None), ((-90.0, 90.0), 180.0)]
)
def test_an_axis_has_its_period_where_all_azimuths_are_reached(alpha_deg, period):
    whole = make_whole(with_alpha=True)
    settings = whole.config.with_keys("reach", alpha_deg=alpha_deg)
    row = row_values(replace(whole, config=settings))
    assert row["alpha_star_period_deg"] == period


def test_a_fixed_angle_has_no_prior():
    assert prior_of_angle(np.array([45.0]), np.full(4000, 45.0)) is None


@pytest.mark.parametrize(("n_draws", "is_known"), [(399, False), (400, True)])
def test_a_few_draws_that_roll_tell_no_prior_of_the_angle(n_draws, is_known):
    prior = np.append(np.linspace(5.0, 85.0, n_draws), np.full(1000, np.nan))
    assert (prior_of_angle(np.array([45.0]), prior) is not None) is is_known
