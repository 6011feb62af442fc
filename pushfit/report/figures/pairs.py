"""Corner plots: parameters in pairs, with the prior behind.

The pairs show what single intervals cannot: which combinations the data fix. Excluded:
one quantity by itself (`pushfit.report.figures.posterior`).
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Shaped

from pushfit.report.figures.style import DATA, PALE, PRIOR, sheet, styled, symbol_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# More draws change no pixel of a corner plot and cost a second each.
MAX_DRAWS = 20_000
N_BINS = 24
# Width of a panel in widths of the posterior, at most.
ZOOM = 1.3
# Height of the prior in a panel where the posterior is 1.
PRIOR_TOP = 0.6
# Between panels, in widths of one.
GAP = 0.05
# Panel that a prior fills evenly.
EVERYWHERE = "#EFEFEF"


@styled
def corner_figure(
    samples: Mapping[str, Float[np.ndarray, " n"]],
    prior: Mapping[str, Float[np.ndarray, " m"]],
    *,
    units: Mapping[str, str],
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Posterior draws in pairs, the prior behind in grey.

    Each panel shows the posterior and as much of the prior beside it as keeps the
    posterior legible; of a prior much wider than that no contour is drawn. Positive
    quantities that are shown over more than a factor of ten are on a logarithmic axis.

    Args:
        samples: Posterior draws by name, none of them constant.
        prior: Prior draws, same names.
        units: Unit of each name.
    """
    import corner
    from matplotlib.lines import Line2D

    names = list(samples)
    windows = [_window(samples[name], prior[name]) for name in names]
    # A shape may be positive here and of either sign before the data.
    is_positive = [np.nanmin([samples[n].min(), prior[n].min()]) > 0 for n in names]
    scales = [
        "log" if positive and _is_wide(*window) else "linear"
        for positive, window in zip(is_positive, windows, strict=True)
    ]
    size = max(3.2, 1.45 * len(names) + 0.6)
    # Places that are known cost no layout, which takes seconds for so many panels.
    figure, room = sheet(fig, width=size, height=size, layout=None)
    edge = 0.75 / size
    places = {"left": edge, "bottom": edge, "right": 0.98, "top": 0.98}
    places |= {"wspace": GAP, "hspace": GAP}
    grid = room.subplots(len(names), len(names), gridspec_kw=places)
    is_beyond = np.array(
        [
            _is_beyond(window, prior[name])
            for name, window in zip(names, windows, strict=True)
        ]
    )
    for draws, colour in ((prior, PRIOR), (samples, DATA)):
        table = np.column_stack([draws[name] for name in names])
        table = table[np.isfinite(table).all(axis=1)][:MAX_DRAWS]
        corner.corner(
            table,
            fig=_Panels(grid),  # pyright: ignore[reportArgumentType]
            bins=N_BINS,
            range=[_bulk(draws[name]) for name in names],
            axes_scale=scales,  # pyright: ignore[reportArgumentType]
            color=colour,
            levels=(0.5, 0.9),
            plot_datapoints=False,
            plot_density=False,
            no_fill_contours=True,
            smooth=1.0,
            contour_kwargs={"linewidths": 1.2 if colour == DATA else 0.8},
            max_n_ticks=3,
        )
        if colour == PRIOR:
            _fill(grid[is_beyond[:, None] | is_beyond[None]])
    for index, name in enumerate(names):
        for axes in grid[index:, index]:
            axes.set_xlim(*windows[index])
        for axes in grid[index, :index]:
            axes.set_ylim(*windows[index])
        _draw_margin(
            grid[index, index], samples[name], prior=prior[name], window=windows[index]
        )
    _label_corner(grid, names, units)
    room.legend(
        [Line2D([], [], color=DATA), Line2D([], [], color=PRIOR)],
        ["posterior, 50 % and 90 %", "prior; far wider than a panel in grey"],
        loc="upper right",
        fontsize=9,
    )
    return figure


class _Panels:
    """What corner asks of a figure: its panels, and to move those of the user."""

    def __init__(self, grid: Shaped[np.ndarray, "p p"]) -> None:
        self.axes = list(grid.flat)

    def subplots_adjust(self, **_: float) -> None:
        """Leave every panel of a figure where its owner has it."""


def _draw_margin(
    axes: "Axes",
    samples: Float[np.ndarray, " n"],
    *,
    prior: Float[np.ndarray, " m"],
    window: tuple[float, float],
) -> None:
    """Densities of both in place of corner's counts, each on a scale of its own.

    On one scale a prior that the data narrowed a hundred times would not be seen.
    """
    is_log = axes.get_xscale() == "log"
    _clear([axes])
    shown = [] if _is_beyond(window, prior) else [(prior, N_BINS, PRIOR_TOP)]
    for draws, bins, top in (*shown, (samples, 2 * N_BINS, 1.0)):
        low, high = _bulk(draws)
        space = np.geomspace if is_log else np.linspace
        edges = space(max(low, 1e-6 * high) if is_log else low, high, bins + 1)
        counts, _ = np.histogram(draws[np.isfinite(draws)], edges)
        height = top * counts / max(counts.max(), 1)
        if draws is prior:
            axes.stairs(height, edges, color=PALE, fill=True)
        else:
            axes.stairs(height, edges, color=DATA, lw=1.3)
    axes.set_ylim(0, 1.08)
    axes.set_yticks([])


def _fill(panels: Iterable["Axes"]) -> None:
    """Show a prior that is far wider than some panels: it is everywhere in them."""
    panels = list(panels)
    _clear(panels)
    for axes in panels:
        axes.set_facecolor(EVERYWHERE)


def _clear(panels: Iterable["Axes"]) -> None:
    for axes in panels:
        for artist in (*axes.patches, *axes.lines, *axes.collections):
            artist.remove()


def _bulk(draws: Float[np.ndarray, " n"]) -> tuple[float, float]:
    """Range of nearly all draws."""
    low, high = np.nanquantile(draws, [0.0005, 0.9995])
    return float(low), float(high)


def _window(
    samples: Float[np.ndarray, " n"], prior: Float[np.ndarray, " m"]
) -> tuple[float, float]:
    """Range to show: the posterior, and of the prior what leaves it legible."""
    ends = np.nanquantile(samples, [0.005, 0.995])
    bulk = np.nanquantile(prior, [0.05, 0.95])
    # Ratios count where the prior is open over decades.
    is_log = _is_wide(float(bulk[0]), float(bulk[1])) and ends[0] > 0
    low, high = np.log(ends) if is_log else np.array(ends)
    first, last = np.log(bulk) if is_log else bulk
    room = (ZOOM - 1) / 2 * (high - low)
    shown = np.array(
        [max(min(low, first), low - room), min(max(high, last), high + room)]
    )
    shown += 0.1 * (high - low) * np.array([-1, 1])
    start, end = np.exp(shown) if is_log else shown
    return float(start), float(end)


def _is_beyond(window: tuple[float, float], prior: Float[np.ndarray, " m"]) -> bool:
    """Whether a window shows so little of a prior that its contours mean nothing."""
    low, high = np.nanquantile(prior, [0.25, 0.75])
    return bool(window[1] - window[0] < high - low)


def _is_wide(low: float, high: float) -> bool:
    return low > 0 and high / low > 10


def _label_corner(
    grid: Shaped[np.ndarray, "p p"], names: Sequence[str], units: Mapping[str, str]
) -> None:
    """Names with units along the left and lower border, ticks in plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    for axes in grid.flat:
        axes.grid(visible=False)
        axes.tick_params(labelsize=7)
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log":
                axis.set_minor_formatter(NullFormatter())
                axis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    for index, name in enumerate(names):
        label = symbol_label(name, units.get(name, ""))
        outer = [(grid[-1, index].xaxis, (0.5, -0.36))]
        outer += [(grid[index, 0].yaxis, (-0.36, 0.5))] if index else []
        for axis, place in outer:
            axis.set_label_text(label, parse_math=True)
            axis.set_label_coords(*place)
            # The default formatter writes powers of ten as mathematics.
            if axis.get_scale() == "log":
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
