"""Pushes with no rest between them, on triangles of a height that is known."""

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.records import Recording

HEIGHT, NOISE = 5.0, 0.02
# Three whole pushes before, between and after the ones that are joined, and the middle
# of these [s].
WHOLE, JOINED = (4.0, 20.0, 28.0), 12.0
# Of 72 heights and sds one is off by five sd by chance once in 20 000 runs. What a
# valley read as a rest takes from a height is a hundred.
MAX_PULL = 5.0
# A mean of rests of one sample scatters as that does; the sds of whole pushes are 0.01.
MAX_SD = 1.5 * NOISE


def measured(offsets, *, rate, step=0.0, held=0.0):
    """Rows of the joined pushes; their tops lie beside a middle by so much [s].

    Args:
        held: Share of the height below which nothing falls for 0.6 s between them.
    """
    time = np.arange(0.0, 32.0, 1 / rate)
    tops = [*WHOLE, *(JOINED + own for own in offsets)]
    course = np.max([np.clip(1 - np.abs(time - top), 0, None) for top in tops], axis=0)
    course = np.maximum(course, held * (np.abs(time - JOINED) < 0.3))
    noise = np.random.default_rng(4).standard_normal(len(time))
    y = HEIGHT * course + NOISE * noise + step * (time > JOINED)
    recording = Recording(time=time, channels={"f": y}, units={"f": "n"})
    frame = measure_pushes(recording, settings=PeakSettings(split=0.9)).frame
    assert len(frame) == len(tops)
    return frame[(frame.t_peak_s - JOINED).abs() < 3]


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize(
    "offsets", [(-0.3, 0.3), (-0.7, 0.7), (-0.9, 0.9), (-1.5, 0.0, 1.5)]
)
def test_a_valley_is_the_rest_of_no_push_beside_it(offsets, rate):
    """It lies at 0.7, 0.3, 0.1 and 0.25 of the height; the rest is as steady."""
    rows = measured(offsets, rate=rate)
    assert set(rows["flags"]) == {""}
    pulls = (rows.height_n - HEIGHT) / rows.height_sd_n
    assert pulls.abs().max() < MAX_PULL
    assert rows.height_sd_n.max() < MAX_SD


@pytest.mark.parametrize("held", [0.7, 0.8])
def test_a_valley_that_is_held_high_up_for_less_than_a_push_is_no_rest(held):
    rows = measured((-0.5, 0.5), rate=100.0, held=held)
    assert set(rows["flags"]) == {""}
    pulls = (rows.height_n - HEIGHT) / rows.height_sd_n
    assert pulls.abs().max() < MAX_PULL
    assert rows.height_sd_n.max() < MAX_SD


@pytest.mark.parametrize(("step", "flags"), [(0.1, ""), (0.4, "drift")])
def test_halves_are_flagged_where_the_rest_beyond_them_moves(step, flags):
    """By half of it under either top, of which 0.15 of a height is too much."""
    rows = measured((-0.5, 0.5), rate=100.0, step=step * HEIGHT)
    assert set(rows["flags"]) == {flags}
