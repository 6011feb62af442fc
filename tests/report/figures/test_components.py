"""Force components are drawn each, with what was measured where, at its own sign."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.report.figures import found_figure
from pushfit.report.figures.components import SHADE, TOP
from pushfit.report.figures.recording import marks_of, recording_figure, signal_figure
from pushfit.report.figures.style import ALARM, BLACK, DATA, GREY, PURPLE
from tests.tolerances import EXACT

NOISE, STEP = 0.02, 0.01
# Changes of force while a push is held [N], and readings at rest [N].
HEIGHTS = {
    "fx": [1.0, -1.5, 0.6, 2.0],
    "fy": [-0.8, 0.5, -1.2, 0.9],
    "fz": [-4.0, -5.0, -3.0, -6.0],
}
LEVELS = {"fx": 2.0, "fy": -1.0, "fz": 7.0}
# Begin of contact, and since then the hold and the end [s].
BEGINS, HOLD, END = 2.0 + 5.0 * np.arange(4), (0.5, 2.0), 2.5
# On retracting, of the second push [s] and [N].
JERK_AT, JERK = BEGINS[1] + 2.3, 30.0
# Means of 50 samples and more scatter by 0.02 / sqrt(50); five of them, with rests.
CLOSE = 0.02
ENDS = 3 * STEP  # a stretch ends at samples, and so do the pushes it is a share of
CLOCK = 1e-6  # samples of a clock of 1.7e9 s are 2e-7 s apart at the finest [s]


def course(time):
    """Share of each height by the time, one column per push."""
    since = time[:, None] - BEGINS
    return np.clip(since / HOLD[0], 0, 1) * np.clip(
        (END - since) / (END - HOLD[1]), 0, 1
    )


def forces(names, *, jerk=JERK, after=0.0):
    """Held pushes with a jerk in one of them, in some components."""
    time = np.arange(0.0, 22.0, STEP)
    rng = np.random.default_rng(4)
    channels = {
        name: LEVELS[name]
        + course(time) @ HEIGHTS[name]
        + NOISE * rng.standard_normal(time.size)
        for name in names
    }
    channels["fz"] += jerk * np.exp(-(((time - JERK_AT) / 0.02) ** 2))
    return Recording(
        time=time + after, channels=channels, units=dict.fromkeys(names, "n")
    )


def table_of(made):
    """Heights of four pushes."""
    plan = PushSchedule.planned(np.radians(30.0), 0.0, repeats=4)
    return extract_peaks(made, plan, settings=PeakSettings(normal="-fz"))


def lines_of(axes, colour, width=None):
    """Abscissae and ordinates of the lines that look like this."""
    return [
        (np.asarray(line.get_xdata()), np.asarray(line.get_ydata()))
        for line in axes.lines
        if to_hex(line.get_color()) == colour.lower()
        and (width is None or line.get_linewidth() == width)
    ]


def tops_of(axes):
    """Stretches and heights that are drawn over them."""
    found = lines_of(axes, BLACK, TOP)
    for _, level in found:
        assert level[0] == level[1]
    return np.array([x for x, _ in found]), np.array([level[0] for _, level in found])


def spans_of(axes, alpha):
    """Ends of what is shaded so dark."""
    boxes = [p.get_extents() for p in axes.patches if p.get_alpha() == alpha]
    inverse = axes.transData.inverted()
    return np.array([inverse.transform(box)[:, 0] for box in boxes])


TWO, THREE = ("fx", "fz"), ("fx", "fy", "fz")


@pytest.fixture(scope="module", params=[TWO, THREE], ids=len)
def drawn(request):
    table = table_of(forces(request.param))
    figure = signal_figure(table.traces[0], table)
    figure.draw_without_rendering()
    return request.param, figure


def test_every_component_has_a_panel_under_that_of_their_length(drawn):
    names, figure = drawn
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert labels == ["change of force [N]", *(f"{name} [N]" for name in names)]
    top, *below = figure.axes
    for axes in below:
        assert axes.get_xlim() == top.get_xlim()
        assert top.get_shared_x_axes().joined(top, axes)


def test_heights_stand_on_their_rest_levels_at_their_own_sign(drawn):
    names, figure = drawn
    for name, axes in zip(names, figure.axes[1:], strict=True):
        rests = [y for _, y in lines_of(axes, BLACK, 0.9)]
        np.testing.assert_allclose(rests, LEVELS[name], rtol=0, atol=CLOSE)
        reached = LEVELS[name] + np.array(HEIGHTS[name])
        np.testing.assert_allclose(tops_of(axes)[1], reached, rtol=0, atol=CLOSE)
        stems = np.array([y for _, y in lines_of(axes, GREY, 0.9)])
        np.testing.assert_allclose(
            np.diff(stems)[:, 0], HEIGHTS[name], rtol=0, atol=CLOSE
        )


def test_heights_are_drawn_over_the_shaded_stretch_of_the_hold(drawn):
    _, figure = drawn
    for axes in figure.axes[1:]:
        stretches, _ = tops_of(axes)
        np.testing.assert_allclose(spans_of(axes, SHADE), stretches, rtol=EXACT)
        first, last = (stretches - BEGINS[:, None]).T
        assert (first > HOLD[0]).all()
        assert (last < HOLD[1]).all()
        # So much of the width at half height, on either side of the middle.
        width = (END + HOLD[1] - HOLD[0]) / 2
        np.testing.assert_allclose(last - first, 2 * 0.2 * width, rtol=0, atol=ENDS)


def test_the_height_drawn_is_that_of_the_samples_in_the_stretch():
    """By a second route: the recording itself, and rests around the push."""
    made = forces(THREE)
    table = table_of(made)
    for axes in signal_figure(table.traces[0], table).axes[1:]:
        name = axes.get_ylabel().removesuffix(" [N]")
        for (first, last), level in zip(*tops_of(axes), strict=True):
            inside = (made.time >= first) & (made.time <= last)
            mean = made.channels[name][inside].mean()
            # The top of the length is not quite its mean over the stretch.
            assert level == pytest.approx(mean, abs=NOISE)


def test_a_jerk_on_retracting_is_seen_outside_of_every_stretch(drawn):
    _, figure = drawn
    *others, axes = figure.axes
    (jerk,) = lines_of(axes, PURPLE)
    when = jerk[0][np.isfinite(jerk[1])]
    assert when.min() < JERK_AT < when.max()
    assert when.size < 30
    assert np.nanmax(jerk[1]) > LEVELS["fz"] + 0.9 * JERK
    for first, last in tops_of(axes)[0]:
        assert not ((when >= first) & (when <= last)).any()
    # Nor is it drawn as what was measured, or in the scale of the pushes.
    ((time, kept),) = lines_of(axes, DATA)
    assert np.isnan(kept[np.argmin(np.abs(time - JERK_AT))])
    assert axes.get_ylim()[1] < LEVELS["fz"] + 1.0
    assert not any(lines_of(other, PURPLE) for other in others)


def test_a_legend_names_a_jerk_only_where_there_is_one():
    words = []
    for jerk in (JERK, 0.0):
        table = table_of(forces(THREE, jerk=jerk))
        (legend,) = signal_figure(table.traces[0], table).legends
        words.append([text.get_text() for text in legend.get_texts()])
    assert words[0] == [*words[1], "jerk, left out"]
    assert words[1] == ["rest level", "height", "stretch it was measured over"]


def test_one_channel_has_one_panel_and_no_legend():
    made = forces(("fz",), jerk=0.0)
    plan = PushSchedule.planned(np.radians(30.0), 0.0, repeats=4)
    table = extract_peaks(made, plan, settings=PeakSettings(invert=True))
    figure = signal_figure(table.traces[0], table)
    assert len(figure.axes) == 1
    assert figure.legends == []


def test_stretches_and_jerks_of_a_clock_are_counted_from_the_first_second():
    plain, clock = (table_of(forces(THREE, after=after)) for after in (0.0, 1.7e9))
    figures = [signal_figure(table.traces[0], table) for table in (plain, clock)]
    for one, other in zip(*(figure.axes[1:] for figure in figures), strict=True):
        for ours, theirs in zip(tops_of(one), tops_of(other), strict=True):
            np.testing.assert_allclose(theirs, ours, rtol=0, atol=2 * STEP)
        np.testing.assert_allclose(other.get_xlim(), one.get_xlim(), rtol=0, atol=CLOCK)


def test_pushes_without_directions_have_their_components_as_well():
    figure = found_figure(
        measure_pushes(forces(THREE), settings=PeakSettings(normal="-fz"))
    )
    for name, axes in zip(THREE, figure.axes[1:], strict=True):
        reached = LEVELS[name] + np.array(HEIGHTS[name])
        np.testing.assert_allclose(tops_of(axes)[1], reached, rtol=0, atol=CLOSE)


def test_a_doubtful_push_is_in_colour_in_every_component():
    table = table_of(forces(THREE))
    frame = table.frame.assign(flags=["", "", "saturated", ""])
    figure = signal_figure(table.traces[0], replace(table, frame=frame))
    for axes in figure.axes[1:]:
        assert len(tops_of(axes)[0]) == 3
        ((when, _),) = lines_of(axes, ALARM, TOP)
        assert BEGINS[2] < when[0] < when[1] < BEGINS[2] + END


def test_rows_of_many_pushes_show_each_of_them_once_and_at_one_scale():
    """Heights belong to the rows of the table, which is not in order of time here."""
    table = table_of(forces(THREE))
    (trace,) = table.traces
    n, order = 16, np.random.default_rng(0).permutation(64)
    marks = marks_of(table.frame, unit=table.unit)
    many = marks.loc[np.tile(marks.index, n)].reset_index(drop=True)
    shift = np.repeat(22.0 * np.arange(n), 4)

    def later(time):
        return np.concatenate([time + 22.0 * k for k in range(n)])

    many = many.assign(**{c: many[c] + shift for c in many if c.startswith("t_")})
    components = [
        replace(
            own,
            time=later(own.time),
            # Higher in every row, but for the pushes as they were measured.
            signal=np.tile(own.signal, n) + 0.01 * later(own.time),
            is_jerk=np.tile(own.is_jerk, n),
            heights=replace(
                own.heights,
                start=(np.tile(own.heights.start, n) + shift)[order],
                end=(np.tile(own.heights.end, n) + shift)[order],
                baseline=np.tile(own.heights.baseline, n)[order],
                height=np.tile(own.heights.height, n)[order],
            ),
        )
        for own in trace.components
    ]
    figure = recording_figure(
        later(trace.time),
        np.tile(trace.signal, n),
        many.iloc[order],
        unit="n",
        channel="change of force",
        components=components,
    )
    grid = np.array(figure.axes).reshape(-1, 4)
    assert len(grid) == 3
    for name, panels in zip(THREE, grid.T[1:], strict=True):
        stretches = np.concatenate([tops_of(axes)[0] for axes in panels])
        tops = np.concatenate([tops_of(axes)[1] for axes in panels])
        begins = (BEGINS + 22.0 * np.arange(n)[:, None]).ravel()
        assert (np.abs(stretches.mean(axis=1) - begins - END / 2) < ENDS).all()
        reached = LEVELS[name] + np.tile(HEIGHTS[name], n)
        np.testing.assert_allclose(tops, reached, rtol=0, atol=CLOSE)
        assert len({axes.get_ylim() for axes in panels}) == 1


def test_long_names_stay_beside_their_panel():
    table = table_of(forces(THREE))
    (trace,) = table.traces
    long = [replace(c, name=f"/sensor/wrench.force.{c.name}") for c in trace.components]
    figure = signal_figure(replace(trace, components=tuple(long)), table)
    figure.draw_without_rendering()
    labels = [axes.yaxis.label.get_window_extent() for axes in figure.axes]
    for above, below in itertools.pairwise(labels):
        assert above.y0 > below.y1


def test_all_panels_and_their_legend_go_into_a_subfigure():
    table = table_of(forces(THREE))
    whole = Figure(layout="constrained", figsize=(14, 6))
    own, other = whole.subfigures(1, 2)
    assert signal_figure(table.traces[0], table, fig=own) is whole
    assert len(own.axes) == 4
    assert len(own.legends) == 1
    assert other.axes == []
