"""Two results in one figure: for each quantity both intervals on an axis of its own.

Excluded: the subtraction (`pushfit.report.text.difference`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pushfit.report.figures.style import (
    BLUE,
    COLUMN,
    ORANGE,
    drawable,
    new_figure,
    styled,
    symbol_label,
)
from pushfit.report.text.difference import Difference, sentence

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled
def forest_figure(
    differences: Sequence[Difference], *, labels: tuple[str, str]
) -> "Figure":
    """Draw both intervals of each quantity below each other."""
    n = len(differences)
    figure = new_figure(width=2 * COLUMN, height=0.75 * n + 0.6)
    panels = figure.subplots(n, 1, squeeze=False)[:, 0]
    for axes, one in zip(panels, differences, strict=True):
        for row, quantity, colour in ((1, one.first, BLUE), (0, one.second, ORANGE)):
            assert quantity.interval is not None
            axes.plot(quantity.interval, (row, row), color=colour, lw=3, alpha=0.5)
            axes.plot(quantity.estimate, row, "o", color=colour, ms=5)
        name = symbol_label(one.name, one.unit)
        axes.set_ylabel(name, rotation=0, ha="right", va="center", parse_math=True)
        axes.set_yticks([])
        axes.set_ylim(-0.6, 1.6)
        axes.margins(x=0.08)
        axes.tick_params(labelsize=7)
        axes.set_title(sentence(one), fontsize=7.5, fontweight="normal", pad=2)
    handles = [panels[0].lines[index] for index in (0, 2)]
    figure.legend(
        handles,
        [drawable(label) for label in labels],
        loc="outside upper center",
        ncols=2,
    )
    return figure
