"""Figures that explain themselves: marks where they belong, nothing hidden or empty."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex, to_rgb
from matplotlib.text import Text

from pushfit.data.tables.peak_table import PeakTable
from pushfit.report.figures import (
    Marker,
    Sweep,
    alpha_figure,
    corner_figure,
    coverage_figure,
    figure_bytes,
    grasp_figure,
    plot,
    quantity_figure,
    theta_figure,
    trace_figure,
)
from pushfit.report.figures.diagnostics import MAX_STEPS, MAX_TRACES
from pushfit.report.figures.grasp import RIM
from pushfit.report.figures.main import among
from pushfit.report.figures.pairs import EVERYWHERE
from pushfit.report.figures.recording import marks_of
from pushfit.report.figures.style import BLUE, SERIES
from tests.tolerances import EXACT

# Ends of a panel whose contour reaches to 2.1 sd, in sd: room around it, and little
# more than the furthest of 4000 draws, 4 sd.
CLEAR, FURTHEST = 2.5, 4.5


def sweep_at(alpha_deg: float, slope: float) -> Sweep:
    """Pushes and a fit of stated slope, so that curves are told apart."""
    angle = np.linspace(-60.0, 60.0, 9)
    return Sweep(
        fixed_deg=alpha_deg,
        angle_deg=angle,
        height=slope * angle,
        sd=np.full(9, np.nan),
        is_used=np.ones(9, dtype=bool),
        grid_deg=angle,
        best_fit=slope * angle,
        lower=np.empty(0),
        upper=np.empty(0),
    )


def test_the_critical_angle_stands_on_the_curve_of_its_azimuth_in_its_colour():
    sweeps = [sweep_at(0.0, 1.0), sweep_at(90.0, 2.0)]
    marker = Marker(
        name="theta_c",
        estimates=(10.0,),
        pieces=((5.0, 15.0),),
        text="10°",
        fixed_deg=90.0,
    )
    (axes,) = theta_figure(sweeps, unit="n", prob=0.9, marker=marker).axes
    lone = [line for line in axes.lines if len(line.get_xdata()) == 1]
    (point,) = [line for line in lone if line.get_marker() == "o"]
    assert point.get_xydata().tolist() == [[10.0, 20.0]]
    assert point.get_color() == SERIES[1]
    (shown,) = [line for line in axes.lines if line.get_linewidth() > 4]
    assert (shown.get_xdata()[0], shown.get_xdata()[-1]) == (5.0, 15.0)
    assert axes.get_title() == r"$\theta_c$ at α = 90°:  10°"


NARROW, WIDE, OPEN = (2.1, 2.4), (5.0, 38.0), (35.0, None)
# Length of an arrow head on a screen of 100 dots per inch, and how little of its base
# may be as dark as a line.
HEAD, SOFT = 7, 2


def rendered(figure) -> np.ndarray:
    """Pixels as a screen shows them, from the lowest row up: 0 to 1."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[::-1, :, :3] / 255


@pytest.mark.parametrize("ends", [NARROW, WIDE, OPEN])
def test_a_set_narrower_than_a_dot_is_seen_between_two_tips(ends):
    low, high = ends
    marker = Marker(name="theta_c", pieces=(ends,), text="of a test")
    figure = theta_figure([sweep_at(0.0, 1.0)], unit="n", prob=0.9, marker=marker)
    (axes,) = figure.axes
    pixels = rendered(figure)
    left, top = axes.transData.transform((low, 0.0))[0], axes.bbox.y1
    right = axes.bbox.x1 if high is None else axes.transData.transform((high, 0.0))[0]
    drawn = np.flatnonzero((pixels[int(top)] < 0.5).all(axis=-1))
    assert drawn.min() == pytest.approx(left - HEAD, abs=SOFT)
    beyond = 0 if high is None else HEAD
    assert drawn.max() == pytest.approx(right + beyond, abs=SOFT)
    assert np.diff(drawn).max() <= SOFT


@pytest.mark.parametrize("ends", [NARROW, WIDE, OPEN])
def test_the_sketch_shows_a_narrow_set_too(ends):
    """Blue on the ring beyond the rays, from tip to tip."""
    marks = {"theta_c": Marker(name="theta_c", pieces=(ends,))}
    marks["alpha_star"] = Marker(name="alpha_star", pieces=(ends,))
    figure = grasp_figure(np.empty(0), np.empty(0), reach_deg=(0.0, 90.0), **marks)
    pixels = rendered(figure)
    turn = np.linspace(-20.0, 110.0, 2601)
    for axes, sign in zip(figure.axes, (-1, 1), strict=True):
        ring = RIM * np.exp(1j * np.radians(sign * turn))
        x, y = axes.transData.transform(np.stack([ring.real, ring.imag], axis=1)).T
        shown = pixels[y.astype(int), x.astype(int)]
        is_blue = np.abs(shown - to_rgb(BLUE)).max(axis=-1) < 0.2
        dot = np.degrees(1 / (RIM * axes.transData.get_matrix()[0, 0]))
        first, last = turn[is_blue][[0, -1]]
        assert first == pytest.approx(ends[0] - HEAD * dot, abs=SOFT * dot)
        end = 90.0 if ends[1] is None else ends[1] + HEAD * dot
        assert last == pytest.approx(end, abs=SOFT * dot)


def test_azimuths_have_ticks_where_people_push():
    sweep = replace(sweep_at(15.0, 1.0), angle_deg=np.linspace(0.0, 150.0, 9))
    curves = alpha_figure([sweep], unit="n", prob=0.9).axes[0]
    inside = [x for x in curves.get_xticks() if 0 <= x <= 150]
    assert inside == [0, 30, 60, 90, 120, 150]


def test_the_disc_ends_where_the_pushes_end():
    sweep = replace(sweep_at(15.0, 1.0), angle_deg=np.linspace(0.0, 100.0, 9))
    disc = alpha_figure([sweep], unit="n", prob=0.9).axes[1]
    np.testing.assert_allclose(disc.get_xlim(), np.radians([0, 120]), rtol=EXACT)


def test_no_point_lies_under_the_legend_of_the_coverage():
    points = {"theta_c": [(0.5, 0.0, 0.0, 0.1)], "A": [(0.5, 1.0, 0.9, 1.0)]}
    figure = coverage_figure(points, n_tables=20)
    figure_bytes(figure, "png")
    (axes,) = figure.axes
    legend = axes.get_legend().get_window_extent()
    assert legend.y1 < axes.get_window_extent().y0


def test_what_an_ellipse_shows_is_said(determined):
    (legend,) = plot(determined, "ellipse").legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words[:2] == ["median of the posterior", "draws"]
    assert "65.0°" in words[-1]


def test_traces_stay_small_however_long_the_chain(determined):
    chain = np.zeros((2, 5000, 8, 3))
    figure = trace_figure(chain, ("a", "b", "c"), thin=1, autocorr_time={})
    lines = figure.axes[0].lines
    assert len(lines) <= MAX_TRACES
    assert max(line.get_xdata().size for line in lines) <= MAX_STEPS


def test_the_sketch_names_no_shade_that_a_dark_page_inverts(determined):
    words = [text.get_text() for text in plot(determined, "grasp").findobj(Text)]
    assert any("within reach" in text for text in words)
    assert not re.search("white|black|light|dark|pale", " ".join(words))


def test_the_sketch_shows_true_angles(determined):
    """Rays of both answers leave the contact at the angles that they stand for."""
    side, top = plot(determined, "grasp").axes
    for axes, angle in ((side, -40.123), (top, 65.0)):
        (ray,) = [li for li in axes.lines if li.get_linestyle() == "--"]
        x, y = ray.get_xydata()[1]
        assert np.degrees(np.arctan2(y, x)) == pytest.approx(angle, rel=EXACT)


def test_the_height_of_components_is_drawn_to_the_length_of_their_change():
    table = PeakTable.from_arrays(
        theta=np.radians([30.0, 60.0]),
        alpha=np.zeros(2),
        heights={
            "height_normal": np.full(2, 3.0),
            "height_tangential": np.full(2, 4.0),
        },
        unit="n",
    )
    marks = marks_of(table.frame, unit="n")
    assert marks.baseline.tolist() == [0.0, 0.0]
    assert marks.height.tolist() == [5.0, 5.0]


def test_a_level_of_few_degrees_of_freedom_is_on_the_picture():
    """Of one degree of freedom it is 40 at 90 %, far above what else is shown."""
    rng, grid = np.random.default_rng(0), np.linspace(0.0, 90.0, 181)
    figure = quantity_figure(
        (grid, np.full(181, 0.2)),
        rng.uniform(0.0, 90.0, 500),
        rng.uniform(0.0, 90.0, 500),
        marker=Marker(name="theta_c"),
        likelihood_pieces=((None, None),),
        level=40.0,
        prob=0.9,
    )
    figure_bytes(figure, "png")  # without a warning of a layout that failed
    (label,) = [text for text in figure.axes[0].texts if text.get_text() == "90 %"]
    panel = figure.axes[0].get_window_extent()
    assert panel.y0 < label.get_window_extent().y0 < panel.y1


def test_contours_fill_their_panels():
    """90 % of a normal posterior is a circle of 2.1 sd; the panel is at most 4 sd."""
    rng = np.random.default_rng(0)
    prior = {name: rng.normal(0.0, 50.0, 4000) for name in ("e1", "e2")}
    samples = {name: rng.normal(0.0, 1.0, 4000) for name in ("e1", "e2")}
    figure = corner_figure(samples, prior, units={})
    low, high = figure.axes[2].get_xlim()
    assert CLEAR < high < FURTHEST
    assert CLEAR < -low < FURTHEST
    assert to_hex(figure.axes[2].get_facecolor()) == EVERYWHERE.lower()


def test_a_shape_that_the_data_made_positive_stays_on_a_linear_axis():
    rng = np.random.default_rng(0)
    prior = {name: rng.normal(0.0, 3.0, 4000) for name in ("e1", "e2")}
    samples = {name: rng.lognormal(0.0, 1.5, 4000) for name in ("e1", "e2")}
    figure = corner_figure(samples, prior, units={})
    assert {axes.get_xscale() for axes in figure.axes} == {"linear"}


@pytest.mark.parametrize(
    ("alpha_deg", "drawn_deg"),
    [(65.0, 65.0), (-115.0, 65.0), (245.0, 65.0), (170.0, 170.0)],
)
def test_an_axis_is_drawn_among_the_azimuths_that_were_pushed(alpha_deg, drawn_deg):
    """From 0° to 150°; a finger that pushes the other way may be said another turn."""
    azimuths = replace(sweep_at(0.0, 1.0), angle_deg=np.linspace(0.0, 150.0, 9))
    ends = (alpha_deg - 2.0, None)
    marker = Marker(name="alpha_star", estimates=(alpha_deg,), pieces=(ends,))
    found = among(marker, [azimuths])
    assert found.estimates == (drawn_deg,)
    assert found.pieces == ((drawn_deg - 2.0, None),)
