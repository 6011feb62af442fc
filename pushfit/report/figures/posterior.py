"""What the posterior says against what the prior and the likelihood alone say.

Priors are always drawn behind, in grey: where blue repeats grey, data added nothing.
Two results stand one above the other, quantity by quantity. Excluded: parameters in
pairs (`pushfit.report.figures.pairs`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.fit.assess.reporting_rules import Pieces
from pushfit.report.figures import style
from pushfit.report.figures.sweeps import Marker
from pushfit.report.text.difference import Difference, sentence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# Bins of a histogram; points of a profile between those of its grid: no corner is seen.
N_BINS = 60
N_CURVE = 400
# Largest Δχ² shown: 3.3 sigma, beyond every usual level; above a level of few degrees
# of freedom, which may be tens, there is room for its line.
MAX_DELTA, ABOVE = 11.0, 1.15
# A range that is most of the grid is shown as the whole grid.
MOST = 0.6


def shade(axes: "Axes", pieces: Pieces, colour: str) -> None:
    """Shade a set along x, open ends up to the border."""
    low, high = axes.get_xlim()
    for start, end in pieces:
        left = low if start is None else start
        right = high if end is None else end
        axes.axvspan(left, right, color=colour, alpha=0.15, lw=0, zorder=0)
    axes.set_xlim(low, high)


def draw_profile(
    axes: "Axes",
    values: Float[np.ndarray, " g"],
    delta_chi_square: Float[np.ndarray, " g"],
    *,
    pieces: Pieces,
    level: float,
    prob: float,
    limits: tuple[float, float],
) -> None:
    """Draw a likelihood profile with its level and set."""
    # A profile is nearly a parabola at every optimum, so its root is what is straight
    # between the points of the grid.
    grid = np.union1d(values, np.linspace(*limits, N_CURVE))
    root = np.interp(grid, values, np.sqrt(np.maximum(delta_chi_square, 0.0)))
    axes.plot(grid, root**2, color=style.DATA)
    axes.axhline(level, color=style.BLACK, lw=0.8, ls="--")
    axes.annotate(
        f"{100 * prob:g} %",
        (1, level),
        xycoords=("axes fraction", "data"),
        xytext=(-2, 2),
        textcoords="offset points",
        ha="right",
        fontsize=8,
    )
    axes.set_ylim(0, _top(level))
    axes.set_xlim(*limits)
    axes.set_ylabel("Δχ² of the profile")
    shade(axes, pieces, style.DATA)


def draw_densities(
    axes: "Axes",
    samples: Float[np.ndarray, " n"],
    prior: Float[np.ndarray, " m"],
    *,
    marker: Marker,
    limits: tuple[float, float],
) -> None:
    """Draw the density of draws over that of the prior, the set and the estimates."""
    bins = list(np.linspace(*limits, N_BINS + 1))
    for draws, colour, label, filled in (
        (prior, style.PRIOR, "prior", True),
        (samples, style.DATA, "posterior", False),
    ):
        finite = draws[np.isfinite(draws)]
        if finite.size:
            # Weighted by all draws: what is outside or does not exist lowers the curve.
            weight = np.full(finite.size, 1 / (draws.size * (bins[1] - bins[0])))
            axes.hist(
                finite,
                bins,
                weights=weight,
                color=style.PALE if filled else colour,
                lw=1.6,
                label=label,
                histtype="stepfilled" if filled else "step",
            )
    axes.set_xlim(*limits)
    axes.set_yticks([])
    axes.set_ylabel("density")
    shade(axes, marker.pieces, style.DATA)
    for value in marker.estimates:
        axes.axvline(value, **style.ESTIMATE)
    style.place_legend(axes, loc="best")


@style.styled
def quantity_figure(
    profile: tuple[Float[np.ndarray, " g"], Float[np.ndarray, " g"]] | None,
    samples: Float[np.ndarray, " n"],
    prior: Float[np.ndarray, " m"],
    *,
    marker: Marker,
    likelihood_pieces: Pieces,
    level: float,
    prob: float,
    unit: str = "deg",
    modes: Sequence[float] = (),
    ax: "Axes | None" = None,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Profile likelihood above, posterior over prior below, all modes marked.

    Args:
        profile: Grid and Δχ² on it; None leaves the upper panel out.
        samples: Posterior draws [unit].
        prior: Prior draws [unit].
        marker: Estimates and posterior set to mark.
        likelihood_pieces: Likelihood set, piece by piece; None for an open end [unit].
        level: Δχ² of the likelihood set.
        prob: Probability of the likelihood set.
        unit: Unit of every value.
        modes: Values at the local optima of the likelihood.
        ax: Where to draw the posterior alone.
        fig: Figure or subfigure to draw both into; None makes one.
    """
    limits = _limits(profile, samples, modes, top=_top(level))
    if ax is not None:
        profile, (figure, axes) = (
            None,
            style.canvas(ax, width=style.COLUMN, height=style.COLUMN),
        )
        panels = np.array([axes])
    else:
        n_panels = 1 if profile is None else 2
        height = 0.8 + 1.5 * n_panels
        figure, room = style.sheet(fig, width=1.5 * style.COLUMN, height=height)
        panels = room.subplots(n_panels, 1, sharex=True, squeeze=False)[:, 0]
    draw_densities(panels[-1], samples, prior, marker=marker, limits=limits)
    if profile is not None:
        draw_profile(
            panels[0],
            *profile,
            pieces=likelihood_pieces,
            level=level,
            prob=prob,
            limits=limits,
        )
        inside = [mode for mode in modes if limits[0] <= mode <= limits[1]]
        if inside:
            heights = np.full(len(inside), 0.35)
            panels[0].plot(
                inside, heights, "v", color=style.ALARM, ms=6, label="optimum"
            )
            style.place_legend(panels[0], loc="best")
    panels[-1].set_xlabel(style.symbol_label(marker.name, unit), parse_math=True)
    panels[0].set_title(marker.title, fontweight="normal", fontsize=9, parse_math=True)
    return figure


def _top(level: float) -> float:
    """Upper end of the axis of Δχ² [-], above the level of the interval."""
    return max(MAX_DELTA, ABOVE * level)


def _limits(
    profile: tuple[Float[np.ndarray, " g"], Float[np.ndarray, " g"]] | None,
    samples: Float[np.ndarray, " n"],
    modes: Sequence[float],
    *,
    top: float,
) -> tuple[float, float]:
    """Range that holds the draws, the optima and the profile up to its top.

    An answer that is sharp on the grid of the profile would be a single bin on it.
    """
    finite = samples[np.isfinite(samples)]
    inside = [np.quantile(finite, [0.001, 0.999])] if finite.size else []
    whole = (-np.inf, np.inf)
    if profile is not None:
        values, delta = profile
        whole = float(values[0]), float(values[-1])
        inside.append(values[delta < top])
        inside.append(np.array([m for m in modes if whole[0] <= m <= whole[1]]))
    shown = np.concatenate(inside) if inside else np.empty(0)
    if shown.size == 0:
        return whole if profile is not None else (0.0, 1.0)
    low, high = float(shown.min()), float(shown.max())
    margin = max(0.4 * (high - low), 1e-3 * abs(high), 1e-12)
    limits = max(low - margin, whole[0]), min(high + margin, whole[1])
    is_most = limits[1] - limits[0] > MOST * (whole[1] - whole[0])
    return whole if is_most else limits


@style.styled
def learned_figure(
    names: Sequence[str],
    contraction: Float[np.ndarray, " p"],
    *,
    verdicts: Sequence[str],
    ax: "Axes | None" = None,
) -> "Figure":
    """How much of each parameter came from the data and how much was assumed.

    Args:
        names: Stable names of the parameters.
        contraction: 1 - var_posterior / var_prior; NaN where there is no such number.
        verdicts: Word of each, for example "learned".
        ax: Axes to draw into; None makes some.
    """
    height = 0.9 + 0.28 * len(names)
    figure, axes = style.canvas(ax, width=1.5 * style.COLUMN, height=height)
    rows = np.arange(len(names))[::-1]
    axes.barh(rows, np.ones(len(names)), color=style.PALE, height=0.6, label="assumed")
    share = np.clip(np.nan_to_num(contraction), 0, 1)
    axes.barh(rows, share, color=style.DATA, height=0.6, label="learned")
    for row, verdict, value in zip(rows, verdicts, contraction, strict=True):
        number = f" ({100 * max(value, 0.0):.0f} %)" if np.isfinite(value) else ""
        axes.text(
            1.02, row, f"{verdict.replace('_', ' ')}{number}", va="center", fontsize=8
        )
    axes.set_yticks(rows, [style.math_symbol(name) for name in names], parse_math=True)
    axes.set_xlim(0, 1)
    axes.set_xlabel("share of the prior variance that the data removed")
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
    return figure


@style.styled
def forest_figure(
    differences: Sequence[Difference], *, labels: tuple[str, str]
) -> "Figure":
    """Draw both intervals of each quantity below each other."""
    n = len(differences)
    figure = style.new_figure(width=2 * style.COLUMN, height=0.75 * n + 0.6)
    panels = figure.subplots(n, 1, squeeze=False)[:, 0]
    for axes, one in zip(panels, differences, strict=True):
        for row, quantity, colour in (
            (1, one.first, style.BLUE),
            (0, one.second, style.ORANGE),
        ):
            assert quantity.interval is not None
            axes.plot(quantity.interval, (row, row), color=colour, lw=3, alpha=0.5)
            axes.plot(quantity.estimate, row, "o", color=colour, ms=5)
        name = style.symbol_label(one.name, one.unit)
        axes.set_ylabel(name, rotation=0, ha="right", va="center", parse_math=True)
        axes.set_yticks([])
        axes.set_ylim(-0.6, 1.6)
        axes.margins(x=0.08)
        axes.tick_params(labelsize=7)
        axes.set_title(sentence(one), fontsize=7.5, fontweight="normal", pad=2)
    handles = [panels[0].lines[index] for index in (0, 2)]
    figure.legend(
        handles,
        [style.drawable(label) for label in labels],
        loc="outside upper center",
        ncols=2,
    )
    return figure
