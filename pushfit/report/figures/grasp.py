"""The grasp and its stiffness: what θ, α and the answers mean, and where it is soft.

The grasp is a sketch: proportions are free, angles are true. Azimuths run
counter-clockwise from the x axis, along which the supports stand; elevations run from
the surface into the object.

A stiffness ellipse says how much the contact resists in each tangential direction. It
is the geometric mean K and two numbers (e1, e2) of the symmetric matrix
K expm(½ [[e1, e2], [e2, -e1]]): semi-axes K exp(±|e|/2), the stiff one at the azimuth
½ atan2(e2, e1). Excluded: heights (`pushfit.report.figures.sweeps`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.report.figures.style import (
    BLACK,
    BLUE,
    COLUMN,
    DASHED,
    DATA,
    ESTIMATE,
    GREY,
    PALE,
    PRIOR,
    VERMILLION,
    draw_tip,
    drawable,
    math_symbol,
    sheet,
    styled,
)
from pushfit.report.figures.sweeps import BAND_SHADE, Marker
from pushfit.report.strings import unit_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# Length of the arrows, and where the finger touches, in widths of the object.
REACH = 0.85
# Where the ends of a set are marked, beyond its ray and before its symbol.
RIM = 1.09 * REACH
# Ellipses: enough to show the spread, few enough to see single ones.
N_SHOWN = 60


def _ray(angle_deg: float, length: float, *, down: bool) -> tuple[float, float]:
    angle = np.radians(angle_deg)
    return length * np.cos(angle), (-1 if down else 1) * length * np.sin(angle)


def _arrow(axes: "Axes", end: tuple[float, float], colour: str) -> None:
    axes.annotate(
        "",
        end,
        (0, 0),
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0},
        zorder=5,
    )


def _fan(
    axes: "Axes", marker: Marker, *, limits: tuple[float, float], down: bool
) -> None:
    """The set of an angle as a wedge between two tips, its values as dashed rays."""
    from matplotlib.patches import Arc, Wedge

    for start, end in marker.pieces:
        low = limits[0] if start is None else start
        high = limits[1] if end is None else end
        ends = (-high, -low) if down else (low, high)
        axes.add_patch(
            Wedge((0, 0), REACH, *ends, color=BLUE, alpha=2 * BAND_SHADE, lw=0)
        )
        rim = {"theta1": ends[0], "theta2": ends[1], "capstyle": "butt"}
        axes.add_patch(Arc((0, 0), 2 * RIM, 2 * RIM, color=BLUE, lw=3, **rim))
        for tip, inward in ((start, 90.0), (end, -90.0)):
            if tip is not None:
                toward = (-1 if down else 1) * (tip + inward)
                place = _ray(tip, RIM, down=down)
                draw_tip(axes, *place, toward_deg=toward, colour=BLUE)
    for value in marker.estimates:
        x, y = _ray(value, REACH, down=down)
        axes.plot([0, x], [0, y], color=BLUE, lw=1.2, ls=DASHED)


def _label(axes: "Axes", text: str, angle_deg: float, *, down: bool) -> None:
    """Symbol beyond the end of a ray, clear of the edges of the object."""
    x, y = _ray(angle_deg, 1.3 * REACH, down=down)
    style = {"ha": "center", "va": "center", "fontsize": 9, "color": BLUE}
    axes.text(x, y, text, parse_math=True, **style)


def draw_side(axes: "Axes", marker: Marker, theta_deg: Sequence[float]) -> None:
    """Draw object, supports and finger from the side, with pushes and θ_c."""
    from matplotlib.patches import Arc, Circle, FancyBboxPatch, Wedge

    style = "round,pad=0,rounding_size=0.1"
    axes.add_patch(
        FancyBboxPatch((-1, -1.05), 2, 1.05, boxstyle=style, fc=PALE, ec=GREY, zorder=0)
    )
    axes.add_patch(Circle((0, 0.3), 0.3, fc="white", ec=GREY))
    for x in (-0.67, 0.67):
        axes.add_patch(Wedge((x, -1.35), 0.3, 0, 360, fc="white", ec=GREY))
    for theta in np.unique(np.round(theta_deg, 3)):
        x, y = _ray(theta, REACH, down=True)
        axes.plot([0.9 * x, x], [0.9 * y, y], color=GREY, lw=1)
    _fan(axes, marker, limits=(0.0, 90.0), down=True)
    push = 35.0
    _arrow(axes, _ray(push, REACH, down=True), VERMILLION)
    axes.add_patch(Arc((0, 0), 0.9, 0.9, theta1=-push, theta2=0, color=VERMILLION))
    axes.text(
        *_ray(22.0, 0.58, down=True), "θ", color=VERMILLION, fontsize=11, ha="center"
    )
    axes.plot([0, 0.8], [0, 0], color=BLACK, lw=0.8)
    if marker.estimates:
        _label(axes, math_symbol("theta_c"), marker.estimates[0], down=True)
    words = f"from the side:\nbelow {math_symbol('theta_c')} the object rolls"
    axes.text(0, -1.78, words, ha="center", va="top", parse_math=True)
    for text, place in (("finger", (0, 0.3)), ("supports", (0, -1.35))):
        axes.text(*place, text, ha="center", va="center", fontsize=8, color=GREY)
    axes.text(-0.9, -0.95, "object", fontsize=8, color=GREY)
    axes.set(xlim=(-1.3, 1.3), ylim=(-2.3, 0.75), aspect="equal")


def draw_top(
    axes: "Axes",
    marker: Marker,
    *,
    alpha_deg: Sequence[float],
    reach_deg: tuple[float, float],
) -> None:
    """Draw the surface from above, with azimuths, reach and α*."""
    from matplotlib.patches import Arc, FancyBboxPatch, Wedge

    style = "round,pad=0,rounding_size=0.1"
    axes.add_patch(
        FancyBboxPatch((-1.2, -1), 2.4, 2.2, boxstyle=style, fc=PALE, ec=GREY, zorder=0)
    )
    axes.add_patch(Wedge((0, 0), 0.95 * REACH, *reach_deg, color="white", zorder=1))
    for alpha in np.unique(np.round(alpha_deg, 3)):
        x, y = _ray(alpha, 0.95 * REACH, down=False)
        axes.plot([0, x], [0, y], color=GREY, lw=0.7)
    _fan(axes, marker, limits=reach_deg, down=False)
    push = float(np.clip(30.0, *reach_deg))
    _arrow(axes, _ray(push, REACH, down=False), VERMILLION)
    axes.add_patch(Arc((0, 0), 0.8, 0.8, theta1=0, theta2=push, color=VERMILLION))
    axes.text(0.44, 0.06, "α", color=VERMILLION, fontsize=11)
    axes.plot([0, 1], [0, 0], color=BLACK, lw=0.8)
    axes.text(1.03, -0.05, "x", fontsize=9)
    if marker.estimates:
        _label(axes, math_symbol("alpha_star"), marker.estimates[0], down=False)
    above, along = math_symbol("theta_c"), math_symbol("alpha_star")
    words = f"from above: above {above} it gives\nway most easily along {along}"
    axes.text(0, -1.12, words, ha="center", va="top", parse_math=True)
    axes.text(-1.1, -0.9, "lines: pushed\nsector: within reach", fontsize=8, color=GREY)
    axes.set(xlim=(-1.35, 1.35), ylim=(-1.7, 1.3), aspect="equal")


@styled
def grasp_figure(
    theta_deg: Float[np.ndarray, " n"],
    alpha_deg: Float[np.ndarray, " n"],
    *,
    theta_c: Marker,
    alpha_star: Marker,
    reach_deg: tuple[float, float],
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """The grasp with a push, its two angles and the two answers.

    Args:
        theta_deg: Elevations that were pushed [deg].
        alpha_deg: Azimuths that were pushed [deg].
        theta_c: Critical angle to mark.
        alpha_star: Best push direction to mark.
        reach_deg: Azimuths that the finger can push in [deg].
    """
    figure, room = sheet(fig, width=1.4 * COLUMN, height=0.82 * COLUMN)
    side, top = room.subplots(1, 2)
    draw_side(side, theta_c, list(theta_deg))
    draw_top(top, alpha_star, alpha_deg=list(alpha_deg), reach_deg=reach_deg)
    for axes, marker in ((side, theta_c), (top, alpha_star)):
        axes.set_axis_off()
        axes.set_title(
            replace(marker, fixed_deg=None).title,
            loc="center",
            fontsize=9,
            fontweight="normal",
            color=BLUE,
            parse_math=True,
        )
    return figure


@dataclass(frozen=True, slots=True, kw_only=True)
class Ellipses:
    """Draws of one stiffness ellipse.

    Args:
        title: Words above the panel.
        mean: Geometric mean stiffness K of each draw [unit].
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
    """Closed outline of a stiffness ellipse: x and y in the unit of `mean`.

    Args:
        mean: Geometric mean of the semi-axes.
        e1: First shape number [-].
        e2: Second shape number [-].
        n_points: Points on the outline, the first one repeated at the end.
    """
    stretch, azimuth = np.exp(np.hypot(e1, e2) / 2), np.arctan2(e2, e1) / 2
    turn = np.linspace(0, 2 * np.pi, n_points)
    along, across = mean * stretch * np.cos(turn), mean / stretch * np.sin(turn)
    cos, sin = np.cos(azimuth), np.sin(azimuth)
    return np.stack([cos * along - sin * across, sin * along + cos * across])


def draw_ellipses(
    axes: "Axes", ellipses: Ellipses, *, unit: str, alpha_star: Marker | None
) -> None:
    """Draw some draws, the median ellipse and the soft axis."""
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
        axes.plot(ends * np.cos(value), ends * np.sin(value), **ESTIMATE)
    axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
    label = drawable(unit_label(unit))
    axes.set_xlabel(f"x, along the supports [{label}]")
    axes.set_ylabel(f"y, across them [{label}]")
    axes.locator_params(nbins=5)
    axes.set_title(drawable(ellipses.title), fontsize=9)


@styled
def ellipse_figure(
    ellipses: list[Ellipses],
    *,
    unit: str,
    alpha_star: Marker | None = None,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Stiffness ellipses side by side, with the best push direction.

    Args:
        ellipses: One per panel.
        unit: Unit of their means.
        alpha_star: Direction to mark; None for no mark.
    """
    from matplotlib.lines import Line2D

    figure, room = sheet(fig, width=COLUMN * len(ellipses), height=COLUMN + 0.5)
    panels = np.atleast_1d(room.subplots(1, len(ellipses)))
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
        entries[words] = Line2D([], [], **ESTIMATE)
    legend = room.legend(
        list(entries.values()),
        list(entries),
        loc="outside lower center",
        ncols=2 if len(ellipses) == 1 else len(entries),
    )
    for text in legend.get_texts():
        text.set_parse_math(True)
    return figure
