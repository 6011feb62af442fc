"""A recording with its pushes: the paper's Figures 9 and 11, and the check of peaks.

Every number that peak extraction took from the signal is drawn where it was taken, so
that a reader can disagree with it.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

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
    new_figure,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# What one row shows legibly, and what fits a page.
PUSHES_PER_ROW = 30
MAX_ROWS = 6
# Two per pixel of a page at 300 dpi; a longer signal is drawn as its envelope.
MAX_POINTS = 4000
# Times beyond this are those of a clock and are counted from the first [s].
MAX_TIME = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class PushMarks:
    """Where and how each push was measured; NaN is unknown.

    Args:
        push: Number of the push.
        theta_deg: Elevation [deg].
        alpha_deg: Azimuth [deg].
        t_start: First sample of the push [s].
        t_end: Last sample of the push [s].
        t_peak: Where the height was taken [s].
        baseline: Level before the push [unit of the signal].
        height: Height above it [unit of the signal].
        flags: Words of doubt for each push; empty for none.
    """

    push: Int[np.ndarray, " p"]
    theta_deg: Float[np.ndarray, " p"]
    alpha_deg: Float[np.ndarray, " p"]
    t_start: Float[np.ndarray, " p"]
    t_end: Float[np.ndarray, " p"]
    t_peak: Float[np.ndarray, " p"]
    baseline: Float[np.ndarray, " p"]
    height: Float[np.ndarray, " p"]
    flags: tuple[str, ...]


def direction_labels(
    theta_deg: Float[np.ndarray, " p"], alpha_deg: Float[np.ndarray, " p"]
) -> list[str]:
    """Shortest label of each direction: an angle that never changes is left out.

    Args:
        theta_deg: Elevations [deg].
        alpha_deg: Azimuths [deg].
    """
    vary_theta = np.unique(theta_deg).size > 1
    vary_alpha = np.unique(alpha_deg).size > 1
    labels = []
    for theta, alpha in zip(theta_deg, alpha_deg, strict=True):
        parts = [f"{round(theta, 1):g}°"] if vary_theta or not vary_alpha else []
        parts += [f"{round(alpha, 1):g}°"] if vary_alpha else []
        labels.append("\n".join(parts))
    return labels


def label_words(
    theta_deg: Float[np.ndarray, " p"], alpha_deg: Float[np.ndarray, " p"]
) -> str:
    """What the labels of `direction_labels` mean, for the title.

    Args:
        theta_deg: Elevations [deg].
        alpha_deg: Azimuths [deg].
    """
    if theta_deg.size == 0:
        return ""
    if not np.isfinite(theta_deg).all():
        return "labels: number of the push, whose direction is unknown"
    vary_theta = np.unique(theta_deg).size > 1
    vary_alpha = np.unique(alpha_deg).size > 1
    if vary_theta and vary_alpha:
        return "labels: θ above α"
    if vary_alpha:
        return f"labels: α at θ = {theta_deg[0]:g}°"
    return f"labels: θ at α = {alpha_deg[0]:g}°"


def draw_pushes(axes: "Axes", marks: PushMarks, rows: Sequence[int]) -> None:
    """Draw baseline, height and doubt of some pushes.

    Args:
        axes: Axes with time in seconds along x.
    """
    for row in rows:
        is_doubtful = bool(marks.flags[row])
        colour = ALARM if is_doubtful else GREY
        start, end, peak = marks.t_start[row], marks.t_end[row], marks.t_peak[row]
        if np.isfinite(start) and np.isfinite(end):
            axes.axvspan(start, end, color=colour, alpha=0.12, lw=0, zorder=0)
        base, height = marks.baseline[row], marks.height[row]
        if not np.isfinite(base):
            continue
        ends = (start, end) if np.isfinite(start) and np.isfinite(end) else (peak, peak)
        axes.plot(ends, (base, base), color=BLACK, lw=0.9, zorder=3)
        if np.isfinite(peak) and np.isfinite(height):
            axes.plot(
                (peak, peak), (base, base + height), color=colour, lw=0.9, zorder=3
            )
            axes.plot(
                peak,
                base + height,
                "x" if is_doubtful else "_",
                color=colour,
                ms=6,
                zorder=4,
            )


def label_pushes(axes: "Axes", marks: PushMarks, rows: Sequence[int]) -> None:
    """Write directions above the pushes, once for consecutive repeats, and the doubts.

    Args:
        axes: Axes with time in seconds along x.
        rows: Which to label, in the order of time.
    """
    labels = [str(number) for number in marks.push]
    if np.isfinite(marks.theta_deg).all():
        labels = direction_labels(marks.theta_deg, marks.alpha_deg)
    groups: list[list[int]] = []
    for row in rows:
        if groups and labels[groups[-1][-1]] == labels[row]:
            groups[-1].append(row)
        else:
            groups.append([row])
    rotation = 90 if len(groups) > 14 else 0
    for group in groups:
        centre = float(np.nanmean(marks.t_peak[group])) if len(group) else np.nan
        if np.isfinite(centre):
            axes.annotate(
                labels[group[0]],
                (centre, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 2),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=7,
                rotation=rotation,
            )
    for row in rows:
        if marks.flags[row] and np.isfinite(marks.t_peak[row]):
            axes.annotate(
                drawable(marks.flags[row].replace(";", ", ")),
                (marks.t_peak[row], 0.98),
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
    marks: PushMarks,
    *,
    unit: str,
    channel: str,
) -> "Figure":
    """Signal with every push, its baseline, its height and the doubtful places.

    Args:
        time: Sample times [s].
        signal: Samples; gaps are NaN.
        marks: The pushes, in the order of time.
    """
    # Seconds since 1970 would leave no room for themselves.
    origin = float(np.floor(time[0])) if abs(time[0]) > MAX_TIME else 0.0
    time, marks = time - origin, _shifted(marks, origin)
    n_pushes = marks.push.size
    n_rows = int(np.clip(-(-n_pushes // PUSHES_PER_ROW), 1, MAX_ROWS))
    figure = new_figure(width=PAGE, height=0.6 + 1.9 * n_rows)
    panels = np.atleast_1d(figure.subplots(n_rows, 1, sharey=True))
    order = np.argsort(np.nan_to_num(marks.t_peak, nan=np.inf), kind="stable")
    chunks = np.array_split(order, n_rows)
    edges = _row_edges(time, [marks.t_peak[chunk] for chunk in chunks])
    for axes, chunk, (start, end) in zip(panels, chunks, edges, strict=True):
        inside = (time >= start) & (time <= end)
        axes.plot(
            *envelope(time[inside], signal[inside], max_points=MAX_POINTS),
            color=DATA,
            lw=0.8,
            zorder=2,
        )
        rows = [int(row) for row in chunk]
        draw_pushes(axes, marks, rows)
        label_pushes(axes, marks, rows)
        axes.set_ylabel(axis_label(channel, unit))
        axes.margins(x=0.01, y=0.08)
        axes.grid(visible=False, axis="x")
    panels[-1].set_xlabel("time [s]" + (f" after {origin:.0f} s" if origin else ""))
    words = label_words(marks.theta_deg, marks.alpha_deg)
    doubtful = sum(bool(flag) for flag in marks.flags)
    doubt = f", {doubtful} doubtful" if doubtful else ""
    figure.suptitle(
        f"{n_pushes} pushes{doubt}; {words}".rstrip("; "),
        x=0.01,
        ha="left",
        fontsize=9,
    )
    return figure


def _shifted(marks: PushMarks, origin: float) -> PushMarks:
    """Marks on a clock that starts later."""
    return replace(
        marks,
        t_start=marks.t_start - origin,
        t_end=marks.t_end - origin,
        t_peak=marks.t_peak - origin,
    )


def _row_edges(
    time: Float[np.ndarray, " n"], peaks: Sequence[Float[np.ndarray, " _"]]
) -> list[tuple[float, float]]:
    """Stretch of time for each row, cut halfway between its pushes and the next."""
    cuts = [float(time[0])]
    for before, after in itertools.pairwise(peaks):
        cuts.append(float((np.nanmax(before) + np.nanmin(after)) / 2))
    cuts.append(float(time[-1]))
    return list(itertools.pairwise(cuts))


def signal_figure(trace: Trace, table: PeakTable) -> "Figure":
    """A recording as the table keeps it, with the pushes that were taken from it."""
    rows = range(trace.first_row, trace.first_row + trace.n_rows)
    return recording_figure(
        trace.time,
        trace.signal,
        marks_of(table, rows, sign=trace.sign),
        unit=trace.unit,
        channel=trace.name,
    )


def found_figure(recording: Recording, settings: PeakSettings) -> "Figure":
    """A recording with its pushes numbered: what a schedule has to name."""
    extents = find_pushes(recording, settings=settings)
    recording = looked_at(recording, settings)
    numbers = np.arange(1, len(extents) + 1)
    unknown = np.full(numbers.size, np.nan)
    marks = PushMarks(
        push=numbers,
        theta_deg=unknown,
        alpha_deg=unknown,
        t_start=np.array([extent.t_start for extent in extents]),
        t_end=np.array([extent.t_end for extent in extents]),
        t_peak=np.array([extent.t_peak for extent in extents]),
        baseline=unknown,
        height=unknown,
        flags=("",) * numbers.size,
    )
    name = signal_name(recording, settings)
    unit = recording.units.get(name, next(iter(recording.units.values())))
    return recording_figure(
        *push_signal(recording, settings), marks, unit=unit, channel=name
    )


def marks_of(table: PeakTable, rows: Sequence[int], *, sign: int = 1) -> PushMarks:
    """Where some pushes of a table were measured.

    Args:
        table: Peaks, with their times where these are known.
        rows: Which of them.
        sign: Of the signal to draw them in, that of its `Trace`.
    """
    frame = table.frame.iloc[list(rows)]
    unknown = np.full(len(frame), np.nan)

    def column(name: str) -> Float[np.ndarray, " p"]:
        return frame[name].to_numpy(dtype=float) if name in frame else unknown

    heights = [column(f"{channel}_{table.unit}") for channel in table.channels]
    baseline = sign * column(f"baseline_{table.unit}")
    if len(heights) > 1:
        # Of components the signal is the length of their change, which rests at zero.
        baseline = np.zeros(len(frame))
    return PushMarks(
        push=frame["push"].to_numpy(dtype=int),
        theta_deg=column("theta_deg"),
        alpha_deg=column("alpha_deg"),
        t_start=column("t_start_s"),
        t_end=column("t_end_s"),
        t_peak=column("t_peak_s"),
        baseline=baseline,
        height=heights[0] if len(heights) == 1 else np.linalg.norm(heights, axis=0),
        flags=tuple(";".join(sorted(table.flags[row])) for row in rows),
    )
