"""Diagnostics on chains whose truth is known: the good pass, every bad one does not."""

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.sampler.diagnostics import (
    MAX_RHAT,
    acceptance_fraction,
    autocorr_time,
    diagnose,
    disagreement,
    ess,
    nested_rhat,
)

N_ENSEMBLES, N_WALKERS = 4, 32
# AR(1) with φ = 0.9 has τ = (1 + φ)/(1 - φ) = 19.
PHI, TAU = 0.9, 19.0

# Half of what R-hat exceeds 1 by where one of four ensembles is 4 sd off: it is 1.59.
SHIFTED_RHAT = 1.3
# emcee's own test allows its estimate of τ 20 %; ESS is its inverse.
ESS_TOL = 0.25
# Ranks of a normal mixture are normal again to a few per cent of R-hat - 1.
RANKS_TOL = 0.15
# Chi-square for F of 64 000 draws per ensemble.
MANY_DRAWS = 1e-3


def autoregressive(n_steps, *, phi=PHI, seed=0, n_ensembles=N_ENSEMBLES):
    """Stationary AR(1) chains with unit variance."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((n_steps, n_ensembles, N_WALKERS))
    chain = np.empty_like(noise)
    chain[0] = noise[0]
    for t in range(1, n_steps):
        chain[t] = phi * chain[t - 1] + np.sqrt(1 - phi**2) * noise[t]
    return chain


def held(chain, share=0.6, seed=1):
    """The chain with steps repeated, as rejected proposals repeat them."""
    rng = np.random.default_rng(seed)
    stays = rng.random(chain.shape) < share
    stays[0] = False
    index = np.where(stays, 0, np.arange(len(chain))[:, None, None])
    return np.take_along_axis(chain, np.maximum.accumulate(index, axis=0), axis=0)


def verdict(chain):
    return diagnose(chain[..., None], {"x": chain})


@pytest.fixture(scope="module")
def good():
    return held(autoregressive(4000))


def test_a_well_mixed_chain_passes(good):
    result = verdict(good)
    assert result.problems == ()
    assert result.rhat["x"] < MAX_RHAT
    assert result.n_steps > 50 * result.autocorr_time["x"]


@pytest.mark.parametrize("seed", range(20))
def test_good_chains_raise_no_alarm(seed):
    chain = held(autoregressive(1500, phi=0.5, seed=seed), seed=seed)
    assert verdict(chain).problems == ()


def test_one_shifted_ensemble_fails(good):
    shifted = good.copy()
    shifted[:, 0] += 4
    result = verdict(shifted)
    # Means 4, 0, 0, 0 have variance 4 between ensembles of variance 1: sqrt(5) before
    # ranks. 1.59 with them.
    assert result.rhat["x"] > SHIFTED_RHAT
    assert any("R-hat" in p for p in result.problems)


def test_one_frozen_walker_fails_although_rhat_is_blind(good):
    frozen = good.copy()
    frozen[:, 2, 5] = frozen[0, 2, 5]
    result = verdict(frozen)
    assert result.rhat["x"] < MAX_RHAT
    assert np.isnan(result.autocorr_time["x"])
    assert any("walker 5 of ensemble 2" in p for p in result.problems)


def test_a_nearly_frozen_walker_fails(good):
    sticky = good.copy()
    sticky[: len(good) - 60, 1, 3] = sticky[0, 1, 3]
    result = verdict(sticky)
    assert any("walker 3 of ensemble 1" in p for p in result.problems)


def test_a_chain_of_ten_autocorrelation_times_fails():
    result = verdict(held(autoregressive(int(10 * TAU), seed=3)))
    assert any("fewer than 50 autocorrelation times" in p for p in result.problems)


def test_one_mode_per_ensemble_fails(good):
    modes = good + 10 * np.arange(N_ENSEMBLES)[:, None]
    assert any("R-hat" in p for p in verdict(modes).problems)


def test_rare_swaps_between_modes_are_noticed_where_rhat_is_not(good):
    """Modes 1.5 apart in proportions 0.5 ± 0.06: R-hat 1.00, and no swap at all."""
    rng = np.random.default_rng(4)
    shares = np.array([14, 16, 16, 18])
    which = np.stack([rng.permutation(N_WALKERS) < n for n in shares])
    result = verdict(good + 1.5 * which)
    assert result.rhat["x"] < MAX_RHAT
    assert result.problems


def test_ensembles_that_differ_by_less_than_rhat_sees_fail(good):
    """A shift of 0.12 standard deviations is 10 Monte-Carlo errors here."""
    shifted = good.copy()
    shifted[:, 0] += 0.12
    result = verdict(shifted)
    assert result.rhat["x"] < MAX_RHAT
    assert any("disagree about the mean of x" in p for p in result.problems)


@pytest.mark.parametrize("seed", range(3))
def test_ess_is_that_of_an_autoregressive_chain(seed):
    chain = autoregressive(4000, seed=seed)
    tau = autocorr_time(chain)
    np.testing.assert_allclose(ess(chain, tau), chain.size / TAU, rtol=ESS_TOL)


def test_a_flat_chain_has_no_sample_size():
    chain = np.ones((200, N_ENSEMBLES, N_WALKERS))
    result = verdict(chain)
    assert np.isnan(result.autocorr_time["x"])
    assert result.problems


def test_a_quantity_that_never_varies_is_named_whatever_others_do(good):
    problems = diagnose(good[..., None], {"x": good, "y": np.ones(good.shape)}).problems
    for words in ("time of y is not finite", "R-hat of y", "about the mean of y"):
        assert any(words in one for one in problems)


def test_a_density_that_takes_every_proposal_is_flat_where_it_should_not_be():
    assert any(
        "accept a share" in one for one in verdict(autoregressive(4000)).problems
    )


def test_ensembles_that_differ_by_a_fifth_of_their_width_fail(good):
    """sqrt(1 + 4 / 3 of 0.2²) is 1.026."""
    apart = good + 0.2 * np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    assert any("R-hat" in one for one in verdict(apart).problems)


@pytest.mark.parametrize("seed", range(3))
def test_ensembles_of_independent_draws_disagree_as_an_analysis_of_variance_says(seed):
    chain = autoregressive(2000, phi=0.0, seed=seed)
    expected = stats.f_oneway(*np.moveaxis(chain, 1, 0).reshape(N_ENSEMBLES, -1))
    np.testing.assert_allclose(
        disagreement(chain, 1.0), expected.pvalue, rtol=MANY_DRAWS
    )


def test_nested_rhat_is_its_definition():
    """Equation 8 of its paper by hand, without ranks: sqrt(1 + B / W)."""
    chain = autoregressive(100, phi=0.0, seed=5)
    chain[:, 1] += 1.0
    means = chain.mean(axis=(0, 2))
    between = means.var(ddof=1)
    within = np.mean(chain.var(axis=(0, 2), ddof=1))
    np.testing.assert_allclose(
        nested_rhat(chain) - 1, np.sqrt(1 + between / within) - 1, rtol=RANKS_TOL
    )


def test_acceptance_counts_the_steps_that_moved():
    chain = np.zeros((5, 1, 2, 3))
    chain[2:, 0, 1, 0] = 1.0
    chain[4:, 0, 1, 2] = 2.0
    np.testing.assert_array_equal(acceptance_fraction(chain), [[0.0, 0.5]])
