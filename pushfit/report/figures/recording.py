"""A recording with its pushes: the paper's Figures 9 and 11, and the check of peaks.

Every number that peak extraction took from the signal is drawn where it was taken, so
that a reader can disagree with it. Force components have a panel each, below that of
the length of their change. Excluded: what else components show
(`pushfit.report.figures.components`).
"""

import itertools
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from pushfit.data.peaks.extract import Heights
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.rules import CHANNELS
from pushfit.data.tables.traces import ComponentTrace, Trace, envelope
from pushfit.errors import counted
from pushfit.report.figures import style
from pushfit.report.figures.components import (
    draw_jerks,
    draw_stretches,
    explain,
    heights_in,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# What one row shows legibly, and what fits a page.
PUSHES_PER_ROW = 30
MAX_ROWS, MAX_PANELS = 6, 12
# Two per pixel of a page at 300 dpi; a longer signal is drawn as its envelope.
MAX_POINTS = 4000
# Times beyond this are those of a clock and are counted from the first [s].
MAX_TIME = 1e6
# Heights of a signal and of the legend [inch], and of a component as a share of the
# signal; letters of its label that fit.
ROW, LEGEND, COMPONENT, LETTERS = 1.9, 0.3, 0.63, 17

TIMES = ["t_start_s", "t_end_s", "t_peak_s"]


def direction_labels(marks: pd.DataFrame) -> tuple[list[str], str]:
    """Shortest label of each push, and what the labels mean.

    An angle that never changes is left out.
    """
    angles = {"θ": marks["theta_deg"], "α": marks["alpha_deg"]}
    if bool(angles["θ"].isna().any()):
        words = "labels: number of the push, whose direction is unknown"
        return [str(number) for number in marks["push"]], words
    varied = [name for name, angle in angles.items() if len(set(angle)) > 1] or ["θ"]
    rows = zip(*(angles[name] for name in varied), strict=True)
    labels = ["\n".join(f"{round(angle, 1):g}°" for angle in row) for row in rows]
    if not labels:
        return [], ""
    if len(varied) == 2:
        return labels, "labels: θ above α"
    (other,) = angles.keys() - varied
    return labels, f"labels: {varied[0]} at {other} = {angles[other].iloc[0]:g}°"


def draw_pushes(axes: "Axes", marks: pd.DataFrame, *, tip: str = "_") -> None:
    """Draw baseline, height and doubt of some pushes.

    Args:
        tip: Marker of heights that are in no doubt.
    """
    for mark in marks.to_dict("records"):
        colour = style.ALARM if mark["flags"] else style.GREY
        start, end, peak = mark["t_start_s"], mark["t_end_s"], mark["t_peak_s"]
        has_extent = np.isfinite(start) and np.isfinite(end)
        if has_extent:
            axes.axvspan(start, end, color=colour, alpha=0.12, lw=0, zorder=0)
        base, height = mark["baseline"], mark["height"]
        if not np.isfinite(base):
            continue
        ends = (start, end) if has_extent else (peak, peak)
        axes.plot(ends, (base, base), color=style.BLACK, lw=0.9, zorder=3)
        if np.isfinite(peak) and np.isfinite(height):
            top = base + height
            axes.plot((peak, peak), (base, top), color=colour, lw=0.9, zorder=3)
            shape = "x" if mark["flags"] else tip
            axes.plot(peak, top, shape, color=colour, ms=6, zorder=4)


def label_pushes(axes: "Axes", marks: pd.DataFrame) -> None:
    """Write directions above pushes in order, once for repeats, and the doubts."""
    repeats = (marks["label"] != marks["label"].shift()).cumsum()
    groups = [group for _, group in marks.groupby(repeats)]
    for group in groups:
        centre = float(np.nanmean(group["t_peak_s"]))
        if np.isfinite(centre):
            axes.annotate(
                group["label"].iloc[0],
                (centre, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 2),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=7,
                rotation=90 if len(groups) > 14 else 0,
            )
    for mark in marks.to_dict("records"):
        if mark["flags"] and np.isfinite(mark["t_peak_s"]):
            axes.annotate(
                style.drawable(mark["flags"].replace(";", ", ")),
                (mark["t_peak_s"], 0.98),
                xycoords=("data", "axes fraction"),
                ha="right",
                va="top",
                fontsize=6.5,
                color=style.ALARM,
                rotation=90,
                bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.6},
            )


@style.styled
def recording_figure(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    marks: pd.DataFrame,
    *,
    unit: str,
    channel: str,
    components: Sequence[ComponentTrace] = (),
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Signal with every push, its baseline, its height and the doubtful places.

    Args:
        time: Sample times [s].
        signal: Samples; gaps are NaN.
        marks: The pushes, as `marks_of` gives them.
        unit: Unit of the signal.
        channel: What the signal is, for the axis.
        components: Force components to draw below, with heights of the same pushes.
    """
    # Seconds since 1970 would leave no room for themselves.
    origin = float(np.floor(time[0])) if abs(time[0]) > MAX_TIME else 0.0
    labels, words = direction_labels(marks)
    times = marks[TIMES] - origin
    marks = marks.assign(label=labels, row=np.arange(len(marks)), **times)
    marks = marks.sort_values("t_peak_s", kind="stable")
    no_jerk = np.zeros(len(time), dtype=bool)
    panels = [(channel, (time - origin, signal, no_jerk), marks)]
    for own in components:
        samples = (own.time - origin, own.signal, own.is_jerk)
        panels.append((own.name, samples, heights_in(own, marks, origin=origin)))
    n_pushes = len(marks)
    most = min(MAX_ROWS, max(1, MAX_PANELS // len(panels)))
    n_rows = int(np.clip(-(-n_pushes // PUSHES_PER_ROW), 1, most))
    figure, room, grid = _grid(fig, n_rows, len(panels))
    rows = np.array_split(np.arange(n_pushes), n_rows)
    edges = _row_edges(time - origin, [marks["t_peak_s"].to_numpy()[r] for r in rows])
    for across, row, edge in zip(grid, rows, edges, strict=True):
        for axes, (name, samples, own_marks) in zip(across, panels, strict=True):
            _draw_panel(axes, *samples, marks=own_marks.iloc[row], edge=edge)
            label = style.axis_label(name, unit)
            axes.set_ylabel(label if axes is across[0] else fill(label, LETTERS))
        label_pushes(across[0], marks.iloc[row])
    last = grid[-1, -1]
    last.set_xlabel("time [s]" + (f" after {origin:.0f} s" if origin else ""))
    if components:
        room.align_ylabels()
        explain(room, has_jerks=any(c.is_jerk.any() for c in components))
    doubtful = sum(bool(flag) for flag in marks["flags"])
    doubt = f", {doubtful} doubtful" if doubtful else ""
    room.suptitle(
        f"{counted(n_pushes, 'push')}{doubt}; {words}".rstrip("; "),
        x=0.01,
        ha="left",
        fontsize=9,
    )
    return figure


def _draw_panel(
    axes: "Axes",
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    is_jerk: Bool[np.ndarray, " n"],
    *,
    marks: pd.DataFrame,
    edge: tuple[float, float],
) -> None:
    """Draw pushes as they were measured in a signal, and it between two times [s]."""
    inside = (time >= edge[0]) & (time <= edge[1])
    jerks = time[is_jerk]
    time, signal = envelope(time[inside], signal[inside], max_points=MAX_POINTS)
    is_jerk = np.isin(time, jerks)
    kept = np.where(is_jerk, np.nan, signal)
    axes.plot(time, kept, color=style.DATA, lw=0.8, zorder=2)
    if is_jerk.any():
        draw_jerks(axes, time, signal, is_jerk=is_jerk)
    has_stretches = "first_s" in marks
    draw_pushes(axes, marks, tip="" if has_stretches else "_")
    if has_stretches:
        draw_stretches(axes, marks)
    axes.margins(x=0.01, y=0.08)
    axes.grid(visible=False, axis="x")


def _grid(
    fig: "Figure | SubFigure | None", n_rows: int, n_panels: int
) -> "tuple[Figure, Figure | SubFigure, np.ndarray]":
    """Panels below each other: of one row with one time, of one signal with one scale.

    Returns:
        The figure, the room that the panels take in it, and the panels by row.
    """
    n_components = n_panels - 1
    ratios = [1.0, *[COMPONENT] * n_components] * n_rows
    height = 0.6 + ROW * sum(ratios) + (LEGEND if n_components else 0.0)
    figure, room = style.sheet(fig, width=style.PAGE, height=height)
    grid = room.subplots(len(ratios), 1, squeeze=False, height_ratios=ratios)
    grid = grid.reshape(n_rows, n_panels)
    for across in grid:
        for axes, first in zip(across, grid[0], strict=True):
            if axes is not first:
                axes.sharey(first)
            if axes is not across[0]:
                axes.sharex(across[0])
            axes.tick_params(labelbottom=axes is across[-1])
    return figure, room, grid


def _row_edges(
    time: Float[np.ndarray, " n"], peaks: Sequence[Float[np.ndarray, " _"]]
) -> list[tuple[float, float]]:
    """Stretch of time for each row, cut halfway between its pushes and the next."""
    cuts = [float(time[0])]
    for before, after in itertools.pairwise(peaks):
        cuts.append(float((np.nanmax(before) + np.nanmin(after)) / 2))
    cuts.append(float(time[-1]))
    return list(itertools.pairwise(cuts))


def signal_figure(
    trace: Trace, table: PeakTable | Heights, *, fig: "Figure | SubFigure | None" = None
) -> "Figure":
    """A recording as the table keeps it, with the pushes that were taken from it.

    Args:
        trace: What the heights were measured in.
        table: The heights, with directions or without.
    """
    rows = slice(trace.first_row, trace.first_row + trace.n_rows)
    return recording_figure(
        trace.time,
        trace.signal,
        marks_of(table.frame.iloc[rows], unit=trace.unit, sign=trace.sign),
        unit=trace.unit,
        channel=trace.name,
        components=trace.components,
        fig=fig,
    )


def found_figure(
    found: Heights, *, fig: "Figure | SubFigure | None" = None
) -> "Figure":
    """A recording with its pushes numbered: what a schedule has to name.

    Args:
        found: Heights of pushes whose directions are not known.
    """
    return signal_figure(found.trace, found, fig=fig)


def marks_of(frame: pd.DataFrame, *, unit: str, sign: int = 1) -> pd.DataFrame:
    """Where pushes were measured.

    Args:
        frame: Rows of a table of peak heights.
        unit: Unit of the heights.
        sign: Of the signal to draw them in, that of its `Trace`.

    Returns:
        One row per push: `push`, `theta_deg`, `alpha_deg`, the times `t_start_s`,
        `t_end_s` and `t_peak_s`, `baseline` and `height` in the unit of the signal, and
        `flags`, words of doubt joined by ";". NaN is unknown.
    """
    names = ["theta_deg", "alpha_deg", *TIMES, f"baseline_{unit}"]
    numbers = frame.reindex(columns=names).astype(float)
    columns = [f"{channel}_{unit}" for channel in CHANNELS]
    heights = frame[[name for name in columns if name in frame]].to_numpy(dtype=float)
    baseline = sign * numbers.pop(names[-1])
    is_one = heights.shape[1] == 1
    return numbers.assign(
        push=frame["push"].astype(int),
        # Of components the signal is the length of their change, which rests at zero.
        baseline=baseline if is_one else 0.0,
        height=heights[:, 0] if is_one else np.linalg.norm(heights, axis=1),
        flags=frame["flags"],
    )
