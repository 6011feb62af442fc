"""Plans are paired right or refused: never wrong without a word."""

import numpy as np
import pytest

from benchmarks.plan_alignment import count
from pushfit.data.plans.alignment import align

PERIOD = 3.5


@pytest.mark.parametrize("n_cases", [50, pytest.param(10_000, marks=pytest.mark.slow)])
def test_no_subset_of_a_regular_plan_is_paired_wrong_silently(n_cases):
    verdicts = count(n_cases)
    assert verdicts["wrong"] == 0
    assert verdicts["right"] > 0.3 * n_cases


@pytest.mark.parametrize("lost", range(7))
def test_one_push_of_seven_is_placed_where_there_is_no_room_for_another(lost):
    times = np.delete(PERIOD * np.arange(7.0), lost)
    found = align(
        times,
        [False] * 6,
        n_planned=7,
        planned_times=None,
        span=(-0.6 * PERIOD, 6.6 * PERIOD),
    )
    assert not found.is_ambiguous
    assert found.missing == (lost,)


def test_where_few_pushes_show_no_rhythm_mere_order_is_the_other_candidate():
    times = np.delete(PERIOD * np.arange(5.0), 2)
    span = (-0.6 * PERIOD, 4.6 * PERIOD)
    found = align(times, [False] * 4, n_planned=5, planned_times=None, span=span)
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
        n_planned=n_planned,
        planned_times=None,
        span=(0.0, 24.0),
    )
    assert found.other is not None
    assert found.other.tolist() == [*range(6), *[-1] * (n_planned - 6)]


def test_a_plan_whose_first_pushes_feel_nothing_is_paired_with_its_last():
    rng = np.random.default_rng(1)
    times = PERIOD * np.arange(27) + 0.1 * rng.standard_normal(27)
    found = align(
        times[15:],
        [False] * 12,
        n_planned=27,
        planned_times=None,
        span=(-1.5, 26 * PERIOD + 3.0),
    )
    assert found.hump.tolist() == [-1] * 15 + list(range(12))
    assert not found.is_ambiguous


@pytest.mark.parametrize("is_timed", [False, True])
def test_bumps_between_the_beats_are_named_as_extra(is_timed):
    rng = np.random.default_rng(1)
    pushes = PERIOD * np.arange(51) + 0.1 * rng.standard_normal(51)
    bumps = np.sort(rng.choice(50, 5, replace=False) + 0.5) * PERIOD
    times = np.sort(np.concatenate([pushes, bumps]))
    found = align(
        times,
        [False] * 56,
        n_planned=51,
        planned_times=PERIOD * np.arange(51.0) if is_timed else None,
        span=(-2.0, 50 * PERIOD + 3.0),
    )
    assert not found.is_ambiguous
    assert found.missing == ()
    np.testing.assert_array_equal(times[list(found.extra)], bumps)
