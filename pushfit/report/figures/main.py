"""The sweeps of one identification and its main figure: height against θ and α.

The same answers that the text gives are marked, with their whole sets. Excluded: the
drawing of sweeps (`pushfit.report.figures.sweeps`).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Int

from pushfit.fit.assess.reporting_rules import Pieces, is_trusted
from pushfit.fit.results import FitStatus, Identification
from pushfit.parameters import HALF_TURN
from pushfit.report.answers import (
    MIN_DIRECTIONS,
    AnswerText,
    alpha_star_answer,
    theta_c_answer,
)
from pushfit.report.figures.style import COLUMN, sheet, styled
from pushfit.report.figures.sweeps import (
    SAME_DEG,
    Marker,
    Sweep,
    alpha_figure,
    draw_panel,
    legend_height,
    theta_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure


# What the first figure shows at a glance: more bands cover each other. The others have
# a figure of their own.
MAX_SWEEPS = 5
# Axes with title and ticks, without the legend below them [inch].
PANEL_HEIGHT = 3.0
# Widths in columns: of panels in a stack, and at least of those side by side, where a
# single one may be as wide as a column and a half. Tick labels take the margin [inch].
STACK_WIDTH, LEAST_WIDTH, TICK_MARGIN = 1.25, 1.5, 0.4
ANSWERS = {"theta": theta_c_answer, "alpha": alpha_star_answer}
OTHER = {"theta": "alpha", "alpha": "theta"}


def sweeps_of(identification: Identification, swept: str, channel: str) -> list[Sweep]:
    """Measured and predicted heights along one angle, one entry per other angle."""
    frame = identification.table.frame
    angle = frame[f"{swept}_deg"].to_numpy(dtype=float)
    other = frame[f"{OTHER[swept]}_deg"].to_numpy(dtype=float).round(3)
    return [
        _sweep(identification, swept, channel=channel, rows=rows)
        for rows in (np.flatnonzero(other == value) for value in np.unique(other))
        if np.unique(angle[rows].round(3)).size >= MIN_DIRECTIONS
    ]


def _sweep(
    identification: Identification,
    swept: str,
    *,
    channel: str,
    rows: Int[np.ndarray, " r"],
) -> Sweep:
    """The pushes of some rows with the prediction that belongs to them."""
    table, frame = identification.table, identification.table.frame
    # What is in a mean is drawn with it, and was not left out.
    flags = table.flags
    rows = np.array([row for row in rows if "averaged" not in flags[row]])
    fixed = float(frame[f"{OTHER[swept]}_deg"].iloc[rows[0]])
    band = next(
        (
            band
            for band in identification.bands
            if (band.swept, band.channel) == (swept, channel)
            and abs(band.fixed_deg - fixed) < SAME_DEG
        ),
        None,
    )
    sd = table.sd(channel)
    has_fit = band is not None and identification.fit.status is FitStatus.OK
    # A band of an unconverged posterior would be an interval in disguise.
    has_band = has_fit and is_trusted(identification)
    return Sweep(
        fixed_deg=fixed,
        angle_deg=frame[f"{swept}_deg"].to_numpy(dtype=float)[rows],
        height=table.heights(channel)[rows],
        sd=np.full(rows.size, np.nan) if sd is None else sd[rows],
        is_used=identification.used[rows],
        grid_deg=band.angle_deg if band and has_fit else np.empty(0),
        best_fit=band.best_fit if band and has_fit else np.empty(0),
        lower=band.lower if band and has_band else np.empty(0),
        upper=band.upper if band and has_band else np.empty(0),
    )


def _richest(sweeps: list[Sweep], fixed_deg: float | None) -> list[Sweep]:
    """The sweeps with most directions, where there are too many for one look.

    The one that the marked angle belongs to is always among them.
    """
    if len(sweeps) <= MAX_SWEEPS:
        return sweeps
    counts = [np.unique(sweep.angle_deg.round(3)).size for sweep in sweeps]
    most = max(counts)
    kept = [s for s, count in zip(sweeps, counts, strict=True) if count == most]
    step = -(-len(kept) // MAX_SWEEPS)
    own = [s for s in sweeps if s.fixed_deg == fixed_deg]
    chosen = kept[::step]
    if own and own[0] not in chosen:
        chosen = [*own, *chosen[: MAX_SWEEPS - 1]]
    return sorted(chosen, key=lambda sweep: sweep.fixed_deg)


def marker_of(answer: AnswerText, identification: Identification) -> Marker:
    """What figures mark of an answer."""
    pieces, fixed_deg = answer.pieces, None
    if answer.name == "theta_c":
        fixed_deg = identification.reference_alpha_deg
    if answer.name == "alpha_star" and identification.config.reach.is_whole:
        pieces = within_half_turn(pieces)
    return Marker(
        name=answer.name,
        estimates=answer.values,
        pieces=pieces,
        text=answer.short,
        fixed_deg=fixed_deg,
    )


def among(marker: Marker, sweeps: Sequence[Sweep]) -> Marker:
    """α*, which a reach may have turned, beside the azimuths that were pushed."""
    if marker.name != "alpha_star" or not marker.estimates:
        return marker
    pushed = np.concatenate([sweep.angle_deg for sweep in sweeps])
    gap = max(np.min(pushed) - max(marker.estimates), 0.0)
    gap += min(np.max(pushed) - min(marker.estimates), 0.0)
    turn = HALF_TURN * round(gap / HALF_TURN)
    return replace(
        marker,
        estimates=tuple(angle + turn for angle in marker.estimates),
        pieces=tuple(
            (low if low is None else low + turn, high if high is None else high + turn)
            for low, high in marker.pieces
        ),
    )


def within_half_turn(pieces: Pieces) -> Pieces:
    """Pieces of an axis [deg] moved into [0, 180], those across the end cut there."""
    cut = []
    for low, high in pieces:
        if low is None or high is None:
            cut.append((low, high))
            continue
        start = low % HALF_TURN
        end = start + high - low
        cut.append((start, min(end, HALF_TURN)))
        if end > HALF_TURN:
            cut.append((0.0, end - HALF_TURN))
    return tuple(cut)


@styled
def main_figure(
    identification: Identification,
    *,
    is_stacked: bool = False,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Heights against both angles with the answers.

    Args:
        identification: What a table told.
        is_stacked: Whether panels stand below each other, for a narrow page.
    """
    answers = {swept: answer(identification) for swept, answer in ANSWERS.items()}
    channels = identification.table.channels
    swept = [s for s in answers if sweeps_of(identification, s, channels[0])]
    swept = swept or ["theta"]
    markers = {s: marker_of(answer, identification) for s, answer in answers.items()}
    panels = {
        (channel, angle): _richest(
            sweeps_of(identification, angle, channel), markers[angle].fixed_deg
        )
        for channel in channels
        for angle in swept
    }
    n_columns = 1 if is_stacked else len(swept)
    n_rows = len(panels) // n_columns
    width = COLUMN * max(LEAST_WIDTH, n_columns) + TICK_MARGIN
    width = STACK_WIDTH * COLUMN if is_stacked else width
    height = PANEL_HEIGHT + max(legend_height(sweeps) for sweeps in panels.values())
    figure, room = sheet(fig, width=width, height=height * n_rows)
    grid = room.subplots(n_rows, n_columns, squeeze=False)
    for axes, ((channel, angle), sweeps) in zip(grid.flat, panels.items(), strict=True):
        draw_panel(
            axes,
            sweeps,
            swept=angle,
            channel=channel,
            unit=identification.table.unit,
            marker=among(markers[angle], sweeps),
            prob=_band_prob(identification),
        )
    return figure


def sweep_makers(identification: Identification) -> dict[str, Callable[..., "Figure"]]:
    """What draws heights against each angle that was swept, by the name of the file."""
    makers, table = {}, identification.table
    draw = {"theta": theta_figure, "alpha": alpha_figure}
    for channel in table.channels:
        for swept, answer in ANSWERS.items():
            sweeps = sweeps_of(identification, swept, channel)
            marker = marker_of(answer(identification), identification)
            if sweeps:
                makers[f"{swept}{channel.removeprefix('height')}"] = partial(
                    draw[swept],
                    sweeps,
                    unit=table.unit,
                    channel=channel,
                    prob=_band_prob(identification),
                    marker=among(marker, sweeps),
                )
    return makers


def _band_prob(identification: Identification) -> float:
    bands = identification.bands
    return bands[0].prob if bands else identification.theta_c.prob
