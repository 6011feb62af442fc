"""Where an exploration stands: what is known, what pushes would tell, how it went."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from pushfit.explore.decide.intervals import HALF_TURN
from pushfit.parameters import ANGLES
from pushfit.report.figures.style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    PAGE,
    PALE,
    RAMP,
    VERMILLION,
    new_figure,
    place_legend,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

N_BINS = 90


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What is known of one angle.

    Args:
        name: "theta_c" or "alpha_star".
        values: Draws; NaN where undefined [deg].
        weights: Their weights, which sum to 1.
        interval: Shortest interval; None where there is none [deg].
        width: Width that would decide [deg].
    """

    name: str
    values: Float[np.ndarray, " n"]
    weights: Float[np.ndarray, " n"]
    interval: tuple[float, float] | None
    prob: float
    width: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GainMap:
    """What every push would tell.

    Args:
        theta_deg: Elevations of the candidates [deg].
        alpha_deg: Azimuths [deg].
        gain: Expected information [nat].
        is_allowed: Whether limits permit the push.
        made_deg: Elevation and azimuth of the pushes made [deg].
        next_deg: Elevation and azimuth of the pushes suggested, best first [deg].
    """

    theta_deg: Float[np.ndarray, " k"]
    alpha_deg: Float[np.ndarray, " k"]
    gain: Float[np.ndarray, " k"]
    is_allowed: Bool[np.ndarray, " k"]
    made_deg: Float[np.ndarray, "m 2"]
    next_deg: Float[np.ndarray, "s 2"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """How the interval of one angle and the forecast went.

    Args:
        n_pushes: Pushes made [-].
        lower: Lower end of the interval; NaN where there was none [deg].
        upper: Upper end [deg].
        p_budget: Forecast to decide with the pushes left; NaN where there was none.
    """

    n_pushes: Float[np.ndarray, " n"]
    lower: Float[np.ndarray, " n"]
    upper: Float[np.ndarray, " n"]
    p_budget: Float[np.ndarray, " n"]


@styled
def exploration_figure(
    known: Known, gains: GainMap, course: Course | None, *, title: str
) -> "Figure":
    """What is known, what pushes would tell, and how it went.

    Args:
        course: How it went; None where pushes were not followed.
    """
    n = 2 if course is None else 3
    figure = new_figure(width=PAGE * n / 2.6, height=3.2)
    axes = figure.subplots(1, n)
    _draw_known(axes[0], known)
    _draw_gains(axes[1], gains)
    if course is not None:
        _draw_course(axes[2], course, known)
    figure.suptitle(title, x=0.01, ha="left", fontsize=9)
    return figure


def _draw_known(axes: "Axes", known: Known) -> None:
    """Posterior of the angle, with its interval and the width that would decide."""
    is_there = np.isfinite(known.values) & (known.weights > 0)
    values = known.values[is_there]
    low, high = 0.0, 90.0
    if known.name == "alpha_star":
        values, high = np.mod(values, HALF_TURN), HALF_TURN
    elif values.size and np.min(values) < 0:  # a preload may lower it so far
        low = float(np.floor(np.min(values) / 10) * 10)
    edges = np.linspace(low, high, N_BINS + 1)
    mass, _ = np.histogram(values, edges, weights=known.weights[is_there])
    axes.stairs(mass / np.diff(edges), edges, fill=True, color=BLUE, alpha=0.85)
    top = float(np.max(mass / np.diff(edges), initial=0.0)) or 1.0
    if known.interval is not None:
        start, end = known.interval
        axes.axvspan(start, min(end, high), color=PALE, zorder=0)
        if end > high:
            axes.axvspan(low, end - high, color=PALE, zorder=0)
        middle = (start + end) / 2
        axes.plot(
            [middle - known.width / 2, middle + known.width / 2],
            [1.08 * top] * 2,
            color=VERMILLION,
            lw=3,
            solid_capstyle="butt",
            label=f"asked: ± {known.width / 2:g}°",
        )
    axes.set(
        xlim=(low, high),
        ylim=(0, 1.4 * top),
        xlabel=f"{ANGLES[known.name].prose} [deg]",
        ylabel="density [1/deg]",
        title="What is known",
    )
    axes.set_axisbelow(True)
    place_legend(axes, loc="upper right")


def _draw_gains(axes: "Axes", gains: GainMap) -> None:
    """Gain over elevation, and over azimuth where that was open."""
    theta, alpha = np.unique(gains.theta_deg), np.unique(gains.alpha_deg)
    axes.set_title("What a push would tell")
    axes.set_axisbelow(True)
    axes.set_xlabel("θ [deg]")
    if alpha.size == 1:
        allowed = gains.is_allowed
        axes.bar(gains.theta_deg[allowed], gains.gain[allowed], 3.4, color=ORANGE)
        top = float(np.max(gains.gain, initial=0.0)) or 1.0
        _mark(axes, gains.theta_deg[~allowed], np.zeros(np.sum(~allowed)), "out")
        made = gains.made_deg[:, 0]
        axes.plot(made, np.full(made.size, -0.06 * top), "|", color=BLACK, ms=7)
        axes.set(ylabel="expected information [nat]", ylim=(-0.12 * top, 1.45 * top))
        if gains.next_deg.size:
            axes.plot(
                gains.next_deg[0, 0], 1.07 * top, "v", color=VERMILLION, label="next"
            )
        axes.plot([], [], "|", color=BLACK, label="made")
    else:
        shown = np.where(gains.is_allowed, gains.gain, np.nan)
        grid = shown.reshape(theta.size, alpha.size).T
        image = axes.pcolormesh(theta, alpha, grid, cmap=RAMP, shading="nearest")
        axes.grid(visible=False)
        bar = axes.figure.colorbar(image, ax=axes)
        bar.set_label("expected information [nat]")
        refused = ~gains.is_allowed
        _mark(axes, gains.theta_deg[refused], gains.alpha_deg[refused], "out")
        axes.plot(*gains.made_deg.T, "o", mfc="none", mec="white", ms=5, label="made")
        if gains.next_deg.size:
            axes.plot(*gains.next_deg[0], "v", color=VERMILLION, label="next")
        axes.set_ylabel("α [deg]")
    place_legend(axes, loc="upper right", ncols=3)


def _mark(
    axes: "Axes", x: Float[np.ndarray, " r"], y: Float[np.ndarray, " r"], label: str
) -> None:
    """Candidates that limits rule out."""
    if x.size:
        axes.plot(x, y, "x", color=GREY, ms=4, label=f"{label} of limits")


def _draw_course(axes: "Axes", course: Course, known: Known) -> None:
    """Interval and forecast by push."""
    n = course.n_pushes
    axes.fill_between(n, course.lower, course.upper, color=BLUE, alpha=0.3, lw=0)
    axes.plot(n, course.lower, color=BLUE, marker=".")
    axes.plot(n, course.upper, color=BLUE, marker=".")
    axes.set(
        xlabel="pushes",
        ylabel=f"{ANGLES[known.name].prose} [deg]",
        title="How it went",
        ylim=_padded(course.lower, course.upper),
    )
    axes.locator_params(axis="x", integer=True)
    right = axes.twinx()
    right.plot(n, course.p_budget, color=VERMILLION, ls="--")
    right.set_ylim(0, 1.05)
    right.grid(visible=False)
    right.spines["right"].set_visible(True)
    right.set_ylabel("chance to decide in budget", color=VERMILLION)
    right.tick_params(colors=VERMILLION)


def _padded(
    lower: Sequence[float] | Float[np.ndarray, " n"],
    upper: Sequence[float] | Float[np.ndarray, " n"],
) -> tuple[float, float]:
    """Range of an axis with some air; without any interval, that of the angle."""
    if not np.any(np.isfinite(lower)):
        return 0.0, 90.0
    low, high = float(np.nanmin(lower)), float(np.nanmax(upper))
    air = 0.08 * max(high - low, 1.0)
    return low - air, high + air
