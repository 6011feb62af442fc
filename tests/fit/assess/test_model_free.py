"""The cosine through the heights: known minima, a seam, and no minimum at all."""

import numpy as np
import pytest

from pushfit.config.schema import ReachSection
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.model_free import model_free_direction
from pushfit.fit.results import Verdict
from tests.tolerances import MAX_Z

# Noise of a billionth of the wave turns its minimum by less [deg].
OF_NOISE = 1e-6
# Tables, and four binomial sd of how many of their 90 % intervals hold the truth.
N_TABLES = 300
CHANCE = MAX_Z * np.sqrt(N_TABLES * 0.9 * 0.1)

REACH = ReachSection()

ALPHA_DEG = np.tile(np.arange(0.0, 180.0, 30.0), 3)


def wave_table(axis_deg: float, amplitude: float, noise: float, seed: int = 0):
    rng = np.random.default_rng(seed)
    wave = -amplitude * np.cos(2 * np.radians(ALPHA_DEG - axis_deg))
    heights = 5.0 + wave + rng.normal(0, noise, ALPHA_DEG.size)
    return PeakTable.from_arrays(
        theta=np.full(ALPHA_DEG.size, np.radians(15.0)),
        alpha=np.radians(ALPHA_DEG),
        heights={"height": heights},
        unit="n",
    )


@pytest.mark.parametrize("axis_deg", [65.0, 1.0, 179.0])
def test_minimum_of_a_pure_wave_is_exact(axis_deg):
    found = model_free_direction(
        wave_table(axis_deg, 1.0, 1e-9), reach=REACH, prob=0.9, seed=0
    )
    assert found is not None
    np.testing.assert_allclose(found.estimate, axis_deg, atol=OF_NOISE)


@pytest.mark.parametrize(
    ("alpha_deg", "expected"),
    [
        ((-150.0, -80.0), -115.0),
        ((100.0, 260.0), 245.0),
        ((-80.0, -20.0), -80.0),  # that is 100, nearer to 65 than -20, that is 160
        ((-10.0, 40.0), 40.0),
    ],
)
def test_the_minimum_lies_within_the_reach(alpha_deg, expected):
    reach = ReachSection(alpha_deg=alpha_deg)
    table = wave_table(65.0, 1.0, 1e-9)
    found = model_free_direction(table, reach=reach, prob=0.9, seed=0)
    assert found is not None
    assert found.interval is not None
    ends = np.array([found.estimate, *found.interval])
    np.testing.assert_allclose(ends, expected, rtol=0, atol=OF_NOISE)


@pytest.mark.slow
def test_interval_covers_the_axis_as_often_as_it_says():
    n_covered = 0
    for seed in range(N_TABLES):
        found = model_free_direction(
            wave_table(65.0, 1.0, 0.3, seed), reach=REACH, prob=0.9, seed=1
        )
        assert found is not None
        if found.interval is not None:
            low, high = found.interval
            n_covered += (65.0 - low) % 180.0 <= high - low
    assert abs(n_covered - 0.9 * N_TABLES) < CHANCE


def test_round_heights_have_no_direction():
    found = model_free_direction(
        wave_table(65.0, 0.0, 0.3), reach=REACH, prob=0.9, seed=0
    )
    assert found is not None
    assert found.verdict is Verdict.NOT_DETERMINED
    assert found.estimate is None
    assert found.interval is None


def test_two_azimuths_are_no_sweep():
    table = PeakTable.from_arrays(
        theta=np.full(6, 0.3),
        alpha=np.radians([0.0, 90.0] * 3),
        heights={"height": np.arange(6.0) + 1},
        unit="n",
    )
    assert model_free_direction(table, reach=REACH, prob=0.9, seed=0) is None
