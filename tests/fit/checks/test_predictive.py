"""Posterior predictive checks where the posterior is known without any engine.

Below θ_c the tangential height is linear in C_rr, so with known noise the posterior of
C_rr is normal and the p-values are one-dimensional integrals.
"""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from scipy import integrate, stats

from pushfit.fit.checks.predictive import noise_at, predictive_checks
from pushfit.fit.problem.problem import STUDENT_DOF
from pushfit.fit.results import FitStatus
from tests.fit.posteriors import posterior_of
from tests.fit.tables import FRICTION_ONLY, case_table, setup_of, without_sd
from tests.problems import CASES, PUSH
from tests.tolerances import EXACT

SIGMA, PRIOR_MEAN, PRIOR_SD = 0.01, 0.24, 0.01
THETA_DEG = np.linspace(2.0, 30.0, 22)
SLOPE = 400 * PUSH * np.sin(np.radians(THETA_DEG))
N_DRAWS = 4000
# Five standard deviations of a share of as many draws, at its widest.
SHARE = 5 * 0.5 / np.sqrt(N_DRAWS)
# A right model leaves a p-value below the first once in 1000, and one below the second
# too often for a surprise, once in 20.
EXTREME, ORDINARY = 1e-3, 0.05


@pytest.fixture(scope="module")
def table():
    return case_table(
        CASES["paper"],
        noise=SIGMA,
        theta_deg=THETA_DEG,
        repeats=1,
        channels=("height_tangential",),
    )


@pytest.fixture(scope="module")
def setup(table):
    found = setup_of(table, FRICTION_ONLY)
    assert found.noise.kind == "given"
    return found


def with_heights(setup, heights):
    """The same problem with other heights."""
    observed = setup.problem.observed.at[0, : heights.size].set(heights)
    problem = eqx.tree_at(lambda p: p.observed, setup.problem, observed)
    return dataclasses.replace(setup, problem=problem)


def moments(heights):
    """Mean and standard deviation of the posterior of C_rr."""
    precision = 1 / PRIOR_SD**2 + np.sum((SLOPE / SIGMA) ** 2)
    weighted = PRIOR_MEAN / PRIOR_SD**2 + np.sum(SLOPE * heights) / SIGMA**2
    return weighted / precision, precision**-0.5


def drawn(heights, rng, status=FitStatus.OK):
    """Independent draws from that posterior."""
    draws = {"C_rr": rng.normal(*moments(heights), N_DRAWS)}
    return posterior_of(draws, draws, status)


def checked(table, setup, heights, seed):
    rng = np.random.default_rng(seed)
    model = with_heights(setup, heights)
    checks = predictive_checks(table, model, drawn(heights, rng), seed=seed)
    return {check.feature: check.p_value for check in checks}


def simulated(rng):
    """Heights of the model, with a truth from its prior."""
    truth = rng.normal(PRIOR_MEAN, PRIOR_SD)
    return truth * SLOPE + rng.normal(0, SIGMA, SLOPE.size)


@pytest.mark.parametrize(
    ("likelihood", "excess"), [("normal", 0.0), ("normal", 2.5), ("student_t", 2.5)]
)
def test_p_values_are_those_of_the_integral_over_the_posterior(
    table, setup, likelihood, excess
):
    """Noise with tails has the standard deviation that is stated, too."""
    heights = simulated(np.random.default_rng(8))
    heights[4] += excess * SIGMA
    mean, sd = moments(heights)
    n = heights.size
    is_normal = likelihood == "normal"
    tails = stats.t(STUDENT_DOF, scale=1 / stats.t.std(STUDENT_DOF))
    noise = stats.norm() if is_normal else tails

    def scatter(residuals):
        return stats.chi2.sf(np.sum(residuals**2), n)

    def largest(residuals):
        return 1 - (1 - 2 * noise.sf(np.max(np.abs(residuals)))) ** n

    problem = dataclasses.replace(setup.problem, likelihood=likelihood)
    found = checked(table, dataclasses.replace(setup, problem=problem), heights, 1)
    known = [("largest", largest), *([("scatter", scatter)] if is_normal else [])]
    for name, tail in known:

        def weighted(z, tail=tail):
            residuals = (heights - SLOPE * (mean + sd * z)) / SIGMA
            return stats.norm.pdf(z) * tail(residuals)

        expected, _ = integrate.quad(weighted, -8, 8)
        assert abs(found[name] - expected) < SHARE, name


def test_noise_that_is_drawn_adds_in_squares_to_what_is_stated():
    """3, 4 and 5, draw by draw; a component without draws has what is stated."""
    table = case_table(
        CASES["paper"],
        noise=3 * SIGMA,
        theta_deg=THETA_DEG,
        repeats=1,
        channels=("height_normal", "height_tangential"),
    )
    problem = setup_of(table).problem
    draws = {"sigma_height_tangential": SIGMA * np.array([4.0, 0.0])}
    found = noise_at(problem, draws)[..., : THETA_DEG.size] / SIGMA
    expected = np.array([[3.0, 5.0], [3.0, 3.0]])[..., None]
    np.testing.assert_allclose(
        found, np.broadcast_to(expected, found.shape), rtol=EXACT
    )


def test_every_draw_judges_by_its_own_noise(table):
    """Half of them have twice as much as the other half."""
    setup = setup_of(without_sd(table), FRICTION_ONLY)
    draws = {
        "C_rr": np.full(N_DRAWS, PRIOR_MEAN),
        "sigma_height_tangential": SIGMA * np.resize([1.0, 2.0], N_DRAWS),
    }
    scatter, *_ = predictive_checks(table, setup, posterior_of(draws), seed=0)
    residuals = table.heights("height_tangential") - PRIOR_MEAN * SLOPE
    squares = np.sum(residuals**2) / SIGMA**2 / np.array([1.0, 4.0])
    expected = np.mean(stats.chi2.sf(squares, residuals.size))
    assert abs(scatter.p_value - expected) < SHARE


@pytest.mark.slow
def test_data_of_the_model_are_not_faulted(table, setup):
    """Over truths from the prior: mean 1/2, and P(p < a) <= 2a (Meng 1994)."""
    rng = np.random.default_rng(2)
    n = 100
    rows = [checked(table, setup, simulated(rng), seed) for seed in range(n)]
    for name in ("scatter", "largest", "pattern"):
        p_values = np.array([row[name] for row in rows])
        assert abs(np.mean(p_values) - 0.5) < 5 * np.std(p_values) / np.sqrt(n), name
        # Five standard deviations of the count.
        assert np.sum(p_values < 0.05) <= 0.1 * n + 5 * np.sqrt(0.09 * n), name


def test_a_missed_effect_is_extreme_where_the_noise_would_cover_it(table, setup):
    """A wave of the size of the noise: its scatter is no surprise, its pattern is."""
    wave = 1.2 * SIGMA * np.sin(np.radians(24 * THETA_DEG))
    found = checked(table, setup, PRIOR_MEAN * SLOPE + wave, 3)
    assert found["pattern"] < EXTREME
    assert found["scatter"] > ORDINARY
    assert found["largest"] > ORDINARY


def test_an_outlying_push_is_extreme_by_its_residual(table, setup):
    heights = simulated(np.random.default_rng(4))
    heights[11] += 6 * SIGMA
    found = checked(table, setup, heights, 4)
    assert found["largest"] < EXTREME
    assert found["pattern"] > ORDINARY


def test_draws_that_are_not_to_be_trusted_check_nothing(table, setup):
    heights = simulated(np.random.default_rng(5))
    rng = np.random.default_rng(5)
    posterior = drawn(heights, rng, FitStatus.NOT_CONVERGED)
    assert predictive_checks(table, setup, posterior, seed=5) == ()
