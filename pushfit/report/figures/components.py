"""What force components show beside their pushes: stretches, jerks, and their legend.

Excluded: the panels and the pushes in them (`pushfit.report.figures.recording`).
"""

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float

from pushfit.data.tables.traces import ComponentTrace
from pushfit.report.figures.style import ALARM, BLACK, GREY, PURPLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# Of the shade over a stretch, twice as dark as that over its push.
SHADE = 0.3
# Widths of the lines of a rest, a top and a jerk [points].
REST, TOP, JERK = 0.9, 1.8, 0.8


def heights_in(
    component: ComponentTrace, marks: pd.DataFrame, *, origin: float
) -> pd.DataFrame:
    """Marks of pushes as they were measured in one component.

    Args:
        marks: As those of the whole, with the position `row` of each in the table.
        origin: Time to count from [s].

    Returns:
        The marks with `baseline` and `height` of the component, and first and last
        time of the stretch that it was measured over, `first_s` and `last_s`.
    """
    heights, row = component.heights, marks["row"].to_numpy()
    return marks.assign(
        first_s=heights.start[row] - origin,
        last_s=heights.end[row] - origin,
        baseline=heights.baseline[row],
        height=heights.height[row],
    )


def left_out_samples(
    signal: Float[np.ndarray, " n"], is_jerk: Bool[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Samples of jerks, joined to those beside them; NaN elsewhere."""
    shown = np.convolve(is_jerk, np.ones(3), mode="same") > 0
    return np.where(shown, signal, np.nan)


def draw_stretches(axes: "Axes", marks: pd.DataFrame) -> None:
    """Draw the height of each push over the stretch that it was measured over."""
    for mark in marks.to_dict("records"):
        shade, colour = (ALARM, ALARM) if mark["flags"] else (GREY, BLACK)
        ends = mark["first_s"], mark["last_s"]
        axes.axvspan(*ends, color=shade, alpha=SHADE, lw=0, zorder=1)
        top = mark["baseline"] + mark["height"]
        axes.plot(
            ends, (top, top), color=colour, lw=TOP, solid_capstyle="butt", zorder=5
        )


def draw_jerks(
    axes: "Axes",
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    *,
    is_jerk: Bool[np.ndarray, " n"],
) -> None:
    """Draw what was left out.

    Jerks ten times the pushes would flatten them, so they set no limits and may leave
    the panel.
    """
    from matplotlib.lines import Line2D

    jerks = left_out_samples(signal, is_jerk)
    axes.add_artist(Line2D(time, jerks, color=PURPLE, lw=JERK, zorder=2))


def explain(room: "Figure | SubFigure", *, has_jerks: bool) -> None:
    """Say below the panels what the marks are."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: dict[str, Line2D | Patch] = {
        "rest level": Line2D([], [], color=BLACK, lw=REST),
        "height": Line2D([], [], color=BLACK, lw=TOP),
        "stretch it was measured over": Patch(color=GREY, alpha=SHADE, lw=0),
    }
    if has_jerks:
        entries["jerk, left out"] = Line2D([], [], color=PURPLE, lw=JERK)
    room.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=len(entries),
    )
