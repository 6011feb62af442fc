"""Figures: functions from arrays to matplotlib figures, and those of a result."""

from pushfit.report.figures.diagnostics import (
    coverage_figure,
    residual_figure,
    trace_figure,
)
from pushfit.report.figures.grasp import Ellipses, ellipse_figure, grasp_figure
from pushfit.report.figures.identification import all_figures, figure_files, plot
from pushfit.report.figures.main import main_figure
from pushfit.report.figures.pairs import corner_figure
from pushfit.report.figures.posterior import (
    learned_figure,
    quantity_figure,
)
from pushfit.report.figures.recording import (
    found_figure,
    recording_figure,
    signal_figure,
)
from pushfit.report.figures.style import figure_bytes, save_figure
from pushfit.report.figures.sweeps import Marker, Sweep, alpha_figure, theta_figure

__all__ = [
    "Ellipses",
    "Marker",
    "Sweep",
    "all_figures",
    "alpha_figure",
    "corner_figure",
    "coverage_figure",
    "ellipse_figure",
    "figure_bytes",
    "figure_files",
    "found_figure",
    "grasp_figure",
    "learned_figure",
    "main_figure",
    "plot",
    "quantity_figure",
    "recording_figure",
    "residual_figure",
    "save_figure",
    "signal_figure",
    "theta_figure",
    "trace_figure",
]
