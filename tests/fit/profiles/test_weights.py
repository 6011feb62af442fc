"""Noise in proportion to the height: estimated, stated, and as it enters a problem."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError
from pushfit.fit.identify.fit_table import MIN_SHARE_GAIN, fit_table
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.weights import (
    Errors,
    likeliest_shares,
    share_gain,
    tail_gain,
)
from tests.fit.tables import case_table, config
from tests.problems import CASES

CONSTANT = '[noise]\nheight_share = 0.0\nlikelihood = "normal"\n'
ESTIMATED = '[noise]\nheight_share = "estimate"\n'
# The share of 204 heights is known to 1/sqrt(2 · 204) of it where all noise is in
# proportion: a false alarm once in 10^4.
N_SE = 4.0
# By the Fisher information of 204 variances a share of 0.05 beside 0.03 N of constant
# noise is known to 0.0033, and that noise to 0.0058 N: four of one, and two and a half
# of the other.
BESIDE_CONSTANT, BESIDE_SHARE = 0.0133, 0.015
# A share that rounding leaves, and tables without one.
NONE, N_DRAWN = 1e-4, 200
# A share that would show: at the tallest height, 2.6 N, it is 2.6 times the constant
# noise of 0.05 N.
SHOWN = 0.05
SETTLED = 1e-6  # weights are settled with the fit, in three rounds
# Half a step beside the likeliest point of a grid, 51 heights lose 51 (step / 2)²: 4e-6
# where scales are tried, and 5e-4 for each of two parts.
SCALES, PARTS = 1e-5, 2e-3


def scattered(*, share: float, constant: float, seed: int, repeats: int = 12):
    """One firm grasp at 17 elevations, with both kinds of noise [N]."""
    clean = case_table(CASES["firm"], repeats=repeats)
    heights = clean.heights("height")
    rng = np.random.default_rng(seed)
    noise = np.hypot(share * heights, constant) * rng.standard_normal(heights.size)
    return PeakTable.from_arrays(
        theta=clean.theta,
        alpha=clean.alpha,
        heights={"height": heights + noise},
        unit="n",
    )


def share_of(fitted) -> float:
    """Known noise over height."""
    sd = np.asarray(fitted.setup.problem.sd)[np.asarray(fitted.setup.problem.mask)]
    shares = sd / fitted.fit.predicted
    np.testing.assert_allclose(shares, shares[0], rtol=SETTLED)
    return float(shares[0])


def test_noise_in_proportion_to_the_height_is_found():
    known = config(f"[grasp]\npreload_n = 0.0\n{ESTIMATED}")
    fitted = fit_table(scattered(share=0.05, constant=0.0, seed=0), known)
    error = 0.05 / np.sqrt(2 * 204)
    assert abs(share_of(fitted) - 0.05) < N_SE * error
    assert [n.code for n in fitted.warnings] == ["height_share"]


@pytest.mark.slow
def test_half_of_all_tables_without_a_share_show_none():
    """A variance that is 0 is estimated at its bound as often as not."""
    problem = build_problem(
        scattered(share=0.0, constant=0.0, seed=0), config()
    ).problem
    mask, rng = np.asarray(problem.mask), np.random.default_rng(1)
    predicted, found = np.asarray(problem.observed), []
    for _ in range(N_DRAWN):
        noise = np.where(mask, 0.05 * rng.standard_normal(mask.shape), 0.0)
        drawn = replace(problem, observed=predicted + noise)
        errors = Errors.of_fit(drawn, predicted[mask])
        (share,), _ = likeliest_shares(errors, predicted[mask][None], is_sampled=True)
        found.append(share)
    low, high = stats.binom.interval(0.999, N_DRAWN, 0.5)
    assert low <= np.sum(np.array(found) < NONE) <= high
    assert np.max(found) < SHOWN


def test_both_parts_are_told_apart():
    fitted = fit_table(scattered(share=0.05, constant=0.03, seed=2), config(ESTIMATED))
    assert abs(share_of(fitted) - 0.05) < BESIDE_CONSTANT
    share = share_of(fitted) * fitted.fit.predicted
    constant = np.sqrt(fitted.fit.sigma**2 - share**2)
    np.testing.assert_allclose(constant, constant[0], rtol=SETTLED)
    assert abs(constant[0] - 0.03) < BESIDE_SHARE


def test_a_stated_share_is_added_to_stated_deviations():
    table = case_table(CASES["firm"], noise=0.02, seed=3)
    fitted = fit_table(table, config("[noise]\nheight_share = 0.04\n"))
    expected = np.hypot(0.02, 0.04 * fitted.fit.predicted)
    np.testing.assert_allclose(fitted.fit.sigma, expected, rtol=SETTLED)
    assert fitted.setup.noise.kind == "given"


def test_pooled_repeats_hold_the_share_already():
    table = scattered(share=0.05, constant=0.0, seed=0)
    with pytest.raises(ConfigError, match="height_share") as caught:
        fit_table(table, config('[noise]\nsigma = "pooled"\nheight_share = 0.05\n'))
    assert caught.value.code == "pooled_with_uneven"


@pytest.mark.parametrize("kind", ["given", "sampled"])
def test_tails_gain_the_ratio_of_the_likelihoods(kind):
    """By densities written out, and the likeliest scales of a fine grid."""
    table = case_table(CASES["firm"], noise=0.02, seed=3)
    fitted = fit_table(table, config('[noise]\nlikelihood = "normal"\n'))
    z = (table.heights("height") - fitted.fit.predicted) / fitted.fit.sigma
    scales = np.array([1.0]) if kind == "given" else np.geomspace(0.3, 3.0, 4001)
    squares = (z / scales[:, None]) ** 2
    normal = np.sum(-squares / 2 - np.log(2 * np.pi) / 2, axis=1)
    # Γ(5/2) / (Γ(2) √(4π)) = 3/8, and a variance of 1 by a scale of 1 / √2.
    student = np.sum(np.log(3 / 8 * 2**0.5) - 2.5 * np.log1p(squares / 2), axis=1)
    change = -z.size * np.log(scales)
    expected = np.max(student + change) - np.max(normal + change)
    found = tail_gain(fitted.setup.problem, fitted.fit, kind)
    np.testing.assert_allclose(found, expected, rtol=0, atol=SCALES)
    # Heights that are met have no tails, and one that is not is all tail.
    exact = replace(fitted.fit, predicted=table.heights("height"))
    assert tail_gain(fitted.setup.problem, exact, kind) == 0.0
    predicted = exact.predicted + np.eye(1, z.size)[0]
    one = replace(fitted.fit, predicted=predicted)
    assert tail_gain(fitted.setup.problem, one, kind) > 1.0


@pytest.mark.parametrize("share", [0.0, 0.05])
def test_a_share_gains_the_ratio_of_the_likelihoods(share):
    """By densities written out, and the likeliest of a fine grid of both parts."""
    table = scattered(share=share, constant=0.02, seed=4, repeats=3)
    fitted = fit_table(table, config(CONSTANT))
    heights, n, p = fitted.fit.predicted, 51, fitted.fit.n_free
    squares = (table.heights("height") - heights) ** 2 / (1 - p / n)
    sigmas = np.geomspace(0.002, 0.3, 801)[:, None, None]
    shares = np.r_[0.0, np.geomspace(1e-4, 0.3, 800)][:, None]
    variance = sigmas**2 + (shares * heights) ** 2
    levels = -np.sum(np.log(variance) + squares / variance, axis=2) / 2
    expected = np.max(levels) - np.max(levels[:, 0])
    assert (expected > MIN_SHARE_GAIN) == (share > 0)
    found = share_gain(fitted.setup.problem, fitted.fit, heights)
    np.testing.assert_allclose(found, expected, rtol=0, atol=PARTS)


def test_few_pushes_show_no_share():
    """Three pushes beyond the unknowns, and low ones that the fit goes through."""
    table = scattered(share=0.5, constant=0.0, seed=0, repeats=1).frame.iloc[:6]
    few = PeakTable.from_arrays(
        theta=np.radians(table["theta_deg"].to_numpy()),
        alpha=np.radians(table["alpha_deg"].to_numpy()),
        heights={"height": table["height_n"].to_numpy()},
        unit="n",
    )
    fitted = fit_table(few, config(CONSTANT))
    assert share_gain(fitted.setup.problem, fitted.fit, fitted.fit.predicted) == 0.0
