"""Schedules: reading plans of pushes."""

import numpy as np
import pandas as pd
import pytest

from pushfit.data.plans.schedule import PushSchedule, read_schedule
from pushfit.errors import DataError
from tests.tolerances import ROUNDING


def written(tmp_path, text):
    path = tmp_path / "plan.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_schedule_keeps_its_order_and_numbers(tmp_path):
    text = "push,theta_deg,alpha_deg,repeat\n3,60,90,1\n1,-60,90,2\n"
    schedule = read_schedule(written(tmp_path, text))
    assert schedule.push.tolist() == [3, 1]
    assert schedule.repeat.tolist() == [1, 2]
    np.testing.assert_allclose(schedule.theta, [np.pi / 3, -np.pi / 3], rtol=ROUNDING)
    assert schedule.time is None


def test_planned_times_are_seconds(tmp_path):
    text = "theta_deg,alpha_deg,time_ms\n60,90,500\n30,90,2500\n"
    assert read_schedule(written(tmp_path, text)).time.tolist() == [0.5, 2.5]


def test_a_schedule_may_be_parquet(tmp_path):
    text = written(tmp_path, "theta_deg,alpha_deg\n60,90\n30,0\n")
    path = tmp_path / "plan.parquet"
    pd.read_csv(text).to_parquet(path)
    found, same = read_schedule(path), read_schedule(text)
    np.testing.assert_array_equal(found.theta, same.theta)
    np.testing.assert_array_equal(found.alpha, same.alpha)
    assert found.source.path == str(path)


def test_an_impossible_elevation_is_named(tmp_path):
    with pytest.raises(DataError, match=r"plan\.csv, line 3, column theta_deg: 97 is"):
        read_schedule(written(tmp_path, "theta_deg,alpha_deg\n60,90\n97,90\n"))


@pytest.mark.parametrize("more", [("height_kpa", "1.5"), ("height_n,flags", "1.5,cut")])
def test_a_table_of_peaks_is_called_what_it_is(more, tmp_path):
    names, cells = more
    path = written(tmp_path, f"theta_deg,alpha_deg,{names}\n30,0,{cells}\n")
    with pytest.raises(DataError, match=r"table of peak heights.*`pushfit fit`"):
        read_schedule(path)


@pytest.mark.parametrize(
    ("time", "code", "says"),
    [
        ("", "missing_value", "line 3, column time_s: nan stands for an empty cell"),
        ("1.5", "duplicate_time", "column time_s: 1.5 is the time of two pushes"),
        ("2.5", None, ""),
    ],
)
def test_times_that_order_nothing_are_refused(tmp_path, time, code, says):
    path = written(tmp_path, f"theta_deg,alpha_deg,time_s\n10,0,1.5\n20,0,{time}\n")
    if code is None:
        assert read_schedule(path).time.tolist() == [1.5, 2.5]
        return
    with pytest.raises(DataError) as caught:
        read_schedule(path)
    assert caught.value.code == code
    assert says in str(caught.value)


def test_a_schedule_without_directions_is_refused(tmp_path):
    with pytest.raises(DataError) as caught:
        read_schedule(written(tmp_path, "push,repeat\n1,1\n"))
    assert caught.value.code == "missing_column"


THETA = np.radians(np.arange(-60.0, 61.0, 30.0))
TWICE = PushSchedule.planned(THETA, 1.5, repeats=2)
IN_RUNS = PushSchedule.planned(THETA, 1.5, repeats=1).repeated(2)
FORTH_AND_BACK = PushSchedule.planned(np.append(THETA, THETA[-2::-1]), np.full(9, 1.5))


@pytest.mark.parametrize(
    ("plan", "jumps"),
    [
        (TWICE, [0, 2, 4, 6, 8]),
        (IN_RUNS, [0, 5]),
        (FORTH_AND_BACK, [0]),
        (PushSchedule.planned(np.array([0.1, 0.5, 0.2, 1.1]), np.full(4, 1.5)), []),
        (PushSchedule.planned(np.array([0.1, 0.5]), np.array([1.5, 1.5])), []),
        (PushSchedule.planned(np.array([0.1]), np.array([1.5])), []),
    ],
)
def test_jumps_are_moves_unlike_most(plan, jumps):
    assert np.flatnonzero(plan.is_jump).tolist() == jumps


def test_directions_are_those_of_the_angles():
    assert TWICE.direction.tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    assert IN_RUNS.direction.tolist() == [0, 1, 2, 3, 4, 0, 1, 2, 3, 4]
