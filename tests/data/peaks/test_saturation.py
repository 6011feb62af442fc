"""Ceilings of sensors: what is cut off there, and what only looks like it."""

import dataclasses

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import ALPHA_SWEEP
from tests.data.peaks.sweeps import simulated, with_signal


def test_saturated_pushes_are_flagged_and_out_of_use():
    plan = PushSchedule.planned(np.radians([15.0, 30, 45, 60]), 0.0, repeats=2)
    made = simulated(plan, limit=2750.0)
    table = extract_peaks(made.recording, plan)
    is_cut = np.asarray(made.truth.height) > 2750.0 - 2440.0
    assert is_cut.tolist() == [False] * 4 + [True] * 4
    assert ["saturated" in words for words in table.flags] == is_cut.tolist()
    assert table.is_used.tolist() == (~is_cut).tolist()


def test_a_stated_limit_is_believed():
    made = simulated()
    top = made.recording.channels["pressure"].max()
    settings = PeakSettings(limit=float(top) + 1.0)
    assert extract_peaks(made.recording, ALPHA_SWEEP, settings=settings).is_used.all()


def test_the_limit_of_an_inverted_channel_is_its_own_reading():
    made = simulated()
    turned = with_signal(made.recording, np.negative)
    heights = np.asarray(made.truth.height)
    limit = -(2440.0 + 0.7 * heights.max())
    settings = PeakSettings(invert=True, limit=limit)
    table = extract_peaks(turned, ALPHA_SWEEP, settings=settings)
    flagged = ["saturated" in words for words in table.flags]
    assert flagged == (heights > 0.7 * heights.max()).tolist()


def test_a_limit_of_pushes_that_go_up_leaves_that_of_dips_to_be_recognised():
    heights = np.array([90.0, -90.0, 95.0, -95.0, 90.0, -90.0])
    time, y = course(heights, ["peak"] * 6)
    y += 0.02 * np.random.default_rng(0).standard_normal(y.size)
    flags = flags_of(time, np.maximum(y, -70.0), signed=True, limit=200.0)
    assert flags == ["", "saturated"] * 3


def test_pointed_pushes_end_at_a_limit_that_creeps_while_they_are_at_it():
    """By 0.2 N in a push, ten times the noise: no two readings of a top are equal."""
    time, y = course(HEIGHTS, ["peak"] * HEIGHTS.size)
    y += 0.02 * np.random.default_rng(0).standard_normal(y.size)
    limit = 100.0 + 0.2 * np.clip((time - 2.0) % 4.0, 0.0, 2.0)
    flagged = [own == "saturated" for own in flags_of(time, np.minimum(y, limit))]
    assert flagged == (HEIGHTS > limit.max()).tolist()


@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_a_noisy_ceiling_is_recognised(noise):
    """The sensor ends, but its last stage still adds noise: 2 is 0.6 % of a height."""
    plan = PushSchedule.planned(np.radians([15.0, 30, 45, 60]), 0.0, repeats=2)
    made = simulated(plan, noise=noise, quantum=None)
    cut = np.minimum(made.recording.channels["pressure"], 2750.0)
    noisy = cut + noise * np.random.default_rng(3).standard_normal(cut.size)
    recording = dataclasses.replace(made.recording, channels={"pressure": noisy})
    flagged = ["saturated" in words for words in extract_peaks(recording, plan).flags]
    assert flagged == [False] * 4 + [True] * 4


@pytest.mark.parametrize(("step", "definition"), [(0.05, "plateau"), (0.08, "apex")])
def test_short_holds_end_at_no_ceiling_where_lower_ones_are_as_flat(step, definition):
    """Holds of a second at 12 Hz are read at their apex, as too few for a plateau."""
    rng, period = np.random.default_rng(1), 4.0
    heights = np.array([6.0, 9.5, 11.5, 8.0, 10.5, 9.0])
    time = np.arange(0.0, period * (heights.size + 1), step)
    flanks = 3.0 * (1.0 - np.abs(time[:, None] - period * np.arange(1, 7)))
    course = np.sum(heights * np.clip(flanks, 0.0, 1.0), axis=1)
    noisy = course + 0.02 * rng.standard_normal(time.size)
    recording = Recording(time=time, channels={"p": noisy}, units={"p": "n"})
    frame = measure_pushes(recording).frame
    assert frame["definition"].tolist() == [definition] * heights.size
    assert not frame["flags"].str.contains("saturated").any()


def holds(heights, *, half, noise):
    """Pushes of 2 `half` seconds from foot to foot, flanks of 0.25 s, at 100 Hz."""
    time = np.arange(0.0, 4.0 * (heights.size + 1), 0.01)
    since = np.abs(time[:, None] - 4.0 * np.arange(1, heights.size + 1))
    course = np.sum(heights * np.clip(4.0 * (half - since), 0.0, 1.0), axis=1)
    return time, course + noise * np.random.default_rng(1).standard_normal(time.size)


def test_a_hold_with_a_gap_ends_at_no_ceiling():
    """What is left of the highest is too little for a plateau: a flat apex."""
    time, y = holds(np.array([6.0, 9.5, 11.5, 8.0, 10.5, 9.0]), half=0.5, noise=0.05)
    keep = np.abs(time - 11.85) > 0.2
    recording = Recording(time=time[keep], channels={"p": y[keep]}, units={"p": "n"})
    frame = measure_pushes(recording).frame
    assert frame["flags"].tolist() == ["", "", "gap", "", "", ""]


def test_holds_in_coarse_digits_end_at_no_ceiling_where_lower_ones_are_as_flat():
    """But where two end at the same reading that may be the limit."""
    heights = np.array([6.0, 9.5, 11.5, 8.0, 10.5, 9.0])
    time, y = holds(heights, half=1.0, noise=0.01)
    recording = Recording(time=time, channels={"p": y.round(1)}, units={"p": "n"})
    assert not any(measure_pushes(recording).frame["flags"])
    cut = dataclasses.replace(recording, channels={"p": np.minimum(y.round(1), 10.2)})
    flags = measure_pushes(cut).frame["flags"]
    assert flags.tolist() == ["", "", "saturated", "", "saturated", ""]


def test_a_hold_by_itself_is_cut_where_its_readings_are_at_one():
    """As an exploration measures it: no push is lower."""
    time, y = holds(np.array([11.5]), half=1.0, noise=0.05)
    whole = Recording(time=time, channels={"p": y}, units={"p": "n"})
    cut = dataclasses.replace(whole, channels={"p": np.minimum(y, 11.48)})
    flags = [measure_pushes(one).frame["flags"].tolist() for one in (whole, cut)]
    assert flags == [[""], ["saturated"]]


def test_the_highest_of_several_holds_without_noise_is_no_limit_of_a_component():
    """The noise of components is not known there, so that only equal readings tell."""
    time, y = course(np.array([50.0, 70.0, 60.0, 90.0, 80.0]), ["hold"] * 5)
    channels = {"fz": np.round(2 * y) / 2, "fx": np.round(0.6 * y) / 2}
    recording = Recording(time=time, channels=channels, units={"fz": "n", "fx": "n"})
    frame = measure_pushes(recording, settings=PeakSettings(normal="fz")).frame
    assert not any(frame["flags"])


@pytest.mark.parametrize("shape", ["triangle", "sine"])
def test_natural_tops_are_no_ceiling(shape):
    """Nearly without noise, equal pushes end within a noise of each other."""
    plan = PushSchedule.planned(np.radians(45.0), 0.0, repeats=12)
    made = simulated(plan, shape=shape, noise=0.1, quantum=None)
    assert extract_peaks(made.recording, plan).is_used.all()


@pytest.mark.parametrize("decimals", [None, 1])
def test_the_highest_hold_among_pointed_pushes_is_cut_where_its_noise_is(decimals):
    """Two cut at one level are, too; a warning names them, and where to say more."""
    heights = np.array([6.0, 9.5, 11.5, 8.0, 10.5, 9.0])
    time, y = holds(heights, half=1.0, noise=0.02 if decimals is None else 0.06)
    since = np.abs(time[:, None] - 4.0 * np.arange(1, 7))[:, 1::2]
    y -= heights[1::2] @ np.clip(4.0 * (1.0 - since), 0.0, 1.0).T
    y += heights[1::2] @ np.clip(1.0 - since, 0.0, 1.0).T
    for limit, cut in ((np.inf, []), (10.8, [3]), (9.2, [2, 3, 5])):
        readings = np.minimum(y, limit)
        readings = readings if decimals is None else readings.round(decimals)
        recording = Recording(time=time, channels={"p": readings}, units={"p": "n"})
        found = measure_pushes(recording)
        flagged = found.frame["flags"].str.contains("saturated")
        assert found.frame["push"][flagged].tolist() == cut
        said = [own for own in found.cautions if "`limit`" in own]
        assert len(said) == bool(cut)
        assert all(f"push {', '.join(map(str, cut))}," in own for own in said)


def course(heights, shapes, *, rate=100.0):
    """Pushes of 2 s every 4 s: "hold", "over" (a hold by 13 % lower), "peak", "cos"."""
    time = np.arange(0.0, 4.0 * heights.size + 3.0, 1.0 / rate)
    y = np.zeros(time.size)
    for k, (height, shape) in enumerate(zip(heights, shapes, strict=True)):
        u = np.clip((time - 2.0 - 4.0 * k) / 2.0, 0.0, 1.0)
        flank = 1.0 - np.abs(2.0 * u - 1.0)
        hold = np.clip((6.0 if shape == "over" else 4.0) * flank, 0.0, 1.0)
        excess = 0.15 * np.exp(-np.clip(u - 0.15, 0.0, None) / 0.08)
        y += height * {
            "hold": hold,
            "over": hold * (1.0 + excess) / 1.15,
            "peak": flank,
            "cos": np.sin(np.pi * u) ** 2,
        }.get(shape)
    return time, y


def flags_of(time, readings, **settings):
    """Flags of the pushes of a signal."""
    recording = Recording(time=time, channels={"p": readings}, units={"p": "n"})
    own = PeakSettings(**settings)
    return measure_pushes(recording, settings=own).frame["flags"].tolist()


HEIGHTS = np.array([90.0, 150.0, 110.0, 170.0, 80.0, 200.0])


@pytest.mark.parametrize("ratio", [0.001, 0.05, 0.2])
@pytest.mark.parametrize("shape", ["hold", "over", "cos"])
def test_tops_far_calmer_than_rests_and_lower_ones_end_at_a_limit(shape, ratio):
    """Noise of 1, of which a share is left at a limit of 130."""
    rng = np.random.default_rng(9)
    time, y = course(HEIGHTS, [shape] * 6)
    y += rng.standard_normal(y.size)
    y = np.where(y > 130.0, 130.0 + ratio * rng.standard_normal(y.size), y)
    assert flags_of(time, y) == ["", "saturated"] * 3


def test_calm_tops_end_at_a_limit_also_where_no_push_is_lower():
    rng = np.random.default_rng(9)
    time, y = course(HEIGHTS[1::2], ["hold"] * 3)
    y += rng.standard_normal(y.size)
    y = np.where(y > 130.0, 130.0 + 0.05 * rng.standard_normal(y.size), y)
    assert flags_of(time, y) == ["saturated"] * 3


def test_holds_without_the_tremor_of_lower_ones_end_at_a_limit():
    """The limit has the noise of the rests, but not the unrest of a finger."""
    rng = np.random.default_rng(4)
    time, y = course(HEIGHTS, ["hold"] * 6)
    y *= 1.0 + 0.02 * np.sin(2 * np.pi * 1.7 * time)
    noise = 0.2 * rng.standard_normal(y.size)
    assert flags_of(time, np.minimum(y, 130.0) + noise) == ["", "saturated"] * 3
    assert flags_of(time, y + noise) == [""] * 6


@pytest.mark.parametrize("rate", [30.0, 100.0])
@pytest.mark.parametrize("shape", ["hold", "over"])
def test_a_hold_is_no_limit_whichever_pushes_are_beside_it(shape, rate):
    """Its noise is that of its rest. Files of the first two, three and four pushes."""
    shapes = [shape, "peak", "cos", shape]
    time, y = course(np.array([160.0, 93.0, 54.0, 190.0]), shapes, rate=rate)
    y += 0.2 * np.random.default_rng(2).standard_normal(y.size)
    for end in (9.0, 13.0, 19.0):
        keep = time < end
        assert not any(flags_of(time[keep], y[keep]))


@pytest.mark.parametrize("definition", ["auto", "apex", "plateau"])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_read_of_equal_holds_makes_no_limit_of_their_level(definition, seed):
    """Read at their apex, all ten had been flagged: they had counted as pointed."""
    time, y = course(np.full(10, 100.0), ["hold"] * 10)
    y += np.random.default_rng(seed).standard_normal(y.size)
    assert not any(flags_of(time, y, height=definition))


def test_what_a_cut_leaves_of_a_hold_is_no_limit():
    time, y = course(np.array([93.0, 160.0]), ["peak", "hold"])
    y += 0.2 * np.random.default_rng(2).standard_normal(y.size)
    keep = time < 7.0
    assert flags_of(time[keep], y[keep]) == ["", "clipped"]


def test_equal_overshoots_are_no_limit():
    """Tops of the highest are flat for 0.1 s, in their noise; those of others not."""
    heights = np.array([182.0, 182.0, 182.0, 92.0, 92.0])
    time, y = course(heights, ["over"] * 5, rate=200.0)
    for seed in range(4):
        noise = 0.5 * np.random.default_rng(seed).standard_normal(y.size)
        assert not any(flags_of(time, y + noise))


@pytest.mark.parametrize("step", [0.5, 1.0])
@pytest.mark.parametrize("shape", ["cos", "peak"])
def test_equal_readings_of_round_tops_are_those_of_the_resolution(shape, step):
    """They leave as many readings in the next counts, which a limit does not."""
    heights = np.array([50.0, 100.0, 100.0, 100.0, 60.0])
    time, y = course(heights, [shape] * 5)
    y += 0.05 * np.random.default_rng(2).standard_normal(y.size)
    coarse = np.round(y / step) * step
    assert not any(flags_of(time, coarse))
    cut = flags_of(time, np.minimum(coarse, 90.0))
    assert cut == ["", "saturated", "saturated", "saturated", ""]
