"""Figures: functions from arrays to matplotlib figures, and those of a result."""

from pushfit.report.figures.diagnostics import coverage_figure as coverage_figure
from pushfit.report.figures.diagnostics import residual_figure as residual_figure
from pushfit.report.figures.diagnostics import trace_figure as trace_figure
from pushfit.report.figures.grasp import Ellipses as Ellipses
from pushfit.report.figures.grasp import ellipse_figure as ellipse_figure
from pushfit.report.figures.grasp import grasp_figure as grasp_figure
from pushfit.report.figures.identification import all_figures as all_figures
from pushfit.report.figures.identification import figure_files as figure_files
from pushfit.report.figures.identification import plot as plot
from pushfit.report.figures.main import main_figure as main_figure
from pushfit.report.figures.pairs import corner_figure as corner_figure
from pushfit.report.figures.posterior import learned_figure as learned_figure
from pushfit.report.figures.posterior import quantity_figure as quantity_figure
from pushfit.report.figures.recording import found_figure as found_figure
from pushfit.report.figures.recording import recording_figure as recording_figure
from pushfit.report.figures.recording import signal_figure as signal_figure
from pushfit.report.figures.style import figure_bytes as figure_bytes
from pushfit.report.figures.style import save_figure as save_figure
from pushfit.report.figures.sweeps import Marker as Marker
from pushfit.report.figures.sweeps import Sweep as Sweep
from pushfit.report.figures.sweeps import alpha_figure as alpha_figure
from pushfit.report.figures.sweeps import theta_figure as theta_figure
