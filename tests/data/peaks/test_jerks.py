"""Jerks of a single channel: they hide no hold, and are no pushes."""

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError

HOLDS = (5.0, 5.5, 4.5)
# Of a hold in noise of 0.02 N [N].
NEAR = 0.02
TOLD = "jerks far briefer than a push are left out"


def recording(course, *, jerks=(), rate=100.0):
    """Pushes of two seconds every four; jerks of so many newtons at moments."""
    time = np.arange(0.0, 15.0, 1 / rate)
    since = np.abs(time[:, None] - 3.0 - 4.0 * np.arange(3))
    y = course(since) @ HOLDS + 0.02 * np.random.default_rng(5).standard_normal(
        len(time)
    )
    for moment, height in jerks:
        y += height * np.exp(-(((time - moment) / 0.02) ** 2) / 2)
    return Recording(time=time, channels={"f": y}, units={"f": "n"})


def held(since):
    return np.clip(10 * (1 - since), 0, 1)


@pytest.mark.parametrize("rate", [60.0, 100.0, 500.0])
@pytest.mark.parametrize("height", [40.0, 60.0, 120.0])
@pytest.mark.parametrize(
    "at", [3.98, 2.02, 3.5, 4.3], ids=["leaving", "on contact", "in a hold", "after it"]
)
def test_a_jerk_is_neither_a_push_nor_the_height_of_one(at, height, rate):
    moments = at + 4.0 * np.arange(3)
    own = recording(held, jerks=[(when, height) for when in moments], rate=rate)
    found = measure_pushes(own)
    np.testing.assert_allclose(found.frame["height_n"], HOLDS, rtol=0, atol=NEAR)
    assert not any(found.frame["flags"])


@pytest.mark.parametrize("rate", [60.0, 100.0, 500.0])
@pytest.mark.parametrize("depth", [3.0, 6.0, 70.0])
@pytest.mark.parametrize("every", [1, 2])
@pytest.mark.parametrize("at", [3.98, 4.05, 4.3])
def test_a_jerk_down_on_retracting_leaves_the_pushes(at, every, depth, rate):
    """Deeper than the pushes are high: none of these is the shoulder of a brief dip."""
    moments = at + 4.0 * np.arange(0, 3, every)
    own = recording(held, jerks=[(when, -depth) for when in moments], rate=rate)
    found = measure_pushes(own)
    np.testing.assert_allclose(found.frame["height_n"], HOLDS, rtol=0, atol=NEAR)
    assert not any(found.frame["flags"])
    assert any("the signal falls below rest" in caution for caution in found.cautions)


@pytest.mark.parametrize("rate", [60.0, 100.0, 500.0])
@pytest.mark.parametrize("level", [0.0, -20.0])
@pytest.mark.parametrize("at", [2.5, 3.0, 3.6])
def test_a_contact_that_is_lost_for_moments_parts_no_hold(at, level, rate):
    """For 40 ms each; neither is the hold a hump, or its height another one."""
    own = recording(held, rate=rate)
    since = own.time[:, None] - at - 4.0 * np.arange(3)
    is_lost = np.any(np.abs(since) < 0.02, axis=1)
    y = np.where(is_lost, level, own.channels["f"])
    found = measure_pushes(Recording(time=own.time, channels={"f": y}, units=own.units))
    np.testing.assert_allclose(found.frame["height_n"], HOLDS, rtol=0, atol=NEAR)
    assert set(found.frame["definition"]) == {"plateau"}
    assert not any(found.frame["flags"])
    told = "far below all around them, for less than a push lasts, are left out: at"
    assert any(told in caution for caution in found.cautions)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("min_height", [None, 1.0])
def test_what_rises_beside_deeper_dips_is_named_where_none_is_a_push(min_height):
    """Pulls of 12 after each push, for 0.3 s: which of them are pushes is not known."""
    time = np.arange(0.0, 15.0, 0.01)
    since = time[:, None] - 3.0 - 4.0 * np.arange(3)
    y = (held(np.abs(since)) @ HOLDS) - 12 * np.sin(
        np.pi * np.clip((since - 1) / 0.3, 0, 1)
    ).sum(axis=1)
    y += 0.02 * np.random.default_rng(5).standard_normal(len(time))
    own = Recording(time=time, channels={"f": y}, units={"f": "n"})
    with pytest.raises(DataError, match=r"rises above it by 5\.\d+ n at most, at 6\."):
        measure_pushes(own, settings=PeakSettings(min_height=min_height))


def test_a_jerk_at_the_begin_of_a_recording_makes_no_brush_of_pushes():
    found = measure_pushes(recording(held, jerks=[(0.1, 40.0)]))
    np.testing.assert_allclose(found.frame["height_n"], HOLDS, rtol=0, atol=NEAR)
    assert [caution for caution in found.cautions if TOLD in caution]


def test_a_jerk_is_told_of_where_pushes_go_both_ways_too():
    time = np.arange(0.0, 15.0, 0.01)
    since = np.abs(time[:, None] - 3.0 - 4.0 * np.arange(3))
    y = held(since) @ [-5.0, 5.5, 4.5] + 60 * np.exp(-(((time - 7.5) / 0.02) ** 2) / 2)
    y += 0.02 * np.random.default_rng(5).standard_normal(len(time))
    own = Recording(time=time, channels={"f": y}, units={"f": "n"})
    plan = PushSchedule.planned(np.radians([-30.0, 30.0, 50.0]), np.zeros(3), repeats=1)
    table = extract_peaks(own, plan)
    expected = [-5.0, 5.5, 4.5]
    np.testing.assert_allclose(table.heights("height"), expected, rtol=0, atol=NEAR)
    assert any(TOLD in caution for caution in table.cautions)


@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.15, 0.2])
@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_a_jerk_on_top_of_a_slow_push_is_not_its_height(seconds, rate):
    """What is told to be left out is; it hides the top, which is flagged for it."""
    time = np.arange(0.0, 27.0, 1 / rate)
    y = 0.01 * np.random.default_rng(6).standard_normal(len(time))
    jerk = (14, 10, seconds / 2)
    for top, height, half in ((5, 5, 1.5), (14, 6, 1.5), (22, 5, 1.5), jerk):
        y += height * np.clip(1 - np.abs(time - top) / half, 0, None)
    found = measure_pushes(Recording(time=time, channels={"f": y}, units={"f": "n"}))
    assert any(TOLD in caution for caution in found.cautions)
    assert found.frame["flags"].tolist() == ["", "gap", ""]
    assert 5 < found.frame["height_n"].iloc[1] < 6.1


@pytest.mark.parametrize("seconds", [0.05, 0.08, 0.12, 0.2])
def test_what_rebounds_from_taps_downwards_is_no_push(seconds):
    """Taps that are hardly briefer than the rebounds are what the finger did."""
    time = np.arange(0.0, 23.0, 0.005)
    since = time[:, None] - 2.0 - 2.0 * np.arange(10)
    tap, rebound = (
        np.sin(np.pi * np.clip(u, 0, 1)) ** 2
        for u in (since / seconds, (since - seconds) / 0.3)
    )
    y = (0.37 * rebound - 1.5 * tap).sum(axis=1)
    y += 0.005 * np.random.default_rng(5).standard_normal(len(time))
    with pytest.raises(DataError, match="invert"):
        measure_pushes(Recording(time=time, channels={"f": y}, units={"f": "n"}))


def test_taps_by_themselves_are_pushes():
    """All of them are as brief as a jerk; there is nothing else."""
    found = measure_pushes(recording(lambda since: since < 0.03, rate=1000.0))
    assert len(found.frame) == len(HOLDS)
    assert not [caution for caution in found.cautions if TOLD in caution]


@pytest.mark.parametrize("seed", range(5))
def test_a_recording_is_not_all_jerks(seed):
    """Of 70 ms nothing is left once what is beside two spikes is left out."""
    time = np.arange(140) / 2000.0
    y = 1e-3 * np.random.default_rng(seed).standard_normal(140) - 2e-3 * time / 0.07
    y[[36, 102]] -= 0.05
    own = Recording(time=time, channels={"f": y}, units={"f": "n"})
    found = find_pushes(own)
    assert all(0.0 <= push.t_peak <= time[-1] for push in found)


def test_a_jerk_that_is_included_is_a_push():
    own = recording(held, jerks=[(14.0, 40.0)])
    window = ((13.9, 14.1),)
    found = measure_pushes(own, settings=PeakSettings(include=window))
    assert found.frame["height_n"].iloc[-1] > 2 * max(HOLDS)
    left_out = measure_pushes(own)
    assert len(left_out.frame) == len(HOLDS)
    assert any(TOLD in caution for caution in left_out.cautions)
