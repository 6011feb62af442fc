"""Alignment: which push is missing or extra is told by the rhythm."""

import numpy as np
import pytest

from benchmarks.recordings.plan_alignment import evenly
from pushfit.data.plans.alignment import align
from tests.tolerances import EXACT

PERIOD = 3.5
N = 27


def humps(n=N, jitter=0.1, seed=0):
    rng = np.random.default_rng(seed)
    return PERIOD * np.arange(n) + jitter * rng.standard_normal(n)


def aligned(times, brush=None, n_planned=N):
    brush = [False] * len(times) if brush is None else brush
    span = (times[0] - PERIOD, times[-1] + PERIOD)
    return align(times, brush, plan=evenly(n_planned), span=span)


def test_as_many_humps_as_pushes_are_paired_in_order():
    result = aligned(humps())
    assert result.n_odd == 0
    assert result.hump.tolist() == list(range(N))


@pytest.mark.parametrize("lost", [1, 7, 13, 25])
def test_a_missing_push_inside_is_located(lost):
    result = aligned(np.delete(humps(), lost))
    assert result.missing == (lost,)
    assert result.extra == ()
    assert result.other is None


@pytest.mark.parametrize("lost", [(3, 4), (5, 20), (10, 11, 12)])
def test_several_missing_pushes_are_located(lost):
    assert aligned(np.delete(humps(), lost)).missing == lost


@pytest.mark.parametrize("after", [0, 9, 25])
def test_an_extra_hump_between_two_pushes_is_located(after):
    times = humps()
    times = np.insert(times, after + 1, times[after] + 0.45 * PERIOD)
    result = aligned(times)
    assert result.extra == (after + 1,)
    assert result.missing == ()


def test_a_push_missing_at_an_end_is_ambiguous():
    """No rhythm tells the first from the last: either end may lack one."""
    result = aligned(humps()[1:])
    assert len(result.missing) == 1
    assert result.other is not None


def test_a_brush_in_the_rhythm_is_the_push_that_was_missing():
    brush = [False] * N
    brush[13] = True
    result = aligned(humps(), brush)
    assert result.n_odd == 0
    assert result.hump[13] == 13


def test_a_brush_out_of_the_rhythm_stays_a_brush():
    times = humps()
    times = np.insert(times, 5, times[4] + 0.4 * PERIOD)
    brush = [False] * (N + 1)
    brush[5] = True
    result = aligned(times, brush)
    assert result.n_odd == 0
    assert 5 not in result.hump


def test_a_schedule_of_one_cycle_repeats():
    result = aligned(humps(), n_planned=9)
    assert (result.n_cycles, result.n_odd) == (3, 0)


@pytest.mark.parametrize("pause", [2.3, 9.0])
def test_pauses_between_runs_through_a_schedule_take_none_of_its_pushes(pause):
    beats = np.arange(16) + pause * (np.arange(16) // 4)
    result = aligned(PERIOD * beats, n_planned=4)
    assert (result.n_cycles, result.n_odd, result.other) == (4, 0, None)


def test_a_pause_moves_no_moment_of_a_push_after_it():
    beats = np.arange(11) + 6.3 * (np.arange(11) > 5)
    span = PERIOD * np.array([-0.5, beats[-1] + 2.5])
    found = align(
        PERIOD * beats,
        [False] * 11,
        plan=evenly(12),
        span=(float(span[0]), float(span[1])),
    )
    assert found.missing == (11,)
    assert found.expected[-1] == pytest.approx(PERIOD * (beats[-1] + 1), rel=EXACT)


@pytest.mark.parametrize(("shift", "is_of_another"), [(0.0, False), (-0.4, True)])
def test_runs_that_lack_more_pushes_than_one_has_are_of_another_schedule(
    shift, is_of_another
):
    beats = np.arange(16) + shift * (np.arange(16) // 4)
    result = aligned(PERIOD * beats, n_planned=9)
    assert result.n_cycles == 2
    assert result.is_of_another is is_of_another


def test_a_few_odd_pushes_of_many_short_runs_are_no_other_schedule():
    times = np.delete(humps(40), 11)
    times = np.sort(np.append(times, times[[15, 25]] + 0.45 * PERIOD))
    result = aligned(times, n_planned=2)
    assert (result.n_cycles, result.n_odd) == (20, 3)
    assert not result.is_of_another


def test_planned_times_locate_a_push_in_an_uneven_schedule():
    planned = np.cumsum([0, 2, 2, 6, 2, 9, 2, 2, 4, 2.0])
    recorded = np.delete(planned + 100.0, 5)
    span = (90.0, 140.0)
    result = align(recorded, [False] * 9, plan=evenly(10, planned), span=span)
    assert result.missing == (5,)


@pytest.mark.parametrize(("origin", "is_plain"), [(3.0, True), (0.0, False)])
def test_times_of_the_recordings_own_clock_place_what_is_missing_at_its_begin(
    origin, is_plain
):
    """Those that begin at 0 are of another clock, and tell the rhythm only."""
    planned = 4.0 * np.arange(N)
    result = align(
        3.0 + planned[3:],
        [False] * (N - 3),
        plan=evenly(N, origin + planned),
        span=(0.0, 3.0 + planned[-1] + 20.0),
    )
    assert (result.other is None) is is_plain
    if is_plain:
        np.testing.assert_array_equal(result.missing, [0, 1, 2])


@pytest.mark.parametrize("are_onsets", [True, False])
def test_times_of_the_own_clock_may_be_onsets_and_six_in_ten_keep_to_them(are_onsets):
    """Seven of ten pushes, and a bump between two pairs of them and after the last."""
    onsets = 3.0 * np.arange(1, 11)
    pushes = np.delete(onsets, [4, 5, 9])
    starts = np.sort([*pushes, 10.8, 13.8, 34.8])
    result = align(
        starts + 0.5,
        [False] * 10,
        plan=evenly(10, onsets if are_onsets else onsets + 0.5),
        span=(0.0, 37.0),
        starts=starts,
    )
    assert result.other is None
    np.testing.assert_array_equal(result.missing, [4, 5, 9])
    np.testing.assert_array_equal(starts[list(result.extra)], [10.8, 13.8, 34.8])


def test_as_many_humps_as_planned_by_times_from_the_first_push_are_no_proof():
    """Two pushes are missing, the last among them, beside two bumps."""
    planned = 3.0 * np.arange(10)
    humps = np.sort([*np.delete(planned + 3.5, [3, 9]), 10.85, 19.85])
    result = align(humps, [False] * 10, plan=evenly(10, planned), span=(0.0, 32.5))
    assert result.other is not None
    shown = [tuple(np.flatnonzero(one < 0)) for one in (result.hump, result.other)]
    assert (3, 9) in shown


@pytest.mark.parametrize("off", [3.5, -3.5, 0.3, 8.2])
def test_a_whole_plan_in_its_rhythm_needs_no_clock(off):
    """By another one, at nearly a period from that of the recording."""
    middles = 2.6 + 4.0 * np.arange(10)
    plan = evenly(10, middles + off)
    span = (0.0, middles[-1] + 4.0)
    result = align(middles, [False] * 10, plan=plan, span=span, starts=middles - 0.5)
    np.testing.assert_array_equal(result.hump, np.arange(10))
    assert result.other is None


@pytest.mark.parametrize("n_made", [15, 18])
@pytest.mark.parametrize("early", [0.0, 0.5])
def test_a_second_run_that_was_stopped_is_no_row_of_bumps(n_made, early):
    """By the times of the first run, of the middles or of the begins."""
    middles = 2.0 + 4.0 * np.arange(n_made)
    result = align(
        middles,
        [False] * n_made,
        plan=evenly(10, middles[:10] - early),
        span=(0.0, middles[-1] + 2.5),
        starts=middles - 0.5,
    )
    assert result.n_cycles == 2
    assert result.other is None
    np.testing.assert_array_equal(result.missing, np.arange(n_made, 20))


@pytest.mark.parametrize("is_timed", [True, False])
def test_half_as_many_bumps_as_pushes_are_no_second_run(is_timed):
    middles = 2.5 + 3.0 * np.arange(8)
    bumps = middles[1:6] + 1.3
    result = align(
        np.sort([*middles, *bumps]),
        [False] * 13,
        plan=evenly(8, middles if is_timed else None),
        span=(0.0, 27.0),
    )
    assert result.n_cycles == 1
    assert result.other is None
    assert not result.missing


def test_a_bump_on_the_beat_of_a_push_beside_it_is_told_with_that_push():
    """It stands for the missing last one; how soon they follow each other tells."""
    beats = np.array([0.0, 1.04, 2.01, 3.0, 4.06, 5.0, 5.99, 6.09, 7.01])
    span = (-PERIOD / 2, PERIOD * (beats[-1] + 0.5))
    result = align(
        PERIOD * beats, [False] * beats.size, plan=evenly(beats.size), span=span
    )
    assert result.other is None
    assert result.off_beat == (6, 7)
