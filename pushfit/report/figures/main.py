"""The sweeps of one identification and its main figure: height against θ and α.

The same answers that the text gives are marked, with their whole sets.
"""

from typing import TYPE_CHECKING

import numpy as np

from pushfit.fit.quoting import Pieces, is_trusted
from pushfit.fit.results import FitStatus, Identification
from pushfit.report.answers import (
    HALF_TURN,
    Answer,
    alpha_star_answer,
    theta_c_answer,
)
from pushfit.report.figures.style import COLUMN, new_figure, styled
from pushfit.report.figures.sweeps import (
    Marker,
    Sweep,
    alpha_figure,
    draw_panel,
    legend_height,
    theta_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


# Fewer directions than this are no sweep.
MIN_DIRECTIONS = 3
# What the first figure shows at a glance; the others have a figure of their own.
MAX_SWEEPS = 5
OTHER = {"theta": "alpha", "alpha": "theta"}


def sweeps_of(identification: Identification, swept: str, channel: str) -> list[Sweep]:
    """Measured and predicted heights along one angle, one entry per other angle.

    Args:
        identification: The result.
        swept: "theta" or "alpha".
        channel: Height channel.

    Returns:
        Sweeps of at least three directions, by the other angle.
    """
    frame = identification.table.frame
    angle = frame[f"{swept}_deg"].to_numpy(dtype=float)
    other = frame[f"{OTHER[swept]}_deg"].to_numpy(dtype=float).round(3)
    return [
        _sweep(identification, swept, channel=channel, rows=rows)
        for rows in (np.flatnonzero(other == value) for value in np.unique(other))
        if np.unique(angle[rows].round(3)).size >= MIN_DIRECTIONS
    ]


def _sweep(
    identification: Identification, swept: str, *, channel: str, rows: np.ndarray
) -> Sweep:
    """The pushes of some rows with the prediction that belongs to them."""
    table, frame = identification.table, identification.table.frame
    fixed = float(frame[f"{OTHER[swept]}_deg"].iloc[rows[0]])
    band = next(
        (
            band
            for band in identification.bands
            if (band.swept, band.channel) == (swept, channel)
            and abs(band.fixed_deg - fixed) < 1e-2
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


def _richest(sweeps: list[Sweep]) -> list[Sweep]:
    """The sweeps with most directions, where there are too many for one look."""
    if len(sweeps) <= MAX_SWEEPS:
        return sweeps
    counts = [np.unique(sweep.angle_deg.round(3)).size for sweep in sweeps]
    most = max(counts)
    kept = [s for s, count in zip(sweeps, counts, strict=True) if count == most]
    step = -(-len(kept) // MAX_SWEEPS)
    return kept[::step]


def marker_of(answer: Answer) -> Marker:
    """What figures mark of an answer.

    Args:
        answer: θ_c or α*.
    """
    pieces = answer.pieces
    if answer.name == "alpha_star":
        pieces = within_half_turn(pieces)
    return Marker(
        name=answer.name, estimates=answer.values, pieces=pieces, text=answer.short
    )


def within_half_turn(pieces: Pieces) -> Pieces:
    """Pieces of an axis moved into [0, 180], those across the end cut there.

    Args:
        pieces: Pieces that may run beyond 180 [deg].
    """
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
    identification: Identification, *, is_stacked: bool = False
) -> "Figure":
    """Heights against elevation and against azimuth, with both answers marked.

    Args:
        identification: The result.
        is_stacked: Panels below each other, for a narrow page.
    """
    answers = {
        "theta": theta_c_answer(identification),
        "alpha": alpha_star_answer(identification),
    }
    channels = identification.table.channels
    swept = [s for s in answers if sweeps_of(identification, s, channels[0])]
    swept = swept or ["theta"]
    panels = {
        (channel, angle): _richest(sweeps_of(identification, angle, channel))
        for channel in channels
        for angle in swept
    }
    n_columns = 1 if is_stacked else len(swept)
    n_rows = len(panels) // n_columns
    # One panel alone, or a stack, may be as wide as a column and a half.
    width = 1.25 * COLUMN if is_stacked else COLUMN * max(1.5, n_columns) + 0.4
    height = 3.0 + max(legend_height(sweeps) for sweeps in panels.values())
    figure = new_figure(width=width, height=height * n_rows)
    grid = figure.subplots(n_rows, n_columns, squeeze=False)
    for axes, ((channel, angle), sweeps) in zip(grid.flat, panels.items(), strict=True):
        draw_panel(
            axes,
            sweeps,
            swept=angle,
            channel=channel,
            unit=identification.table.unit,
            marker=marker_of(answers[angle]),
            prob=_band_prob(identification),
        )
    return figure


def sweep_figures(identification: Identification) -> dict[str, "Figure"]:
    """Heights against each angle that was swept, one figure per channel.

    Args:
        identification: The result.
    """
    figures, table = {}, identification.table
    options = {"unit": table.unit, "prob": _band_prob(identification)}
    for channel in table.channels:
        suffix = channel.removeprefix("height")
        thetas = sweeps_of(identification, "theta", channel)
        if thetas:
            marker = marker_of(theta_c_answer(identification))
            figures[f"theta{suffix}"] = theta_figure(
                thetas, channel=channel, theta_c=marker, **options
            )
        alphas = sweeps_of(identification, "alpha", channel)
        if alphas:
            marker = marker_of(alpha_star_answer(identification))
            figures[f"alpha{suffix}"] = alpha_figure(
                alphas, channel=channel, alpha_star=marker, **options
            )
    return figures


def _band_prob(identification: Identification) -> float:
    """Probability of the bands."""
    bands = identification.bands
    return bands[0].prob if bands else identification.theta_c.prob
