"""What is left out is no push, and no rest either: the others keep their heights."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule, read_schedule
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError
from tests.tolerances import ROUTES

pytestmark = pytest.mark.repeated

SWEEP = Path(__file__).parents[3] / "examples/foam_box"
PEAKS = PeakSettings()
# Pushes alone choose the smoothing that humps are looked for with, so that heights are
# the same to a tenth of their sd.
SAME = 0.1
# A reading of no push, beside pushes of 30 N: known to a thirtieth of them [N].
SMALL = 1.0
# A mean over a tenth of a triangle takes 2.5 % from its top, and its foot a twentieth.
BLUNTED = 0.08
NUMBERS = ["height_kpa", "height_sd_kpa", "baseline_kpa", "t_start_s", "t_end_s"]


@pytest.fixture(scope="module")
def sweep() -> Recording:
    return read_recording(SWEEP / "alpha_sweep.csv")


@pytest.fixture(scope="module")
def whole(sweep) -> pd.DataFrame:
    return measure_pushes(sweep).frame


def window_of(frame: pd.DataFrame, row: int) -> tuple[float, float]:
    start, end = frame[["t_start_s", "t_end_s"]].to_numpy()[row]
    return float(start), float(end)


def assert_kept(frame: pd.DataFrame, whole: pd.DataFrame) -> None:
    np.testing.assert_allclose(frame[NUMBERS], whole[NUMBERS], rtol=0, atol=ROUTES)
    assert frame["flags"].tolist() == whole["flags"].tolist()


@pytest.mark.parametrize("out", range(18))
def test_a_push_left_out_by_a_window_changes_no_other(sweep, whole, out):
    settings = PeakSettings(exclude=(window_of(whole, out),))
    frame = measure_pushes(sweep, settings=settings).frame
    assert_kept(frame, whole.drop(index=out))


@pytest.mark.parametrize("out", [0, 6, 11, 17])
def test_a_planned_push_left_out_by_a_window_changes_no_other(sweep, whole, out):
    """Its row stays, flagged, at the hump that the user does not trust."""
    schedule = read_schedule(SWEEP / "alpha_schedule.csv")
    settings = PeakSettings(exclude=(window_of(whole, out),), allow_missing=True)
    frame = extract_peaks(sweep, schedule, settings=settings).frame
    there = frame.drop(index=np.flatnonzero(frame["flags"] == "missing"))
    assert_kept(there, whole.drop(index=out))


def test_a_moment_that_is_left_out_is_no_reading_of_a_push_that_felt_nothing(
    sweep, whole
):
    """What lies there is not trusted, so that it may not be used as missing."""
    schedule = read_schedule(SWEEP / "alpha_schedule.csv")
    for exclude, flags in ((window_of(whole, 6), "missing"), ((0.0, 0.1), "")):
        silent = silenced(sweep, *window_of(whole, 6))
        settings = PeakSettings(
            exclude=(exclude,), use_missing=True, allow_missing=True
        )
        frame = extract_peaks(silent, schedule, settings=settings).frame
        assert len(frame) == 18
        assert frame["flags"][6] == flags


def silenced(recording: Recording, first: float, last: float) -> Recording:
    """The recording with rest in place of what one window shows."""
    ((name, samples),) = recording.channels.items()
    time = recording.time
    window = (time > first - 0.2) & (time < last + 0.2)
    rest = np.interp(time, time[~window], samples[~window])
    noise = 0.005 * np.random.default_rng(8).standard_normal(time.size)
    calm = np.where(window, rest + noise, samples)
    return replace(recording, channels={name: calm})


@pytest.mark.parametrize("row", range(1, 18, 4))
def test_the_smallest_height_is_one_of_the_heights_that_are_reported(sweep, whole, row):
    """Not of the smoothed course, which is two percent lower."""
    heights = whole["height_kpa"].to_numpy()
    for factor in (1 - 1e-6, 1 + 1e-6):
        least = factor * heights[row]
        frame = measure_pushes(sweep, settings=PeakSettings(min_height=least)).frame
        assert_kept(frame, whole[heights >= least])


def test_a_push_left_out_still_shows_where_the_sensor_ends():
    time = np.arange(0.0, 13.0, 0.01)
    y = 0.01 * np.random.default_rng(3).standard_normal(time.size)
    for top, height in ((2.0, 150.0), (5.0, 100.4), (8.0, 60.0), (11.0, 70.0)):
        y += height * np.clip(1 - np.abs(time - top), 0, None)
    recording = Recording(
        time=time, channels={"p": np.minimum(y, 100.0)}, units={"p": "n"}
    )
    out = PeakSettings(exclude=((1.0, 3.0),))
    whole, fewer = (measure_pushes(recording, settings=s).frame for s in (PEAKS, out))
    assert whole["flags"].tolist() == ["saturated", "saturated", "", ""]
    assert fewer["flags"].tolist() == ["saturated", "", ""]


@pytest.mark.parametrize("gap", [0.3, 0.8])
@pytest.mark.parametrize(
    ("low", "by"), [(30.0, "window"), (30.0, "height"), (5.0, "height"), (5.0, "size")]
)
def test_a_small_hump_is_no_rest_by_whatever_it_is_left_out(low, by, gap):
    """It lies in the rest before the second push, and need not be measured to count."""
    time = np.arange(0.0, 16.0, 0.01)
    when = 4.75 - gap
    y = 0.3 * np.random.default_rng(5).standard_normal(time.size)
    for top, height, half in ((2, 100, 1), (when, low, 0.25), (6, 90, 1), (10, 80, 1)):
        y += height * np.clip(1 - np.abs(time - top) / half, 0, None)
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    window = ((when - 0.25, when + 0.25),)
    left_out = {
        "window": PeakSettings(exclude=window),
        "height": PeakSettings(min_height=40.0),
        "size": PeakSettings(),
    }
    every = measure_pushes(recording, settings=PeakSettings(include=window)).frame
    assert len(every) == 4
    others = every.drop(index=1)
    measured = measure_pushes(recording, settings=left_out[by])
    assert len(measured.frame) == 3
    pulls = (measured.frame["height_n"].to_numpy() - others["height_n"].to_numpy()) / (
        others["height_sd_n"].to_numpy()
    )
    assert np.abs(pulls).max() < SAME
    assert any("left out" in note for note in measured.notes)


@pytest.mark.parametrize("out", range(4))
@pytest.mark.parametrize(
    "settings", [PeakSettings(normal="fz"), PeakSettings(channel="fx", signed=True)]
)
def test_a_force_or_a_dip_left_out_changes_no_other(settings, out):
    """The rests of each component are those of the whole push."""
    time = np.arange(0.0, 13.0, 0.01)
    shares = np.clip(1 - np.abs(time[:, None] - 2.0 - 2.6 * np.arange(4)), 0, None)
    noise = 0.02 * np.random.default_rng(6).standard_normal((2, time.size))
    forces = np.array([[2.0, -2.0, 3.0, -2.5], [8.0, 9.0, 7.0, 8.0]]) @ shares.T
    fx, fz = forces + noise
    recording = Recording(
        time=time, channels={"fx": fx, "fz": fz}, units={"fx": "n", "fz": "n"}
    )
    whole = measure_pushes(recording, settings=settings).frame
    assert len(whole) == 4
    told = settings.model_copy(update={"exclude": (window_of(whole, out),)})
    frame = measure_pushes(recording, settings=told).frame
    columns = [column for column in whole if str(column).startswith("height")]
    others = whole.drop(index=out)
    np.testing.assert_allclose(frame[columns], others[columns], rtol=0, atol=ROUTES)


def test_what_is_left_out_is_no_rest_of_a_push_that_is_missing_beside_it():
    tops = 2.0 + 4.0 * np.arange(6)
    time = np.arange(0.0, 24.0, 0.01)
    # One begins where that at 10 s, which is missing, was to begin.
    humps = [*np.delete(tops, 2), 8.3]
    y = sum(30.0 * np.clip(1 - np.abs(time - top), 0, None) for top in humps)
    y = y + 0.1 * np.random.default_rng(5).standard_normal(time.size)
    schedule = PushSchedule.planned(theta=np.radians(tops), alpha=np.zeros(6))
    settings = PeakSettings(exclude=((8.0, 8.6),), allow_missing=True)
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    row = extract_peaks(recording, schedule, settings=settings).frame.iloc[2]
    assert row["flags"] == "missing"
    assert abs(row["height_n"]) < 4 * row["height_sd_n"] < SMALL


@pytest.mark.parametrize(
    ("column", "unit", "factor", "stated"),
    [
        ("p_kPa", "kpa", 1.0, {}),
        ("p_Pa", "pa", 1e3, {}),
        ("f (N)", "n", 1.0, {}),
        ("f_mN", "mn", 1e3, {}),
        ("f (µN)", "un", 1e6, {}),
        ("f_V", "n", 2.0, {"f_V": "500 mN/V"}),
    ],
)
def test_heights_are_told_and_asked_for_in_the_unit_of_the_column(
    tmp_path, column, unit, factor, stated
):
    """Of a brush of 0.06 and pushes of 2 and 3, whatever the file calls these."""
    time = np.arange(0.0, 16.0, 0.01)
    y = 1e-3 * np.random.default_rng(5).standard_normal(time.size)
    for top, height in ((2.0, 2.0), (5.0, 0.06), (8.0, 3.0), (13.0, 2.0)):
        y += height * np.clip(1 - np.abs(time - top), 0, None)
    path = tmp_path / "log.csv"
    pd.DataFrame({"time_s": time, column: factor * y}).to_csv(path, index=False)
    recording = read_recording(path, units=stated)
    in_unit = 1.0 if stated else factor

    def told(**settings):
        made = measure_pushes(recording, settings=PeakSettings(**settings))
        (caution,) = made.cautions
        heights = re.findall(r"\((\S+) (\w+)\)", caution)
        assert {own for _, own in heights} == {unit}
        return [float(height) / in_unit for height, _ in heights], made.frame

    heights, frame = told()
    assert heights == pytest.approx([0.058], rel=BLUNTED)
    assert frame.filter(regex="height_[nk]").to_numpy()[:, 0] == pytest.approx(
        [2.0, 3.0, 2.0], rel=BLUNTED
    )
    assert told(min_height=2.5 * in_unit)[0] == pytest.approx(
        [2.0, 0.058, 2.0], rel=BLUNTED
    )
    assert told(limit=2.5 * in_unit)[1]["flags"].tolist() == ["", "saturated", ""]


def test_thresholds_of_force_components_are_in_the_unit_of_the_normal(tmp_path):
    """What is across may come first, and in another unit."""
    time = np.arange(0.0, 16.0, 0.01)
    y = 1e-3 * np.random.default_rng(5).standard_normal(time.size)
    for top, height in ((2.0, 2.0), (7.0, 3.0), (13.0, 2.0)):
        y += height * np.clip(1 - np.abs(time - top), 0, None)
    path = tmp_path / "log.csv"
    columns = {"time_s": time, "fx_mN": 300 * y, "fz_N": -y}
    pd.DataFrame(columns).to_csv(path, index=False)
    settings = PeakSettings(normal="-fz", min_height=2.5)
    made = measure_pushes(read_recording(path), settings=settings)
    assert made.frame["height_normal_n"].to_numpy() == pytest.approx([3], rel=BLUNTED)


def test_a_reading_that_never_changes_is_told_as_it_is():
    recording = Recording(
        time=np.arange(0.0, 9.0, 0.01),
        channels={"p": np.full(900, 4095.0)},
        units={"p": "counts"},
    )
    with pytest.raises(DataError, match="is 4095 counts throughout"):
        measure_pushes(recording, settings=PEAKS)


# Pushes hold a level that creeps up from 2 s to 6 s, and is highest at its end, and one
# is far smaller; the middle of each hold is on paper.
CREEP = np.arange(0.0, 42.0, 0.01)
MIDDLES = np.array([4.0, 14.0, 24.0, 34.0])
LEVELS = (3.0, 2.0, 0.06, 2.5)
MIDDLE = 0.1  # what is read of a hold may be longer on one side [s]


def creeping() -> Recording:
    signal = 1e-4 * np.random.default_rng(3).standard_normal(CREEP.size)
    for middle, level in zip(MIDDLES, LEVELS, strict=True):
        held = np.interp(CREEP - middle, [-2.2, -2.0, 2.0, 2.2], [0, 1, 1.03, 0])
        signal += level * held
    return Recording(time=CREEP, channels={"p": signal}, units={"p": "n"})


def test_a_window_names_a_push_by_the_time_that_its_table_gives():
    recording = creeping()
    whole = measure_pushes(recording).frame
    assert whole["t_peak_s"].tolist() == pytest.approx([4.0, 14.0, 34.0], abs=MIDDLE)

    def told(**windows):
        made = measure_pushes(recording, settings=PeakSettings(**windows))
        assert not any("no hump" in note for note in made.notes)
        return made.frame["height_n"].tolist()

    heights = whole["height_n"].tolist()
    # The middle, and the end, where it is highest.
    for window in ((13.8, 14.2), (15.0, 16.0)):
        left = told(exclude=[window])
        assert left == pytest.approx([heights[0], heights[2]], rel=ROUTES)
    assert len(told(include=[(23.8, 24.2)])) == len(told(include=[(25.0, 26.0)])) == 4


def test_a_planned_push_left_out_by_the_time_of_its_table_is_no_reading():
    planned = [0, 1, 3]
    schedule = PushSchedule.planned(
        theta=np.radians([0.0, 30.0, 60.0]), alpha=np.zeros(3)
    )
    schedule = replace(schedule, time=MIDDLES[planned])
    settings = PeakSettings(
        exclude=((13.9, 14.1),), allow_missing=True, use_missing=True
    )
    frame = extract_peaks(creeping(), schedule, settings=settings).frame
    assert frame["flags"].tolist() == ["", "missing", ""]


def test_a_window_that_names_nothing_is_told_as_it_was_typed():
    recording = creeping()
    recording = replace(recording, time=recording.time + 1663502488.25)
    settings = PeakSettings(exclude=((1663502497.5, 1663502499.0),))
    (note,) = [
        n for n in measure_pushes(recording, settings=settings).notes if "no hump" in n
    ]
    assert "in 1663502497.5:1663502499 s, which is excluded or included" in note


def test_all_that_is_left_out_as_far_smaller_is_listed():
    """Of fifteen humps of 0.6 N beside pushes of 30 N three had been "and 3 more"."""
    time = np.arange(0.0, 70.0, 0.01)
    small = np.arange(32.0, 62.0, 2.0)
    y = 0.01 * np.random.default_rng(4).standard_normal(time.size)
    for middle in (5.0, 11.0, 17.0, 23.0):
        y += 30.0 * np.clip(1 - np.abs(time - middle), 0, None)
    for middle in small:
        y += 0.6 * np.clip(1 - 2 * np.abs(time - middle), 0, None)
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    found = measure_pushes(recording)
    assert len(found.frame) == 4
    (told,) = (line for line in found.cautions if "far smaller" in line)
    # Nor does a refusal hide which hump may be the push that it lacks.
    plan = PushSchedule.planned(np.radians(45.0), np.radians(90.0), repeats=3)
    with pytest.raises(DataError, match="Two assignments") as caught:
        extract_peaks(recording, plan)
    for line in (told, str(caught.value).partition("far smaller")[2]):
        when = [float(word) for word in re.findall(r"([\d.]+) s \(", line)]
        np.testing.assert_allclose(when, small, rtol=0, atol=MIDDLE)


@pytest.mark.parametrize("use_missing", [False, True])
def test_a_brush_where_a_push_is_missing_is_listed(use_missing):
    """Off the beat it is not paired, and the row of its height has no word of it."""
    time, tops = np.arange(0.0, 39.0, 0.01), 3.0 + 4.0 * np.arange(9)
    tops[-1] -= 0.4
    y = 0.02 * np.random.default_rng(4).standard_normal(time.size)
    for top, height in zip(tops, [*np.full(8, 30.0), 1.5], strict=True):
        y += height * np.clip(1 - np.abs(time - top), 0, None)
    recording = Recording(time=time, channels={"p": y}, units={"p": "n"})
    plan = PushSchedule.planned(np.radians(10.0 * np.arange(9)), np.zeros(9))
    settings = PeakSettings(use_missing=use_missing)
    table = extract_peaks(recording, plan, settings=settings)
    flag = "" if use_missing else "missing"
    assert table.frame["flags"].tolist() == [""] * 8 + [flag]
    (told,) = (line for line in table.cautions if "far smaller" in line)
    assert "at 34.6" in told
