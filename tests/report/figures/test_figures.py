"""Figures: everything asked for is drawn, and nothing that may not be quoted."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
from matplotlib import rcParams
from matplotlib.colors import to_hex, to_rgb

from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.traces import envelope
from pushfit.report.figures import (
    Marker,
    all_figures,
    alpha_figure,
    coverage_figure,
    main_figure,
    quantity_figure,
    recording_figure,
    theta_figure,
)
from pushfit.report.figures.diagnostics import autocorrelation
from pushfit.report.figures.grasp import ellipse_points
from pushfit.report.figures.main import sweep_makers, sweeps_of
from pushfit.report.figures.pairs import corner_figure
from pushfit.report.figures.recording import MAX_POINTS, marks_of, signal_figure
from pushfit.report.figures.style import (
    DATA,
    PRIOR,
    SERIES,
    figure_bytes,
    series_colours,
)
from pushfit.report.figures.sweeps import Sweep
from tests.tolerances import EXACT

# 80 000 steps, one in 9 of them independent: 0.011 per lag, five of them.
PER_LAG = 0.055
# A parabola that is interpolated between points 0.1 apart would be off by 0.028.
BETWEEN = 0.02
PIXELS = 1e-6  # to pixels and back [deg]
STEP = 0.02  # an arc of 25° has 60 points, 0.007 apart [rad]


def svg(figure) -> str:
    """The figure as text."""
    return figure_bytes(figure, "svg").decode()


def titles(figure) -> str:
    """All titles of a figure."""
    return " ".join(
        axes.get_title(loc=side) for axes in figure.axes for side in ("left", "center")
    )


def test_the_main_figure_marks_both_answers(determined):
    figure = main_figure(determined)
    assert "40.1° (38.1° to 42.1°)" in titles(figure)
    assert "65.0° (63.0° to 67.0°)" in titles(figure)
    lines = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    x = [line.get_xdata() for line in lines]
    assert any(np.allclose(one, 40.123, rtol=EXACT, atol=0) for one in x)


def test_all_modes_are_marked(two_modes):
    axes = main_figure(two_modes).axes[0]
    verticals = {
        round(float(line.get_xdata()[0]))
        for line in axes.lines
        if len(line.get_xdata()) == 2 and np.ptp(line.get_xdata()) == 0
    }
    assert {40, 56} <= verticals


@pytest.mark.parametrize("kind", ["not_determined", "not_converged"])
def test_what_is_not_quoted_is_not_marked(kind, request):
    figure = main_figure(request.getfixturevalue(kind))
    axes = figure.axes[0]
    assert not [line for line in axes.lines if line.get_linestyle() == "--"]
    assert "not " in titles(figure)


def test_an_unconverged_posterior_draws_no_band(not_converged):
    (sweep,) = sweeps_of(not_converged, "theta", "height")
    assert sweep.lower.size == 0
    assert sweep.best_fit.size > 0
    assert "theta_c" not in all_figures(not_converged)


def test_pushes_that_were_left_out_are_in_the_figure(determined):
    (sweep,) = sweeps_of(determined, "theta", "height")
    assert sweep.angle_deg.size == 51 + 3  # three of the azimuth sweep are at 90°
    assert np.sum(~sweep.is_used) == 1


def test_pushes_that_are_in_a_mean_are_drawn_with_it(determined):
    later = [1, 2]
    table = determined.table.with_flag(later, "averaged")
    averaged = replace(determined, table=table, used=table.is_used)
    (drawn,) = sweeps_of(averaged, "theta", "height")
    (whole,) = sweeps_of(determined, "theta", "height")
    np.testing.assert_array_equal(drawn.height, np.delete(whole.height, later))


def test_without_an_azimuth_sweep_there_is_one_panel(theta_only):
    assert len(main_figure(theta_only).axes) == 1
    assert list(sweep_makers(theta_only)) == ["theta"]


def test_every_axis_with_numbers_says_its_unit(determined):
    for axes in main_figure(determined).axes:
        assert re.search(r"\[.+\]", axes.get_xlabel())
        assert re.search(r"\[.+\]", axes.get_ylabel())


@pytest.mark.slow
def test_each_kind_of_result_can_be_drawn_without_a_warning(any_identification):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for figure in all_figures(any_identification).values():
            assert svg(figure).startswith("<?xml")


def test_equal_results_give_equal_files(determined):
    assert svg(main_figure(determined)) == svg(main_figure(determined))


def test_drawing_leaves_the_settings_of_the_session_alone(determined):
    before = dict(rcParams)
    main_figure(determined)
    assert dict(rcParams) == before


def test_neighbouring_series_differ_in_grey_print():
    """Relative luminance (Rec. 709): 0.05 of full scale is seen as another grey."""
    luminance = [np.dot(to_rgb(c), [0.2126, 0.7152, 0.0722]) for c in SERIES]
    assert np.min(np.abs(np.diff(luminance))) > 0.05


def test_a_dollar_sign_in_a_name_is_no_mathematics():
    figure = theta_figure([], unit="$\\frac$", prob=0.9)
    assert "$\\frac$" in figure.axes[0].get_ylabel()
    assert svg(figure)


def test_an_open_set_is_shaded_to_the_border():
    rng = np.random.default_rng(0)
    figure = quantity_figure(
        None,
        rng.normal(70.0, 5.0, 500),
        rng.uniform(0.0, 90.0, 500),
        marker=Marker(name="theta_c", pieces=((61.0, None),), text="above 61°"),
        likelihood_pieces=(),
        level=2.7,
        prob=0.9,
    )
    axes = figure.axes[0]
    shade = axes.patches[-1].get_extents().transformed(axes.transData.inverted())
    assert abs(shade.x0 - 61.0) < PIXELS
    assert abs(shade.x1 - axes.get_xlim()[1]) < PIXELS


def test_a_set_beyond_the_pushes_is_drawn_to_its_end():
    """Azimuths up to 60°, and a set that ends at 75°, where there is no curve."""
    angle = np.linspace(0.0, 60.0, 7)
    sweep = Sweep(
        fixed_deg=30.0,
        angle_deg=angle,
        height=2.0 - angle / 60,
        sd=np.full(7, 0.1),
        is_used=np.ones(7, dtype=bool),
        grid_deg=angle,
        lower=np.empty(0),
        upper=np.empty(0),
        best_fit=2.0 - angle / 60,
    )
    marker = Marker(name="alpha_star", estimates=(66.0,), pieces=((50.0, 75.0),))
    marker = replace(marker, fixed_deg=30.0)
    axes, polar = alpha_figure([sweep], unit="n", prob=0.9, marker=marker).axes
    assert axes.get_xlim()[1] > 75.0
    shade = axes.patches[-1].get_extents().transformed(axes.transData.inverted())
    assert abs(shade.x1 - 75.0) < PIXELS
    assert abs(np.degrees(polar.get_xlim()[1]) - 90.0) < PIXELS
    # A sector, no triangle: half way the shade is as far out.
    outline = polar.collections[-2].get_paths()[0].vertices
    assert np.max(outline[np.abs(outline[:, 0] - np.radians(62.5)) < STEP, 1]) > 2.0
    # Nothing is drawn on the curve where there is none.
    thick = next(line for line in axes.lines if line.get_lw() == 6)
    point = next(line for line in axes.lines if line.get_mec() == "white")
    x, y = thick.get_data()
    assert np.max(x[np.isfinite(y)]) <= 60.0
    assert np.isnan(point.get_ydata()).all()


def test_profile_and_draws_of_an_axis_share_one_half_turn(make_identification):
    """The profile of α* may run from 70° to 245°; 206° is 26°."""
    result = make_identification()
    grid = np.linspace(70.0, 245.0, 176)
    profile = replace(
        result.profiles["theta_c"],
        name="alpha_star",
        values=grid,
        delta_chi_square=((grid - 206.0) / 2) ** 2,
        pieces=((203.0, 209.0),),
    )
    figure = all_figures(replace(result, profiles={"alpha_star": profile}))[
        "alpha_star"
    ]
    x, y = figure.axes[0].lines[0].get_data()
    assert x[np.argmin(y)] == 26.0
    assert np.all(np.diff(x) >= 0)
    shade = figure.axes[0].patches[0].get_extents()
    ends = shade.transformed(figure.axes[0].transData.inverted())
    np.testing.assert_allclose([ends.x0, ends.x1], [23.0, 29.0], rtol=EXACT)


def test_an_ellipse_has_the_axes_of_its_matrix():
    """Semi-axes and azimuth are the eigenvalues and eigenvector of K expm(...)."""
    mean, e1, e2 = 80.0, -0.7, 0.9
    values, vectors = np.linalg.eigh(np.array([[e1, e2], [e2, -e1]]) / 2)
    points = ellipse_points(mean, e1, e2, n_points=721)
    radius = np.hypot(*points)
    np.testing.assert_allclose(radius.max(), mean * np.exp(values[1]), rtol=EXACT)
    np.testing.assert_allclose(radius.min(), mean * np.exp(values[0]), rtol=EXACT)
    stiff = points[:, np.argmax(radius)] / radius.max()
    np.testing.assert_allclose(abs(stiff @ vectors[:, 1]), 1.0, rtol=EXACT)


def test_a_thinned_signal_keeps_its_extremes():
    rng = np.random.default_rng(2)
    signal = rng.normal(size=50_000)
    time = np.arange(signal.size) * 0.01
    thin_time, thin = envelope(time, signal, max_points=MAX_POINTS)
    assert thin.size <= MAX_POINTS
    assert (thin.min(), thin.max()) == (signal.min(), signal.max())
    assert np.all(np.diff(thin_time) > 0)


def test_a_gap_stays_a_gap_in_a_thinned_signal():
    signal = np.ones(50_000)
    signal[20_000:30_000] = np.nan
    time = np.arange(signal.size) * 0.01
    time, thin = envelope(time, signal, max_points=MAX_POINTS)
    inside = (time > 201.0) & (time < 299.0)
    assert np.isnan(thin[inside]).all()


def test_autocorrelation_of_an_ar1_chain_decays_as_known():
    """x' = 0.8 x + noise has the autocorrelation 0.8^lag."""
    rng = np.random.default_rng(4)
    chain = np.empty((2, 4000, 10))
    chain[:, 0] = rng.normal(size=(2, 10))
    for step in range(1, 4000):
        chain[:, step] = 0.8 * chain[:, step - 1] + 0.6 * rng.normal(size=(2, 10))
    rho = autocorrelation(chain)
    np.testing.assert_allclose(rho[:6], 0.8 ** np.arange(6), atol=PER_LAG)


def make_recording():
    """Nine pushes, one of them saturated, one without a known time."""
    table = PeakTable.from_arrays(
        theta=np.radians(np.repeat([-30.0, 0.0, 30.0], 3)),
        alpha=np.radians(np.full(9, 90.0)),
        heights={"height": np.full(9, 20.0)},
        unit="counts",
        flags=("",) * 4 + ("saturated",) + ("",) * 4,
    )
    peaks = 2.0 + 4.0 * np.arange(9)
    frame = table.frame.assign(
        t_peak_s=peaks,
        t_start_s=peaks - 1,
        t_end_s=peaks + 1,
        baseline_counts=700.0,
    )
    frame.loc[8, ["t_peak_s", "t_start_s", "t_end_s"]] = np.nan
    time = np.arange(0.0, 38.0, 0.01)
    signal = 700 + 20 * np.clip(1 - np.abs((time - 2) % 4 - 0), 0, 1)
    return time, signal, PeakTable.from_frame(frame)


def test_a_recording_shows_directions_and_doubts():
    time, signal, table = make_recording()
    marks = marks_of(table.frame, unit=table.unit)
    figure = recording_figure(time, signal, marks, unit="counts", channel="pressure")
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert ["-30°", "0°", "30°"] == texts[:3]
    assert "saturated" in texts
    assert figure.axes[0].get_ylabel() == "pressure [counts]"
    assert figure.get_suptitle() == "9 pushes, 1 doubtful; labels: θ at α = 90°"


def test_every_quantity_and_claim_of_a_calibration_is_drawn():
    points = {
        "theta_c": [(0.5, 0.6, 0.4, 0.8), (0.9, 0.85, 0.6, 0.97)],
        "A": [(0.5, 0.4, 0.2, 0.6), (0.9, 1.0, 0.8, 1.0)],
    }
    figure = coverage_figure(points, n_tables=20)
    (axes,) = figure.axes
    assert [label.get_text() for label in axes.get_xticklabels()] == ["50 %", "90 %"]
    assert len(axes.containers) == 2
    drawn = np.concatenate([c.lines[0].get_ydata() for c in axes.containers])
    np.testing.assert_allclose(drawn.astype(float), [60, 85, 40, 100], rtol=EXACT)
    assert "20 simulated tables" in axes.get_title(loc="left")


def test_no_push_lies_under_a_legend(determined):
    figure = main_figure(determined)
    figure_bytes(figure, "png")
    for axes in figure.axes:
        legend = axes.get_legend().get_window_extent()
        assert legend.y1 < axes.get_window_extent().y0


def test_series_beyond_the_palette_keep_colours_of_their_own():
    assert series_colours(3) == list(SERIES[:3])
    assert len(set(series_colours(12))) == 12


def luminance(rgb):
    """Relative luminance, as WCAG 2 defines it."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
    return np.dot((0.2126, 0.7152, 0.0722), linear)


@pytest.mark.parametrize("n", [8, 12])
def test_a_ramp_is_read_on_paper_and_where_a_dark_page_inverts_it(n):
    """Three to one is what WCAG 2 asks of graphics."""
    for colour in series_colours(n):
        shown = luminance(to_rgb(colour))
        inverted = luminance(1 - np.array(to_rgb(colour)))
        assert 1.05 / (shown + 0.05) > 3
        assert (inverted + 0.05) / (luminance((0.11, 0.11, 0.11)) + 0.05) > 3


def test_a_sharp_angle_is_drawn_over_many_bins():
    """On the grid of the profile all draws would fall into one or two."""
    rng = np.random.default_rng(1)
    grid = np.union1d(np.linspace(-90.0, 90.0, 181), np.linspace(37.0, 43.0, 61))
    draws = rng.normal(40.0, 0.3, 4000)
    figure = quantity_figure(
        (grid, ((grid - 40.0) / 0.3) ** 2),
        draws,
        rng.uniform(-90.0, 90.0, 4000),
        marker=Marker(name="theta_c", estimates=(40.0,)),
        likelihood_pieces=((39.5, 40.5),),
        level=2.7,
        prob=0.9,
        modes=(40.0,),
    )
    low, high = figure.axes[-1].get_xlim()
    assert low < draws.min()
    assert draws.max() < high
    assert high - low < 20 * draws.std()
    curve = figure.axes[0].lines[0]
    drawn = np.interp(40.15, curve.get_xdata(), curve.get_ydata())
    # The root is interpolated, not the square.
    assert drawn == pytest.approx(0.25, abs=BETWEEN)


def test_a_result_shows_its_recording_with_every_push(determined):
    (trace,) = determined.table.traces
    figure = signal_figure(trace, determined.table)
    words = figure._suptitle.get_text()
    assert words.startswith("69 pushes, 1 doubtful")
    assert figure.axes[0].get_ylabel() == "force [N]"


def contour_colours(axes):
    return {to_hex(lines.get_edgecolor()[0]) for lines in axes.collections}


def test_a_prior_is_drawn_in_pairs_only_where_a_panel_shows_a_good_part_of_it():
    rng = np.random.default_rng(0)
    prior = {name: rng.normal(0.0, 1.0, 4000) for name in ("e1", "e2", "f1")}
    sds = {"e1": 0.5, "e2": 0.5, "f1": 0.01}
    samples = {name: rng.normal(0.3, sd, 4000) for name, sd in sds.items()}
    figure = corner_figure(samples, prior, units={})
    grid = np.array(figure.axes).reshape(3, 3)
    assert contour_colours(grid[1, 0]) == {DATA.lower(), PRIOR.lower()}
    assert contour_colours(grid[2, 0]) == {DATA.lower()}
