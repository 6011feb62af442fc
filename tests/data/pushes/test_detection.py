"""What counts as a push, a rest or noise, on courses drawn by hand."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.peaks.heights import measure_heights
from pushfit.data.peaks.rests import rests_of
from pushfit.data.pushes.feet import Feet, are_cut
from pushfit.data.pushes.noise import SignalNoise
from pushfit.data.pushes.running_means import RunningMeans, View
from pushfit.data.recordings.records import Recording

RATE = 100.0
NOISE = 0.5
# Noise over the slope of a flank is 5 ms at most; four of them.
NEAR = 0.02
# Heights scatter by 0.15 and rests by less; three of them.
LEVEL = 0.45
# Means of samples widen a brief push by 3 ms and take 3 % off a pointed top.
WIDENED, BLUNTED = 0.005, 0.05
# σ of 4000 samples scatters by 2 %, and the bends of flanks add as much.
SIGMA = 0.1


def course(*corners, rate=RATE):
    """Straight lines between times and levels, with noise."""
    when, level = np.array(corners, dtype=float).T
    time = np.arange(when[0], when[-1], 1 / rate)
    rng = np.random.default_rng(3)
    return time, np.interp(time, when, level) + NOISE * rng.standard_normal(len(time))


def push(start, *, width=2.0, rest=0.0, height=100.0, after=None):
    """Corners of a triangle."""
    after = rest if after is None else after
    return (
        (start, rest),
        (start + width / 2, rest + height),
        (start + width, after),
    )


def recording(time, y):
    return Recording(time=time, channels={"p": y}, units={"p": "n"})


def found(time, y, **settings):
    return find_pushes(recording(time, y), settings=PeakSettings(**settings))


def view(time, y):
    return View(
        time=time,
        signal=y,
        course=RunningMeans.of(time, y),
        noise=SignalNoise.of(time, y),
        min_height=None,
        smoothing=None,
        split=0.5,
    )


def tops(time, y):
    return [round(extent.t_peak) for extent in found(time, y)]


def test_a_level_that_is_come_back_to_is_a_rest_however_high_it_lies():
    """Both valleys lie at 3/4 of the lower tops, which a push with two tops has too."""
    shelf = 300.0
    corners = (
        (0.0, 0.0),
        (2.8, 0.0),
        (3.0, shelf),
        *push(5.0, rest=shelf),
        *push(9.0, rest=shelf),
        (13.0, shelf),
    )
    assert tops(*course(*corners)) == [6, 10]


def test_pushes_close_together_beyond_a_step_of_the_rest_are_told_apart():
    """No rest between them is held for long, but each comes back to the same level."""
    shelf = 300.0
    pushes = [corner for k in range(4) for corner in push(5.0 + 2.2 * k, rest=shelf)]
    corners = ((0.0, 0.0), (2.8, 0.0), (3.0, shelf), *pushes, (15.0, shelf))
    time, y = course(*corners)
    extents = found(time, y)
    np.testing.assert_allclose(
        [extent.t_peak for extent in extents], 6.0 + 2.2 * np.arange(4), atol=NEAR
    )


def test_two_tops_over_a_valley_that_is_no_rest_are_one_push():
    corners = ((0, 0), (2, 0), (3, 100), (4, 60), (5, 100), (6, 0), (8, 0))
    assert tops(*course(*corners)) in ([3], [5])


def test_the_valley_of_one_push_with_two_tops_is_no_rest_of_the_next_one():
    """Flat valleys at 0.6 of the lower tops, each push as it would be alone."""

    def double(start, second):
        tops = (0.0, 0.0), (0.8, 100.0), (1.0, 60.0), (1.4, 60.0), (1.7, second)
        return [(start + t, level) for t, level in (*tops, (2.5, 0.0))]

    doubles = [*double(2.0, 90.0), *double(8.0, 100.0)]
    time, y = course((0.0, 0.0), *doubles, *push(13.0), (16.0, 0.0))
    assert len(found(time, y)) == 3
    alone = time > 6.0
    assert len(found(time[alone], y[alone])) == 2
    # Nor is a hold that the recording begins in, beyond a low push.
    held = (2.0, 60.0), (3.0, 60.0), (3.3, 0.0), *push(4.0, height=30.0)
    extents = found(*course(*held, *double(8.0, 100.0), *push(13.0), (16.0, 0.0)))
    assert [extent.is_cut for extent in extents] == [True, False, False, False]


@pytest.mark.parametrize(
    ("drift", "after", "end"), [(1.0, 0.0, 8), (0.0, 12.0, 8), (0.0, 40.0, 4.52)]
)
def test_a_change_of_rest_under_a_push_that_goes_on_is_drift_and_another_a_step(
    drift, after, end
):
    """The rest under the top is on the line of a drift [1/s], unmoved by a step.

    A step shows as a rest that stays where it is, or, where little of it is seen, by
    its size.
    """
    time, y = course((0, 0), *push(2.0, after=after), (end, after))
    y = y + drift * time
    extents = found(time, y)
    height = measure_heights(time, y, extents, definition="apex", limit=None)[0]
    np.testing.assert_allclose(height.height, 100.0, rtol=0, atol=LEVEL)
    level = drift * time[np.argmax(y)]
    np.testing.assert_allclose(height.baseline, level, rtol=0, atol=LEVEL)


def test_brief_pushes_with_brief_rests_are_told_apart():
    """0.2 s wide with 0.1 s of rest between them, as a fast robot taps."""
    taps = [corner for k in range(6) for corner in push(1 + 0.3 * k, width=0.2)]
    time, y = course((0, 0), *taps, (4, 0), rate=1000.0)
    extents = found(time, y)
    np.testing.assert_allclose(
        [extent.t_peak for extent in extents], 1.1 + 0.3 * np.arange(6), atol=NEAR
    )
    # Half of a triangle's base is above half of its height.
    np.testing.assert_allclose([e.width for e in extents], 0.1, rtol=0, atol=WIDENED)


@pytest.mark.parametrize("shown", [0.15, 0.4, 1.0])
def test_a_push_on_a_grip_is_found_however_little_follows_it(shown):
    grip = 300.0
    corners = ((0, 0), (2.0, 0), (2.2, grip), *push(6.0, rest=grip, height=130.0))
    time, y = course(*corners, (8.0 + shown, grip))
    (extent,) = found(time, y)
    np.testing.assert_allclose(extent.t_peak, 7.0, atol=NEAR)
    np.testing.assert_allclose(extent.height, 130.0, rtol=BLUNTED)


@pytest.mark.parametrize(("shown", "height"), [(-0.4, 83.0), (0.2, 100.0)])
def test_a_push_on_a_grip_that_is_cut_near_its_top_is_flagged(shown, height):
    """Before its top the grip is a part of it; after it that is its rest."""
    grip = 30.0
    corners = ((0, 0), (6.0, 0), (6.3, grip), *push(14.0, rest=grip))
    time, y = course(*corners, (17.0, grip))
    frame = measure_pushes(recording(*np.stack([time, y])[:, time < 15.0 + shown]))
    (own,) = frame.frame.to_dict("records")
    assert own["flags"] == "clipped"
    np.testing.assert_allclose(own["height_n"], height, rtol=BLUNTED)


def test_a_single_deep_dip_costs_no_low_push_far_from_it():
    pushes = (*push(2.0), *push(5.0, height=20.0), *push(8.0))
    dip = ((11.0, 0), (11.1, -300.0), (11.2, -300.0), (11.3, 0))
    assert tops(*course((0, 0), *pushes, *dip, (14.0, 0))) == [3, 6, 9]


def test_a_dip_well_before_a_first_push_that_is_lower_makes_no_shoulder_of_it():
    dip = ((2.0, 0), (2.1, -200.0), (2.2, -200.0), (2.3, 0))
    pushes = (*push(4.5, width=5.0), *push(12.0, height=300.0))
    assert tops(*course((0, 0), *dip, *pushes, (16.0, 0))) == [7, 13]


def test_a_push_on_a_grip_is_found_if_the_next_one_is_cut_as_it_begins():
    grip = 300.0
    corners = ((0, 0), (2, 0), (2.2, grip), *push(6.0, rest=grip, height=130.0))
    time, y = course(*corners, (9.0, grip), (9.3, grip + 30.0))
    assert any(abs(extent.t_peak - 7.0) < NEAR for extent in found(time, y))


def test_the_noise_of_uneven_steps_is_that_of_the_samples():
    """On the flanks of pushes, where neighbours in number are far apart in time."""
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.choice([0.01, 0.3], size=4000, p=[0.7, 0.3]))
    flanks = 200.0 * np.abs(time % 4.0 - 2.0)
    noise = SignalNoise.of(time, flanks + 2.0 * rng.standard_normal(len(time)))
    np.testing.assert_allclose(noise.sigma, 2.0, rtol=SIGMA)


def test_a_small_push_is_found_beside_the_edge_of_a_large_one():
    """Where nothing else shows how the rest wanders."""
    corners = (*push(1.0, height=600.0), *push(4.0, height=80.0), (6.3, 0), (6.8, 120))
    assert 5 in tops(*course((0, 0), *corners))


@pytest.mark.parametrize("high", [30.0, 40.0])
@pytest.mark.parametrize("end", [slice(0, 3), slice(-3, None)])
def test_a_jolt_at_an_end_makes_no_pushes_of_bumps(end, high):
    """It has a height between those of bumps and pushes, which are far apart."""
    pushes = (*push(3.0), *push(9.0), *push(15.0))
    bumps = push(6.5, width=0.4, height=8.0), push(12.5, width=0.4, height=8.0)
    corners = sorted({(0.0, 0.0), (19.0, 0.0), *pushes, *bumps[0], *bumps[1]})
    time, y = course(*corners)
    y[end] += high
    whole = [extent.t_peak for extent in found(time, y) if not extent.is_cut]
    np.testing.assert_allclose(whole, [4.0, 10.0, 16.0], atol=NEAR)


def test_noise_further_from_a_push_than_it_is_wide_is_not_its_own():
    """The rest between is thirty widths at half height long."""
    time, y = course((0, 0), *push(3.0, width=0.6), *push(14.0, width=0.6), (18.0, 0))
    extents = found(time, y)
    assert len(extents) == 2
    noise, _ = rests_of(time, y, extents)
    is_far = (time > 4.4) & (time < 13.3)
    slow = np.repeat(y[::20], 20)[: y.size]
    slower, _ = rests_of(time, np.where(is_far, slow, y), extents)
    np.testing.assert_array_equal(slower.sigma, noise.sigma)
    np.testing.assert_array_equal(slower.correlation, noise.correlation)


@pytest.mark.parametrize(("start", "is_cut"), [(3.4, False), (3.5, True)])
def test_a_push_that_begins_at_half_of_its_height_is_cut(start, is_cut):
    """However long the signal seems to rest before it."""
    time, y = course((0, 0), *push(3.0), (8.0, 0))
    (extent,) = found(time, y)
    feet = Feet.together([replace(extent.feet, start=start, half_up=3.5)])
    assert are_cut(view(time, y), feet).tolist() == [is_cut]


@pytest.mark.parametrize(
    ("shown", "after", "noise", "is_cut"),
    [
        (0.05, 0.0, NOISE, False),
        (0.05, 0.0, 40 * NOISE, True),
        (0.15, 7.0, NOISE, True),
        (0.15, 7.0, 40 * NOISE, False),
    ],
)
@pytest.mark.parametrize("is_turned", [False, True])
def test_noise_hides_where_a_push_begins_and_how_high_a_brief_rest_is(
    shown, after, noise, is_cut, is_turned
):
    """What is seen before it, or after it, is too brief for a rest in each case."""
    time, y = course((0, 0), *push(3.0, after=after), (8.0, after))
    feet = Feet.together([found(time, y)[0].feet])
    part = time >= 3.0 - shown
    time, y = time[part], y[part]
    own = replace(feet, sigma=np.array([noise])).alone(view(time, y))
    if is_turned:
        time, y = 8.0 - time[::-1], y[::-1]
        turned = {"start": "end", "half_up": "half_down", "lowest": "highest"}
        turned |= {"peak": "peak"} | {other: one for one, other in turned.items()}
        times = {one: 8.0 - getattr(own, other) for one, other in turned.items()}
        own = replace(own, **times, moved=-own.moved)
    assert are_cut(view(time, y), own).tolist() == [is_cut]


@pytest.mark.parametrize("valley", [6.0, 15.0, 25.0])
def test_a_whole_last_push_that_touches_its_neighbour_is_not_cut(valley):
    """The little that is seen between them is no rest to compare that after it to."""
    corners = ((0, 0), (4, 0), (5, 100), (6, valley), (7, 100), (8, 0), (8.15, 0))
    assert [push.is_cut for push in found(*course(*corners))] == [False, False]


def test_jerks_of_contact_are_no_pushes_also_where_the_last_push_is_cut():
    """Each push begins with one; the last is cut while it rises."""
    corners = [(0.0, 0.0)]
    for start in (3.0, 10.0, 17.0, 24.0):
        jerk = ((start, 0.0), (start + 0.04, 60.0), (start + 0.08, 0.0))
        rise = ((start + 0.2, 0.0), (start + 0.4, 100.0))
        corners += [*jerk, *rise, (start + 4.0, 100.0), (start + 4.2, 0.0)]
    time, y = course(*corners, (30.0, 0.0), rate=500.0)
    for end, is_cut in ((30.0, False), (24.5, True)):
        pushes = found(time[time < end], y[time < end])
        assert [one.is_cut for one in pushes] == [False, False, False, is_cut]
        assert all(one.t_start % 7 > 3.1 for one in pushes)


@pytest.mark.parametrize("decay", [1.5, 2.0, 2.5])
def test_a_push_on_a_decay_from_the_begin_is_no_part_of_a_trend(decay):
    """The rest falls by more than half of a push before the first: it looks cut."""
    time = np.arange(0.0, 34.0, 0.01)
    since = time[:, None] - 3.0 - 3.0 * np.arange(10)
    y = 0.8 * np.clip(4 * np.minimum(since, 1 - since), 0, 1).sum(axis=1)
    y += decay * np.exp(-time / 15)
    y += 0.005 * np.random.default_rng(1).standard_normal(time.size)
    own = Recording(time=time, channels={"f": y}, units={"f": "n"})
    frame = measure_pushes(own).frame
    starts = 3.0 + 3.0 * np.arange(10)
    is_own = np.abs(frame["t_peak_s"].to_numpy()[:, None] - starts - 0.5) < 0.5
    assert is_own.any(axis=0).all()
    # What is more is the begin of the decay, or looks so.
    is_off = np.abs(frame["height_n"] - 0.8) > 0.1
    assert all(
        "clipped" in cell for cell in frame["flags"][is_off | ~is_own.any(axis=1)]
    )


@pytest.mark.parametrize(("smoothing", "n"), [(None, 25), (0.6, 5)])
def test_pushes_that_tremble_are_whole_in_an_average_over_what_is_asked_for(
    smoothing, n
):
    """They fall back to rest every half second of 3 s."""
    time, y = course((0.0, 0.0), (36.0, 0.0))
    for start in 3.0 + 7.0 * np.arange(5):
        since = time - start
        hold = np.clip(4.0 * np.minimum(since, 3.0 - since) / 3.0, 0.0, 1.0)
        y += 100.0 * hold * np.cos(2.0 * np.pi * since) ** 2
    assert len(found(time, y, smoothing=smoothing)) == n


def test_pushes_as_low_as_noise_lets_stand_out_are_found_where_they_are_asked_for():
    """They are twice the noise of a sample, and a sixtieth of the others."""
    corners = [(0.0, 0.0)]
    for k in range(6):
        corners += push(2.0 + 4.0 * k, height=60.0 if k < 3 else 1.0)
    time, y = course(*corners, (28.0, 0.0))
    assert len(found(time, y)) == 3
    assert len(found(time, y, min_height=0.5)) == 6


def test_a_level_after_a_step_is_the_rest_of_the_next_push_however_brief_it_is():
    """It is more than half way up to the first push, but not to the second."""
    corners = [(0.0, 0.0), *push(3.0, width=3.0, after=60.0)]
    for start in (6.8, 10.6, 14.4):
        corners += push(start, width=3.0, rest=60.0, height=40.0)
    time, y = course(*corners, (20.0, 60.0))
    frame = measure_pushes(recording(time, y)).frame
    assert frame["flags"].tolist() == ["drift", "", "", ""]


@pytest.mark.parametrize(("held", "second"), [(0.8, 100.0), (6.0, 40.0)])
def test_a_valley_high_up_is_a_rest_where_it_is_held_for_longer_than_pushes(
    held, second
):
    after = push(6.0 + held, width=3.0, rest=60.0, height=40.0, after=0.0)
    corners = [(0.0, 0.0), *push(3.0, width=3.0, after=60.0), *after]
    time, y = course(*corners, (18.0, 0.0))
    settings = PeakSettings(split=0.8)
    heights = measure_pushes(recording(time, y), settings=settings).frame["height_n"]
    np.testing.assert_allclose(heights, [100.0, second], atol=LEVEL)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("more", [1.1, 1.2])
def test_noise_between_interpolated_samples_is_no_push(seed, more):
    """Their neighbours differ by less than the noise that is left in their means."""
    time = np.arange(0.0, 96.0, 1 / 16)
    y = 10 * np.clip(1 - np.abs(time % 8 - 4), 0, 1)
    y += np.random.default_rng(seed).standard_normal(len(time))
    finer = np.linspace(time[0], time[-1], int(more * len(time)))
    assert len(found(finer, np.interp(finer, time, y))) == len(found(time, y)) == 12
