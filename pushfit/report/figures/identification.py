"""The figures of one identification: which arrays go where.

Everything is drawn by the functions beside this module; here is only the choice of what
to draw, so that text, page and figures mark the same answers.
"""

from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np

from pushfit.fit.profile_sets import threshold
from pushfit.fit.quoting import STIFFNESSES, is_trusted, quoted
from pushfit.fit.results import FitStatus, Identification, Quantity, Verdict
from pushfit.report.answers import (
    HALF_TURN,
    Answer,
    alpha_star_answer,
    theta_c_answer,
)
from pushfit.report.figures.diagnostics import residual_figure, trace_figure
from pushfit.report.figures.direction import Ellipses, ellipse_figure
from pushfit.report.figures.main import (
    main_figure,
    marker_of,
    sweep_figures,
    within_half_turn,
)
from pushfit.report.figures.pairs import corner_figure
from pushfit.report.figures.posterior import (
    learned_figure,
    quantity_figure,
)
from pushfit.report.figures.recording import signal_figure
from pushfit.report.figures.style import figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INFORMED = frozenset({Verdict.LEARNED, Verdict.PARTLY, Verdict.DETERMINED})


def all_figures(identification: Identification) -> dict[str, "Figure"]:
    """Every figure that a result supports, by the name of its file.

    Args:
        identification: The result.

    Returns:
        Figures; those of a posterior only where it is to be trusted, corner plots only
        where the library `corner` is installed.
    """
    figures = {"main": main_figure(identification)}
    for index, trace in enumerate(identification.table.traces, start=1):
        figures[f"recording_{index}"] = signal_figure(trace, identification.table)
    figures |= sweep_figures(identification)
    if identification.fit.status is FitStatus.OK:
        figures["residuals"] = _residuals(identification)
    if is_trusted(identification):
        figures |= _posterior_figures(identification)
    posterior = identification.posterior
    if posterior.chain is not None:
        diagnostics = posterior.diagnostics
        figures["traces"] = trace_figure(
            posterior.chain,
            posterior.chain_names,
            thin=posterior.thin,
            autocorr_time=diagnostics.autocorr_time if diagnostics else {},
        )
    return figures


def figure_files(
    identification: Identification,
    *,
    is_wanted: Callable[[str, str], bool] = lambda name, suffix: True,
) -> dict[str, bytes]:
    """Content of the files of all figures, each as PNG and SVG.

    Args:
        identification: The result.
        is_wanted: Whether a figure is wanted in a format, both by name.

    Returns:
        Content by file name, "main.png" and so on.
    """
    files = {}
    for name, figure in all_figures(identification).items():
        for suffix in filter(partial(is_wanted, name), ("png", "svg")):
            files[f"{name}.{suffix}"] = figure_bytes(figure, suffix)
    return files


def _posterior_figures(identification: Identification) -> dict[str, "Figure"]:
    """Figures of a posterior that is to be trusted."""
    figures = {}
    answers = (
        (identification.theta_c, theta_c_answer(identification)),
        (identification.alpha_star, alpha_star_answer(identification)),
    )
    for quantity, answer in answers:
        if answer.name in identification.posterior.samples:
            figures[answer.name] = _angle(identification, quantity, answer)
    if "f1" in identification.posterior.samples:
        figures["ellipse"] = _ellipse(identification)
    if identification.parameters:
        shown = [quoted(q, identification) for q in identification.parameters]
        figures["learned"] = learned_figure(
            [q.name for q in shown],
            np.array([_or_nan(q.contraction) for q in shown]),
            verdicts=[q.verdict.value for q in shown],
        )
    if find_spec("corner"):
        groups = {
            "corner_parameters": identification.parameters,
            "corner_combinations": identification.combinations,
        }
        for name, quantities in groups.items():
            figure = _corner(identification, quantities)
            if figure is not None:
                figures[name] = figure
    return figures


def _or_nan(value: float | None) -> float:
    """None as NaN."""
    return np.nan if value is None else value


def _angle(
    identification: Identification, quantity: Quantity, answer: Answer
) -> "Figure":
    """Profile and posterior of θ_c or α*."""
    posterior = identification.posterior
    draws = posterior.samples[answer.name]
    prior = posterior.prior_samples.get(answer.name, np.empty(0))
    profile = identification.profiles.get(answer.name)
    curve, pieces, freedom = None, (), np.inf
    if profile is not None:
        curve = (profile.values, profile.delta_chi_square)
        pieces, freedom = profile.pieces, profile.degrees_of_freedom
    modes = [m.theta_c_deg for m in identification.fit.modes if m.theta_c_deg]
    if answer.name == "alpha_star":
        # Draws, profile and sets of an axis may each start at another azimuth.
        draws, prior, modes = draws % HALF_TURN, prior % HALF_TURN, []
        pieces = within_half_turn(pieces)
        if curve is not None:
            values = curve[0] % HALF_TURN
            order = np.argsort(values)
            curve = (values[order], curve[1][order])
    return quantity_figure(
        curve,
        draws,
        prior,
        marker=marker_of(answer),
        likelihood_pieces=pieces,
        level=threshold(quantity.prob, freedom),
        prob=quantity.prob,
        modes=modes,
    )


def _ellipse(identification: Identification) -> "Figure":
    """The stiffness ellipses that the heights meet and of the support finger."""
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
    marker = marker_of(alpha_star_answer(identification))
    return ellipse_figure(panels, unit=unit, alpha_star=marker)


def _corner(
    identification: Identification, quantities: Sequence[Quantity]
) -> "Figure | None":
    """Corner plot of what varies and may be quoted; None for fewer than two."""
    posterior = identification.posterior
    is_known = identification.config.push.length_known
    shown = [
        q
        for q in quantities
        if (is_known or q.name not in STIFFNESSES)
        and _varies(posterior.samples.get(q.name))
        and _varies(posterior.prior_samples.get(q.name))
    ]
    if len(shown) < 2:
        return None
    return corner_figure(
        {q.name: posterior.samples[q.name] for q in shown},
        {q.name: posterior.prior_samples[q.name] for q in shown},
        units={q.name: q.unit for q in shown},
    )


def _varies(draws: np.ndarray | None) -> bool:
    """Whether there are draws and they differ."""
    return draws is not None and bool(np.nanstd(draws) > 0)


def _residuals(identification: Identification) -> "Figure":
    """Residuals of the best fit."""
    fit, table = identification.fit, identification.table
    rows = np.array(fit.row, dtype=int)
    observed = np.array(
        [table.heights(c)[r] for c, r in zip(fit.channel, fit.row, strict=True)]
    )
    return residual_figure(
        (observed - fit.predicted) / fit.sigma,
        fit.predicted,
        theta_deg=np.degrees(table.theta)[rows],
        alpha_deg=np.degrees(table.alpha)[rows],
        row=rows,
        channels=fit.channel,
        unit=table.unit,
    )
