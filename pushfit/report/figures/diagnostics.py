"""Figures for judging what is claimed: residuals, traces, autocorrelation, coverage.

Excluded: figures of the answers (`pushfit.report.figures.posterior`).
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float, Int

from pushfit.fit.results import OUTLIER_SIGMA
from pushfit.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

    from pushfit.fit.coverage import CoverageStudy

# More lines hide each other, more steps change no pixel, and both cost megabytes.
MAX_TRACES = 4
MAX_STEPS = 400
# Probability claimed, measured share, and the limits of the measurement.
Point = tuple[float, float, float, float]
# Share of a group's width that its points take.
SPREAD = 0.6


def _draw_residuals(
    axes: "Axes",
    x: Float[np.ndarray, " n"],
    residuals: Float[np.ndarray, " n"],
    *,
    channels: Sequence[str],
) -> None:
    """Residuals in sigmas with the ±2 sigma stripe and outliers marked."""
    axes.axhspan(-2, 2, color=style.BLACK, alpha=0.06, lw=0)
    axes.axhline(0, color=style.BLACK, lw=0.8)
    for index, channel in enumerate(dict.fromkeys(channels)):
        mine = np.array([name == channel for name in channels])
        axes.plot(
            x[mine],
            residuals[mine],
            style.MARKERS[index],
            color=style.SERIES[index],
            mfc="white",
            ms=4,
            label=style.drawable(channel.replace("_", " ")),
        )
    far = np.abs(residuals) > OUTLIER_SIGMA
    axes.plot(x[far], residuals[far], "o", color=style.ALARM, ms=8, mfc="none", mew=1.2)


@style.styled
def residual_figure(
    residuals: Float[np.ndarray, " n"],
    predicted: Float[np.ndarray, " n"],
    *,
    theta_deg: Float[np.ndarray, " n"],
    alpha_deg: Float[np.ndarray, " n"],
    row: Int[np.ndarray, " n"],
    channels: Sequence[str],
    unit: str,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Residuals in units of sigma against direction, height and the normal law.

    Args:
        residuals: (observation - prediction)/sigma.
        predicted: Best-fit height of each residual [table unit].
        theta_deg: Elevation of each residual [deg].
        alpha_deg: Azimuth of each residual [deg].
        row: Row of the table of each residual, the order in time.
        channels: Channel of each residual.
        unit: Unit of the heights.
    """
    from scipy.special import ndtri

    figure, room = style.sheet(fig, width=style.PAGE, height=4.6)
    panels = room.subplots(2, 2)
    directions = (
        ("push elevation θ [°]", theta_deg),
        ("push azimuth α [°]", alpha_deg),
    )
    columns = [(label, x) for label, x in directions if np.ptp(x) > 0]
    columns += [
        (style.channel_label("height", unit).replace("peak", "predicted"), predicted),
        ("row of the table", row.astype(float)),
    ]
    for axes, (label, x) in zip(panels.flat[:3], columns, strict=False):
        _draw_residuals(axes, x, residuals, channels=channels)
        axes.set_xlabel(label)
    if len(set(channels)) > 1:
        style.place_legend(panels[0, 0], loc="best")
    n = residuals.size
    # Blom's plotting positions: expected normal order statistics to about 1 %.
    expected = ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    last = panels[1, 1]
    last.plot(expected, expected, color=style.BLACK, lw=0.8)
    last.plot(expected, np.sort(residuals), "o", color=style.DATA, ms=3, mfc="white")
    last.set_xlabel("normal quantile [σ]")
    for axes in panels[:, 0]:
        axes.set_ylabel("residual [σ]")
    return figure


def autocorrelation(chain: Float[np.ndarray, "e t w"]) -> Float[np.ndarray, " t"]:
    """Normalised autocorrelation of one coordinate by step, averaged over walkers."""
    from emcee.autocorr import function_1d

    walkers = np.moveaxis(chain, 1, -1).reshape(-1, chain.shape[1])
    moving = [walker for walker in walkers if np.ptp(walker) > 0]
    if not moving:
        return np.ones(chain.shape[1])
    return np.mean([function_1d(walker) for walker in moving], axis=0)


@style.styled
def trace_figure(
    chain: Float[np.ndarray, "e t w p"],
    names: Sequence[str],
    *,
    thin: int,
    autocorr_time: Mapping[str, float],
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """Walkers against step, and how fast they forget, for each coordinate.

    Args:
        chain: Kept states by ensemble, step, walker and coordinate.
        names: Coordinates, the last axis of the chain.
        thin: Steps between kept states.
        autocorr_time: Integrated autocorrelation time by name [steps].
    """
    n_ensembles, n_kept, n_walkers, n_names = chain.shape
    figure, room = style.sheet(fig, width=style.PAGE, height=0.7 + 1.05 * n_names)
    panels = room.subplots(n_names, 2, width_ratios=(3, 1), squeeze=False)
    steps = thin * np.arange(n_kept)
    shown = max(1, -(-n_walkers * n_ensembles // MAX_TRACES))
    every = max(1, -(-n_kept // MAX_STEPS))
    for index, name in enumerate(names):
        trace, lag = panels[index]
        for ensemble in range(n_ensembles):
            trace.plot(
                steps[::every],
                chain[ensemble, ::every, ::shown, index],
                color=style.SERIES[ensemble % len(style.SERIES)],
                ls=style.DASHES[0],
                lw=0.6,
                alpha=0.8,
                rasterized=True,
            )
        trace.set_ylabel(style.math_symbol(name), parse_math=True)
        rho = autocorrelation(chain[..., index])
        tau = autocorr_time.get(name, np.nan)
        last = int(np.clip(5 * tau / thin, 20, n_kept)) if np.isfinite(tau) else n_kept
        lag.plot(steps[:last], rho[:last], color=style.DATA)
        lag.axhline(0, color=style.BLACK, lw=0.6)
        words = f"τ = {tau:.0f} steps" if np.isfinite(tau) else "τ unknown"
        lag.annotate(
            words,
            (0.97, 0.92),
            xycoords="axes fraction",
            ha="right",
            va="top",
            fontsize=8,
        )
        lag.set_ylim(-0.25, 1.05)
        for axes in (trace, lag):
            axes.tick_params(labelbottom=index == n_names - 1)
    # Every lag axis has its own range, so each keeps its numbers.
    for lag in panels[:, 1]:
        lag.tick_params(labelbottom=True, labelsize=7)
    panels[-1, 0].set_xlabel("step")
    panels[-1, 1].set_xlabel("lag [steps]")
    panels[0, 0].set_title(
        f"{n_ensembles} ensembles of {n_walkers} walkers, a few of each", fontsize=9
    )
    panels[0, 1].set_title("autocorrelation", fontsize=9)
    return figure


def study_figure(study: "CoverageStudy") -> "Figure":
    """Measured over claimed coverage of the intervals."""
    points: dict[str, list[Point]] = {}
    for coverage in study.coverages:
        if coverage.kind == "interval" and coverage.n_tables:
            row = (coverage.prob, coverage.share, *coverage.limits)
            points.setdefault(coverage.name, []).append(row)
    return coverage_figure(points, n_tables=study.n_tables - study.n_failed)


@style.styled
def coverage_figure(
    points: Mapping[str, Sequence[Point]], *, n_tables: int, ax: "Axes | None" = None
) -> "Figure":
    """Draw measured coverage with its limits, a group for each claim.

    Args:
        points: For each quantity the claimed probability, the measured share, and the
            lower and upper binomial limit.
        n_tables: Simulated tables that gave a result.
        ax: Axes to draw into; None makes some.
    """
    rows = -(-len(points) // 4)
    figure, axes = style.canvas(
        ax, width=style.COLUMN, height=style.COLUMN + 0.25 * rows
    )
    claims = sorted({row[0] for rows in points.values() for row in rows})
    for place, claim in enumerate(claims):
        axes.plot(
            [place - 0.45, place + 0.45],
            [100 * claim] * 2,
            color=style.BLACK,
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
            fmt=style.MARKERS[index % len(style.MARKERS)],
            ms=4,
            lw=1,
            color=style.SERIES[index % len(style.SERIES)],
            label=style.math_symbol(name),
        )
    axes.set_xticks(range(len(claims)), [f"{100 * claim:g} %" for claim in claims])
    axes.grid(visible=False, axis="x")
    axes.set_ylim(0, 102)
    axes.set_xlabel("probability claimed")
    axes.set_ylabel("truth inside [%]")
    axes.set_title(f"{n_tables} simulated tables")
    # Below the axes: points may stand anywhere inside.
    style.place_legend(axes, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=4)
    legend = axes.get_legend()
    for text in legend.get_texts() if legend else ():
        text.set_parse_math(True)
    return figure
