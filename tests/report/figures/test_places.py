"""Every figure goes into a place of the user's: its axes, or its figure and panels."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from pushfit.data.peaks.extract import measure_pushes
from pushfit.errors import ConfigError
from pushfit.report import figures
from pushfit.report.figures import Ellipses, Marker
from pushfit.report.figures.main import sweeps_of
from pushfit.report.figures.recording import marks_of
from pushfit.report.result import Result
from tests.report.figures.test_recording import recording

RNG = np.random.default_rng(0)
DRAWS = {name: RNG.normal(0.0, 1.0, 400) for name in ("e1", "e2")}
CURVE = np.linspace(-3.0, 3.0, 61)
ANGLES = np.array([0.0, 30.0, 60.0, 90.0])
SHAPE = Ellipses(
    title="B", mean=np.ones(9), e1=np.zeros(9), e2=np.zeros(9), is_informed=True
)
WHAT = {
    "alpha": lambda result: (
        (sweeps_of(result, "alpha", "height"),),
        {"unit": "n", "prob": 0.9},
    ),
    "theta": lambda result: (
        (sweeps_of(result, "theta", "height"),),
        {"unit": "n", "prob": 0.9},
    ),
    "corner": lambda _: ((DRAWS, DRAWS), {"units": {}}),
    "coverage": lambda _: (({"A": [(0.5, 0.4, 0.2, 0.6)]},), {"n_tables": 9}),
    "ellipse": lambda _: (([SHAPE, SHAPE],), {"unit": "n_per_m"}),
    "found": lambda _: ((measure_pushes(recording()),), {}),
    "grasp": lambda _: (
        (ANGLES, ANGLES),
        {
            "theta_c": Marker(name="theta_c", estimates=(40.0,)),
            "alpha_star": Marker(name="alpha_star"),
            "reach_deg": (0.0, 90.0),
        },
    ),
    "learned": lambda _: ((["A"], np.array([0.5])), {"verdicts": ["learned"]}),
    "main": lambda result: ((result,), {}),
    "quantity": lambda _: (
        ((CURVE, CURVE**2), DRAWS["e1"], DRAWS["e2"]),
        {
            "marker": Marker(name="theta_c"),
            "likelihood_pieces": (),
            "level": 2.7,
            "prob": 0.9,
        },
    ),
    "recording": lambda result: (
        (CURVE, CURVE, marks_of(result.table.frame.iloc[:3], unit=result.table.unit)),
        {"unit": "n", "channel": "force"},
    ),
    "residual": lambda _: (
        (ANGLES, ANGLES),
        {
            "theta_deg": ANGLES,
            "alpha_deg": ANGLES,
            "row": np.arange(4),
            "channels": ["height"] * 4,
            "unit": "n",
        },
    ),
    "signal": lambda result: ((result.table.traces[0], result.table), {}),
    "trace": lambda _: (
        (RNG.normal(size=(2, 30, 4, 2)), ["A", "B"]),
        {"thin": 1, "autocorr_time": {}},
    ),
}
IN_AXES = {"alpha", "theta", "coverage", "learned", "quantity"}
IN_FIGURES = set(WHAT) - {"theta", "coverage", "learned"}


@pytest.fixture
def alone(monkeypatch):
    """No figure but those of the test."""
    made = []
    make = Figure.__init__

    def counted(self, *arguments, **options):
        made.append(self)
        make(self, *arguments, **options)

    monkeypatch.setattr(Figure, "__init__", counted)
    yield
    assert len(made) == 1


def test_every_public_figure_is_tried_here():
    public = {name for name in dir(figures) if name.endswith("_figure")}
    assert public == {f"{name}_figure" for name in WHAT} | {"save_figure"}


@pytest.mark.parametrize("name", sorted(IN_AXES))
def test_a_figure_of_one_panel_is_drawn_into_axes(name, determined, alone):
    whole = Figure(layout="constrained")
    own, other = whole.subplots(1, 2)
    arguments, options = WHAT[name](determined)
    draw = getattr(figures, f"{name}_figure")
    assert draw(*arguments, **options, ax=own) is whole
    assert own.has_data()
    assert whole.axes == [own, other]
    assert not other.has_data()


@pytest.mark.parametrize("layout", [None, "constrained"])
@pytest.mark.parametrize("name", sorted(IN_FIGURES))
def test_a_figure_of_panels_is_drawn_into_a_subfigure(name, layout, determined, alone):
    whole = Figure(layout=layout, figsize=(16, 8))
    own, other = whole.subfigures(1, 2)
    beside = other.subplots()
    before = beside.get_position().bounds
    arguments, options = WHAT[name](determined)
    draw = getattr(figures, f"{name}_figure")
    assert draw(*arguments, **options, fig=own) is whole
    whole.draw_without_rendering()
    panels = [axes for axes in whole.axes if axes is not beside]
    assert panels
    middle = whole.bbox.width / 2
    for axes in panels:
        assert axes.get_figure(root=False) in (own, *own.subfigs)
        assert axes.get_window_extent().x1 <= middle
    assert any(axes.has_data() for axes in panels)
    assert not beside.has_data()
    if layout is None:
        assert beside.get_position().bounds == before


def test_every_figure_of_a_result_goes_into_a_subfigure(determined):
    result = Result.of(determined)
    for name in figures.all_figures(determined):
        whole = Figure(layout="constrained", figsize=(12, 6))
        own, other = whole.subfigures(1, 2)
        assert result.plot(name, fig=own) is whole
        assert any(axes.has_data() for axes in whole.axes)
        assert other.axes == []


def test_a_place_that_does_not_fit_is_said(determined):
    result, axes = Result.of(determined), Figure().subplots()
    with pytest.raises(ConfigError, match=r"'main' has several panels.* fig="):
        result.plot("main", ax=axes)
    with pytest.raises(ConfigError, match="ax and fig are both given"):
        result.plot("theta", ax=axes, fig=Figure())
    with pytest.raises(ConfigError, match="it has main, grasp"):
        result.plot("nothing")
