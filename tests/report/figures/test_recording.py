"""Pictures of a recording show it as its pushes were looked for."""

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.report.figures import found_figure
from pushfit.report.figures.recording import signal_figure
from tests.tolerances import EXACT

REST, HEIGHT = 700.0, 100.0
TOPS = 3.0 + 4.0 * np.arange(5)
NEAR = 0.02  # noise over the slope of a flank is 5 ms; four of them [s]
CLOSE = 0.5  # heights scatter by 0.15 and rests by less; three of them [counts]


def recording(*, sign: int = 1) -> Recording:
    """Triangles over a rest, or below it."""
    time = np.arange(0.0, 22.0, 0.01)
    humps = np.clip(1 - np.abs(time[:, None] - TOPS), 0, None).sum(axis=1)
    noise = np.random.default_rng(2).standard_normal(time.size)
    pressure = REST + sign * HEIGHT * humps + 0.5 * noise
    return Recording(time=time, channels={"p": pressure}, units={"p": "counts"})


def test_found_pushes_are_those_between_begin_and_end():
    part = PeakSettings(begin=5.0, end=17.0)
    found = find_pushes(recording(), settings=part)
    np.testing.assert_allclose([e.t_peak for e in found], TOPS[1:4], atol=NEAR)
    figure = found_figure(measure_pushes(recording(), settings=part))
    assert figure.get_suptitle().startswith("3 pushes")
    times = np.concatenate([line.get_xdata() for line in figure.axes[0].lines])
    assert (times.min(), times.max()) == (5.0, pytest.approx(17.0, rel=EXACT))


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("has_directions", [True, False])
def test_baselines_lie_in_the_drawn_signal_and_tops_on_it(sign, has_directions):
    settings = PeakSettings(invert=sign < 0)
    if has_directions:
        schedule = PushSchedule.planned(np.full(5, np.radians(30.0)), np.zeros(5))
        found = extract_peaks(recording(sign=sign), schedule, settings=settings)
        figure = signal_figure(found.traces[0], found)
    else:
        found = measure_pushes(recording(sign=sign), settings=settings)
        figure = found_figure(found)
    np.testing.assert_allclose(found.frame["baseline_counts"], REST, atol=CLOSE)
    (axes,) = figure.axes
    drawn = [np.asarray(line.get_ydata()) for line in axes.lines]
    rests = [y for y in drawn if y.size == 2 and y[0] == y[1]]
    tops = [y for y in drawn if y.size == 1]
    assert len(rests) == len(tops) == 5
    np.testing.assert_allclose(np.stack(rests), sign * REST, rtol=0, atol=CLOSE)
    np.testing.assert_allclose(np.stack(tops), sign * REST + HEIGHT, rtol=0, atol=CLOSE)
