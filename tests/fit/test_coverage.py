"""Coverage: truths that are really in the tables, and counts that are read honestly."""

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.coverage import Coverage, coverage_study, holds, simulate_tables
from pushfit.fit.identify.fit_table import fit_table
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

NOISE = 0.03
N_TABLES = 40
LIMIT = 1e-3  # false alarms per seed


@pytest.fixture(scope="module")
def fitted():
    table = case_table(CASES["firm"], noise=NOISE, seed=1)
    return fit_table(table, config())


@pytest.fixture(scope="module")
def simulation(fitted):
    return simulate_tables(fitted, N_TABLES, np.random.default_rng(0))


def test_simulated_tables_repeat_the_pushes_of_the_users(fitted, simulation):
    assert len(simulation.tables) == N_TABLES
    same = ["theta_deg", "alpha_deg", "repeat", "height_sd_n"]
    for table in simulation.tables:
        assert table.unit == "n"
        np.testing.assert_allclose(
            table.frame[same], fitted.table.frame[same], rtol=EXACT, atol=0
        )


def test_heights_scatter_about_their_truth_by_the_noise(simulation):
    """Eqs. (12)-(14) by hand; the sum of squares is chi-square."""
    truths = simulation.truths
    total = 0.0
    for index, table in enumerate(simulation.tables):
        A, B, C_rr = (truths[name][index] for name in ("A", "B", "C_rr"))
        normal = 0.005 * A * np.sin(table.theta)
        tangential = np.minimum(C_rr * normal, 0.005 * B * np.cos(table.theta))
        error = table.heights("height") - np.hypot(normal, tangential)
        total += float(np.sum((error / NOISE) ** 2))
    n = N_TABLES * simulation.tables[0].n_pushes
    # Normal limit of chi-square: 3.3 standard deviations.
    assert abs(total - n) < 3.3 * np.sqrt(2 * n)


def test_truths_are_draws_from_the_priors(simulation):
    """C_rr has the default prior: median 0.3, standard deviation 0.8 of the log."""
    z = (np.log(simulation.truths["C_rr"]) - np.log(0.3)) / 0.8
    assert abs(np.mean(z)) < 3.3 / np.sqrt(N_TABLES)
    assert abs(np.mean(z**2) - 1) < 3.3 * np.sqrt(2 / N_TABLES)


def test_the_limits_are_those_of_clopper_and_pearson():
    """With no success the upper limit p solves (1 - p)^n = 2.5 %."""
    none = Coverage(name="A", kind="interval", prob=0.5, n_held=0, n_tables=20)
    assert none.limits == (0.0, pytest.approx(1 - 0.025 ** (1 / 20), rel=ROUTES))
    assert not none.is_compatible
    fine = Coverage(name="A", kind="interval", prob=0.9, n_held=17, n_tables=20)
    assert fine.is_compatible
    nothing = Coverage(name="A", kind="interval", prob=0.9, n_held=0, n_tables=0)
    assert nothing.limits == (0.0, 1.0)
    assert np.isnan(nothing.share)


@pytest.mark.parametrize(
    ("pieces", "truth", "expected"),
    [
        (((10.0, 20.0), (40.0, 50.0)), 30.0, False),
        (((10.0, 20.0), (40.0, 50.0)), 45.0, True),
        (((60.0, None),), 89.0, True),
        (((None, 20.0),), 21.0, False),
        (((170.0, 190.0),), 5.0, True),
        (((170.0, 190.0),), 15.0, False),
        (((-30.0, -20.0),), -25.0, True),
        (((-30.0, -20.0),), 155.0, False),
    ],
)
def test_a_set_holds_what_lies_in_a_piece_of_it(pieces, truth, expected):
    """That of an axis goes on beyond 180°."""
    assert holds(pieces, truth) is expected


@pytest.mark.slow
def test_intervals_cover_at_the_level_that_they_claim(fitted):
    """The binomial test of each claim, at a level shared by all of them."""
    found = coverage_study(fitted.table, config(), n_tables=100, seed=0)
    assert found.n_failed == 0
    intervals = [c for c in found.coverages if c.kind == "interval"]
    for c in intervals:
        p_value = stats.binomtest(c.n_held, c.n_tables, c.prob).pvalue
        assert p_value > LIMIT / len(intervals), c
