"""Measured beside claimed coverage, with what the number of tables can tell."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pushfit.report.figures.style import (
    BLACK,
    COLUMN,
    MARKERS,
    SERIES,
    canvas,
    math_symbol,
    place_legend,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Probability claimed, measured share, and the limits of the measurement.
Point = tuple[float, float, float, float]
# Share of a group's width that its points take.
SPREAD = 0.6


@styled
def coverage_figure(
    points: Mapping[str, Sequence[Point]],
    *,
    n_tables: int,
    ax: "Axes | None" = None,
) -> "Figure":
    """Draw measured coverage with its limits, a group for each claim.

    Args:
        points: For each quantity the claimed probability, the measured share, and the
            lower and upper binomial limit.
        ax: Where to draw; None makes a figure.

    Returns:
        Figure of one column's width.
    """
    rows = -(-len(points) // 4)
    figure, axes = canvas(ax, width=COLUMN, height=COLUMN + 0.25 * rows)
    claims = sorted({row[0] for rows in points.values() for row in rows})
    for place, claim in enumerate(claims):
        axes.plot(
            [place - 0.45, place + 0.45],
            [100 * claim] * 2,
            color=BLACK,
            lw=0.8,
            ls="--",
        )
    for index, (name, rows) in enumerate(points.items()):
        shift = SPREAD * ((index + 0.5) / len(points) - 0.5)
        axes.errorbar(
            [claims.index(row[0]) + shift for row in rows],
            [100 * row[1] for row in rows],
            yerr=[
                [100 * (row[1] - row[2]) for row in rows],
                [100 * (row[3] - row[1]) for row in rows],
            ],
            fmt=MARKERS[index % len(MARKERS)],
            ms=4,
            lw=1,
            color=SERIES[index % len(SERIES)],
            label=math_symbol(name),
        )
    axes.set_xticks(range(len(claims)), [f"{100 * claim:g} %" for claim in claims])
    axes.grid(visible=False, axis="x")
    axes.set_ylim(0, 102)
    axes.set_xlabel("probability claimed")
    axes.set_ylabel("truth inside [%]")
    axes.set_title(f"{n_tables} simulated tables")
    # Below the axes: points may stand anywhere inside.
    place_legend(axes, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=4)
    legend = axes.get_legend()
    for text in legend.get_texts() if legend else ():
        text.set_parse_math(True)
    return figure
