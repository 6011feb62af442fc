"""Pushes on a step of the rest level that is as brief as one or two of them."""

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.records import Recording

HEIGHTS = (100.0, 160.0, 130.0, 90.0)
# As much as noise makes of a height of 90, whose rests are cut.
NEAR = 1.0
TOLD = "is held before and after the top of push"


def recording(steps, shape):
    """Pushes of two seconds every four, the first at 2 s, in a noise of one."""
    time = np.arange(0.0, 18.0, 0.01)
    since = np.abs(time[:, None] - 3.0 - 4.0 * np.arange(4))
    course = np.clip(1 - since, 0, 1)
    if shape == "trapezoid":
        course = np.clip(2.5 * course, 0, 1)
    if shape == "sine":
        course = np.sin(np.pi / 2 * course)
    y = course @ HEIGHTS + np.random.default_rng(7).standard_normal(time.size)
    for moment, step in steps:
        y += step * np.clip((time - moment) / 0.1, 0, 1)
    return Recording(time=time, channels={"p": y}, units={"p": "n"})


@pytest.mark.parametrize("shape", ["triangle", "trapezoid", "sine"])
@pytest.mark.parametrize("step", [150.0, 200.0, 400.0])
@pytest.mark.parametrize("push", [2, 3])
def test_what_may_be_a_push_on_a_grip_is_said_and_can_be_read(shape, step, push):
    first, last = 4.0 * push - 3.0, 4.0 * push + 1.0
    own = recording([(first, step), (last, -step)], shape)
    (told,) = [caution for caution in measure_pushes(own).cautions if TOLD in caution]
    assert f"{TOLD} {push};" in told
    settings = PeakSettings(begin=first + 0.2, end=last - 0.1)
    (found,) = measure_pushes(own, settings=settings).frame["height_n"]
    assert abs(found - HEIGHTS[push - 1]) < NEAR


@pytest.mark.parametrize("shape", ["triangle", "trapezoid", "sine"])
@pytest.mark.parametrize("step", [150.0, 400.0])
def test_two_pushes_on_a_grip_are_pushes(shape, step):
    found = measure_pushes(recording([(5.0, step), (13.0, -step)], shape))
    np.testing.assert_allclose(found.frame["height_n"], HEIGHTS, rtol=0, atol=NEAR)
    assert not [caution for caution in found.cautions if TOLD in caution]


@pytest.mark.parametrize("shape", ["triangle", "trapezoid", "sine"])
@pytest.mark.parametrize(
    "steps", [[], [(9.0, 200.0)], [(1.0, 200.0)], [(5.0, -80.0), (13.0, 80.0)]]
)
def test_a_level_that_is_held_on_no_more_than_one_side_is_none(shape, steps):
    cautions = measure_pushes(recording(steps, shape)).cautions
    assert not [caution for caution in cautions if TOLD in caution]
