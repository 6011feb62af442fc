"""What the reports state besides the two answers, as rows of words.

Text and page lay out the same rows, so that neither says more than the other. Excluded:
their layout (`pushfit.report.text.result`, `pushfit.report.html.result`).
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from pushfit.data.text.faults import listed
from pushfit.fit.assess.reporting_rules import is_trusted, pieces_for
from pushfit.fit.results import (
    Identification,
    MechanicsAnswer,
    PredictiveCheck,
    Quantity,
    Verdict,
)
from pushfit.mechanics.registry import mechanics_named
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.frames import correlations
from pushfit.report.strings import (
    format_angle,
    format_estimate,
    format_number,
    format_p_value,
    format_range,
    join_and,
    join_or,
    printable,
    symbol,
    unit_label,
    with_unit,
)

# The strongest are shown, and of outliers the first; summary.json has all.
MAX_CORRELATIONS = MAX_OUTLIERS = 8
# Quantities that are a set of several pieces or with an open end, and their value.
SEE_SET, UNQUOTED = "see set", "not quoted"
SET_VERDICTS = frozenset({Verdict.ONE_SIDED, Verdict.SEVERAL_MODES})

# Features that heights simulated from the posterior are compared in.
PREDICTIVE = {"scatter": "scatter", "largest": "largest residual", "pattern": "pattern"}
WORDS = {
    Verdict.LEARNED: "learned",
    Verdict.PARTLY: "partly learned",
    Verdict.ASSUMED: "assumed",
    Verdict.SEVERAL_MODES: "several modes",
    Verdict.ONE_SIDED: "one-sided",
    Verdict.NOT_DETERMINED: "not determined",
    Verdict.ABSENT: "does not exist",
    Verdict.UNKNOWN: "not known",
}


def verdict_word(verdict: Verdict) -> str:
    """Verdict as printed."""
    return WORDS.get(verdict, verdict.value)


def fit_rows(identification: Identification) -> list[tuple[str, str]]:
    """Statistics of the fit as pairs of words."""
    fit, quality = identification.fit, identification.goodness_of_fit
    unit = unit_label(identification.table.unit)
    channels = join_and([c.replace("_", " ") for c in identification.table.channels])
    is_preloaded = identification.config.grasp.preload[1] is not None
    rows = [
        ("data", f"{fit.n_data} values ({channels} in {unit}), {fit.n_free} free"),
        ("preload", "" if is_preloaded else "taken as 0, as none is stated"),
        (
            "chi-square",
            f"{format_number(quality.chi_square)} for "
            f"{max(quality.degrees_of_freedom, 0)} degrees of freedom"
            f"{_p_value(quality.p_value)}",
        ),
        ("R²", f"{quality.r_squared:.4f}" if np.isfinite(quality.r_squared) else ""),
        ("lack of fit", _p_value(quality.lack_of_fit_p_value).strip(", ")),
        ("pattern", _p_value(quality.pattern_p_value).strip(", ")),
        ("simulated", _predictive(quality.predictive)),
        ("outliers", listed(quality.outliers, MAX_OUTLIERS)),
        ("noise", _noise(identification)),
        ("optima", _optima(identification)),
        ("posterior", _posterior(identification)),
        ("seed", str(identification.seed)),
    ]
    return [(name, printable(text)) for name, text in rows if text]


def cannot_say(identification: Identification) -> list[str]:
    """What the data leave open and which measurement would close it, in sentences."""
    result, sentences = identification.identifiability, []
    parameters = identification.parameters if is_trusted(identification) else ()
    for verdict, words in (
        (Verdict.ASSUMED, "are those of the prior"),
        (Verdict.PARTLY, "lean on the prior"),
    ):
        names = join_and([symbol(q.name) for q in parameters if q.verdict is verdict])
        if names:
            sentences.append(f"{names}: the values {words}.")
    if result.rank < result.n_parameters:
        sentences.append(
            f"The heights fix {result.rank} of {result.n_parameters} directions in the "
            "space of the parameters."
        )
    if not identification.config.push.length_known:
        sentences.append(
            "The push length is unknown: heights compare directions, and no stiffness "
            "is quoted. Measure it and give push.length_mm."
        )
    sentences += [printable(advice) for advice in result.advice]
    return sentences


def quantity_cells(quantity: Quantity) -> tuple[str, str, str, str, str]:
    """Value, interval, unit, verdict and note of a quantity, as printed."""
    value, interval = UNQUOTED, ""
    if quantity.interval is not None:
        interval = format_range(*quantity.interval, "")
    is_set = quantity.verdict in SET_VERDICTS and bool(pieces_for(quantity))
    if is_set:
        value = SEE_SET
        interval = join_or([format_range(*piece, "") for piece in pieces_for(quantity)])
    elif quantity.estimate is not None and quantity.interval is not None:
        value, interval = format_estimate(quantity.estimate, quantity.interval, "")
    elif quantity.estimate is not None:
        value = format_number(quantity.estimate)
    if quantity.estimate is not None and quantity.verdict is Verdict.FIXED:
        value = f"{quantity.estimate:.6g}"
    is_shown = is_set or quantity.estimate is not None or not is_withheld(quantity)
    return (
        value,
        interval,
        unit_label(quantity.unit),
        verdict_word(quantity.verdict) if is_shown else "",
        printable(quantity.note),
    )


def is_withheld(quantity: Quantity) -> bool:
    """Whether a number that is left out is known, but may not be quoted."""
    is_noted = quantity.note.startswith(UNQUOTED)
    return is_noted or quantity.verdict is Verdict.DETERMINED


def _p_value(p_value: float | None) -> str:
    """Clause such as "p = 0.46" after a comma, or nothing."""
    if p_value is None or not np.isfinite(p_value):
        return ""
    return f", p {format_p_value(p_value)}"


def _predictive(checks: Sequence[PredictiveCheck]) -> str:
    parts = [f"{PREDICTIVE[c.feature]}{_p_value(c.p_value)}" for c in checks]
    return "; ".join(part.replace(", ", " ") for part in parts)


def _noise(identification: Identification) -> str:
    sigma = identification.fit.sigma
    sigma = sigma[np.isfinite(sigma)]
    if not sigma.size:
        return ""
    low, high = float(np.min(sigma)), float(np.max(sigma))
    ends = format_number(high)
    if high - low > 1e-3 * high:
        ends = f"{format_number(low)} to {ends}"
    return f"sd {with_unit(ends, identification.table.unit)}"


def _optima(identification: Identification) -> str:
    modes = identification.fit.modes
    if len(modes) < 2:
        return ""
    shown = []
    for mode in modes:
        angle = mode.theta_c_deg
        where = "none" if angle is None else format_angle(angle, spread=1.0)
        shown.append(f"θ_c {where} (χ² {mode.chi_square:.1f})")
    # Optima that differ in what no angle shows read alike.
    alike = [f"{n} × {text}" if n > 1 else text for text, n in Counter(shown).items()]
    return f"{len(modes)}: {', '.join(alike)}"


def _posterior(identification: Identification) -> str:
    posterior = identification.posterior
    diagnostics = posterior.diagnostics
    if diagnostics is None:
        return f"{posterior.engine}, {posterior.log_prob.size} draws"
    worst = {
        "τ ≤": (diagnostics.autocorr_time, np.max, ".0f"),
        "ESS ≥": (diagnostics.ess, np.min, ".0f"),
        "R-hat ≤": (diagnostics.rhat, np.max, ".3f"),
    }
    parts = [
        f"{label} {pick(list(values.values())):{form}}"
        for label, (values, pick, form) in worst.items()
        if values
    ]
    size = (
        f"{diagnostics.n_ensembles} ensembles × {diagnostics.n_walkers} walkers × "
        f"{diagnostics.n_steps} steps"
    )
    return ", ".join([posterior.engine, size, *parts, *diagnostics.problems])


def angle_rows(identification: Identification) -> list[tuple[str, str]]:
    """Both angles in short, the likelihood's sets beside them."""
    rows = []
    for quantity, answer in (
        (identification.theta_c, theta_c_answer(identification)),
        (identification.alpha_star, alpha_star_answer(identification)),
    ):
        text = answer.short
        sets = quantity.likelihood_sets
        if sets and is_trusted(identification):
            is_axis = identification.config.reach.is_whole
            ranges = join_or([format_range(*p, "deg", is_axis=is_axis) for p in sets])
            text += f"; likelihood alone: {ranges}"
        rows.append((symbol(answer.name), text))
    if len(identification.by_mechanics) > 1:
        unit = identification.table.unit
        rows += [_mechanics_row(one, unit) for one in identification.by_mechanics]
    return rows


def _mechanics_row(answer: MechanicsAnswer, unit: str) -> tuple[str, str]:
    theta_c = answer.theta_c
    ranges = [format_range(*piece, "deg") for piece in pieces_for(theta_c)]
    text = join_or(ranges) or UNQUOTED
    if theta_c.verdict is Verdict.ABSENT:
        text = verdict_word(theta_c.verdict)
    if theta_c.estimate is not None and theta_c.interval is not None:
        number, interval = format_estimate(theta_c.estimate, theta_c.interval, "deg")
        text = f"{number} ({interval})"
    parts = [text]
    if answer.rms_residual is not None:
        off = with_unit(format_number(answer.rms_residual), unit)
        parts.append(f"heights off by {off}, rms")
    if answer.log_evidence is not None:
        parts.append(f"ln evidence {answer.log_evidence:z.1f}")
    title = mechanics_named(answer.mechanics).title
    return f"θ_c, {title}", "; ".join(parts)


def correlation_rows(identification: Identification) -> list[tuple[str, str]]:
    """The strongest correlations."""
    found = correlations(identification)
    rows = [
        (f"{symbol(c.first)}, {symbol(c.second)}", f"{c.value:+.2f}")
        for c in found[:MAX_CORRELATIONS]
    ]
    left = len(found) - MAX_CORRELATIONS
    if left > 0:
        rows.append(("…", f"{left} weaker, in summary.json"))
    return rows
