"""Force components on the page: what their panels draw, and that they take clicks."""

import numpy as np
import pytest
from bokeh.events import Tap
from bokeh.models import Div, Line, Plot, Segment, VStrip

from pushfit.cli.look.page import Page
from pushfit.cli.look.state import Look
from pushfit.config import read_config
from pushfit.report.figures.components import REST, TOP
from pushfit.report.figures.style import BLACK, DATA, GREY, PURPLE
from tests.cli.look.makers import a_look
from tests.report.figures.test_components import (
    BEGINS,
    CLOSE,
    END,
    HEIGHTS,
    HOLD,
    JERK,
    JERK_AT,
    LEVELS,
    THREE,
    forces,
)

FOOT = 0.1  # of a push, where it is found for its shade [s]
SAMPLE = 1e-3  # a tenth of a sampling step [s]


def page_of(made, **peaks):
    changes = {"peaks": {"normal": "-fz", **peaks}}
    look = Look(made, read_config(None, changes=changes))
    return look, Page(look, title="a.csv", save=lambda own: "")


def plots_of(page):
    return [part for part in page.root.children if isinstance(part, Plot)]


def drawn(plot, kind, **looks):
    """What glyphs of a kind show that look like this, field by field."""
    found = []
    for renderer in plot.renderers:
        glyph, data = renderer.glyph, renderer.data_source.data
        if isinstance(glyph, kind) and looks == {n: getattr(glyph, n) for n in looks}:
            names = glyph.dataspecs().keys() & {"x", "y", "x0", "x1", "y0", "y1"}
            found.append({n: np.asarray(data[getattr(glyph, n)], float) for n in names})
    return found


def levels(plot, width):
    """Begins, ends and heights of level lines of a width."""
    (own,) = drawn(plot, Segment, line_color=BLACK, line_width=width)
    np.testing.assert_array_equal(own["y0"], own["y1"])
    return own["x0"], own["x1"], own["y0"]


@pytest.fixture(scope="module")
def shown():
    look, page = page_of(forces(THREE))
    return look, plots_of(page)


def test_every_component_has_a_panel_below_that_of_their_length(shown):
    _, (whole, *below) = shown
    labels = [plot.left[0].axis_label for plot in (whole, *below)]
    assert labels == ["change of force [N]", *(f"{name} [N]" for name in THREE)]
    assert {plot.x_range for plot in below} == {whole.x_range}
    assert [plot.below[0].visible for plot in (whole, *below)] == [False] * 3 + [True]
    assert below[-1].below[0].axis_label == "time [s]"


def test_heights_stand_on_their_rest_levels_at_their_own_sign(shown):
    _, (_, *below) = shown
    for name, plot in zip(THREE, below, strict=True):
        begin, end, rests = levels(plot, REST)
        np.testing.assert_allclose(rests, LEVELS[name], rtol=0, atol=CLOSE)
        np.testing.assert_allclose(begin, BEGINS, rtol=0, atol=FOOT)
        np.testing.assert_allclose(end, BEGINS + END, rtol=0, atol=FOOT)
        reached = LEVELS[name] + np.array(HEIGHTS[name])
        np.testing.assert_allclose(levels(plot, TOP)[2], reached, rtol=0, atol=CLOSE)
        (stem,) = drawn(plot, Segment, line_width=2)
        np.testing.assert_array_equal(stem["y0"], rests)
        np.testing.assert_allclose(stem["y1"], reached, rtol=0, atol=CLOSE)


def test_heights_are_drawn_over_the_shaded_stretch_of_the_hold(shown):
    _, (_, *below) = shown
    for plot in below:
        first, last, _ = levels(plot, TOP)
        (shade,) = drawn(plot, VStrip, fill_color=GREY)
        np.testing.assert_array_equal(shade["x0"], first)
        np.testing.assert_array_equal(shade["x1"], last)
        assert (first - BEGINS > HOLD[0]).all()
        assert (last - BEGINS < HOLD[1]).all()
        assert (last - first > 0.5).all()


def test_a_jerk_is_drawn_beside_what_was_measured_and_sets_no_scale(shown):
    _, (_, *others, plot) = shown
    (jerk,) = drawn(plot, Line, line_color=PURPLE)
    when = jerk["x"][np.isfinite(jerk["y"])]
    assert when.min() < JERK_AT < when.max()
    assert when.size < 30
    assert np.nanmax(jerk["y"]) > LEVELS["fz"] + 0.9 * JERK
    (kept,) = drawn(plot, Line, line_color=DATA)
    assert np.isnan(kept["y"][np.argmin(np.abs(kept["x"] - JERK_AT))])
    scale = [own.glyph.line_color for own in plot.y_range.renderers]
    assert DATA in scale
    assert PURPLE not in scale
    assert not any(drawn(other, Line, line_color=PURPLE) for other in others)


def test_words_name_a_jerk_only_where_there_is_one():
    said = []
    for jerk in (JERK, 0.0):
        _, page = page_of(forces(THREE, jerk=jerk))
        texts = [div.text for div in page.root.select({"type": Div})]
        said.append(next(t for t in texts if t.startswith("Each component")))
    assert said[0] == f"{said[1].removesuffix('.')}; jerks, left out, are purple."


def test_a_click_in_a_component_leaves_a_hump_out_of_all_of_them():
    look, page = page_of(forces(THREE))
    whole, *below = plots_of(page)
    when = BEGINS[1] + 1.0
    below[1]._trigger_event(Tap(below[1], x=when, y=0.0))
    assert look.counts == [True, False, True, True]
    for name, plot in zip(THREE, below, strict=True):
        reached = LEVELS[name] + np.array(HEIGHTS[name])
        tops = levels(plot, TOP)[2]
        assert np.isnan(tops).tolist() == [False, True, False, False]
        np.testing.assert_allclose(tops[2:], reached[2:], rtol=0, atol=CLOSE)
    whole._trigger_event(Tap(whole, x=when, y=0.0))
    assert not any(np.isnan(levels(plot, TOP)[2]).any() for plot in below)


def test_heights_of_pushes_with_directions_are_the_same():
    look, page = page_of(forces(THREE))
    before = [levels(plot, TOP)[2] for plot in plots_of(page)[1:]]
    look.fill("30", "0", 4)
    page.refresh()
    after = [levels(plot, TOP)[2] for plot in plots_of(page)[1:]]
    np.testing.assert_array_equal(after, before)


def test_components_are_seen_where_no_push_counts():
    look, page = page_of(forces(THREE), exclude=[(0.0, 22.0)])
    assert not any(look.counts)
    for name, plot in zip(THREE, plots_of(page)[1:], strict=True):
        (kept,) = drawn(plot, Line, line_color=DATA)
        rest = kept["y"][kept["x"] < BEGINS[0]].mean()
        assert rest == pytest.approx(LEVELS[name], abs=CLOSE)
        assert np.isnan(levels(plot, TOP)[2]).all()


def test_only_the_part_that_is_looked_at_is_drawn():
    _, page = page_of(forces(THREE), begin=6.0, end=15.5)
    for plot in plots_of(page)[1:]:
        (kept,) = drawn(plot, Line, line_color=DATA)
        assert (kept["x"].min(), kept["x"].max()) == (6.0, 15.5)


def test_stretches_of_a_clock_are_counted_from_the_first_second():
    for after in (0.0, 1.7e9):
        _, page = page_of(forces(THREE, after=after))
        for plot in plots_of(page)[1:]:
            first, last, _ = levels(plot, TOP)
            assert (first - BEGINS > HOLD[0]).all()
            assert (last - BEGINS < HOLD[1]).all()
            (kept,) = drawn(plot, Line, line_color=DATA)
            assert kept["x"].max() == pytest.approx(21.99, abs=SAMPLE)


def test_one_channel_has_one_panel_and_no_words_about_components():
    page = Page(a_look(), title="a.csv", save=None)
    assert len(plots_of(page)) == 1
    texts = [div.text for div in page.root.select({"type": Div})]
    assert not any(text.startswith("Each component") for text in texts)
