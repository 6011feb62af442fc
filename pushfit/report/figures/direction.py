"""The stiffness ellipse: how much the contact resists in each tangential direction.

An ellipse is the geometric mean K and two numbers (e1, e2) of the symmetric matrix
K expm(½ [[e1, e2], [e2, -e1]]): semi-axes K exp(±|e|/2), the stiff one at the azimuth
½ atan2(e2, e1).
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.report.figures.style import (
    BLACK,
    COLUMN,
    DATA,
    PRIOR,
    drawable,
    math_symbol,
    new_figure,
    styled,
)
from pushfit.report.figures.sweeps import Marker
from pushfit.report.strings import unit_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Enough to show the spread, few enough to see single ellipses.
N_SHOWN = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipses:
    """Draws of one stiffness ellipse.

    Args:
        title: What the ellipse is.
        mean: Geometric mean stiffness K of each draw.
        e1: First shape number of each draw [-].
        e2: Second shape number of each draw [-].
        is_informed: Whether the data fix it; a prior is drawn in grey.
    """

    title: str
    mean: Float[np.ndarray, " n"]
    e1: Float[np.ndarray, " n"]
    e2: Float[np.ndarray, " n"]
    is_informed: bool


def ellipse_points(
    mean: float, e1: float, e2: float, *, n_points: int = 91
) -> Float[np.ndarray, "2 k"]:
    """Closed outline of a stiffness ellipse.

    Args:
        mean: Geometric mean of the semi-axes.
        e1: First shape number [-].
        e2: Second shape number [-].
        n_points: Points on the outline, the first one repeated at the end.

    Returns:
        x and y in the unit of `mean`.
    """
    stretch, azimuth = np.exp(np.hypot(e1, e2) / 2), np.arctan2(e2, e1) / 2
    turn = np.linspace(0, 2 * np.pi, n_points)
    along, across = mean * stretch * np.cos(turn), mean / stretch * np.sin(turn)
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    return np.stack([cos * along - sin * across, sin * along + cos * across])


def draw_ellipses(
    axes: "Axes", ellipses: Ellipses, *, unit: str, alpha_star: Marker | None
) -> None:
    """Draw some draws, the median ellipse and the soft axis.

    Args:
        unit: Unit of the stiffness.
    """
    colour = DATA if ellipses.is_informed else PRIOR
    step = max(1, ellipses.mean.size // N_SHOWN)
    for mean, e1, e2 in zip(
        ellipses.mean[::step], ellipses.e1[::step], ellipses.e2[::step], strict=True
    ):
        axes.plot(*ellipse_points(mean, e1, e2), color=colour, alpha=0.08, lw=0.8)
    middle = [float(np.median(v)) for v in (ellipses.mean, ellipses.e1, ellipses.e2)]
    outline = ellipse_points(*middle)
    axes.plot(*outline, color=colour, lw=1.8)
    # One wide draw must not shrink the rest to a dot.
    reach = 1.6 * float(np.max(np.abs(outline)))
    for value in np.radians(alpha_star.estimates if alpha_star else ()):
        ends = reach * np.array([-1.0, 1.0])
        axes.plot(
            ends * np.cos(value),
            ends * np.sin(value),
            color=BLACK,
            lw=1.1,
            ls=(0, (4, 2)),
        )
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    label = drawable(unit_label(unit))
    axes.set_xlabel(f"x, along the supports [{label}]")
    axes.set_ylabel(f"y, across them [{label}]")
    axes.locator_params(nbins=5)
    axes.set_title(drawable(ellipses.title), fontsize=9)


@styled
def ellipse_figure(
    ellipses: list[Ellipses], *, unit: str, alpha_star: Marker | None = None
) -> "Figure":
    """Stiffness ellipses side by side, with the best push direction.

    Args:
        ellipses: One panel each.
        unit: Unit of the stiffness.
    """
    from matplotlib.lines import Line2D

    figure = new_figure(width=COLUMN * len(ellipses), height=COLUMN + 0.5)
    panels = np.atleast_1d(figure.subplots(1, len(ellipses)))
    for axes, one in zip(panels, ellipses, strict=True):
        draw_ellipses(axes, one, unit=unit, alpha_star=alpha_star)
    entries = {
        "median of the posterior": Line2D([], [], color=DATA, lw=1.8),
        "draws": Line2D([], [], color=DATA, lw=0.8, alpha=0.4),
    }
    if any(not one.is_informed for one in ellipses):
        entries["not learned from these data"] = Line2D([], [], color=PRIOR, lw=1.8)
    if alpha_star is not None and alpha_star.estimates:
        words = f"{math_symbol('alpha_star')} {drawable(alpha_star.text)}"
        entries[words] = Line2D([], [], color=BLACK, lw=1.1, ls=(0, (4, 2)))
    legend = figure.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=2 if len(ellipses) == 1 else len(entries),
    )
    for text in legend.get_texts():
        text.set_parse_math(True)
    return figure
