"""Times of pushes in a table lie inside of what was recorded."""

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording

TIME = np.arange(0.0, 40.0, 0.01)
TOPS = 2.0 + 4.0 * np.arange(9.0)
PLAN = PushSchedule.planned(
    theta=np.radians(np.linspace(10.0, 80.0, 9)), alpha=np.zeros(9)
)
TIMES = ["t_start_s", "t_peak_s", "t_end_s"]
LENIENT = PeakSettings(allow_missing=True)


def recorded(begin: float, end: float, lost: int | None = None) -> Recording:
    """Nine pushes of 2 N in a time of which a part is recorded, one not made."""
    made = [k for k in range(9) if k != lost]
    force = sum(2.0 * np.exp(-(((TIME - TOPS[k]) / 0.5) ** 2)) for k in made)
    force = force + 0.01 * np.random.default_rng(3).standard_normal(TIME.size)
    own = (begin <= TIME) & (end > TIME)
    return Recording(
        time=TIME[own], channels={"force": force[own]}, units={"force": "n"}
    )


@pytest.mark.parametrize(
    ("begin", "end", "lost", "column", "row", "flag"),
    [
        (2.0, 40.0, None, "t_peak_s", 0, "clipped"),
        (2.0, 40.0, None, "t_start_s", 0, "clipped"),
        (0.0, 34.0, None, "t_end_s", 8, "clipped"),
        (0.0, 34.25, 8, "t_end_s", 8, "missing"),
        (1.5, 40.0, 0, "t_start_s", 0, "missing"),
    ],
)
def test_a_push_that_an_end_of_the_recording_cuts_ends_there(
    begin, end, lost, column, row, flag
):
    recording = recorded(begin, end, lost)
    frame = extract_peaks(recording, PLAN, settings=LENIENT).frame
    assert frame["flags"][row] == flag
    first, last = recording.time[[0, -1]]
    assert frame[column][row] == (first if row == 0 else last)
    assert frame[TIMES].min().min() >= first
    assert frame[TIMES].max().max() <= last
