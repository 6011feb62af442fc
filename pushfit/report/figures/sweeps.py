"""Peak height against push elevation and azimuth: the paper's Figures 10 and 8.

Each sweep is drawn as measured pushes, the best fit and the credible band of the
height without noise. The quantity asked for (θ_c, α*) is marked with its whole set.
Excluded: which sweeps are drawn (`pushfit.report.figures.main`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from pushfit.fit.assess.reporting_rules import Pieces
from pushfit.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# Entries of a legend side by side, below the panel, where no push can lie under them.
LEGEND_COLUMNS = 4
# Opacity of a set that is a hundredth of the axis wide, and must still be seen.
BAND_SHADE = 0.16
# Opacity of a band: two that cross are still told apart from one. And of a set in polar
# axes, where it is drawn on both ends of the axis.
BAND, POLAR_SHADE = 0.18, 0.09
# A legend below a panel: its frame, and each of its rows [inch].
LEGEND_FRAME, LEGEND_ROW = 0.25, 0.17
# Height of a figure without its legend, alone and beside polar axes [inch].
ALONE, BESIDE = 3.4, 3.2
# Points of a curve or an arc along a set: no corner is seen.
N_CURVE = 60
# Where people push, and as many ticks as have room in a column.
TICKS = {"theta": (15, 30, 45, 90), "alpha": (30, 60, 90)}
MAX_TICKS = 10
# Room beside what is drawn, as a share of the axis.
MARGIN = 0.03
# No curve goes on beyond its ends.
BEYOND = {"left": np.nan, "right": np.nan}
# Angles that differ by less are one [deg].
SAME_DEG = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Heights along one angle while the other is fixed, measured and predicted.

    Args:
        fixed_deg: The other angle [deg].
        angle_deg: Swept angle of each measured push [deg].
        height: Their heights [table unit].
        sd: Standard deviations of them; NaN where unknown [table unit].
        is_used: False for pushes that were left out of the fit.
        grid_deg: Swept angle of the predictions [deg]; empty if there are none.
        lower: Lower end of the credible band; empty if there is none [table unit].
        upper: Upper end of the credible band; empty if there is none [table unit].
        best_fit: Least-squares predictions [table unit].
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
        fixed_deg: The other angle, where the quantity belongs to one curve [deg].
    """

    name: str
    estimates: tuple[float, ...] = ()
    pieces: Pieces = ()
    text: str = ""
    fixed_deg: float | None = None

    @property
    def marked(self) -> list[float]:
        """Values, and ends of the set but for open ones [deg]."""
        return [*self.estimates, *(e for p in self.pieces for e in p if e is not None)]

    @property
    def title(self) -> str:
        """Symbol, azimuth and text, as mathtext."""
        alpha = self.fixed_deg
        where = "" if alpha is None else style.angle_words(" at α", alpha)
        return f"{style.math_symbol(self.name)}{where}:  {style.drawable(self.text)}"


def draw_sweep(
    axes: "Axes", sweep: Sweep, *, index: int, colour: str, label: str
) -> None:
    """Draw one sweep: pushes, best fit and band.

    Args:
        axes: Cartesian axes with the angle in degrees, or polar in radians.
        index: Number of the series; decides marker and dashes.
    """
    scale = np.radians if axes.name == "polar" else np.asarray
    dashes = style.DASHES[index % len(style.DASHES)]
    if sweep.grid_deg.size:
        grid = scale(sweep.grid_deg)
        if sweep.lower.size:
            axes.fill_between(
                grid, sweep.lower, sweep.upper, color=colour, alpha=BAND, lw=0
            )
        axes.plot(grid, sweep.best_fit, color=colour, ls=dashes)
    used = sweep.is_used
    axes.errorbar(
        scale(sweep.angle_deg[used]),
        sweep.height[used],
        yerr=np.nan_to_num(sweep.sd[used]),
        color=colour,
        fmt=style.MARKERS[index % len(style.MARKERS)],
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
            color=style.ALARM,
            ms=6,
            zorder=4,
        )


def draw_marker(
    axes: "Axes",
    marker: Marker,
    *,
    sweep: Sweep | None = None,
    colour: str = style.BLACK,
) -> None:
    """Mark a quantity and its set on the angle axis, and on the curve it belongs to.

    Args:
        axes: Cartesian axes with the angle in degrees along x, which holds the curves.
        sweep: The curve; None where the quantity belongs to all of them.
    """
    low, high = axes.get_xlim()
    room = MARGIN * (high - low)
    low = min([low, *(value - room for value in marker.marked)])
    high = max([high, *(value + room for value in marker.marked)])
    axes.set_xlim(low, high)
    for start, end in marker.pieces:
        left = low if start is None else max(start, low)
        right = high if end is None else min(end, high)
        if left < right:
            axes.axvspan(left, right, color=colour, alpha=BAND_SHADE, lw=0, zorder=0)
            _draw_extent(axes, left, right, colour=colour)
            if sweep is not None:
                grid = sweep.grid_deg
                inside = np.linspace(left, right, N_CURVE)
                curve = np.interp(inside, grid, sweep.best_fit, **BEYOND)
                axes.plot(inside, curve, color=colour, lw=6, alpha=0.4, zorder=2.5)
    for value in marker.estimates:
        axes.axvline(value, color=colour, lw=1.1, ls=style.DASHED, zorder=2)
        if sweep is not None:
            height = np.interp(value, sweep.grid_deg, sweep.best_fit, **BEYOND)
            axes.plot(value, height, "o", color=colour, mec="white", ms=7, zorder=5)
    if marker.text:
        axes.set_title(
            marker.title,
            loc="center",
            fontsize=9,
            fontweight="normal",
            color=colour,
            parse_math=True,
        )


def _draw_extent(axes: "Axes", left: float, right: float, *, colour: str) -> None:
    """A set at the upper edge, between two tips; none where the axes cut it off."""
    low, high = axes.get_xlim()
    edge = {"transform": axes.get_xaxis_transform(), "clip_on": False}
    axes.plot([left, right], [1, 1], color=colour, lw=3, solid_capstyle="butt", **edge)
    if left > low:
        style.draw_tip(axes, left, 1.0, toward_deg=0.0, colour=colour, **edge)
    if right < high:
        style.draw_tip(axes, right, 1.0, toward_deg=180.0, colour=colour, **edge)


def set_angle_ticks(axes: "Axes", swept: str) -> None:
    """Ticks of an angle in degrees where people push: at multiples of 15° and 30°."""
    from matplotlib.ticker import MultipleLocator

    low, high = axes.get_xlim()
    steps = [step for step in TICKS[swept] if (high - low) / step <= MAX_TICKS]
    if high - low >= TICKS[swept][0] and steps:
        axes.xaxis.set_major_locator(MultipleLocator(steps[0]))


def legend_height(sweeps: Sequence[Sweep]) -> float:
    """Room that the legend below a panel takes [inch]."""
    return LEGEND_FRAME + LEGEND_ROW * -(-len(sweeps) // LEGEND_COLUMNS)


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
    """Draw all sweeps of one angle into cartesian axes."""
    letter = {"theta": "α", "alpha": "θ"}[swept]
    colours = style.series_colours(len(sweeps))
    for index, sweep in enumerate(sweeps):
        label = style.angle_words(letter, sweep.fixed_deg)
        draw_sweep(axes, sweep, index=index, colour=colours[index], label=label)
    # Heights change sign with the elevation where the grasp is preloaded; along the
    # azimuth zero would only flatten the curve.
    if swept == "theta":
        axes.axhline(0, color=style.BLACK, lw=0.6)
    words = {"theta": "push elevation θ [°]", "alpha": "push azimuth α [°]"}
    axes.set_xlabel(words[swept])
    axes.set_ylabel(style.channel_label(channel, unit))
    axes.margins(x=MARGIN, y=0.12)
    if marker is not None:
        own = _sweep_of(marker, sweeps)
        if own is None:
            draw_marker(axes, marker)
        else:
            draw_marker(axes, marker, sweep=sweeps[own], colour=colours[own])
    set_angle_ticks(axes, swept)
    title = "pushes"
    if any(sweep.grid_deg.size for sweep in sweeps):
        title += ", fit"
    if any(sweep.lower.size for sweep in sweeps):
        title += f", {100 * prob:g} % band"
    if not all(sweep.is_used.all() for sweep in sweeps):
        title += "; ×: left out"
    style.place_legend(
        axes,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.17),
        ncols=LEGEND_COLUMNS,
        columnspacing=1.0,
        handletextpad=0.3,
        title=title,
        title_fontsize=8,
    )


def _sweep_of(marker: Marker, sweeps: Sequence[Sweep]) -> int | None:
    """Number of the sweep whose curve a quantity belongs to, if it has a curve."""
    for index, sweep in enumerate(sweeps):
        is_own = (
            marker.fixed_deg is not None
            and abs(sweep.fixed_deg - marker.fixed_deg) < SAME_DEG
        )
        if is_own and sweep.grid_deg.size:
            return index
    return None


@style.styled
def theta_figure(
    sweeps: Sequence[Sweep],
    *,
    unit: str,
    channel: str = "height",
    prob: float,
    marker: Marker | None = None,
    ax: "Axes | None" = None,
) -> "Figure":
    """Peak height against elevation, one series per azimuth."""
    height = ALONE + legend_height(sweeps)
    figure, axes = style.canvas(ax, width=1.5 * style.COLUMN, height=height)
    draw_panel(
        axes,
        sweeps,
        swept="theta",
        channel=channel,
        unit=unit,
        marker=marker,
        prob=prob,
    )
    return figure


def draw_polar(axes: "Axes", sweeps: Sequence[Sweep], marker: Marker) -> None:
    """Draw heights as distance from the centre, so that the soft axis is seen as one.

    Args:
        sweeps: One per elevation, swept in azimuth.
        marker: α*; its set is shaded on both ends of the axis.
    """
    from matplotlib.ticker import MaxNLocator

    colours = style.series_colours(len(sweeps))
    for index, sweep in enumerate(sweeps):
        draw_sweep(axes, sweep, index=index, colour=colours[index], label="_")
    top = 1.08 * max(float(np.nanmax(s.height, initial=0.0)) for s in sweeps) or 1.0
    for start, end in marker.pieces:
        low, high = 0.0 if start is None else start, 180.0 if end is None else end
        inside = np.radians(np.linspace(low, high, N_CURVE))
        for turn in (0.0, np.pi):
            axes.fill_between(
                inside + turn, 0, top, color=style.BLACK, alpha=POLAR_SHADE, lw=0
            )
    for value in np.radians(marker.estimates):
        for turn in (0.0, np.pi):
            axes.plot([value + turn] * 2, [0, top], **style.ESTIMATE)
    axes.set_ylim(0, top)
    low, high = _wedge(sweeps, marker)
    axes.set_xlim(np.radians(low), np.radians(high))
    axes.set_xticks(np.radians(np.arange(low, min(high, low + 331) + 1, 30)))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=7)


def _wedge(sweeps: Sequence[Sweep], marker: Marker) -> tuple[float, float]:
    """Azimuths between which there is something to see, in steps of 30° [deg]."""
    seen = np.concatenate([*(s.angle_deg for s in sweeps), np.array(marker.marked)])
    low = 30.0 * np.floor(seen.min(initial=90.0) / 30)
    high = 30.0 * np.ceil(seen.max(initial=90.0) / 30)
    return (low, high) if high - low < 300 else (0.0, 360.0)


@style.styled
def alpha_figure(
    sweeps: Sequence[Sweep],
    *,
    unit: str,
    channel: str = "height",
    prob: float,
    marker: Marker | None = None,
    ax: "Axes | None" = None,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Peak height against azimuth, as a curve and around the push frame.

    Args:
        sweeps: One per elevation.
        unit: Unit of the heights.
        channel: Which heights, for the axis.
        prob: Probability of the bands.
        marker: α* to mark; None for no mark.
        ax: Where to draw the curves alone.
        fig: Figure or subfigure to draw both into; None makes one.
    """
    marker = marker or Marker(name="alpha_star")
    panel = {"swept": "alpha", "channel": channel, "unit": unit, "prob": prob}
    if ax is not None:
        figure, axes = style.canvas(ax, width=style.PAGE, height=style.PAGE)
        draw_panel(axes, sweeps, marker=marker, **panel)
        return figure
    height = BESIDE + legend_height(sweeps)
    figure, room = style.sheet(fig, width=style.PAGE, height=height)
    # Apart, so that the legend of the one takes no room from the other.
    grid = room.add_gridspec(1, 2)
    left, right = room.add_subfigure(grid[0]), room.add_subfigure(grid[1])
    draw_panel(left.subplots(), sweeps, marker=marker, **panel)
    draw_polar(right.add_subplot(projection="polar"), sweeps, marker)
    is_signed = any(np.any(sweep.height < 0) for sweep in sweeps)
    right.suptitle(
        f"{'positive ' if is_signed else ''}{style.channel_label(channel, unit)}, "
        "around the push frame",
        fontsize=8,
    )
    return figure
