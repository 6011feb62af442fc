"""Where an exploration stands: what is known, what pushes would tell, how it went.

Excluded: its sentences (`pushfit.report.text.exploration`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.explore.decide.intervals import AskedAngle
from pushfit.explore.explorer import Explorer
from pushfit.explore.records import State, Suggestion
from pushfit.parameters import HALF_TURN
from pushfit.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Bins of the histogram: of 1° for elevations, of 2° for azimuths of an axis.
N_BINS = 90


@style.styled
def exploration_picture(
    explorer: Explorer, suggestions: Sequence[Suggestion] = ()
) -> "Figure":
    """What is known, what pushes would tell and, if some were made, how it went.

    Args:
        explorer: The exploration as it stands.
        suggestions: Pushes of its `ask`, of which the first is marked.
    """
    angle, course = explorer.angle, explorer.history.course
    known = explorer.judge.targets(explorer.belief, explorer.question)
    n = len(known) + 1 + (len(course) > 1)
    figure = style.new_figure(width=style.PAGE * n / 2.6, height=3.2)
    axes = figure.subplots(1, n)
    for panel, (name, target) in zip(axes, known.items(), strict=False):
        _draw_known(panel, explorer, name, target)
    _draw_gains(axes[len(known)], explorer, suggestions)
    if len(course) > 1:
        draw_course(axes[-1], course, angle, is_axis=known[angle].is_axis)
    figure.suptitle(explorer.state.sentence, x=0.01, ha="left", fontsize=9, wrap=True)
    # Ticks follow the size of their panel, and labels these: solved twice.
    figure.draw_without_rendering()
    return figure


def _draw_known(
    axes: "Axes", explorer: Explorer, angle: str, target: AskedAngle
) -> None:
    """Posterior of an angle, with its interval and the width that would decide."""
    interval = explorer.state.intervals[angle]
    values, weights, width = target.values, explorer.belief.weights, target.width
    is_there = np.isfinite(values) & (weights > 0)
    values = values[is_there]
    low, high = 0.0, HALF_TURN if angle == "alpha_star" else 90.0
    if values.size:  # a preload may lower θ_c, and a reach lie where it likes
        low = min(low, float(np.floor(np.min(values) / 10) * 10))
        high = max(high, float(np.ceil(np.max(values) / 10) * 10))
    edges = np.linspace(low, high, N_BINS + 1)
    mass, _ = np.histogram(values, edges, weights=weights[is_there])
    axes.stairs(mass / np.diff(edges), edges, fill=True, color=style.BLUE, alpha=0.85)
    top = float(np.max(mass / np.diff(edges), initial=0.0)) or 1.0
    if interval is not None:
        start, end = interval
        axes.axvspan(start, min(end, high), color=style.PALE, zorder=0)
        if end > high:
            axes.axvspan(low, end - high, color=style.PALE, zorder=0)
        middle = (start + end) / 2
        axes.plot(
            [middle - width / 2, middle + width / 2],
            [1.08 * top] * 2,
            color=style.VERMILLION,
            lw=3,
            solid_capstyle="butt",
            label=f"asked: ± {width / 2:g}°",
        )
    axes.set(
        xlim=(low, high),
        ylim=(0, 1.4 * top),
        ylabel="density [1/°]",
        title="What is known",
    )
    axes.set_xlabel(style.symbol_label(angle, "°"), parse_math=True)
    axes.set_axisbelow(True)
    style.place_legend(axes, loc="upper right")


def _draw_gains(
    axes: "Axes", explorer: Explorer, suggestions: Sequence[Suggestion]
) -> None:
    """Gain over elevation, and over azimuth where that was open."""
    survey, told = explorer.survey(is_full=True), explorer.history.told
    gain, allowed = survey.gains, survey.is_allowed
    theta_deg, alpha_deg = np.degrees(survey.theta), np.degrees(survey.alpha)
    theta, alpha = np.unique(theta_deg), np.unique(alpha_deg)
    made = np.degrees([(row.theta, row.alpha) for row in told]).reshape(-1, 2)
    following = [(push.theta_deg, push.alpha_deg) for push in suggestions[:1]]
    axes.set_title("What a push would tell")
    axes.set_axisbelow(True)
    axes.set_xlabel("push elevation θ [°]")
    if alpha.size == 1:
        axes.bar(theta_deg[allowed], gain[allowed], 3.4, color=style.ORANGE)
        top = float(np.max(gain, initial=0.0)) or 1.0
        _mark(axes, theta_deg[~allowed], np.zeros(np.sum(~allowed)), label="out")
        axes.plot(
            made[:, 0], np.full(len(made), -0.06 * top), "|", color=style.BLACK, ms=7
        )
        axes.set(ylabel="expected information [nat]", ylim=(-0.12 * top, 1.2 * top))
        for best, _ in following:
            axes.plot(best, 1.07 * top, "v", color=style.VERMILLION, label="next")
        axes.plot([], [], "|", color=style.BLACK, label="made")
    else:
        grid = np.where(allowed, gain, np.nan).reshape(theta.size, alpha.size).T
        image = axes.pcolormesh(theta, alpha, grid, cmap=style.RAMP, shading="nearest")
        axes.grid(visible=False)
        bar = axes.figure.colorbar(image, ax=axes)
        bar.set_label("expected information [nat]")
        _mark(axes, theta_deg[~allowed], alpha_deg[~allowed], label="out")
        axes.plot(
            *made.T, "o", mfc="white", mec=style.BLACK, mew=0.8, ms=4.5, label="made"
        )
        for best in following:
            axes.plot(*best, "v", color=style.VERMILLION, label="next")
        axes.set_ylabel("push azimuth α [°]")
    # Where nothing is drawn: a map fills its axes.
    style.place_legend(
        axes,
        loc="upper center",
        bbox_to_anchor=(0.5, -0.2),
        ncols=3,
        columnspacing=1.0,
        handletextpad=0.3,
        handlelength=1.2,
    )


def _mark(
    axes: "Axes", x: Float[np.ndarray, " r"], y: Float[np.ndarray, " r"], *, label: str
) -> None:
    """Candidates that limits rule out."""
    if x.size:
        axes.plot(x, y, "x", color=style.GREY, ms=4, label=f"{label} of limits")


def draw_course(
    axes: "Axes", course: Sequence[State], angle: str, *, is_axis: bool = False
) -> None:
    """Interval of the angle, and chance to decide, after each push.

    Args:
        is_axis: Whether 180° is 0°.
    """
    n = [state.n_pushes for state in course]
    ends = [state.intervals[angle] or (np.nan, np.nan) for state in course]
    lower, upper = np.transpose(ends)
    if is_axis:  # it has no ends: each interval beside the last
        known = np.isfinite(lower)
        middle = (lower + upper)[known] / 2
        shift = np.unwrap(middle, period=HALF_TURN) - middle
        lower[known], upper[known] = lower[known] + shift, upper[known] + shift
    axes.fill_between(n, lower, upper, color=style.BLUE, alpha=0.3, lw=0)
    axes.plot(n, lower, color=style.BLUE, marker=".")
    axes.plot(n, upper, color=style.BLUE, marker=".")
    axes.set(xlabel="pushes", title="How it went", ylim=_padded(lower, upper))
    axes.set_ylabel(style.symbol_label(angle, "°"), parse_math=True)
    axes.locator_params(axis="x", integer=True)
    right = axes.twinx()
    chances = np.array([state.p_budget for state in course], dtype=float)
    right.plot(n, chances, color=style.VERMILLION, ls="--")
    right.set_ylim(0, 1.05)
    right.grid(visible=False)
    right.spines["right"].set_visible(True)
    right.set_ylabel("chance to decide in budget", color=style.VERMILLION)
    right.tick_params(colors=style.VERMILLION)


def _padded(
    lower: Float[np.ndarray, " n"], upper: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Range of an axis with some air; without any interval, that of the angle."""
    if not np.any(np.isfinite(lower)):
        return 0.0, 90.0
    low, high = float(np.nanmin(lower)), float(np.nanmax(upper))
    air = 0.08 * max(high - low, 1.0)
    return low - air, high + air
