"""Populations whose truth, or whose posterior, is known from elsewhere."""

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.population.item_likelihoods import ItemDraws
from pushfit.fit.population.pooling import pool

# The same sums in another order, and roots found in them.
SUMS = 1e-7

# Draws at the quantiles of their density: no chance in them.
PROBS = (np.arange(400) + 0.5) / 400
SCALE = 1.0


def normal_item(name: str, estimate: float, sd: float, prior=None) -> ItemDraws:
    """Posterior of a normal estimate under a normal or a flat prior (mean, sd)."""
    if prior is None:
        draws = estimate + sd * stats.norm.ppf(PROBS)
        return ItemDraws(name=name, draws=draws, log_prior=np.zeros(draws.size))
    precision = sd**-2 + prior[1] ** -2
    mean = (estimate / sd**2 + prior[0] / prior[1] ** 2) / precision
    draws = mean + precision**-0.5 * stats.norm.ppf(PROBS)
    return ItemDraws(name=name, draws=draws, log_prior=stats.norm.logpdf(draws, *prior))


def items_at(estimates, sds, prior=None) -> list[ItemDraws]:
    sds = np.broadcast_to(sds, np.shape(estimates))
    return [
        normal_item(f"item {k}", float(y), float(sd), prior)
        for k, (y, sd) in enumerate(zip(estimates, sds, strict=True))
    ]


def by_quadrature(estimates, sds):
    """Normal-normal posterior on a plain rectangle: quantiles of mean and spread."""
    mean = np.linspace(-6, 6, 1201)[:, None]
    spread = np.linspace(1e-4, 6, 1200)
    log_density = -(spread**2) / (2 * SCALE**2) + 0 * mean
    for y, sd in zip(estimates, sds, strict=True):
        log_density = log_density + stats.norm.logpdf(y, mean, np.hypot(spread, sd))
    weights = np.exp(log_density - np.max(log_density))
    weights /= np.sum(weights)
    found = []
    for axis, values in ((1, mean[:, 0]), (0, spread)):
        mass = np.sum(weights, axis=axis)
        # Each point stands for the step around it.
        found.append(np.interp([0.05, 0.5, 0.95], np.cumsum(mass) - mass / 2, values))
    return found


ESTIMATES = np.array([-0.6, 0.1, 0.5, 0.9, -0.2, 0.4])
SDS = np.array([0.1, 0.2, 0.15, 0.1, 0.3, 0.05])
# 400 draws under a kernel stand for each normal density, and the grid has steps of 0.3
# standard deviations: together below 3 % of the width of an interval.
SHARE = 0.03


@pytest.mark.parametrize("prior", [None, (1.0, 0.5)])
def test_normal_items_have_the_closed_posterior(prior):
    """Whatever the prior of the items, the population is that of the estimates."""
    found = pool(items_at(ESTIMATES, SDS, prior), scale=SCALE)
    assert found is not None
    mean, spread = by_quadrature(ESTIMATES, SDS)
    np.testing.assert_allclose(
        found.mean_interval, mean[[0, 2]], rtol=0, atol=SHARE * (mean[2] - mean[0])
    )
    low, high = found.spread_interval
    np.testing.assert_allclose(
        np.array([low, found.spread, high], dtype=float),
        spread,
        rtol=0,
        atol=SHARE * (spread[2] - spread[0]),
    )
    assert (found.n_items, found.is_edge_reached) == (6, False)


N_REPEATS = 50
# Binomial with N = 50 and p = 0.9: outside with a probability of 0.4 %.
COVERED = stats.binom.ppf([0.002, 0.998], N_REPEATS, 0.9)


def test_intervals_of_the_mean_cover_under_a_prior_that_is_wrong():
    """Items lean on a prior two of its standard deviations off the population."""
    rng, n_covered = np.random.default_rng(0), 0
    for _ in range(N_REPEATS):
        truth = rng.normal()
        sds = rng.uniform(0.1, 0.4, 10)
        estimates = rng.normal(truth + 0.3 * rng.normal(size=10), sds)
        items = items_at(estimates, sds, prior=(truth + 1.0, 0.5))
        found = pool(items, scale=SCALE)
        assert found is not None
        n_covered += found.mean_interval[0] <= truth <= found.mean_interval[1]
    assert COVERED[0] <= n_covered <= COVERED[1]


def test_a_spread_that_may_be_zero_is_bounded_on_one_side():
    estimates = 0.2 * stats.norm.ppf((np.arange(8) + 0.5) / 8)
    found = pool(items_at(estimates, 0.2), scale=SCALE)
    assert found is not None
    assert (found.spread, found.spread_interval[0]) == (None, None)
    # The spread among eight estimates of ± 0.2 is known no better than that.
    assert 0.05 < found.spread_interval[1] < 0.4


def test_an_outlier_is_named_and_no_other():
    found = pool(items_at([1.0, 1.1, 0.9, 1.05, 0.95, 4.0], 0.05), scale=SCALE)
    assert found is not None
    assert found.outliers == ("item 5",)


def test_a_clean_population_has_no_outlier():
    estimates = 1 + 0.3 * stats.norm.ppf((np.arange(20) + 0.5) / 20)
    found = pool(items_at(estimates, 0.05), scale=SCALE)
    assert found is not None
    assert found.outliers == ()


def test_an_item_whose_prior_hides_the_population_is_not_usable():
    """Hardly a draw of an item that only repeats its prior lies where others are."""
    told = items_at([3.0, 3.1, 2.9, 3.05], 0.05)
    blind = ItemDraws(
        name="blind",
        draws=0.8 * stats.norm.ppf(PROBS),
        log_prior=stats.norm.logpdf(0.8 * stats.norm.ppf(PROBS), scale=0.8),
    )
    found, alone = pool([*told, blind], scale=SCALE), pool(told, scale=SCALE)
    assert found is not None
    assert alone is not None
    assert (found.not_usable, found.n_items) == (("blind",), 4)
    assert found.mean == alone.mean


def test_items_without_a_value_are_left_out():
    items = items_at([1.0, 1.1, 0.9, 1.2], 0.1)
    draws = items[3].draws.copy()
    draws[:40] = np.nan
    items[3] = ItemDraws(name="never", draws=draws, log_prior=items[3].log_prior)
    found = pool(items, scale=SCALE)
    assert found is not None
    assert found.n_items == 3
    assert pool(items[1:], scale=SCALE) is None


def test_the_order_of_items_and_the_unit_change_nothing():
    found = pool(items_at(ESTIMATES, SDS), scale=SCALE)
    other = pool(items_at(100 * ESTIMATES, 100 * SDS)[::-1], scale=100 * SCALE)
    assert found is not None
    assert other is not None
    np.testing.assert_allclose(
        [other.mean, *other.mean_interval, *other.spread_interval],
        100 * np.array([found.mean, *found.mean_interval, *found.spread_interval]),
        rtol=SUMS,
    )
