"""Posteriors by emcee: against closed forms and quadrature, bit by bit, and honest."""

import dataclasses
import math

import numpy as np
import pytest

from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.results import FitStatus
from pushfit.fit.sampler import emcee_posterior as posterior
from pushfit.fit.sampler.checkpoint import CheckpointWarning
from pushfit.fit.sampler.emcee_posterior import Budget, sample_posterior
from tests.fit.tables import FRICTION_ONLY, case_table, setup_of
from tests.problems import CASES
from tests.tolerances import MAX_Z

REACH = (0.0, math.radians(150))
# The likeliest draw has every coordinate near the mode [standard deviations].
BEST_DRAW = 2.0
# 1/sqrt(2 ν) is an approximation, and the draws are some hundred independent ones.
SD_OF_SD = 0.3
SHORT = Budget(n_ensembles=2, n_walkers=32, max_steps=300)


def sample(setup, *, seed=0, alpha=math.pi / 2, **options):
    fit = fit_least_squares(setup, reference_alpha=alpha)
    return sample_posterior(
        setup, fit, seed=seed, reference_alpha=alpha, reach=REACH, **options
    )


@pytest.fixture(scope="module")
def setup():
    return setup_of(case_table(CASES["firm"], noise=0.03))


@pytest.fixture(scope="module")
def short(setup):
    """A short run, and what it said of its progress."""
    calls = []
    result = sample(setup, budget=SHORT, progress=lambda *call: calls.append(call))
    return result, calls


def effective_draws(result) -> float:
    """Variance of a mean: that of the chain, and that of keeping some draws of it."""
    ess = min(result.diagnostics.ess.values())
    return 1 / (1 / ess + 1 / result.log_prob.size)


def assert_same_bits(one, other):
    np.testing.assert_array_equal(one.chain, other.chain)
    np.testing.assert_array_equal(one.log_prob, other.log_prob)
    for name, draws in one.samples.items():
        np.testing.assert_array_equal(draws, other.samples[name], err_msg=name)
    assert one.diagnostics.n_steps == other.diagnostics.n_steps


def test_friction_alone_has_the_posterior_of_linear_regression():
    """Below θ_c = 45° the tangential height is A C_rr S_p sin θ: linear in C_rr.

    With a normal prior the posterior is normal with precision 1/s0² + Σ (a/σ)².
    """
    table = case_table(
        CASES["paper"],
        noise=0.03,
        channels=("height_tangential",),
        theta_deg=np.array([5.0, 10.0, 15.0, 20.0]),
    )
    result = sample(setup_of(table, FRICTION_ONLY))
    slope = 400 * 0.005 * np.sin(table.theta)
    heights, sd = table.heights("height_tangential"), table.sd("height_tangential")
    precision = 1 / 0.01**2 + np.sum((slope / sd) ** 2)
    mean = (0.24 / 0.01**2 + np.sum(slope * heights / sd**2)) / precision
    draws = result.samples["C_rr"]
    n = effective_draws(result)
    assert abs(draws.mean() - mean) < MAX_Z / np.sqrt(precision * n)
    assert abs(draws.std() * np.sqrt(precision) - 1) < MAX_Z / np.sqrt(2 * n)


def test_log_prob_belongs_to_its_draw(setup, short):
    """The best draw by log_prob is near the best fit's A."""
    result, _ = short
    best = int(np.argmax(result.log_prob))
    fit = fit_least_squares(setup, reference_alpha=math.pi / 2)
    ln_A = fit.estimate[fit.names.index("ln_A")]
    spread = np.log(result.samples["A"]).std()
    assert abs(np.log(result.samples["A"][best]) - ln_A) < BEST_DRAW * spread


def test_prior_samples_have_the_same_names_and_follow_the_prior(setup, short):
    result, _ = short
    assert result.prior_samples.keys() == result.samples.keys()
    prior = setup.problem.priors["K_sn"]
    ln_K = np.log(result.prior_samples["K_sn"])
    error = float(prior.second) / np.sqrt(ln_K.size)
    assert abs(ln_K.mean() - np.log(float(prior.first))) < MAX_Z * error


@pytest.mark.parametrize("n_looks", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_a_run_killed_and_resumed_gives_the_same_bits(
    tmp_path, monkeypatch, setup, n_looks
):
    # Short blocks, so that there is something left to do after the first.
    monkeypatch.setattr(posterior, "FIRST_BLOCK", 40)
    whole = sample(setup, budget=SHORT)
    path, looks = tmp_path / "run.npz", []

    def interrupt(stage, share):
        looks.append(stage)
        if looks.count("sampling") == n_looks:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sample(setup, budget=SHORT, progress=interrupt, checkpoint=path)
    assert path.exists()
    stages = []
    resumed = sample(
        setup,
        budget=SHORT,
        checkpoint=path,
        progress=lambda stage, share: stages.append(stage),
    )
    assert "starting points" not in stages
    assert len(looks) + len(stages) > 3
    assert_same_bits(whole, resumed)


@pytest.mark.slow
def test_a_checkpoint_of_another_seed_is_kept_aside(tmp_path, setup, short):
    path = tmp_path / "run.npz"
    other = sample(setup, budget=SHORT, checkpoint=path, seed=5)
    with pytest.warns(CheckpointWarning, match="another seed"):
        result = sample(setup, budget=SHORT, checkpoint=path)
    assert_same_bits(short[0], result)
    assert not np.array_equal(other.samples["A"], result.samples["A"])
    assert (tmp_path / "run.npz.bad").exists()


def test_a_spent_budget_is_reported_and_not_raised(setup):
    budget = Budget(n_ensembles=2, n_walkers=32, max_steps=60)
    result = sample(setup, budget=budget)
    assert result.status is FitStatus.NOT_CONVERGED
    assert any("autocorrelation times" in p for p in result.diagnostics.problems)
    assert all(np.all(np.isfinite(v)) for v in result.samples.values())


def test_progress_runs_from_the_start_to_the_end(short):
    _, calls = short
    assert calls[0] == ("starting points", 0.0)
    assert calls[-1] == ("sampling", 1.0)
    assert all(0 <= share <= 1 for _, share in calls)


def test_thinned_chain_has_ensembles_first(setup, short):
    result, _ = short
    n_ensembles, _, n_walkers, n_dim = result.chain.shape
    assert (n_ensembles, n_walkers) == (SHORT.n_ensembles, SHORT.n_walkers)
    assert n_dim == len(result.chain_names) == len(setup.problem.names)


@pytest.mark.slow
def test_sampled_noise_is_found():
    """σ from 51 residuals of three combinations: known to 1/sqrt(2 · 48) = 10 %."""
    table = case_table(CASES["firm"], noise=0.03, seed=2)
    sampled = setup_of(table, '[noise]\nsigma = "sampled"')
    bare = dataclasses.replace(sampled.problem, sd=np.zeros_like(sampled.problem.sd))
    result = sample(dataclasses.replace(sampled, problem=bare))
    sigma = result.samples["sigma_height"]
    truth = float(np.median(table.sd("height")))
    assert abs(np.log(np.median(sigma) / truth)) < MAX_Z * 0.1
    np.testing.assert_allclose(np.log(sigma).std(), 0.1, rtol=SD_OF_SD)
