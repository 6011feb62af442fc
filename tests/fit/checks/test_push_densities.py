"""Densities of pushes left out: against closed forms, and ratios of evidences."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from scipy import stats

from pushfit.fit.checks.push_densities import left_out_density, push_densities
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.model import Parameters, forward
from tests.fit.tables import FRICTION_ONLY, case_table, setup_of
from tests.oracle.exact import exact_grid, exact_posterior
from tests.problems import CASES, PUSH
from tests.tolerances import EXACT, ROUTES

ALPHA, REACH = np.pi / 2, (0.0, np.pi)
SIGMA, PRIOR_MEAN, PRIOR_SD = 0.01, 0.24, 0.01
N_DRAWS = 20_000
N_PUSHES = 22


@pytest.mark.parametrize(("low", "pareto_k"), [(-1.0, -np.inf), (-3.0, np.inf)])
def test_a_push_whose_largest_weights_are_one_number_has_a_density(low, pareto_k):
    """Of 1000 draws 100, more than are smoothed; 1 / E[1 / density], written out."""
    log_likelihood = np.r_[np.full(100, low), np.full(900, -1.0)]
    elpd, k, p_loo = left_out_density(log_likelihood)
    expected = -np.log(0.1 * np.exp(-low) + 0.9 * np.exp(1.0))
    np.testing.assert_allclose(elpd, expected, rtol=EXACT)
    mean = 0.1 * np.exp(low) + 0.9 * np.exp(-1.0)
    np.testing.assert_allclose(p_loo, np.log(mean) - expected, atol=EXACT)
    assert k == pareto_k


def test_a_push_with_one_draw_at_a_quarter_of_its_largest_weights_has_a_density():
    """Of 1000 draws 95 are smoothed; 45 of these are one, as is the largest below."""
    log_likelihood = np.r_[np.linspace(-5.0, -4.0, 50), np.full(100, -3.0)]
    log_likelihood = np.r_[log_likelihood, np.linspace(-2.0, -1.0, 850)]
    elpd, k, p_loo = left_out_density(log_likelihood)
    expected = -np.log(np.mean(np.exp(-log_likelihood)))
    np.testing.assert_allclose(elpd, expected, rtol=EXACT)
    mean = np.mean(np.exp(log_likelihood))
    np.testing.assert_allclose(p_loo, np.log(mean) - expected, rtol=EXACT)
    assert k == np.inf


def monte_carlo_error(log_likelihoods):
    """Five standard errors of ln mean(1/p) over independent draws."""
    weights = np.exp(np.min(log_likelihoods, axis=0) - log_likelihoods)
    spread = np.std(weights, axis=0) / np.mean(weights, axis=0)
    return 5 * spread / np.sqrt(len(log_likelihoods))


def test_densities_are_those_of_linear_regression():
    """Without h_i the posterior of C_rr is normal, and so is the prediction of h_i."""
    theta_deg = np.linspace(2.0, 30.0, N_PUSHES)
    table = case_table(
        CASES["paper"],
        noise=SIGMA,
        theta_deg=theta_deg,
        repeats=1,
        channels=("height_tangential",),
    )
    heights = table.heights("height_tangential")
    slope = 400 * PUSH * np.sin(np.radians(theta_deg))

    def posterior(keep):
        precision = 1 / PRIOR_SD**2 + np.sum((slope[keep] / SIGMA) ** 2)
        weighted = PRIOR_MEAN / PRIOR_SD**2
        weighted += np.sum(slope[keep] * heights[keep]) / SIGMA**2
        return weighted / precision, precision**-0.5

    draws = np.random.default_rng(0).normal(*posterior(slice(None)), N_DRAWS)
    problem = setup_of(table, FRICTION_ONLY).problem
    found = push_densities(problem, {"C_rr": draws}, n_pushes=N_PUSHES)
    tolerance = monte_carlo_error(
        stats.norm.logpdf(heights, draws[:, None] * slope, SIGMA)
    )
    for i in range(N_PUSHES):
        mean, sd = posterior(np.arange(N_PUSHES) != i)
        spread = np.hypot(SIGMA, slope[i] * sd)
        expected = stats.norm.logpdf(heights[i], slope[i] * mean, spread)
        assert abs(found.elpd[i] - expected) < tolerance[i], i
    assert found.n_unreliable == 0
    # One free parameter, held by its prior too.
    assert 0 < np.sum(found.p_loo) < 2


def test_components_of_a_push_are_predicted_together():
    """By draws that are all alike, which leave nothing to weigh."""
    words = {"theta_deg": [10.0, 25.0], "repeats": 1}
    noisy, clean = (
        case_table(
            CASES["paper"],
            noise=noise,
            channels=("height_normal", "height_tangential"),
            **words,
        )
        for noise in (SIGMA, 0.0)
    )
    draws = {"C_rr": np.full(100, float(CASES["paper"].params.C_rr))}
    problem = setup_of(noisy, FRICTION_ONLY).problem
    found = push_densities(problem, draws, n_pushes=2)
    expected = sum(
        stats.norm.logpdf(noisy.heights(name), clean.heights(name), SIGMA)
        for name in noisy.channels
    )
    np.testing.assert_allclose(found.elpd, expected, rtol=ROUTES)


@pytest.mark.parametrize(("n_draws", "largest"), [(100, 0.5), (1000, 2 / 3)])
def test_of_few_draws_a_lighter_tail_is_not_relied_on(n_draws, largest):
    """1 - 1 / log10 S of S draws: Vehtari et al. (2024), JMLR 25 (72)."""
    table = case_table(CASES["paper"], noise=SIGMA, theta_deg=[10.0], repeats=1)
    problem = setup_of(table, FRICTION_ONLY).problem
    draws = {"C_rr": np.full(n_draws, 0.24)}
    found = push_densities(problem, draws, n_pushes=1)
    np.testing.assert_allclose(found.max_pareto_k, largest, rtol=EXACT)


@pytest.mark.slow
def test_densities_are_ratios_of_evidences():
    """ln p(h_i | h_-i) = ln Z - ln Z without h_i, both by quadrature."""
    table = case_table(
        CASES["firm"], noise=0.05, theta_deg=np.array([10.0, 30.0, 45.0, 60.0, 80.0])
    )
    setup = setup_of(table)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    result = exact_posterior(
        setup, fit, n_draws=8000, seed=1, reference_alpha=ALPHA, reach=REACH
    )
    problem, n = setup.problem, len(setup.rows)
    found = push_densities(problem, result.samples, n_pushes=n)
    predicted = forward_heights(problem, result.samples)[:, :n]
    sigma = np.asarray(problem.reference_sigma)[0, :n]
    observed = np.asarray(problem.observed)[0, :n]
    tolerance = monte_carlo_error(stats.norm.logpdf(observed, predicted, sigma))
    # The pushes with the least and the most weight, and one between.
    for i in np.argsort(found.p_loo)[[0, n // 2, -1]]:
        mask = problem.mask.at[0, i].set(False)
        without = eqx.tree_at(lambda p: p.mask, problem, mask)
        grid = exact_grid(dataclasses.replace(setup, problem=without), fit)
        expected = result.log_evidence - grid.log_evidence
        assert abs(found.elpd[i] - expected) < tolerance[i], i


def forward_heights(problem, samples):
    """Heights of every draw by the model itself."""
    names = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L")
    draws = np.stack([samples[name] for name in names], axis=1)
    curve = eqx.filter_jit(
        eqx.filter_vmap(
            lambda row: forward(Parameters(*row), problem.pushes, problem.grasp).height
        )
    )
    return np.asarray(curve(draws))
