"""Rests between holds that are longer, where pushes may go both ways."""

import re

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError

RATE, NOISE = 100.0, 0.02
# Holds and rests scatter by 0.002 and 0.005 N, and ramps belong to neither.
NEAR = 0.05
RAMP = 0.2
EQUAL = [5.0] * 8
REPEATED = [1.0, 1.0, 1.0, 3.0, 3.0, 3.0, 5.0, 5.0, 5.0]
BOTH_WAYS = [3.0, 3.0, 3.0, 3.0, -3.0, -3.0, -3.0, -3.0]
# Of holds, and of the rests between them [s].
LENGTHS = [(1.0, 2.0), (2.0, 1.0), (3.0, 1.0), (5.0, 1.0)]


def course(heights, hold, rest, drift, ramp=RAMP):
    """Holds with a rest before each and after the last."""
    starts = rest + (hold + rest) * np.arange(len(heights))
    time = np.arange(0.0, starts[-1] + hold + rest, 1 / RATE)
    since = time[:, None] - starts
    share = np.clip(np.minimum(since, hold - since) / ramp, 0, 1)
    return time, share @ heights + drift * time


@pytest.mark.parametrize(("drift", "count"), [(0.0, 0.0), (0.003, 0.0), (0.0, 0.04)])
@pytest.mark.parametrize(("hold", "rest"), LENGTHS)
@pytest.mark.parametrize("heights", [EQUAL, REPEATED, BOTH_WAYS])
@pytest.mark.parametrize("share", [{"fz": 1.0}, {"fx": 0.3, "fy": 0.0, "fz": 0.954}])
def test_rests_between_longer_holds_are_the_rest(
    share, heights, hold, rest, drift, count
):
    """Of a signal that goes both ways, and of force components, some of them counted.

    Args:
        drift: Of the rest [N/s].
        count: Resolution; 0 for the finest [N].
    """
    time, y = course(heights, hold, rest, drift)
    rng = np.random.default_rng(1)
    forces = {
        name: own * y + NOISE * rng.standard_normal(len(time))
        for name, own in share.items()
    }
    if count:
        forces = {name: count * np.round(own / count) for name, own in forces.items()}
    is_one = len(share) == 1
    recording = Recording(time=time, channels=forces, units=dict.fromkeys(forces, "n"))
    settings = PeakSettings(signed=True) if is_one else PeakSettings(normal="fz")
    found = measure_pushes(recording, settings=settings).frame
    column = found["height_n" if is_one else "height_normal_n"]
    normal = share["fz"] * np.array(heights)
    np.testing.assert_allclose(column, normal, rtol=0, atol=NEAR)
    assert not any(found["flags"])


def test_one_component_that_drifts_far_rests_when_the_others_do():
    """By 1.4 N of the 3.57 N that pushes change it by, between holds thrice as long."""
    time, y = course([5.0] * 16, 3.0, 1.0, 0.0)
    rng = np.random.default_rng(7)
    forces = {
        name: 0.02 * rng.standard_normal(len(time)) for name in ("fx", "fy", "fz")
    }
    forces["fy"] += 0.714 * y + 1.4 * time / time[-1]
    forces["fz"] += 0.7 * y
    recording = Recording(time=time, channels=forces, units=dict.fromkeys(forces, "n"))
    found = measure_pushes(recording, settings=PeakSettings(normal="fz")).frame
    normal, across = found["height_normal_n"], found["height_tangential_n"]
    np.testing.assert_allclose(normal, [3.5] * 16, rtol=0, atol=NEAR)
    np.testing.assert_allclose(across, [3.57] * 16, rtol=0, atol=NEAR)
    assert not any(found["flags"])


@pytest.mark.parametrize("is_one", [True, False])
def test_slow_ramps_between_rests_and_holds_that_are_as_long_hide_no_rest(is_one):
    """Noise of 2 % makes flanks as dense as either."""
    time, y = course([5.0] * 19, 3.5, 1.06, 0.0, ramp=1.2)
    rng = np.random.default_rng(6)
    forces = {name: 0.1 * rng.standard_normal(len(time)) for name in ("fx", "fy", "fz")}
    forces["fz"] -= y
    settings = PeakSettings(normal="-fz")
    if is_one:
        forces = {"fz": forces["fz"]}
        settings = PeakSettings(signed=True)
    recording = Recording(time=time, channels=forces, units=dict.fromkeys(forces, "n"))
    found = measure_pushes(recording, settings=settings).frame
    column = -found["height_n"] if is_one else found["height_normal_n"]
    np.testing.assert_allclose(column, [5.0] * 19, rtol=0, atol=2 * NEAR)
    assert not any(found["flags"])


@pytest.mark.parametrize(("hold", "rest"), LENGTHS)
@pytest.mark.parametrize("heights", [EQUAL, REPEATED])
def test_it_is_told_that_pushes_may_go_down(heights, hold, rest):
    time, y = course(heights, hold, rest, 0.0)
    y = NOISE * np.random.default_rng(4).standard_normal(len(time)) - y
    recording = Recording(time=time, channels={"f": y}, units={"f": "n"})
    try:
        told = " ".join(measure_pushes(recording).cautions)
    except DataError as error:
        told = str(error)
    assert "go down" in told
    assert "`invert=True`" in told
    found = measure_pushes(recording, settings=PeakSettings(invert=True))
    np.testing.assert_allclose(found.frame["height_n"], heights, rtol=0, atol=NEAR)
    assert found.cautions == ()


def test_it_is_told_that_inverted_pushes_may_go_up():
    """What can be typed: an option has no value to turn it off by."""
    time, y = course(EQUAL, *LENGTHS[0], 0.0)
    y += NOISE * np.random.default_rng(4).standard_normal(len(time))
    recording = Recording(time=time, channels={"f": y}, units={"f": "n"})
    try:
        settings = PeakSettings(invert=True)
        told = " ".join(measure_pushes(recording, settings=settings).cautions)
    except DataError as error:
        told = str(error)
    assert re.search(r"go up\b.* leave out `invert`|go up \(leave out `invert`\)", told)


def test_a_recording_that_begins_and_ends_inside_pushes_has_them_all():
    time, y = course(EQUAL, 1.0, 2.0, 0.0)
    y += NOISE * np.random.default_rng(5).standard_normal(len(time))
    part = (time > 2.5) & (time < time[-1] - 2.5)
    recording = Recording(time=time[part], channels={"f": y[part]}, units={"f": "n"})
    found = measure_pushes(recording)
    np.testing.assert_allclose(found.frame["height_n"], EQUAL, rtol=0, atol=NEAR)
    assert found.frame["flags"].tolist() == ["clipped", *[""] * 6, "clipped"]


def test_half_a_minute_without_a_rest_has_none_where_both_ends_are_inside_pushes():
    """Slow ramps to holds of 8 and 2 N, after and before pushes that are cut."""
    knots = [0, 4, 16, 24, 39, 48, 62, 70, 73, 79, 82, 90, 96, 98]
    level = [6, 6, 0, 0, 8, 8, 0, 0, 2, 2, 0, 0, 4, 4]
    time = np.arange(0.0, 98.0, 1 / RATE)
    y = np.interp(time, knots, level)
    y += NOISE * np.random.default_rng(8).standard_normal(len(time))
    recording = Recording(time=time, channels={"f": y}, units={"f": "n"})
    found = measure_pushes(recording).frame
    assert found["flags"].tolist() == ["clipped", "", "", "clipped"]
    np.testing.assert_allclose(found["height_n"][1:3], [8, 2], rtol=0, atol=NEAR)


@pytest.mark.parametrize("jerk", [0.0, 25.0])
def test_a_recording_that_begins_in_a_hold_says_nothing_by_its_begin(jerk):
    """Its rest is what most readings have in common, whatever a jerk spans."""
    time, y = course([5.0] * 30, 1.0, 2.0, 0.0)
    y += NOISE * np.random.default_rng(3).standard_normal(len(time))
    y[(time > 47.0) & (time < 47.05)] += jerk
    part = time > 2.5
    recording = Recording(time=time[part], channels={"f": y[part]}, units={"f": "n"})
    found = measure_pushes(recording, settings=PeakSettings(signed=True)).frame
    np.testing.assert_allclose(found["height_n"], 5.0, rtol=0, atol=NEAR)
    assert found["flags"].tolist() == ["clipped", *[""] * 29]
