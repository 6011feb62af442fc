"""Populations whose truth, or whose posterior, is known from elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.population.item_likelihoods import (
    ItemDraws,
    effective_draws,
    likelihoods,
)
from pushfit.fit.population.pooling import _Grid, _tails, pool
from pushfit.parameters import TINY
from tests.tolerances import EXACT, ROUTES

# The same sums in another order, and roots found in them.
SUMS = 1e-7

# Draws at the quantiles of their density: no chance in them.
PROBS = (np.arange(400) + 0.5) / 400
SCALE = 1.0
# Of the variance of draws, what is lost where they are gathered in nodes.
IN_NODES = 3e-3


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


MEAN, SPREAD = np.linspace(-6, 6, 1201)[:, None], np.linspace(1e-4, 6, 1200)
# Probabilities of the quantiles of a posterior.
QUANTILES = [0.05, 0.5, 0.95, 0.9]


def weights_of(estimates, sds):
    """Normal-normal posterior on a plain rectangle of mean and spread."""
    log_density = -(SPREAD**2) / (2 * SCALE**2) + 0 * MEAN
    for y, sd in zip(estimates, sds, strict=True):
        log_density = log_density + stats.norm.logpdf(y, MEAN, np.hypot(SPREAD, sd))
    weights = np.exp(log_density - np.max(log_density))
    return weights / np.sum(weights)


def by_quadrature(estimates, sds):
    """Quantiles of mean and spread."""
    weights, found = weights_of(estimates, sds), []
    for axis, values in ((1, MEAN[:, 0]), (0, SPREAD)):
        mass = np.sum(weights, axis=axis)
        # Each point stands for the step around it.
        found.append(np.interp(QUANTILES, np.cumsum(mass) - mass / 2, values))
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
        spread[:3],
        rtol=0,
        atol=SHARE * (spread[2] - spread[0]),
    )
    assert (found.n_items, found.is_edge_reached) == (6, False)


N_REPEATS = 50
# Binomial with N = 50 and p = 0.9: outside with a probability of 0.4 %.
COVERED = stats.binom.ppf([0.002, 0.998], N_REPEATS, 0.9)


def test_intervals_of_the_mean_cover_under_a_prior_that_is_wrong():
    """Items lean on a prior two of its standard deviations off the population."""
    rng, n_covered, n_outlying = np.random.default_rng(0), 0, 0
    for _ in range(N_REPEATS):
        truth = rng.normal()
        sds = rng.uniform(0.1, 0.4, 10)
        estimates = rng.normal(truth + 0.3 * rng.normal(size=10), sds)
        items = items_at(estimates, sds, prior=(truth + 1.0, 0.5))
        found = pool(items, scale=SCALE)
        assert found is not None
        n_covered += found.mean_interval[0] <= truth <= found.mean_interval[1]
        n_outlying += bool(found.outliers)
    assert COVERED[0] <= n_covered <= COVERED[1]
    # Of one in 100 populations: more once in 600 seeds.
    assert n_outlying <= 3


def test_a_spread_that_may_be_zero_is_bounded_on_one_side():
    estimates = 0.2 * stats.norm.ppf((np.arange(8) + 0.5) / 8)
    found = pool(items_at(estimates, 0.2), scale=SCALE)
    assert found is not None
    assert (found.spread, found.spread_interval[0]) == (None, None)
    _, spread = by_quadrature(estimates, np.full(8, 0.2))
    np.testing.assert_allclose(found.spread_interval[1], spread[3], rtol=2 * SHARE)


def test_the_chance_of_an_item_is_that_which_all_others_predict():
    """Two-sided about the mean at each spread, by sums over the rectangle."""
    found = _tails(likelihoods(items_at(ESTIMATES, SDS)), SCALE)
    for i, (y, sd) in enumerate(zip(ESTIMATES, SDS, strict=True)):
        weights = weights_of(np.delete(ESTIMATES, i), np.delete(SDS, i))
        middle = np.sum(weights * MEAN, axis=0) / np.sum(weights, axis=0)
        off, width = np.abs(y - middle), np.hypot(SPREAD, sd)
        beyond = stats.norm.sf(middle + off, MEAN, width)
        beyond += stats.norm.cdf(middle - off, MEAN, width)
        np.testing.assert_allclose(found[i], np.sum(weights * beyond), rtol=SHARE)


def of_two_modes(centre: float) -> ItemDraws:
    """Four fifths at one value and a fifth far from it, each ± 0.1."""
    normal = 0.1 * stats.norm.ppf(PROBS)
    draws = np.r_[np.tile(centre + normal, 4), centre + 3.0 + normal]
    return ItemDraws(name="two", draws=draws, log_prior=np.zeros(draws.size))


def test_kernels_keep_the_moments_of_the_draws_that_they_stand_for():
    items = [*items_at(ESTIMATES, SDS, (1.0, 0.5)), of_two_modes(0.0)]
    found = likelihoods(items)
    weights = np.exp(found.log_weights)
    mean = np.sum(weights * found.nodes, axis=1)
    np.testing.assert_allclose(mean, found.mean, rtol=EXACT)
    variance = np.sum(weights * (found.nodes - mean[:, None]) ** 2, axis=1)
    variance += found.kernel**2
    np.testing.assert_allclose(variance, found.sd**2, rtol=IN_NODES)


def test_the_likelihood_of_an_item_has_its_modes():
    """Each a normal density, as wide as its draws and the spread together."""
    found = likelihoods([of_two_modes(0.0)])
    at = np.array([0.0, 0.2, 1.5, 2.9, 3.0])
    log_likelihood = found.at(at[:, None], np.log([0.2]))[:, 0]
    width = np.hypot(0.1, 0.2)
    expected = 0.8 * stats.norm.pdf(at, 0.0, width)
    expected += 0.2 * stats.norm.pdf(at, 3.0, width)
    ratio = np.exp(log_likelihood - log_likelihood[0]) / (expected / expected[0])
    np.testing.assert_allclose(ratio[[1, 3, 4]], 1.0, rtol=SHARE)
    assert ratio[2] * expected[2] < SHARE * expected[0]


@pytest.mark.parametrize("centres", [np.zeros(8), np.array([0.0, 0.1, -0.1, 0.2])])
def test_items_of_two_modes_have_the_mean_that_they_agree_on(centres):
    """A tenth of what each is as a whole, and the grid is laid out by that."""
    found = pool([of_two_modes(centre) for centre in centres], scale=SCALE)
    assert found is not None
    width = np.hypot(SPREAD, 0.1)
    log_density = -(SPREAD**2) / (2 * SCALE**2) + 0 * MEAN
    for centre in centres:
        density = 0.8 * stats.norm.pdf(MEAN, centre, width)
        density += 0.2 * stats.norm.pdf(MEAN, centre + 3.0, width)
        log_density += np.log(np.maximum(density, TINY))
    mass = np.sum(np.exp(log_density - np.max(log_density)), axis=1)
    mass /= np.sum(mass)
    low, high = np.interp([0.05, 0.95], np.cumsum(mass) - mass / 2, MEAN[:, 0])
    np.testing.assert_allclose(
        found.mean_interval, [low, high], rtol=0, atol=2 * SHARE * (high - low)
    )


def test_items_are_independent_however_many_there_are():
    found = likelihoods(items_at(np.linspace(-1.0, 1.0, 150), 0.1))
    mean, ln_spread = np.array([[-0.2, 0.1], [0.4, 0.5]]), np.log([0.05, 0.5])
    each = [found.take(np.arange(150) == i).at(mean, ln_spread) for i in range(150)]
    np.testing.assert_allclose(found.at(mean, ln_spread), np.sum(each, 0), rtol=ROUTES)


def test_draws_without_weight_make_no_kernel_narrower():
    draws = 0.3 * stats.norm.ppf(PROBS)
    alone = ItemDraws(name="alone", draws=draws, log_prior=np.zeros(draws.size))
    beside = ItemDraws(
        name="beside",
        draws=np.tile(draws, 3),
        log_prior=np.repeat([0.0, 100.0, 100.0], draws.size),
    )
    found = likelihoods([alone, beside])
    np.testing.assert_allclose(found.kernel[0], found.kernel[1], rtol=EXACT)


def test_a_draw_that_is_kept_for_half_of_the_time_leaves_a_kernel():
    draws = np.r_[np.zeros(300), np.linspace(-1.0, 1.0, 100)]
    found = likelihoods([ItemDraws(name="", draws=draws, log_prior=0 * draws)])
    assert found.kernel[0] > 0


def test_draws_count_that_lie_within_a_kernel_of_a_population_without_spread():
    """n E[w]² / E[w²] of normal draws, w = exp(-x² / (2 k²)), by Gaussian integrals."""
    (item,) = items = items_at([0.0], 0.3)
    known = likelihoods(items)
    (found,) = effective_draws(items, known, mean=0.0, spread=1e-9)
    s, k = 0.3, known.kernel[0]
    once, twice = k / np.hypot(k, s), k / np.hypot(k, np.sqrt(2) * s)
    np.testing.assert_allclose(found, item.draws.size * once**2 / twice, rtol=SHARE)


@pytest.mark.parametrize("where", [(0, 1), (2, 1), (1, 0), (1, 2)])
def test_the_edge_of_a_grid_is_that_of_mean_and_spread(where):
    weights = np.zeros((3, 3))
    weights[1, 1] = weights[where] = 0.5
    mean, ln_spread = np.linspace(-1.0, 1.0, 9).reshape(3, 3), np.linspace(0.0, 1.0, 3)
    grid = _Grid(mean=mean, step=np.ones(3), ln_spread=ln_spread, weights=weights)
    assert grid.edge == 0.5


def test_an_outlier_is_named_and_no_other():
    found = pool(items_at([1.0, 1.1, 0.9, 1.05, 0.95, 4.0], 0.05), scale=SCALE)
    assert found is not None
    assert found.outliers == ("item 5",)


@pytest.mark.parametrize("n", [20, 100])
def test_a_clean_population_has_no_outlier(n):
    """Of a hundred items the two at its ends are as far out as one in a hundred is."""
    estimates = 1 + 0.3 * stats.norm.ppf((np.arange(n) + 0.5) / n)
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
    assert pool([*told[:2], blind], scale=SCALE) is None


@pytest.mark.parametrize(
    ("what", "n_missing", "is_left_out"),
    [("draws", 16, False), ("draws", 40, True), ("log_prior", 40, True)],
)
def test_items_without_a_value_are_left_out(what, n_missing, is_left_out):
    """In more than one in twenty of their 400 draws."""
    items = items_at([1.0, 1.1, 0.9, 1.2], 0.1)
    values = getattr(items[3], what).copy()
    values[:n_missing] = np.nan
    items[3] = replace(items[3], **{what: values})
    found = pool(items, scale=SCALE)
    assert found is not None
    assert found.n_items == 4 - is_left_out
    assert (pool(items[1:], scale=SCALE) is None) is is_left_out


def test_an_item_of_one_value_is_left_out():
    items = items_at([1.0, 1.1, 0.9, 1.2], 0.1)
    items[3] = replace(items[3], draws=np.full(PROBS.size, 1.2))
    found = pool(items, scale=SCALE)
    assert found is not None
    assert found.n_items == 3


@pytest.mark.parametrize(("times", "offset"), [(100.0, 0.0), (1.0, 1e7)])
def test_the_order_of_items_their_unit_and_its_zero_change_nothing(times, offset):
    found = pool(items_at(ESTIMATES, SDS), scale=SCALE)
    other = items_at(offset + times * ESTIMATES, times * SDS)[::-1]
    other = pool(other, scale=times * SCALE)
    assert found is not None
    assert other is not None
    np.testing.assert_allclose(
        [one - offset for one in (other.mean, *other.mean_interval)],
        times * np.array([found.mean, *found.mean_interval]),
        rtol=SUMS,
    )
    np.testing.assert_allclose(
        other.spread_interval, times * np.array(found.spread_interval), rtol=SUMS
    )
