"""Draws to reported numbers: circular statistics and sets against known targets."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from pushfit.fit.problem.derived import (
    contraction,
    equal_tailed_interval,
    highest_density_set,
    median,
    samples_mapping,
)
from pushfit.fit.problem.setup import build_problem
from pushfit.mechanics.directions import best_direction, critical_angle
from pushfit.parameters import SIX
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

REACH = (0.0, np.pi)
# The standard errors of the two quantiles are 1.1 % and 0.5 %.
QUANTILES = 0.03
# Ends of a set scatter by 0.03 of a standard deviation, and kernel smoothing moves them
# by as much; those of draws that repeat scatter by 0.05.
ENDS, REPEATED = 0.1, 0.2
# Smoothing takes 0.011 off a set at the sharp end of an exponential density.
START = 0.05


def draws_about(centre: float, sd: float, n: int = 20000) -> np.ndarray:
    return np.random.default_rng(0).normal(centre, sd, n)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("paper", marks=pytest.mark.slow),
        "preload",
        "ellipse",
        "never_rolls",
    ],
)
def test_each_draw_is_the_model_at_that_draw(name):
    case = CASES[name]
    text = f"[grasp]\npreload_n = {float(case.grasp.preload)!r}\n"
    problem = build_problem(case_table(case), config(text)).problem
    rng = np.random.default_rng(1)
    x = rng.normal(0, 0.3, (5, len(problem.names))) + 1.0
    samples = samples_mapping(problem, x, np.pi / 2, reach=REACH)
    for i, row in enumerate(x):
        state = problem.state(jnp.asarray(row))
        for parameter in SIX:
            expected = float(getattr(state.params, parameter))
            np.testing.assert_allclose(samples[parameter][i], expected, rtol=EXACT)
        angle = critical_angle(state.params, problem.grasp, jnp.asarray(np.pi / 2))
        np.testing.assert_allclose(
            samples["theta_c"][i], np.degrees(angle), rtol=ROUTES
        )
        if "alpha_star" in samples:
            axis = best_direction(state.params, problem.grasp, 0.3, reach=REACH)
            expected = np.degrees(float(axis))
            np.testing.assert_allclose(samples["alpha_star"][i], expected, rtol=ROUTES)


def test_interval_of_an_axis_does_not_notice_the_seam():
    """Draws about 178° spread over 0°: the interval is that of draws about 90°."""
    away = draws_about(90.0, 5.0)
    across = np.mod(away + 88.0, 180.0)
    low, high = equal_tailed_interval(away, 0.9)
    seam_low, seam_high = equal_tailed_interval(across, 0.9, is_axis=True)
    np.testing.assert_allclose(
        [seam_low, seam_high], [low + 88, high + 88], rtol=ROUTES
    )
    middle = (np.median(away) + 88.0) % 180
    np.testing.assert_allclose(median(across, is_axis=True), middle, rtol=ROUTES)


def test_interval_is_equal_tailed():
    draws = np.random.default_rng(0).gamma(2.0, size=50000)
    expected = stats.gamma.ppf([0.05, 0.95], 2.0)
    np.testing.assert_allclose(
        equal_tailed_interval(draws, 0.9), expected, rtol=QUANTILES
    )


def test_set_of_a_skew_density_is_the_shortest():
    """Exponential: the highest-density 80 % set is [0, ln 5]."""
    draws = np.random.default_rng(0).exponential(size=50000)
    ((low, high),) = highest_density_set(draws, 0.8)
    assert low < START
    np.testing.assert_allclose(high, np.log(5), atol=ENDS)


def test_set_of_two_modes_has_two_pieces():
    draws = np.concatenate([draws_about(40.0, 1.0), draws_about(56.0, 1.0)])
    first, second = highest_density_set(draws, 0.9)
    half = stats.norm.ppf(0.95)
    np.testing.assert_allclose(first, [40 - half, 40 + half], atol=ENDS)
    np.testing.assert_allclose(second, [56 - half, 56 + half], atol=ENDS)


def test_draws_that_repeat_are_not_taken_for_modes():
    """A normal posterior by weights, drawn anew from 3000 draws of Student's t."""
    rng = np.random.default_rng(0)
    proposed = rng.standard_t(3.0, size=3000)
    weights = stats.norm.pdf(proposed) / stats.t.pdf(proposed, 3.0)
    draws = rng.choice(proposed, size=8192, p=weights / np.sum(weights))
    ((low, high),) = highest_density_set(draws, 0.9)
    half = stats.norm.ppf(0.95)
    np.testing.assert_allclose([low, high], [-half, half], atol=REPEATED)


def test_set_of_an_axis_crosses_the_seam():
    ((low, high),) = highest_density_set(
        np.mod(draws_about(179.0, 3.0), 180), 0.9, is_axis=True
    )
    half = 3 * stats.norm.ppf(0.95)
    np.testing.assert_allclose([low, high], [179 - half, 179 + half], atol=3 * ENDS)


@pytest.mark.parametrize(
    ("at_low", "at_high", "expected"),
    [
        (0.0, 0.95, ((30.0, 30.0),)),
        (0.47, 0.48, ((20.0, 20.0), (30.0, 30.0))),
        # A third of those between is the rest: the shortest lies beside the end.
        (0.0, 0.85, ((30.0 - np.log(1.5), 30.0),)),
    ],
)
def test_end_of_a_reach_that_many_draws_are_at_has_no_width(at_low, at_high, expected):
    """Others fall off as an exponential from the upper end; sets of 90 %."""
    n = 20000
    n_low, n_high = round(n * at_low), round(n * at_high)
    n_beside = n - n_low - n_high
    beside = 30.0 + np.log((np.arange(n_beside) + 0.5) / n_beside)
    draws = np.r_[np.full(n_low, 20.0), beside, np.full(n_high, 30.0)]
    found = highest_density_set(draws, 0.9, has_ends=True)
    np.testing.assert_allclose(found, expected, atol=ENDS)
    ends = [end for piece in found for end in piece]
    assert {20.0, 30.0} & set(ends) == set(np.ravel(expected)) & {20.0, 30.0}


def test_draws_without_a_critical_angle_are_left_out():
    draws = np.concatenate([draws_about(20.0, 1.0, 100), np.full(50, np.nan)])
    assert np.isfinite(equal_tailed_interval(draws, 0.9)).all()
    assert np.isnan(median(np.full(3, np.nan)))


def test_contraction_of_a_conjugate_normal_is_known():
    """Prior sd 1 and data of sd ½: the posterior variance is 1/5."""
    prior, posterior = draws_about(0.0, 1.0), draws_about(0.3, np.sqrt(0.2))
    np.testing.assert_allclose(contraction(posterior, prior), 0.8, rtol=0, atol=ROUTES)
