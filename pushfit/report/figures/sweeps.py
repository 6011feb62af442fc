"""Peak height against push elevation and azimuth: the paper's Figures 10 and 8.

Each sweep is drawn as measured pushes, the best fit and the credible band of the
height without noise. The quantity asked for (θ_c, α*) is marked with its whole set.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from pushfit.report.figures.style import (
    ALARM,
    BLACK,
    COLUMN,
    DASHES,
    MARKERS,
    PAGE,
    angle_words,
    channel_label,
    drawable,
    math_symbol,
    new_figure,
    place_legend,
    series_colours,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Pieces = Sequence[tuple[float | None, float | None]]

# Entries of a legend side by side, below the panel, where no push can lie under them.
LEGEND_COLUMNS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Heights along one angle while the other is fixed, measured and predicted.

    Args:
        fixed_deg: The other angle [deg].
        angle_deg: Swept angle of each measured push [deg].
        height: Measured heights.
        sd: Their standard deviations; NaN where unknown.
        is_used: False for pushes that were left out of the fit.
        grid_deg: Swept angle of the predictions [deg]; empty if there are none.
        lower: Lower end of the credible band; empty if there is none.
        upper: Upper end of the credible band; empty if there is none.
        best_fit: Least-squares prediction.
    """

    fixed_deg: float
    angle_deg: Float[np.ndarray, " n"]
    height: Float[np.ndarray, " n"]
    sd: Float[np.ndarray, " n"]
    is_used: Bool[np.ndarray, " n"]
    grid_deg: Float[np.ndarray, " g"]
    lower: Float[np.ndarray, " b"]
    upper: Float[np.ndarray, " b"]
    best_fit: Float[np.ndarray, " g"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Marker:
    """A quantity to mark on the angle axis.

    Args:
        name: Stable name, "theta_c" or "alpha_star".
        estimates: Values to mark by a line [deg]; several for several modes.
        pieces: Set to shade, piece by piece; None for an open end [deg].
        text: The answer in a few words, written above the axes.
    """

    name: str
    estimates: tuple[float, ...] = ()
    pieces: Pieces = ()
    text: str = ""


def draw_sweep(
    axes: "Axes", sweep: Sweep, *, index: int, colour: str, label: str
) -> None:
    """Draw one sweep: pushes, best fit and band.

    Args:
        axes: Cartesian axes with the angle in degrees, or polar in radians.
        sweep: What to draw.
        index: Number of the series; decides marker and dashes.
        colour: Of the series.
        label: Entry of the legend.
    """
    scale = np.radians if axes.name == "polar" else np.asarray
    dashes = DASHES[index % len(DASHES)]
    if sweep.grid_deg.size:
        grid = scale(sweep.grid_deg)
        if sweep.lower.size:
            axes.fill_between(
                grid, sweep.lower, sweep.upper, color=colour, alpha=0.18, lw=0
            )
        axes.plot(grid, sweep.best_fit, color=colour, ls=dashes)
    used = sweep.is_used
    axes.errorbar(
        scale(sweep.angle_deg[used]),
        sweep.height[used],
        yerr=np.nan_to_num(sweep.sd[used]),
        color=colour,
        fmt=MARKERS[index % len(MARKERS)],
        ms=4,
        mfc="white",
        mew=1.1,
        elinewidth=0.8,
        label=label,
        zorder=3,
    )
    if not used.all():
        axes.plot(
            scale(sweep.angle_deg[~used]),
            sweep.height[~used],
            "x",
            color=ALARM,
            ms=6,
            zorder=4,
        )


def draw_marker(axes: "Axes", marker: Marker) -> None:
    """Shade the set of a quantity and mark its value on the angle axis.

    Args:
        axes: Cartesian axes with the angle in degrees along x, limits already set.
        marker: What to mark.
    """
    low, high = axes.get_xlim()
    for start, end in marker.pieces:
        left = low if start is None else max(start, low)
        right = high if end is None else min(end, high)
        if left < right:
            axes.axvspan(left, right, color=BLACK, alpha=0.09, lw=0, zorder=0)
    for value in marker.estimates:
        if low <= value <= high:
            axes.axvline(value, color=BLACK, lw=1.1, ls=(0, (4, 2)), zorder=2)
    axes.set_xlim(low, high)
    if marker.text:
        axes.set_title(
            f"{math_symbol(marker.name)}  {drawable(marker.text)}",
            loc="center",
            fontsize=9,
            fontweight="normal",
            parse_math=True,
        )


def legend_height(sweeps: Sequence[Sweep]) -> float:
    """Room that the legend below a panel takes [inch].

    Args:
        sweeps: Those of the panel.
    """
    return 0.25 + 0.17 * -(-len(sweeps) // LEGEND_COLUMNS)


def draw_panel(
    axes: "Axes",
    sweeps: Sequence[Sweep],
    *,
    swept: str,
    channel: str,
    unit: str,
    marker: Marker | None,
    prob: float,
) -> None:
    """Draw all sweeps of one angle into cartesian axes.

    Args:
        axes: Where to.
        sweeps: One per value of the other angle.
        swept: "theta" or "alpha".
        channel: Height channel.
        unit: Unit of the heights.
        marker: θ_c or α*, if it is to be marked.
        prob: Probability of the bands.
    """
    letter = {"theta": "α", "alpha": "θ"}[swept]
    colours = series_colours(len(sweeps))
    for index, sweep in enumerate(sweeps):
        label = angle_words(letter, sweep.fixed_deg)
        draw_sweep(axes, sweep, index=index, colour=colours[index], label=label)
    # Heights change sign with the elevation where the grasp is preloaded; along the
    # azimuth zero would only flatten the curve.
    if swept == "theta":
        axes.axhline(0, color=BLACK, lw=0.6)
    words = {"theta": "push elevation θ [°]", "alpha": "push azimuth α [°]"}
    axes.set_xlabel(words[swept])
    axes.set_ylabel(channel_label(channel, unit))
    axes.margins(x=0.03, y=0.12)
    axes.locator_params(axis="x", steps=[1, 1.5, 3, 4.5, 6, 9, 10], nbins=8)
    if marker is not None:
        draw_marker(axes, marker)
    title = "pushes"
    if any(sweep.grid_deg.size for sweep in sweeps):
        title += ", fit"
    if any(sweep.lower.size for sweep in sweeps):
        title += f", {100 * prob:g} % band"
    if not all(sweep.is_used.all() for sweep in sweeps):
        title += "; ×: left out"
    place_legend(
        axes,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.17),
        ncols=LEGEND_COLUMNS,
        columnspacing=1.0,
        handletextpad=0.3,
        title=title,
        title_fontsize=8,
    )


@styled
def theta_figure(
    sweeps: Sequence[Sweep],
    *,
    unit: str,
    channel: str = "height",
    prob: float,
    theta_c: Marker | None = None,
) -> "Figure":
    """Peak height against elevation, one series per azimuth.

    Args:
        sweeps: One per azimuth.
        unit: Unit of the heights.
        channel: Height channel.
        prob: Probability of the bands.
        theta_c: Critical angle to mark.
    """
    figure = new_figure(width=1.5 * COLUMN, height=3.4 + legend_height(sweeps))
    draw_panel(
        figure.subplots(),
        sweeps,
        swept="theta",
        channel=channel,
        unit=unit,
        marker=theta_c,
        prob=prob,
    )
    return figure


def draw_polar(axes: "Axes", sweeps: Sequence[Sweep], marker: Marker) -> None:
    """Draw heights as distance from the centre, so that the soft axis is seen as one.

    Args:
        axes: Polar axes.
        sweeps: One per elevation, swept in azimuth.
        marker: α*; its set is shaded on both ends of the axis.
    """
    from matplotlib.ticker import MaxNLocator

    colours = series_colours(len(sweeps))
    for index, sweep in enumerate(sweeps):
        draw_sweep(axes, sweep, index=index, colour=colours[index], label="_")
    top = 1.08 * max(float(np.nanmax(s.height, initial=0.0)) for s in sweeps) or 1.0
    for start, end in marker.pieces:
        ends = np.radians(
            [0.0 if start is None else start, 180.0 if end is None else end]
        )
        for turn in (0.0, np.pi):
            axes.fill_between(ends + turn, 0, top, color=BLACK, alpha=0.09, lw=0)
    for value in np.radians(marker.estimates):
        for turn in (0.0, np.pi):
            axes.plot([value + turn] * 2, [0, top], color=BLACK, lw=1.1, ls=(0, (4, 2)))
    axes.set_ylim(0, top)
    angles = np.concatenate([sweep.angle_deg for sweep in sweeps])
    if angles.min(initial=0.0) >= 0 and angles.max(initial=0.0) <= 180:
        axes.set_xlim(0, np.pi)
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=7)


@styled
def alpha_figure(
    sweeps: Sequence[Sweep],
    *,
    unit: str,
    channel: str = "height",
    prob: float,
    alpha_star: Marker | None = None,
) -> "Figure":
    """Peak height against azimuth, as a curve and around the push frame.

    Args:
        sweeps: One per elevation.
        unit: Unit of the heights.
        channel: Height channel.
        prob: Probability of the bands.
        alpha_star: Best push direction to mark.
    """
    marker = alpha_star or Marker(name="alpha_star")
    figure = new_figure(width=PAGE, height=3.2 + legend_height(sweeps))
    # Apart, so that the legend of the one takes no room from the other.
    grid = figure.add_gridspec(1, 2)
    left, right = figure.add_subfigure(grid[0]), figure.add_subfigure(grid[1])
    draw_panel(
        left.subplots(),
        sweeps,
        swept="alpha",
        channel=channel,
        unit=unit,
        marker=marker,
        prob=prob,
    )
    polar = right.add_subplot(projection="polar")
    draw_polar(polar, sweeps, marker)
    is_signed = any(np.any(sweep.height < 0) for sweep in sweeps)
    # Half a disc is drawn into the middle of the square of a whole one.
    is_half = polar.get_xlim() == (0.0, np.pi)
    polar.set_title(
        f"{'positive ' if is_signed else ''}{channel_label(channel, unit)}, "
        "around the push frame",
        loc="center",
        fontsize=8,
        fontweight="normal",
        y=0.85 if is_half else None,
    )
    return figure
