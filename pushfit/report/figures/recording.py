"""A recording with its pushes: the paper's Figures 9 and 11, and the check of peaks.

Every number that peak extraction took from the signal is drawn where it was taken, so
that a reader can disagree with it.
"""

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jaxtyping import Float

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.components import looked_at, push_signal, signal_name
from pushfit.data.peaks.extract import find_pushes
from pushfit.data.recordings.recording import Recording
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.traces import Trace, envelope
from pushfit.report.figures.style import (
    ALARM,
    BLACK,
    DATA,
    GREY,
    PAGE,
    axis_label,
    drawable,
    sheet,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# What one row shows legibly, and what fits a page.
PUSHES_PER_ROW = 30
MAX_ROWS = 6
# Two per pixel of a page at 300 dpi; a longer signal is drawn as its envelope.
MAX_POINTS = 4000
# Times beyond this are those of a clock and are counted from the first [s].
MAX_TIME = 1e6


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


def draw_pushes(axes: "Axes", marks: pd.DataFrame) -> None:
    """Draw baseline, height and doubt of some pushes."""
    for mark in marks.to_dict("records"):
        colour = ALARM if mark["flags"] else GREY
        start, end, peak = mark["t_start_s"], mark["t_end_s"], mark["t_peak_s"]
        has_extent = np.isfinite(start) and np.isfinite(end)
        if has_extent:
            axes.axvspan(start, end, color=colour, alpha=0.12, lw=0, zorder=0)
        base, height = mark["baseline"], mark["height"]
        if not np.isfinite(base):
            continue
        ends = (start, end) if has_extent else (peak, peak)
        axes.plot(ends, (base, base), color=BLACK, lw=0.9, zorder=3)
        if np.isfinite(peak) and np.isfinite(height):
            top = base + height
            axes.plot((peak, peak), (base, top), color=colour, lw=0.9, zorder=3)
            shape = "x" if mark["flags"] else "_"
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
                drawable(mark["flags"].replace(";", ", ")),
                (mark["t_peak_s"], 0.98),
                xycoords=("data", "axes fraction"),
                ha="right",
                va="top",
                fontsize=6.5,
                color=ALARM,
                rotation=90,
                bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.6},
            )


@styled
def recording_figure(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    marks: pd.DataFrame,
    *,
    unit: str,
    channel: str,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Signal with every push, its baseline, its height and the doubtful places.

    Args:
        signal: Samples; gaps are NaN.
        marks: The pushes, as `marks_of` gives them.
        fig: Figure or subfigure to draw into; None makes one.
    """
    # Seconds since 1970 would leave no room for themselves.
    origin = float(np.floor(time[0])) if abs(time[0]) > MAX_TIME else 0.0
    time = time - origin
    labels, words = direction_labels(marks)
    marks = marks.assign(label=labels, **(marks[TIMES] - origin))
    marks = marks.sort_values("t_peak_s", kind="stable")
    n_pushes = len(marks)
    n_rows = int(np.clip(-(-n_pushes // PUSHES_PER_ROW), 1, MAX_ROWS))
    figure, room = sheet(fig, width=PAGE, height=0.6 + 1.9 * n_rows)
    panels = np.atleast_1d(room.subplots(n_rows, 1, sharey=True))
    rows = np.array_split(np.arange(n_pushes), n_rows)
    chunks = [marks.iloc[row] for row in rows]
    edges = _row_edges(time, [chunk["t_peak_s"].to_numpy() for chunk in chunks])
    for axes, chunk, (start, end) in zip(panels, chunks, edges, strict=True):
        inside = (time >= start) & (time <= end)
        axes.plot(
            *envelope(time[inside], signal[inside], max_points=MAX_POINTS),
            color=DATA,
            lw=0.8,
            zorder=2,
        )
        draw_pushes(axes, chunk)
        label_pushes(axes, chunk)
        axes.set_ylabel(axis_label(channel, unit))
        axes.margins(x=0.01, y=0.08)
        axes.grid(visible=False, axis="x")
    panels[-1].set_xlabel("time [s]" + (f" after {origin:.0f} s" if origin else ""))
    doubtful = sum(bool(flag) for flag in marks["flags"])
    doubt = f", {doubtful} doubtful" if doubtful else ""
    room.suptitle(
        f"{n_pushes} pushes{doubt}; {words}".rstrip("; "),
        x=0.01,
        ha="left",
        fontsize=9,
    )
    return figure


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
    trace: Trace, table: PeakTable, *, fig: "Figure | SubFigure | None" = None
) -> "Figure":
    """A recording as the table keeps it, with the pushes that were taken from it.

    Args:
        fig: Figure or subfigure to draw into; None makes one.
    """
    rows = range(trace.first_row, trace.first_row + trace.n_rows)
    return recording_figure(
        trace.time,
        trace.signal,
        marks_of(table, rows, sign=trace.sign),
        unit=trace.unit,
        channel=trace.name,
        fig=fig,
    )


def found_figure(
    recording: Recording,
    settings: PeakSettings,
    *,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """A recording with its pushes numbered: what a schedule has to name.

    Args:
        fig: Figure or subfigure to draw into; None makes one.
    """
    extents = find_pushes(recording, settings=settings)
    recording = looked_at(recording, settings)
    marks = pd.DataFrame(
        [(e.t_start, e.t_end, e.t_peak) for e in extents], columns=TIMES
    ).assign(
        push=np.arange(1, len(extents) + 1),
        theta_deg=np.nan,
        alpha_deg=np.nan,
        baseline=np.nan,
        height=np.nan,
        flags="",
    )
    name = signal_name(recording, settings)
    unit = recording.units.get(name, next(iter(recording.units.values())))
    return recording_figure(
        *push_signal(recording, settings), marks, unit=unit, channel=name, fig=fig
    )


def marks_of(table: PeakTable, rows: Sequence[int], *, sign: int = 1) -> pd.DataFrame:
    """Where some pushes of a table were measured.

    Args:
        sign: Of the signal to draw them in, that of its `Trace`.

    Returns:
        One row per push: `push`, `theta_deg`, `alpha_deg`, the times `t_start_s`,
        `t_end_s` and `t_peak_s`, `baseline` and `height` in the unit of the signal, and
        `flags`, words of doubt joined by ";". NaN is unknown.
    """
    frame = table.frame.iloc[list(rows)]
    names = ["theta_deg", "alpha_deg", *TIMES, f"baseline_{table.unit}"]
    numbers = frame.reindex(columns=names).astype(float)
    heights = [
        frame[f"{channel}_{table.unit}"].to_numpy(dtype=float)
        for channel in table.channels
    ]
    baseline = sign * numbers.pop(names[-1])
    is_one = len(heights) == 1
    return numbers.assign(
        push=frame["push"].astype(int),
        # Of components the signal is the length of their change, which rests at zero.
        baseline=baseline if is_one else 0.0,
        height=heights[0] if is_one else np.linalg.norm(heights, axis=0),
        flags=[";".join(sorted(table.flags[row])) for row in rows],
    )
