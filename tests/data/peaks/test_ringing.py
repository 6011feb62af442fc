"""Pushes after which finger or sensor rings, which is neither a push nor a drift."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.records import Recording

HEIGHT, NOISE, RATE = 5.0, 0.02, 200.0
LENGTH, N_PUSHES = 3.0, 5
# Of 240 heights and sds one is off by five sd by chance once in 7000 runs.
MAX_PULL = 5.0
# As far as a rest of a second rings, it tells less: 10 N where it was taken for drift.
USUAL_SD = 0.2 * HEIGHT


def recording(shape, *, rest, share, frequency, decay):
    """Triangles, or holds that ring at their begin, too; their rests ring."""
    seed = [int(100 * share), int(10 * decay), int(frequency), int(rest)]
    rng, starts = (
        np.random.default_rng(seed),
        3.0 + (LENGTH + rest) * np.arange(N_PUSHES),
    )
    time = np.arange(0.0, starts[-1] + LENGTH + rest, 1 / RATE)
    since = time[:, None] - starts
    rise = np.minimum(since, LENGTH - since) / (LENGTH / 2)
    course = np.clip(5 * rise if shape == "hold" else rise, 0, 1)

    def ringing(after):
        after = np.maximum(after, 0.0)
        return share * np.sin(2 * np.pi * frequency * after) * np.exp(-after / decay)

    course -= ringing(since - LENGTH)
    if shape == "hold":
        course += ringing(since - LENGTH / 10)
    y = HEIGHT * course.sum(axis=1) + NOISE * rng.standard_normal(len(time))
    return Recording(time=time, channels={"f": y}, units={"f": "n"})


@pytest.mark.parametrize("shape", ["triangle", "hold"])
@pytest.mark.parametrize("rest", [1.0, 3.0])
@pytest.mark.parametrize("share", [0.05, 0.1, 0.2])
@pytest.mark.parametrize(
    ("frequency", "decay"), [(5.0, 0.1), (5.0, 0.3), (12.0, 0.1), (12.0, 0.3)]
)
def test_what_rings_after_a_push_is_no_push_and_no_drift(
    shape, rest, share, frequency, decay
):
    own = recording(shape, rest=rest, share=share, frequency=frequency, decay=decay)
    frame = measure_pushes(own).frame
    assert len(frame) == N_PUSHES
    assert not any(frame["flags"])
    pulls = (frame.height_n - HEIGHT) / frame.height_sd_n
    assert pulls.abs().max() < MAX_PULL
    assert frame.height_sd_n.median() < USUAL_SD


def test_what_rings_is_told_once_and_can_be_taken_in():
    own = recording("triangle", rest=3.0, share=0.1, frequency=5.0, decay=0.8)
    found = measure_pushes(own)
    assert len(found.frame) == N_PUSHES
    (told,) = found.cautions
    assert "far briefer than one beside them, are left out" in told
    window = re.search(r"include=\[\(([\d.]+), ([\d.]+)\)\]", told)
    settings = PeakSettings(include=[tuple(map(float, window.groups()))])
    assert len(measure_pushes(own, settings=settings).frame) == N_PUSHES + 1


@pytest.mark.parametrize("height", [2.0, 5.0, 8.0])
def test_taps_do_not_ring_because_of_a_long_push_elsewhere(height):
    time = np.arange(0.0, 24.0, 1 / RATE)
    since = time[:, None] - 2.0 * np.arange(1, 7)
    y = height * np.clip(1 - np.abs(since) / 0.1, 0, 1).sum(axis=1)
    y += HEIGHT * np.clip(np.minimum(time - 15.0, 20.0 - time) / 0.3, 0, 1)
    y += NOISE * np.random.default_rng(1).standard_normal(len(time))
    own = Recording(time=time, channels={"f": y}, units={"f": "n"})
    frame = measure_pushes(own).frame
    assert len(frame) == 7
    assert not any(frame["flags"])


def test_a_brief_push_after_a_long_one_does_not_ring_where_it_is_higher_than_half():
    """It lasts 0.1 s at half its height, as brief as what rings after a push of 1.5."""
    own = recording("triangle", rest=3.0, share=0.0, frequency=5.0, decay=0.1)
    for share, n in ((0.4, 0), (0.6, 1)):
        brief = np.clip(1 - np.abs(own.time - 6.5) / 0.1, 0, None)
        channels = {"f": own.channels["f"] + share * HEIGHT * brief}
        frame = measure_pushes(replace(own, channels=channels)).frame
        assert len(frame) == N_PUSHES + n
