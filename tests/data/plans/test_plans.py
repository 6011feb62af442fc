"""Plans are paired right or refused: never wrong without a word."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.recordings.plan_alignment import (
    count,
    count_whole,
    count_with_jumps,
    count_with_pause,
    evenly,
)
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.alignment import Alignment, align
from pushfit.data.plans.mismatch import mismatch_error
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.feet import Feet
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.recordings.records import Recording

PERIOD = 3.5
# Sequences by hand, and the share of them that is paired; the rest is refused.
N_WHOLE, MOST = 50, 0.85
# Sweeps whose direction jumps.
N_JUMPS = 15


@pytest.mark.parametrize("n_cases", [50, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_subset_of_a_regular_plan_is_paired_wrong_silently(n_cases):
    verdicts = count(n_cases)
    assert verdicts["wrong"] == 0
    assert verdicts["right"] > 0.3 * n_cases


@pytest.mark.parametrize(
    ("n_missing", "least", "most"), [(0, 0.6, 0.0), (1, 0.2, 0.03)]
)
def test_a_pause_takes_no_push_from_a_plan(n_missing, least, most):
    """As many as planned are in order; one that is missing may be hidden by a pause."""
    verdicts = count_with_pause(200, n_missing)
    assert verdicts["right"] > least * 200
    assert verdicts["wrong"] <= most * 200


@pytest.mark.parametrize("is_in_a_row", [True, False])
@pytest.mark.parametrize(
    ("n_missing", "n_bumps", "least"),
    [(0, 0, 1.0), (1, 0, 0.8), (0, 1, 0.9), (2, 2, 0.3)],
)
def test_a_jump_of_the_direction_takes_its_time(is_in_a_row, n_missing, n_bumps, least):
    """A robot pushes three times in a row, then moves on, or begins again."""
    verdicts = count_with_jumps(
        N_JUMPS, is_in_a_row=is_in_a_row, n_missing=n_missing, n_bumps=n_bumps
    )
    assert verdicts["wrong"] == 0
    assert verdicts["right"] >= least * N_JUMPS


FIVE = evenly(5)
IN_A_ROW = PushSchedule.planned(FIVE.theta, FIVE.alpha, repeats=2)


def with_one_lost(plan: PushSchedule, gaps, lost, heights=None) -> Alignment:
    times = np.delete(5.0 + PERIOD * np.append(0.0, np.cumsum(gaps)), lost)
    return align(
        times,
        [False] * len(times),
        plan=plan,
        span=(0.0, times[-1] + 5.0),
        heights=None if heights is None else np.delete(heights, lost),
    )


@pytest.mark.parametrize("lost", [2, 3])
def test_which_of_two_repeats_is_missing_is_no_doubt(lost):
    found = with_one_lost(IN_A_ROW, [1, 2, 1, 2, 1, 2, 1, 2, 1], lost)
    assert found.other is None
    assert len(found.missing) == 1
    assert found.missing[0] in (2, 3)


def test_heights_of_repeats_tell_a_missing_push_from_a_longer_jump():
    """The last push of the first run is missing, or the first one of the second run."""
    gaps = [1, 1, 1, 1, 2, 1, 1, 1, 1]
    heights = np.tile([1.0, 0.8, 0.4, 0.2, 0.6], 2)
    twice = FIVE.repeated(2)
    found = with_one_lost(twice, gaps, 4, heights)
    assert found.missing == (4,)
    assert found.other is None
    assert with_one_lost(twice, gaps, 4, np.ones(10)).other is not None


@pytest.mark.parametrize("silent", [2, 3])
def test_a_direction_that_shows_nothing_in_any_run_leaves_as_many_runs(silent):
    """Of 18 pushes 15 are found, which is as near to two runs as to three."""
    push = np.delete(np.arange(18), np.arange(silent, 18, 6))
    times = 4.0 + PERIOD * (push + push // 6)
    heights = np.array([1.0, 0.8, 0.4, 0.2, 0.6, 0.9])[push % 6]
    found = align(
        times,
        [False] * 15,
        plan=evenly(6),
        span=(0.0, times[-1] + 3.0),
        heights=heights,
    )
    assert found.n_cycles == 3
    assert found.missing == (silent, silent + 6, silent + 12)
    assert found.other is None


@pytest.mark.parametrize("jumps", [(1.5, 1.5), (1.6, 2.1), (6.7, 9.5)])
@pytest.mark.parametrize("silent", [0, 8])
def test_whether_the_first_or_the_last_of_all_runs_shows_nothing_is_open(silent, jumps):
    gaps = np.ones(26)
    gaps[[8, 17]] = jumps
    beats = np.append(0.0, np.cumsum(gaps))
    push = np.delete(np.arange(27), np.arange(silent, 27, 9))
    times = 7.0 + PERIOD * beats[push]
    found = align(
        times,
        [False] * 24,
        plan=evenly(9),
        span=(0.0, times[-1] + 7.0),
        heights=np.linspace(1.0, 0.2, 9)[push % 9],
    )
    assert found.other is not None
    ends = {tuple(found.missing), tuple(np.flatnonzero(found.other < 0))}
    assert {(0, 9, 18), (8, 17, 26)} == ends


@pytest.mark.parametrize(
    ("scatter", "pauses"), [(0.1, 0), (0.2, 0), (0.5, 0), (0.02, 0.1), (0.02, 0.3)]
)
def test_as_many_as_planned_are_paired_in_order_by_hand_and_with_pauses(
    scatter, pauses
):
    """A rhythm found among gaps of a hand is chance; a robot may pause anywhere."""
    verdicts = count_whole(N_WHOLE, scatter, pauses)
    assert verdicts["right"] >= MOST * N_WHOLE
    assert verdicts["right"] + verdicts["refused"] == N_WHOLE


@pytest.mark.parametrize("lost", range(1, 7))
def test_one_push_of_seven_is_placed_where_there_is_no_room_for_another(lost):
    times = np.delete(PERIOD * np.arange(7.0), lost)
    found = align(
        times,
        [False] * 6,
        plan=evenly(7),
        span=(-0.6 * PERIOD, 6.6 * PERIOD),
    )
    assert found.other is None
    assert found.missing == (lost,)


@pytest.mark.parametrize("lead", [0.1, 0.6, 1.1, 1.6, 2.6])
@pytest.mark.parametrize("n_made", [10, 11])
def test_a_recording_that_was_stopped_early_is_never_shifted_silently(n_made, lead):
    """Its lead-in has room for pushes, which may be missing just as well."""
    found = align(
        PERIOD * np.arange(n_made),
        [False] * n_made,
        plan=evenly(12),
        span=(-lead * PERIOD, (n_made - 0.6) * PERIOD),
    )
    made = np.append(np.arange(n_made), [-1] * (12 - n_made))
    shown = [found.hump] if found.other is None else [found.hump, found.other]
    assert any(np.array_equal(made, one) for one in shown)


def test_where_few_pushes_show_no_rhythm_mere_order_is_the_other_candidate():
    times = np.delete(PERIOD * np.arange(5.0), 2)
    span = (-0.6 * PERIOD, 4.6 * PERIOD)
    found = align(times, [False] * 4, plan=evenly(5), span=span)
    assert found.hump.tolist() == [0, 1, -1, 2, 3]
    assert found.other is not None
    assert found.other.tolist() == [0, 1, 2, 3, -1]


@pytest.mark.parametrize("n_planned", [7, 8, 12])
def test_a_recording_that_was_stopped_early_is_no_plan_with_every_other_push_missing(
    n_planned,
):
    """Twelve pushes at half of the period would have room, and six to spare."""
    found = align(
        3.0 + 4.0 * np.arange(6),
        [False] * 6,
        plan=evenly(n_planned),
        span=(0.0, 24.0),
    )
    missing = [-1] * (n_planned - 6)
    assert found.hump.tolist() == [*range(6), *missing]
    assert found.other is not None
    assert found.other.tolist() == [*missing, *range(6)]


@pytest.mark.parametrize(
    ("beats", "made", "lead", "rest"),
    [
        ([0.0, 2.0, 3.0, 3.505, 5.505], [1, 3, 4], 1.42, 6.07),
        ([0.0, 0.52, 1.01, 3.02, 3.54, 5.01, 5.54], [5, 6, 8, 10], 7.17, 2.05),
    ],
)
def test_bumps_halfway_between_pushes_set_no_rhythm_of_half_the_period(
    beats, made, lead, rest
):
    """The first are two bumps beside three pushes, the last three beside four."""
    times = 4.0 * np.array(beats)
    found = align(
        times,
        [False] * len(times),
        plan=evenly(12),
        span=(times[0] - 4.0 * lead, times[-1] + 4.0 * rest),
    )
    missing = np.setdiff1d(np.arange(12), made)
    assert found.other is not None or list(found.missing) == missing.tolist()


# Twelve humps at which a plan of twelve has pushes 2, 8 and 10 missing and three bumps.
WITH_BUMPS = [8.93, 14.2, 16.6, 20.92, 24.86, 28.55, 32.9, 38.7, 40.97, 43.2]
WITH_BUMPS += [48.6, 52.62]


@pytest.mark.parametrize(
    ("times", "off"),
    [
        (WITH_BUMPS, {1, 7, 9}),
        (4 * np.array([0, 1.2, 2.1, 3.2, 4, 5.3, 6.1, 7.2, 8.3, 9.1, 10.2, 11.3]), ()),
    ],
)
def test_as_many_humps_as_planned_are_told_which_are_off_the_beat(times, off):
    found = align(
        np.array(times),
        [False] * 12,
        plan=evenly(12),
        span=(times[0] - 8.9, times[-1] + 3.8),
    )
    assert found.other is None
    assert found.hump.tolist() == list(range(12))
    assert set(found.off_beat) == set(off)


def recorded(times, heights) -> Recording:
    """Pushes of 1.4 s, with a little noise and 2 s of rest on either side."""
    clock = np.arange(times[0] - 3.0, times[-1] + 3.0, 0.02)
    signal = 0.5 * np.random.default_rng(0).standard_normal(clock.size)
    for when, height in zip(times, heights, strict=True):
        phase = np.clip((clock - when) / 1.4, -0.5, 0.5)
        signal += height * np.cos(np.pi * phase) ** 2
    return Recording(time=clock, channels={"p": signal}, units={"p": "n"})


def test_humps_off_the_beat_of_a_whole_plan_are_told_with_how_to_leave_them_out():
    table = extract_peaks(recorded(WITH_BUMPS, [100.0] * 12), evenly(12))
    told = [line for line in table.cautions if "more even" in line]
    assert len(told) == 1
    assert "without those at 14.19 s, 38.71 s, 43.20 s" in told[0]
    assert "exclude=[(13.6, 14.81), (" in told[0]
    assert len(table.frame) == 12


def test_a_bump_far_briefer_than_the_pushes_is_told_where_it_stands_for_one():
    """Gaps are those of a hand, so that as many as planned are paired in order."""
    whole = recorded([3.0, 8.1, 11.2, 18.0, 20.9], [100.0, 150.0, 0.0, 90.0, 120.0])
    bump = 60.0 * np.exp(-(((whole.time - 13.6) / 0.08) ** 2))
    signal = whole.channels["p"] + bump
    table = extract_peaks(
        Recording(time=whole.time, channels={"p": signal}, units={"p": "n"}), evenly(5)
    )
    told = [line for line in table.cautions if "which lasts 0.1" in line]
    assert len(told) == 1
    assert "push 3 " in told[0]
    assert "exclude=[(13." in told[0]


@pytest.mark.parametrize("is_early", [False, True])
def test_a_step_that_a_recording_ends_with_leaves_a_whole_plan_as_it_is(is_early):
    """Turned, it is a step that the recording begins with."""
    whole = recorded([3.0, 7.1, 11.2, 15.0], [100.0, 150.0, 130.0, 90.0])
    clock, signal = whole.time, whole.channels["p"]
    signal = signal + 200.0 * (clock > clock[-1] - 0.7)
    if is_early:
        signal = signal[::-1]
    stepped = Recording(time=clock, channels={"p": signal}, units={"p": "n"})
    table = extract_peaks(stepped, evenly(4))
    assert len(table.frame) == 4
    assert not table.frame["flags"].str.contains("clipped|missing").any()
    assert any("is no planned push" in line for line in table.cautions)


def test_a_plan_whose_first_pushes_feel_nothing_is_paired_with_its_last():
    rng = np.random.default_rng(1)
    times = PERIOD * np.arange(27) + 0.1 * rng.standard_normal(27)
    found = align(
        times[15:],
        [False] * 12,
        plan=evenly(27),
        span=(-1.5, 26 * PERIOD + 3.0),
    )
    assert found.hump.tolist() == [-1] * 15 + list(range(12))
    assert found.other is None


@pytest.mark.parametrize("is_timed", [False, True])
def test_bumps_between_the_beats_are_named_as_extra(is_timed):
    rng = np.random.default_rng(1)
    pushes = PERIOD * np.arange(51) + 0.1 * rng.standard_normal(51)
    bumps = np.sort(rng.choice(50, 5, replace=False) + 0.5) * PERIOD
    times = np.sort(np.concatenate([pushes, bumps]))
    found = align(
        times,
        [False] * 56,
        plan=evenly(51, PERIOD * np.arange(51.0) if is_timed else None),
        span=(-2.0, 50 * PERIOD + 3.0),
    )
    assert found.other is None
    assert found.missing == ()
    np.testing.assert_array_equal(times[list(found.extra)], bumps)


def extents_at(times: np.ndarray) -> list[Extent]:
    """Humps a second wide, of which only the times are looked at."""
    own = {"height": 1.0, "moved": 0.0, "step": 0.01, "sigma": 0.01}
    own |= {"lowest": -np.inf, "highest": np.inf}
    feet = [
        Feet(start=t - 1, half_up=t - 0.5, peak=t, half_down=t + 0.5, end=t + 1, **own)
        for t in times.tolist()
    ]
    cell = {"start": 0, "end": 1, "is_brush": False, "is_cut": False}
    return [Extent(feet=one, **cell) for one in feet]


def told(n_planned: int, n_found: int) -> str:
    """The refusal of a regular plan whose last pushes are missing."""
    schedule = evenly(n_planned)
    found = align(
        3.0 + PERIOD * np.arange(n_found),
        [False] * n_found,
        plan=schedule,
        span=(0.0, PERIOD * n_planned + 3.0),
    )
    extents = extents_at(3.0 + PERIOD * np.arange(n_found))
    return str(mismatch_error(schedule, found, extents))


def test_how_often_a_recording_runs_through_its_plan_is_said_between_commas():
    """Of three runs of six the last push was not made."""
    assert "18 pushes are planned, run through 3 times, 17 found: " in told(6, 17)


@pytest.mark.parametrize("is_timed", [False, True])
@pytest.mark.parametrize("off", [-0.17, 0.17])
def test_a_push_off_its_beat_is_not_both_missing_and_a_hump_too_many(off, is_timed):
    beats = np.array([0, 1 + off, 2, 3, 4, 5, 9, 10, 11])
    found = align(
        5.0 + 4.0 * beats,
        [False] * 9,
        plan=evenly(12, 5.0 + 4.0 * np.arange(12.0) if is_timed else None),
        span=(0.0, 55.0),
    )
    assert found.other is None
    assert found.extra == ()
    assert found.missing == (6, 7, 8)


def test_a_bump_between_two_beats_does_not_stand_for_the_missing_push_beside_it():
    beats = np.array([0, 1.4, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11])
    found = align(
        5.0 + 4.0 * beats,
        [False] * 12,
        plan=evenly(12, 5.0 + 4.0 * np.arange(12.0)),
        span=(0.0, 55.0),
    )
    assert found.missing == (1,)
    assert found.extra == (1,)


@pytest.mark.parametrize(("n_planned", "n_found"), [(60, 20), (9, 8), (40, 25)])
def test_three_faults_of_a_pairing_are_told_and_the_rest_counted(n_planned, n_found):
    message = told(n_planned, n_found)
    n_missing = n_planned - n_found
    assert message.startswith(f"{n_planned} pushes are planned, {n_found} found: push ")
    assert message.count("has no hump") == min(n_missing, 3)
    assert (f"; and {n_missing - 3} more" in message) is (n_missing > 3)
    assert len(message) < 1500


@pytest.mark.parametrize("first", [None, 0.0])
@pytest.mark.parametrize("tail", [12.0, 20.0, 30.0])
@pytest.mark.parametrize("lead", [2.0, 4.0, 8.0])
def test_a_silent_begin_is_shown_first_where_a_recording_ends_late(lead, tail, first):
    """It is as likely as pushes that were not made; times from 0 do not tell either."""
    beats = 9.0 * np.arange(8.0)
    schedule = evenly(8)
    if first is not None:
        schedule = replace(schedule, time=first + beats)
    found = align(
        lead + beats[2:],
        [False] * 6,
        plan=evenly(8, schedule.time),
        span=(0.0, lead + beats[-1] + tail),
    )
    assert found.other is not None
    assert found.missing == (0, 1)
    message = str(mismatch_error(schedule, found, extents_at(lead + beats[2:])))
    needed = "a column time_s" if first is None else "the clock of the recording"
    assert needed in message


WITH_BRUSH = 4.0 * np.arange(11.0)


def brushed(left_out=()) -> Alignment:
    """Ten pushes for ten rows, and a brush on the beat between them."""
    times = np.delete(WITH_BRUSH, 6) if left_out else WITH_BRUSH
    return align(
        times,
        [k == 6 and not left_out for k in range(len(times))],
        plan=evenly(10),
        span=(-3.0, 43.0),
        left_out=left_out,
    )


def test_a_brush_on_the_beat_is_what_the_remedy_leaves_out():
    found = brushed()
    assert found.hump.tolist() == [0, 1, 2, 3, 4, 5, 7, 8, 9, 10]
    assert found.other is not None
    extents = extents_at(WITH_BRUSH)
    extents[6] = replace(extents[6], is_brush=True)
    message = str(mismatch_error(evenly(10), found, extents))
    assert message.count("exclude=") == 1
    assert "exclude=[(23.0, 25.0)]" in message


def test_a_brush_that_the_user_leaves_out_explains_the_beat_without_a_push():
    found = brushed(left_out=[WITH_BRUSH[6]])
    assert (found.n_odd, found.other) == (0, None)


@pytest.mark.parametrize(
    ("theta_deg", "hump", "said"),
    [
        (
            [30.0] * 4,
            [0, 1, -1, 2],
            "directions (theta, alpha) lack pushes: (30, 0) has 3 of 4",
        ),
        (
            [10.0, 20.0, 30.0, 40.0],
            [0, 1, -1, 2],
            "directions (theta, alpha) lack pushes: (30, 0) has 0 of 1; the other 3 "
            "have all of theirs",
        ),
        (
            [10.0, 10.0, 20.0],
            [0, -1, 1],
            "directions (theta, alpha) lack pushes: (10, 0) has 1 of 2; the other "
            "direction has all of theirs; 1 hump is left over",
        ),
        ([10.0, 20.0], [0, 1], "no direction lacks a push; 1 hump is left over"),
        ([10.0], [0], "no direction lacks a push; 2 humps are left over"),
    ],
)
def test_what_an_assignment_leaves_open_is_said_by_direction(theta_deg, hump, said):
    n, n_extra = len(hump), 3 - np.count_nonzero(np.array(hump) >= 0)
    schedule = PushSchedule.planned(theta=np.radians(theta_deg), alpha=np.zeros(n))
    pairs = Alignment(
        hump=np.array(hump),
        other=np.array(hump[::-1]),
        extra=tuple(range(3 - n_extra, 3)),
        n_cycles=1,
        expected=np.arange(float(n)),
    )
    message = str(mismatch_error(schedule, pairs, extents_at(2.0 * np.arange(3.0))))
    assert message.endswith(f"`allow_missing=True`. In (a) {said}")
    planned = "1 push is" if n == 1 else f"{n} pushes are"
    assert message.startswith(f"{planned} planned, 3 found: ")


@pytest.mark.parametrize(
    ("hump", "is_timed", "said"),
    [
        ([-1, 0, 1, 2], False, "unless a later one was not made"),
        ([0, 1, 2, -1], False, "unless an earlier one was not made"),
        ([0, 1, -1, 2], False, None),
        ([0, 1, 2, -1], True, None),
    ],
)
def test_which_push_was_not_made_is_open_where_no_gap_or_time_tells(
    hump, is_timed, said
):
    """One row too many anywhere in a plan leaves the last one over."""
    schedule = PushSchedule.planned(
        theta=np.radians([10.0, 20.0, 30.0, 40.0]), alpha=np.zeros(4)
    )
    if is_timed:
        schedule = replace(schedule, time=2.0 * np.arange(4.0))
    pairs = Alignment(
        hump=np.array(hump),
        other=None,
        extra=(),
        n_cycles=1,
        expected=np.arange(4.0),
    )
    message = str(mismatch_error(schedule, pairs, extents_at(2.0 * np.arange(3.0))))
    assert ("unless" in message) is (said is not None)
    assert said is None or said in message
