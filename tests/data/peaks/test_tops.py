"""Tops of pushes: what hides one, and which of two levels is that of a hold."""

import numpy as np
import pytest

from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.records import Recording

# A hold falls by 1 % to either side of its mean, and its noise is half of that; the
# lower level is twenty times as far off.
LEVEL = 1.0


def measured(time, y):
    """Rows of the pushes of a signal."""
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    return measure_pushes(recording).frame


@pytest.mark.parametrize(("lost", "flags"), [(0.03, ""), (0.2, "gap")])
def test_lost_samples_at_a_top_are_a_gap_where_they_are_more_than_a_blink(lost, flags):
    """Of a push that is 1 s wide at half its height, seen every 2.5 ms."""
    time = np.arange(0.0, 8.0, 0.0025)
    time = time[np.abs(time - 4.0) >= lost / 2]
    y = 10 * np.clip(1 - np.abs(time - 4.0), 0, None)
    y += np.random.default_rng(3).normal(0, 0.02, time.size)
    assert measured(time, y)["flags"].tolist() == [flags]


@pytest.mark.parametrize(("lost", "flags"), [(0.15, ""), (0.35, "gap")])
def test_lost_samples_of_a_flank_are_a_gap_where_they_are_a_quarter_of_the_push(
    lost, flags
):
    """What the push did there nobody knows: it may have overshot and settled."""
    time = np.arange(0.0, 8.0, 0.0025)
    time = time[np.abs(time - 3.4) >= lost / 2]
    y = 10 * np.clip(1 - np.abs(time - 4.0), 0, None)
    y += np.random.default_rng(3).normal(0, 0.02, time.size)
    assert measured(time, y)["flags"].tolist() == [flags]


def test_a_hold_that_is_released_slowly_to_a_lower_level_is_read_at_its_upper_one():
    """The release lasts longer than the hold; what it ends at is left at once."""
    starts = 3.0 + 7.0 * np.arange(3)[:, None]
    when = (starts + np.array([0.0, 0.3, 1.3, 3.3, 3.4])).ravel()
    level = np.tile([0.0, 100.0, 99.0, 70.0, 0.0], 3)
    time = np.arange(0.0, 24.0, 0.01)
    y = np.interp(time, when, level)
    y += 0.5 * np.random.default_rng(3).standard_normal(time.size)
    np.testing.assert_allclose(measured(time, y)["height_n"], 99.5, atol=LEVEL)


def test_a_push_over_a_shoulder_of_half_its_height_is_no_hold_of_that():
    """Whether the shoulder is above half decides how wide the push is."""
    when = [0, 3.0, 4.0, 5.0, 7.0, 7.2, 10.0]
    time = np.arange(0.0, 10.0, 0.01)
    for shoulder in (49.0, 51.0, 53.0):
        y = np.interp(time, when, [0, 0, 100.0, shoulder, shoulder, 0, 0])
        y += 0.5 * np.random.default_rng(3).standard_normal(time.size)
        assert measured(time, y)["definition"].tolist() == ["apex"]


def test_counts_coarser_than_the_noise_are_not_averaged_out_of_short_rests():
    """Whose readings are all equal, though most are off by nearly half a count."""
    count, starts = 8.0, 1.0 + 2.35 * np.arange(8)
    time = np.arange(0.0, starts[-1] + 4.0, 0.01)
    y = 100.0 * np.clip(1 - np.abs(time[:, None] - starts - 1), 0, None).sum(axis=1)
    y += 0.45 * count + 0.3 * np.random.default_rng(3).standard_normal(time.size)
    frame = measured(time, count * np.round(y / count))
    assert len(frame) == len(starts)
    assert frame["height_sd_n"].min() >= count / 12**0.5
