"""The figures of one identification: which arrays go where.

Here is only the choice of what to draw, so that text, page and figures mark the same
answers. Excluded: the drawing, done by the modules beside this one.
"""

import inspect
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.errors import ConfigError
from pushfit.fit.assess.reporting_rules import is_trusted
from pushfit.fit.profiles.profile_sets import threshold
from pushfit.fit.results import FitStatus, Identification, Quantity, Verdict
from pushfit.parameters import HALF_TURN, STIFFNESSES
from pushfit.report.answers import ANSWERS, alpha_star_answer
from pushfit.report.fact_rows import verdict_word
from pushfit.report.figures.diagnostics import residual_figure, trace_figure
from pushfit.report.figures.grasp import Ellipses, ellipse_figure, grasp_figure
from pushfit.report.figures.main import (
    main_figure,
    marker_of,
    sweep_makers,
    within_half_turn,
)
from pushfit.report.figures.pairs import corner_figure
from pushfit.report.figures.posterior import learned_figure, quantity_figure
from pushfit.report.figures.recording import signal_figure
from pushfit.report.figures.style import figure_bytes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

# Draws into `ax` or `fig`, whichever it takes.
Maker = Callable[..., "Figure"]
INFORMED = frozenset({Verdict.LEARNED, Verdict.PARTLY, Verdict.DETERMINED})


def figure_makers(identification: Identification) -> dict[str, Maker]:
    """What draws each figure that a result supports, by the name of its file.

    Returns:
        Functions of `ax` for figures of one panel, of `fig` for those of several; those
        of a posterior only where it is to be trusted, corner plots only where the
        library `corner` is installed.
    """
    makers: dict[str, Maker] = {
        "main": partial(main_figure, identification),
        "grasp": _grasp(identification),
    }
    for index, trace in enumerate(identification.table.traces, start=1):
        makers[f"recording_{index}"] = partial(
            signal_figure, trace, identification.table
        )
    makers |= sweep_makers(identification)
    if identification.fit.status is FitStatus.OK:
        makers["residuals"] = _residuals(identification)
    if is_trusted(identification):
        makers |= _posterior_makers(identification)
    posterior = identification.posterior
    if posterior.chain is not None:
        diagnostics = posterior.diagnostics
        makers["traces"] = partial(
            trace_figure,
            posterior.chain,
            posterior.chain_names,
            thin=posterior.thin,
            autocorr_time=diagnostics.autocorr_time if diagnostics else {},
        )
    return makers


def all_figures(identification: Identification) -> dict[str, "Figure"]:
    """Every figure that a result supports, by the name of its file."""
    makers = figure_makers(identification)
    return {name: make() for name, make in makers.items()}


def plot(
    identification: Identification,
    name: str,
    *,
    ax: "Axes | None" = None,
    fig: "Figure | SubFigure | None" = None,
) -> "Figure":
    """One figure of a result.

    Args:
        identification: What a table told.
        name: As the file is called.
        ax: Axes to draw a figure of a single panel into.
        fig: Figure or subfigure to draw any figure into; without both it gets its own.

    Raises:
        ConfigError: There is no such figure, or it does not fit into axes.
    """
    makers = figure_makers(identification)
    if name not in makers:
        raise ConfigError(
            f"{name!r} is no figure of this result; it has {', '.join(makers)}",
            code="unknown_figure",
        )
    make = makers[name]
    takes = inspect.signature(make).parameters
    if ax is not None and fig is not None:
        raise ConfigError(
            "ax and fig are both given, and a figure has one place; leave one out",
            code="two_places",
        )
    if ax is not None and "ax" not in takes:
        raise ConfigError(
            f"the figure {name!r} has several panels and does not fit into the axes of "
            "one; give it a figure or a subfigure, as fig=, or take the one it makes",
            code="several_panels",
        )
    if fig is not None:
        return make(fig=fig) if "fig" in takes else make(ax=fig.subplots())
    return make() if ax is None else make(ax=ax)


def figure_files(
    identification: Identification, *, is_wanted: Callable[[str, str], bool]
) -> dict[str, bytes]:
    """Content of the files of all figures by name, "main.png" and so on.

    Args:
        is_wanted: Whether a figure is wanted as "png" or "svg", both by name.
    """
    files = {}
    for name, make in figure_makers(identification).items():
        suffixes = [s for s in ("png", "svg") if is_wanted(name, s)]
        if suffixes:
            figure = make()
            files |= {f"{name}.{s}": figure_bytes(figure, s) for s in suffixes}
    return files


def _posterior_makers(identification: Identification) -> dict[str, Maker]:
    makers: dict[str, Maker] = {}
    posterior, parameters = identification.posterior, identification.parameters
    samples = posterior.samples
    for name in ("theta_c", "alpha_star"):
        if name in samples:
            makers[name] = _angle(identification, name)
    if "f1" in samples:
        makers["ellipse"] = _ellipse(identification)
    if parameters:
        makers["learned"] = partial(
            learned_figure,
            [q.name for q in parameters],
            np.array([q.contraction for q in parameters], dtype=float),
            verdicts=[verdict_word(q.verdict) for q in parameters],
        )
    if find_spec("corner"):
        groups = {
            "corner_parameters": parameters,
            "corner_combinations": identification.combinations,
        }
        for name, quantities in groups.items():
            shown = _shown_in_pairs(identification, quantities)
            if len(shown) > 1:
                makers[name] = partial(
                    corner_figure,
                    {q.name: samples[q.name] for q in shown},
                    {q.name: posterior.prior_samples[q.name] for q in shown},
                    units={q.name: q.unit for q in shown},
                )
    return makers


def _grasp(identification: Identification) -> Maker:
    table, used = identification.table, identification.used
    markers = {
        name: marker_of(answer(identification), identification)
        for name, answer in ANSWERS.items()
    }
    return partial(
        grasp_figure,
        np.degrees(table.theta[used]),
        np.degrees(table.alpha[used]),
        reach_deg=identification.config.reach.alpha_deg,
        **markers,
    )


def _angle(identification: Identification, name: str) -> Maker:
    """Profile and posterior of θ_c or α*; into given axes the posterior alone."""
    quantity: Quantity = getattr(identification, name)
    answer = ANSWERS[name](identification)
    posterior = identification.posterior
    draws = posterior.samples[answer.name]
    prior = posterior.prior_samples.get(answer.name, np.empty(0))
    profile = identification.profiles.get(answer.name)
    curve, pieces, freedom = None, (), np.inf
    # Without a degree of freedom it is that of no noise at all.
    if profile is not None and profile.degrees_of_freedom >= 1:
        curve = (profile.values, profile.delta_chi_square)
        pieces, freedom = profile.pieces, profile.degrees_of_freedom
    modes = [m.theta_c_deg for m in identification.fit.modes if m.theta_c_deg]
    is_axis = answer.name == "alpha_star"
    if is_axis and identification.config.reach.is_whole:
        # Draws, profile and sets of an axis may each start at another azimuth.
        draws, prior = draws % HALF_TURN, prior % HALF_TURN
        pieces = within_half_turn(pieces)
        if curve is not None:
            values = curve[0] % HALF_TURN
            order = np.argsort(values)
            curve = (values[order], curve[1][order])
    return partial(
        quantity_figure,
        curve,
        draws,
        prior,
        marker=marker_of(answer, identification),
        likelihood_pieces=pieces,
        level=threshold(quantity.prob, freedom),
        prob=quantity.prob,
        modes=[] if is_axis else modes,
    )


def _ellipse(identification: Identification) -> Maker:
    samples = identification.posterior.samples
    quantities = {
        q.name: q for q in (*identification.combinations, *identification.parameters)
    }
    is_known = identification.config.push.length_known
    unit = quantities["B"].unit if is_known and "B" in quantities else "relative"
    panels = []
    for title, mean, e1, e2 in (
        ("B: unrolled contact", "B", "f1", "f2"),
        ("K: support finger", "K_st", "e1", "e2"),
    ):
        quantity = quantities.get(mean)
        panels.append(
            Ellipses(
                title=title,
                mean=samples[mean] / (1.0 if is_known else np.median(samples[mean])),
                e1=samples[e1],
                e2=samples[e2],
                is_informed=quantity is not None and quantity.verdict in INFORMED,
            )
        )
    marker = marker_of(alpha_star_answer(identification), identification)
    return partial(ellipse_figure, panels, unit=unit, alpha_star=marker)


def _shown_in_pairs(
    identification: Identification, quantities: Sequence[Quantity]
) -> list[Quantity]:
    """What varies and may be quoted."""
    posterior = identification.posterior
    is_known = identification.config.push.length_known
    return [
        q
        for q in quantities
        if (is_known or q.name not in STIFFNESSES)
        and _varies(posterior.samples.get(q.name))
        and _varies(posterior.prior_samples.get(q.name))
    ]


def _varies(draws: Float[np.ndarray, " n"] | None) -> bool:
    return draws is not None and bool(np.nanstd(draws) > 0)


def _residuals(identification: Identification) -> Maker:
    fit, table = identification.fit, identification.table
    rows = np.array(fit.row, dtype=int)
    pairs = zip(fit.channel, fit.row, strict=True)
    observed = np.array([table.heights(channel)[row] for channel, row in pairs])
    return partial(
        residual_figure,
        (observed - fit.predicted) / fit.sigma,
        fit.predicted,
        theta_deg=np.degrees(table.theta)[rows],
        alpha_deg=np.degrees(table.alpha)[rows],
        row=rows,
        channels=fit.channel,
        unit=table.unit,
    )
