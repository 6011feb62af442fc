"""Figures that explain themselves: marks where they belong, nothing hidden or empty."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_hex

from pushfit.data.tables.peak_table import PeakTable
from pushfit.report.figures import (
    Marker,
    Sweep,
    alpha_figure,
    corner_figure,
    coverage_figure,
    figure_bytes,
    plot,
    theta_figure,
    trace_figure,
)
from pushfit.report.figures.diagnostics import MAX_STEPS, MAX_TRACES
from pushfit.report.figures.pairs import EVERYWHERE
from pushfit.report.figures.recording import marks_of
from pushfit.report.figures.style import BLUE, SERIES

EXACT = 1e-12  # equal on paper: a few ulp of numbers of order one


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
    (point,) = [line for line in axes.lines if len(line.get_xdata()) == 1]
    assert point.get_xydata().tolist() == [[10.0, 20.0]]
    assert point.get_color() == SERIES[1]
    (shown,) = [line for line in axes.lines if line.get_linewidth() > 4]
    assert (shown.get_xdata()[0], shown.get_xdata()[-1]) == (5.0, 15.0)
    assert axes.get_title() == r"$\theta_c$ at α = 90°:  10°"


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


def test_the_sketch_shows_true_angles(determined):
    """Rays of both answers leave the contact at the angles that they stand for."""
    side, top = plot(determined, "grasp").axes
    for axes, angle in ((side, -40.123), (top, 65.0)):
        (ray,) = [li for li in axes.lines if li.get_color() == BLUE]
        x, y = ray.get_xydata()[1]
        assert np.degrees(np.arctan2(y, x)) == pytest.approx(angle)


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
    marks = marks_of(table, range(2))
    assert marks.baseline.tolist() == [0.0, 0.0]
    assert marks.height.tolist() == [5.0, 5.0]


def test_contours_fill_their_panels():
    """90 % of a normal posterior is a circle of 2.1 sd; the panel is at most 4 sd."""
    rng = np.random.default_rng(0)
    prior = {name: rng.normal(0.0, 50.0, 4000) for name in ("e1", "e2")}
    samples = {name: rng.normal(0.0, 1.0, 4000) for name in ("e1", "e2")}
    figure = corner_figure(samples, prior, units={})
    low, high = figure.axes[2].get_xlim()
    assert 2.5 < high < 4.5
    assert -4.5 < low < -2.5
    assert to_hex(figure.axes[2].get_facecolor()) == EVERYWHERE.lower()


def test_a_shape_that_the_data_made_positive_stays_on_a_linear_axis():
    rng = np.random.default_rng(0)
    prior = {name: rng.normal(0.0, 3.0, 4000) for name in ("e1", "e2")}
    samples = {name: rng.lognormal(0.0, 1.5, 4000) for name in ("e1", "e2")}
    figure = corner_figure(samples, prior, units={})
    assert {axes.get_xscale() for axes in figure.axes} == {"linear"}
