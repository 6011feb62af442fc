"""What is decided on the page is what the commands then do, without a page."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pushfit.cli.look.state import Look, angles_of
from pushfit.config import parse_config, read_config, template
from pushfit.data.load import configured_recording
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule, read_schedule, write_schedule
from pushfit.errors import ConfigError, DataError
from tests.cli.look.makers import (
    DIP,
    FAINT,
    HUMPS,
    NEAR,
    TIME,
    TOUCH,
    a_look,
    recording,
    rounded,
)
from tests.tolerances import ROUNDING, ROUTES

pytestmark = pytest.mark.repeated

EXAMPLE = Path(__file__).parents[3] / "examples" / "foam_box"
KEPT = 1e-9  # angles are kept to nine decimals of a degree
# Each height has a standard deviation of up to 0.14 %; five of their ratio.
RATIO = 0.01


def directed(look: Look) -> Look:
    """Every push with a direction of its own."""
    for row, k in enumerate(look.pushes):
        look.direct(k, str(5 * row), "90")
    return look


def test_every_hump_is_shown_and_a_faint_one_does_not_count():
    look = a_look()
    tops = [hump.t_peak for hump in look.humps]
    np.testing.assert_allclose(tops, [t for t, _ in HUMPS], atol=NEAR)
    assert [k for k, counts in enumerate(look.counts) if not counts] == [FAINT]


@settings(max_examples=25)
@given(st.sets(st.integers(0, len(HUMPS) - 1), min_size=1))
def test_the_windows_leave_the_pushes_that_count_and_no_others(kept):
    look = a_look()
    for k in range(len(HUMPS)):
        if look.counts[k] != (k in kept):
            look.toggle(k)
    found = find_pushes(look.recording, settings=look.settled().peaks)
    assert [push.t_peak for push in found] == [
        look.humps[k].t_peak for k in look.pushes
    ]


def test_a_window_holds_the_top_of_its_own_hump_only():
    close = ((5.0, 1.0), (6.4, 1.0), (7.8, 1.0), (20.0, 1.0))
    look = a_look(*close)
    look.toggle(1)
    ((first, last),) = look.settled().peaks.exclude
    assert [first <= t <= last for t, _ in close] == [False, True, False, False]


def test_windows_of_the_settings_are_where_the_page_begins():
    look = a_look(exclude=[(7.9, 8.6)], include=[(16.0, 17.0)])
    assert look.counts == [k != TOUCH for k in range(len(HUMPS))]


def test_a_hump_taken_in_again_has_no_window_left():
    look = a_look(exclude=[(7.9, 8.6)], include=[(16.0, 17.0)])
    look.toggle(TOUCH)
    look.toggle(FAINT)
    peaks = look.settled().peaks
    assert [first <= HUMPS[FAINT][0] <= last for first, last in peaks.exclude] == [True]
    assert peaks.include == ()


def test_a_push_left_out_by_the_time_of_its_table_has_no_window_left():
    """Two holds that creep up: the middle is in the table, the end is highest."""
    course = np.interp(TIME % 13 - 6, [-2.2, -2.0, 2.0, 2.2], [0, 1, 1.03, 0])
    held = recording(channels={"force": rounded() + course})
    changes = {"peaks": {"exclude": [(5.9, 6.1)]}}
    look = Look(held, read_config(None, changes=changes))
    assert look.counts == [False, True]
    look.toggle(0)
    assert look.settled().peaks.exclude == ()


def test_a_window_in_which_no_hump_is_stays():
    look = a_look(exclude=[(13.0, 15.0)])
    look.toggle(TOUCH)
    assert (13.0, 15.0) in look.settled().peaks.exclude


def test_heights_are_those_of_the_commands():
    look = a_look()
    look.toggle(TOUCH)
    frame = look.measure().frame
    peaks = parse_config(template(look.settled()), path="saved").peaks
    again = measure_pushes(look.recording, settings=peaks).frame
    assert frame.equals(again)


def test_what_is_saved_pairs_each_push_with_its_own_direction(tmp_path):
    """Without rhythm and with a push missing, only the times can tell."""
    look = a_look()
    look.toggle(TOUCH)
    plan = directed(look).schedule()
    write_schedule(plan, tmp_path / "s.csv")
    peaks = parse_config(template(look.settled()), path="saved").peaks
    saved = read_schedule(tmp_path / "s.csv")
    table = extract_peaks(look.recording, saved, settings=peaks)
    tops = [t for t, h in HUMPS if (t, h) not in (HUMPS[TOUCH], HUMPS[FAINT])]
    np.testing.assert_allclose(table.frame["t_peak_s"], tops, atol=NEAR)
    assert table.frame["theta_deg"].tolist() == [0.0, 5.0, 10.0, 15.0]
    (note,) = table.cautions
    assert re.fullmatch(
        r"left out as told: at 8.20 s \(\S+ n\), 16\.\d\d s \(\S+ n\)", note
    )


def test_a_push_that_the_recording_cuts_keeps_its_direction():
    """Its foot would be before the first sample."""
    own = TIME >= HUMPS[0][0]
    part = recording().taken(np.flatnonzero(own))
    angles = np.radians(np.full(own.sum(), 30.0))
    look = Look(replace(part, theta=angles, alpha=angles), read_config(None))
    assert look.humps[0].t_start < part.time[0] == look.starts[0]
    assert look.is_directed(0)


def test_a_saved_schedule_also_pairs_where_nothing_was_left_out_by_a_window():
    """The touch is then a hump that the plan does not have, by its time."""
    look = a_look()
    look.toggle(TOUCH)
    plan = directed(look).schedule()
    table = extract_peaks(look.recording, plan, settings=look.config.peaks)
    assert table.frame["theta_deg"].tolist() == [0.0, 5.0, 10.0, 15.0]


def test_repeats_are_counted_in_each_direction():
    look = a_look()
    for k, theta in zip(look.pushes, ("0", "15", "0", "15", "0"), strict=True):
        look.direct(k, theta, "90")
    assert look.schedule().repeat.tolist() == [1, 1, 2, 2, 3]


def test_a_plan_fills_every_azimuth_with_all_elevations():
    look = a_look()
    look.toggle(FAINT)
    assert look.fill("0:30:15", "60, 90", 1) == "6 pushes run once through the plan"
    assert look.theta_deg == [0.0, 15.0, 30.0] * 2
    assert look.alpha_deg == [60.0] * 3 + [90.0] * 3


def test_a_plan_may_go_through_the_azimuths_at_every_elevation():
    look = a_look()
    look.toggle(FAINT)
    look.fill("0:30:15", "60, 90", 1, by_theta=True)
    assert look.theta_deg == [0.0, 0.0, 15.0, 15.0, 30.0, 30.0]
    assert look.alpha_deg == [60.0, 90.0] * 3


def test_a_recording_may_run_through_a_plan_several_times():
    look = a_look()
    look.toggle(FAINT)
    assert look.fill("0 30", "90", 1) == "6 pushes run 3 times through the plan"
    assert look.theta_deg == [0.0, 30.0] * 3
    assert look.fill("0 30", "90", 3) == "6 pushes run once through the plan"
    assert look.theta_deg == [0.0] * 3 + [30.0] * 3


def test_a_plan_of_another_length_fills_nothing():
    look = a_look()
    with pytest.raises(ConfigError, match="the plan has 4 pushes and 5 count"):
        look.fill("0:45:15", "90", 1)
    assert not any(look.is_directed(k) for k in look.pushes)


def test_a_schedule_waits_for_the_last_angle():
    look = directed(a_look())
    look.direct(look.pushes[3], "", "90")
    with pytest.raises(DataError, match="1 of 5 pushes have no angles, push 4 is the"):
        look.schedule()


def test_an_angle_out_of_range_is_named():
    look = directed(a_look())
    look.direct(1, "97", "90")
    with pytest.raises(DataError, match="pushes, line 2, column theta_deg: 97"):
        look.schedule()


@pytest.mark.parametrize(
    ("text", "angles"),
    [
        ("15", [15.0]),
        ("0, 30,60", [0.0, 30.0, 60.0]),
        ("0:90:45", [0.0, 45.0, 90.0]),
        ("60:-60:-60", [60.0, 0.0, -60.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
    ],
)
def test_angles_are_lists_or_ranges_whose_last_is_one_of_them(text, angles):
    np.testing.assert_allclose(angles_of(text, "theta"), angles, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize(
    "text", ["", "x", "1:2", "0:90:0", "0:90:-15", "nan", "inf", "0:1e9:1", "0:nan:1"]
)
def test_what_are_no_angles_is_refused(text):
    with pytest.raises(ConfigError, match=r"theta = .* is no list of angles"):
        angles_of(text, "theta")


def test_recorded_angles_are_there_from_the_beginning():
    angles = {"theta": np.full(TIME.size, 0.5), "alpha": np.full(TIME.size, 1.0)}
    look = Look(recording(**angles), read_config(None))
    known = [look.theta_deg[k] for k in look.pushes]
    np.testing.assert_allclose(known, np.degrees(0.5), rtol=0, atol=KEPT)
    assert look.schedule().n_pushes == 5


def test_a_schedule_is_where_the_page_begins_and_its_doubts_are_told():
    """One of its pushes is missing, and the touch is none of them."""
    plan = PushSchedule.planned(np.radians(10 * np.arange(5.0)), np.zeros(5))
    plan = replace(plan, time=np.array([2.0, 5.0, 12.0, 19.0, 22.0]))
    look = Look(recording(), read_config(None), plan)
    assert look.pushes == [0, 1, 3, 5]
    known = [look.theta_deg[k] for k in look.pushes]
    np.testing.assert_allclose(known, [0, 10, 20, 40], rtol=0, atol=ROUTES)
    assert [note.split(",")[0] for note in look.notes] == [
        "push 4 of the schedule has no hump"
    ]


def test_a_sweep_to_both_sides_begins_with_its_schedule_and_stays_as_it_is():
    """Four cycles of 27, dips and humps, in the example."""
    config = read_config(EXAMPLE / "grasp.toml")
    sweep = configured_recording(EXAMPLE / "theta_sweep.csv", config)
    plan = read_schedule(EXAMPLE / "theta_schedule.csv")
    look = Look(sweep, config, plan)
    assert look.signed
    assert len(look.pushes) == 4 * 27
    as_given = extract_peaks(sweep, plan, settings=config.peaks).frame
    saved = parse_config(template(look.settled()), path="saved").peaks
    again = extract_peaks(sweep, look.schedule(), settings=saved).frame
    same = ["theta_deg", "alpha_deg", "height_kpa", "t_peak_s"]
    assert again[same].equals(as_given[same])


def test_force_components_have_both_heights():
    """A tenth along the surface, of which noise is a little."""
    forces = {"fz": rounded(*HUMPS), "fx": 0.1 * rounded(*HUMPS)}
    both = recording(channels=forces, units={"fz": "n", "fx": "n"})
    look = Look(both, read_config(None, changes={"peaks": {"normal": "fz"}}))
    frame = look.measure().frame
    names = [f"{height}_n" for height in look.heights]
    ratio = frame[names[1]] / frame[names[0]]
    np.testing.assert_allclose(ratio, 0.1, rtol=RATIO)


def test_dips_are_shown_when_asked_for_and_then_saved_as_pushes():
    look = a_look(*HUMPS, DIP)
    assert len(look.humps) == len(HUMPS)
    look.search(True)
    assert len(look.humps) == len(HUMPS) + 1
    peaks = parse_config(template(look.settled()), path="saved").peaks
    assert peaks.signed
    frame = look.measure().frame
    assert (frame["height_n"] < 0).sum() == 1


def test_a_click_between_two_humps_is_none():
    look = a_look()
    assert [look.at(t) for t in (2.0, 8.3, 16.5)] == [0, TOUCH, FAINT]
    assert look.at(19.0) is None


def test_nothing_to_look_at_is_refused():
    with pytest.raises(DataError, match="no pushes found"):
        a_look((2.0, 0.0))


def test_leaving_out_every_hump_is_said_and_not_final():
    look = a_look()
    for k in look.pushes:
        look.toggle(k)
    with pytest.raises(DataError, match="`exclude` leaves out 6"):
        look.measure()
    look.toggle(0)
    assert len(look.measure().frame) == 1
