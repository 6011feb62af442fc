"""Corner plots: parameters in pairs, with the prior behind.

The pairs show what single intervals cannot: which combinations the data fix.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.report.figures.style import (
    DATA,
    PRIOR,
    drawable,
    math_symbol,
    new_figure,
    styled,
)
from pushfit.report.strings import unit_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# More draws change no pixel of a corner plot and cost a second each.
MAX_DRAWS = 20_000


@styled
def corner_figure(
    samples: Mapping[str, Float[np.ndarray, " n"]],
    prior: Mapping[str, Float[np.ndarray, " m"]],
    *,
    units: Mapping[str, str],
) -> "Figure":
    """Posterior draws in pairs, the prior behind in grey.

    Positive quantities that the prior leaves open over more than a factor of ten are on
    a logarithmic axis.

    Args:
        samples: Posterior draws by name, none of them constant.
        prior: Prior draws, same names.
        units: Unit by name.
    """
    import corner
    from matplotlib.lines import Line2D

    names = list(samples)
    limits = {name: _corner_range(samples[name], prior[name]) for name in names}
    scales = ["log" if _is_wide(*limits[name]) else "linear" for name in names]
    size = max(3.2, 1.45 * len(names) + 0.6)
    # corner places its panels itself and refuses a layout engine.
    figure = new_figure(width=size, height=size, layout=None)
    for draws, colour, order in ((prior, PRIOR, 1), (samples, DATA, 2)):
        table = np.column_stack([draws[name] for name in names])
        table = table[np.isfinite(table).all(axis=1)][:MAX_DRAWS]
        corner.corner(
            table,
            fig=figure,
            bins=30,
            range=[limits[name] for name in names],
            axes_scale=scales,  # pyright: ignore[reportArgumentType]
            color=colour,
            levels=(0.5, 0.9),
            plot_datapoints=False,
            plot_density=False,
            no_fill_contours=True,
            smooth=1.0,
            smooth1d=1.0,
            weights=np.full(len(table), 1 / len(table)),
            hist_kwargs={"zorder": order},
            contour_kwargs={"linewidths": 1.2 if colour == DATA else 0.8},
            max_n_ticks=3,
        )
    _label_corner(figure, names, units)
    margin = 0.75 / size
    figure.subplots_adjust(left=margin, bottom=margin, right=0.98, top=0.98)
    figure.legend(
        [Line2D([], [], color=DATA), Line2D([], [], color=PRIOR)],
        ["posterior, 50 % and 90 %", "prior"],
        loc="upper right",
        fontsize=9,
    )
    return figure


def _corner_range(
    samples: Float[np.ndarray, " n"], prior: Float[np.ndarray, " m"]
) -> tuple[float, float]:
    """Range that holds the posterior and the bulk of the prior."""
    low, high = np.nanquantile(samples, [0.002, 0.998])
    prior_low, prior_high = np.nanquantile(prior, [0.05, 0.95])
    low, high = min(low, prior_low), max(high, prior_high)
    margin = 0.03 * (high - low) + 1e-12 * max(abs(high), 1.0)
    return float(low if low > 0 else low - margin), float(high + margin)


def _is_wide(low: float, high: float) -> bool:
    """Whether a range calls for a logarithmic axis."""
    return low > 0 and high / low > 10


def _label_corner(
    figure: "Figure", names: Sequence[str], units: Mapping[str, str]
) -> None:
    """Names with units along the left and lower border, ticks in plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    n = len(names)
    grid = np.array(figure.axes).reshape(n, n)
    for axes in figure.axes:
        axes.grid(visible=False)
        axes.tick_params(labelsize=7)
        for axis in (axes.xaxis, axes.yaxis):
            if axis.get_scale() == "log":
                axis.set_minor_formatter(NullFormatter())
                axis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    for index, name in enumerate(names):
        unit = drawable(unit_label(units.get(name, "")))
        label = math_symbol(name) + (f" [{unit}]" if unit else "")
        outer = [(grid[-1, index].xaxis, (0.5, -0.36))]
        outer += [(grid[index, 0].yaxis, (-0.36, 0.5))] if index else []
        for axis, place in outer:
            axis.set_label_text(label, parse_math=True)
            axis.set_label_coords(*place)
            # The default formatter writes powers of ten as mathematics.
            if axis.get_scale() == "log":
                axis.set_major_formatter(StrMethodFormatter("{x:g}"))
