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


def test_a_noisy_ceiling_is_recognised():
    """The sensor ends, but its last stage still adds noise."""
    plan = PushSchedule.planned(np.radians([15.0, 30, 45, 60]), 0.0, repeats=2)
    made = simulated(plan, noise=0.3, quantum=None)
    cut = np.minimum(made.recording.channels["pressure"], 2750.0)
    noisy = cut + 0.3 * np.random.default_rng(3).standard_normal(cut.size)
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
