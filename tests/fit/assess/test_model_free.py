"""The cosine through the heights: known minima, a seam, and no minimum at all."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.config.schema import ReachSection
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.model_free import (
    DISAGREEMENT,
    ROLLED,
    _amplitude_may_vanish,
    direction_disagreement,
    model_free_direction,
)
from pushfit.fit.results import Quantity, Verdict
from pushfit.model import Grasp, Parameters, Pushes, forward
from tests.tolerances import MAX_Z

# Noise of a billionth of the wave turns its minimum by less [deg].
OF_NOISE = 1e-6
# Tables, and four binomial sd of how many of their 90 % intervals hold the truth.
N_TABLES = 300
CHANCE = MAX_Z * np.sqrt(N_TABLES * 0.9 * 0.1)

# Four standard errors of the 5 % quantiles of 4000 draws of t with two degrees of
# freedom, whose density there is 0.029.
OF_DRAWS = 4 * np.sqrt(0.05 * 0.95 / 4000) / 0.029 / 2.92 / np.sqrt(2)

REACH = ReachSection()

# Soft axis of a grasp that tilts, and what a cosine misses of the shape of the wave and
# of the noise [deg].
AXIS_DEG = 65.0
OF_A_COSINE = 3.0
ALONG = 2 * np.radians(AXIS_DEG + 90.0)
SOFT = Parameters(
    K_sn=800,
    K_dn=1500,
    K_st=400,
    C_rr=0.5,
    C_d=0.5,
    L=0.04,
    e1=1.2 * np.cos(ALONG),
    e2=1.2 * np.sin(ALONG),
)
LINEAR = Grasp(push_length=5e-3)
TILTING = replace(LINEAR, mechanics="tilting")

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


def tilting_table(theta_deg: float, channels: tuple[str, ...]) -> PeakTable:
    """Pushes of 5 mm along all azimuths; they roll below about 32°."""
    return simulate_table(
        SOFT,
        TILTING,
        theta=np.radians(theta_deg),
        alpha=np.radians(ALPHA_DEG),
        repeats=1,
        noise=1e-3,
        rng=np.random.default_rng(0),
        channels=channels,
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


@pytest.mark.parametrize(
    "channels",
    [
        ("height_normal", "height_tangential"),
        ("height", "height_normal", "height_tangential"),
        ("height",),
    ],
    ids=["components", "all", "magnitude"],
)
def test_a_tilting_object_is_softest_where_its_tangential_height_is_least(channels):
    """Its normal height is then largest, as the object tilts least."""
    table = tilting_table(60.0, channels)
    found = model_free_direction(table, reach=REACH, prob=0.9, seed=0)
    assert found is not None
    assert found.estimate is not None
    np.testing.assert_allclose(found.estimate, AXIS_DEG, rtol=0, atol=OF_A_COSINE)


@pytest.mark.parametrize(
    ("theta_deg", "is_described", "codes"),
    [
        (60.0, True, []),
        (15.0, True, [ROLLED]),
        (15.0, False, [DISAGREEMENT]),
    ],
)
def test_pushes_that_roll_turn_the_cosine_as_the_model_has_it(
    theta_deg, is_described, codes
):
    """Those of 15° roll, and a tilting object then resists most along its soft axis."""
    table = tilting_table(theta_deg, ("height",))
    free = model_free_direction(table, reach=REACH, prob=0.9, seed=0)
    assert free is not None
    around = (AXIS_DEG - OF_A_COSINE, AXIS_DEG + OF_A_COSINE)
    alpha_star = replace(free, estimate=AXIS_DEG, interval=around)

    def predict(angles):
        grasp = TILTING if is_described else LINEAR
        return np.asarray(forward(SOFT, Pushes(*angles), grasp).height)[None]

    found = direction_disagreement(
        alpha_star, free, table, grasp=TILTING, predict=predict
    )
    assert [warning.code for warning in found] == codes


@pytest.mark.parametrize(
    ("apart", "turned", "grasp", "codes"),
    [
        (9.5, 0.0, LINEAR, []),
        (10.5, 0.0, LINEAR, [DISAGREEMENT]),
        (40.0, 7.5, TILTING, [ROLLED]),
        (40.0, 12.5, TILTING, [DISAGREEMENT]),
    ],
)
def test_intervals_of_10_degrees_disagree_if_they_do_not_touch(
    apart, turned, grasp, codes
):
    """And the model's own cosine explains it within the width of one."""
    table = wave_table(AXIS_DEG, 1.0, 0.1)
    some = model_free_direction(table, reach=REACH, prob=0.9, seed=0)
    middle = AXIS_DEG + apart
    first, second = (
        replace(some, interval=(centre - 5.0, centre + 5.0))
        for centre in (AXIS_DEG, middle)
    )

    def predict(angles):
        return -np.cos(2 * (angles[1] - np.radians(middle + turned)))[None]

    found = direction_disagreement(first, second, table, grasp=grasp, predict=predict)
    assert [warning.code for warning in found] == codes


@pytest.mark.parametrize(("n_azimuths", "is_found"), [(2, False), (3, True)])
def test_three_azimuths_at_an_elevation_are_a_sweep(n_azimuths, is_found):
    frame = wave_table(AXIS_DEG, 1.0, 0.1).frame
    kept = PeakTable.from_frame(frame[frame["alpha_deg"] < 30.0 * n_azimuths - 1])
    found = model_free_direction(kept, reach=REACH, prob=0.9, seed=0)
    assert (found is not None) is is_found


def test_normal_heights_alone_have_no_direction():
    table = tilting_table(60.0, ("height_normal",))
    assert model_free_direction(table, reach=REACH, prob=0.9, seed=0) is None


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


@pytest.mark.parametrize(
    "alpha_deg",
    [[0.0, 90.0] * 3, [0.0, 90.0, 180.0] * 2, [0.0, 90.0, 179.9999] * 2, [0, 60, 120]],
    ids=["two", "the same axis", "nearly the same", "one height each"],
)
def test_two_azimuths_or_none_to_spare_are_no_sweep(alpha_deg):
    table = PeakTable.from_arrays(
        theta=np.full(len(alpha_deg), 0.3),
        alpha=np.radians(alpha_deg),
        heights={"height": np.arange(len(alpha_deg)) + 1.0},
        unit="n",
    )
    assert model_free_direction(table, reach=REACH, prob=0.9, seed=0) is None


def test_elevations_as_a_robot_reports_them_are_those_that_it_was_sent_to():
    table = wave_table(65.0, 1.0, 0.1)
    missed = table.frame["theta_deg"] + 1e-4 * table.frame["alpha_deg"] / 30
    reported = PeakTable.from_frame(table.frame.assign(theta_deg=missed))
    exact, found = (
        model_free_direction(one, reach=REACH, prob=0.9, seed=0)
        for one in (table, reported)
    )
    assert exact is not None
    assert found is not None
    assert found.interval == exact.interval


def second_harmonic(ratio: float) -> Quantity:
    """A wave beside one of half its period, which is all that is left: F = ratio²."""
    alpha = np.pi * np.arange(5) / 5
    table = PeakTable.from_arrays(
        theta=np.full(5, 0.3),
        alpha=alpha,
        heights={"height": 5 - ratio * np.cos(2 * alpha) + np.cos(4 * alpha)},
        unit="n",
    )
    found = model_free_direction(table, reach=REACH, prob=0.9, seed=0)
    assert found is not None
    return found


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_an_amplitude_vanishes_by_the_f_test_of_as_few_residuals(share):
    """Two of five heights are left."""
    ratio = share * np.sqrt(scipy.stats.f.ppf(0.9, 2, 2))
    is_round = second_harmonic(ratio).verdict is Verdict.NOT_DETERMINED
    assert is_round is (share < 1)


def test_an_interval_is_as_wide_as_student_s_t_has_it():
    """By the slope of the angle: the variance of either amplitude is 2 σ²/n."""
    ratio, sigma = 100.0, np.sqrt(5 / 2 / 2)
    sd_deg = np.degrees(sigma * np.sqrt(2 / 5) / (2 * ratio))
    low, high = second_harmonic(ratio).interval
    half = scipy.stats.t.ppf(0.95, 2) * sd_deg
    np.testing.assert_allclose((high - low) / 2, half, rtol=OF_DRAWS)


def test_a_wave_without_scatter_is_one_and_no_wave_is_none():
    nothing = np.zeros((2, 2))
    words = {"dof": 2, "prob": 0.9}
    assert _amplitude_may_vanish(np.zeros(2), nothing, **words)
    assert not _amplitude_may_vanish(np.array([1.0, 0.0]), nothing, **words)
