"""A comparison of models for readers: text and JSON.

Excluded: the scores (`pushfit.fit.comparison`), and two results of one model
(`pushfit.report.text.difference`).
"""

import math
import textwrap
from collections.abc import Callable

from pushfit.config.rivals import NOISES
from pushfit.fit.comparison import Comparison, ModelScore
from pushfit.fit.results import FitStatus
from pushfit.report.json_values import Json, json_safe
from pushfit.report.strings import format_number, join_and

SCHEMA = "pushfit.compare/1"
# Columns of a terminal.
WIDTH = 80
# Larger factors are written as powers of ten.
PLAIN_FACTOR = 1e4


def comparison_text(comparison: Comparison) -> str:
    """Scores, and in plain words what they tell, in lines of at most 80 columns."""
    header = (
        f"{'':<14}{'describes':>9}{'ln evidence':>13}{'to best':>10}"
        f"{'elpd (LOO)':>18}{'to best':>16}"
    )
    lines = [
        *(_wrapped(sentence) for sentence in _warnings(comparison)),
        f"{comparison.n_pushes} pushes, {comparison.mechanics} mechanics, "
        f"noise {comparison.noise}, "
        f"engine {join_and(list(dict.fromkeys(m.engine for m in comparison.models)))}",
        "",
        header,
        *(_line(model) for model in comparison.models),
        "",
        *(_wrapped(sentence) for sentence in comparison_sentences(comparison)),
    ]
    return "\n".join(line.rstrip() for line in lines)


def comparison_sentences(comparison: Comparison) -> list[str]:
    """Which models the heights tell apart, by each criterion."""
    sentences = [
        f"The residuals have no {name} noise beside the constant one, so that this "
        "model is left out: it would be the one that is configured."
        for name in comparison.left_out
    ]
    if comparison.why_no_evidence is None:
        sentences += _told_apart(
            comparison,
            "By evidence",
            is_worse=lambda model: model.is_less_evident,
            reason=lambda model: _odds(model.log_bayes_factor),
        )
        sampled = [model_name(m) for m in comparison.models if m.log_evidence is None]
        if sampled:
            sentences.append(
                f"The posterior of {join_and(sampled)} is sampled, which gives no "
                "evidence; prediction compares it with the others."
            )
    else:
        sentences.append(
            f"There is no evidence to compare, because {comparison.why_no_evidence}."
        )
    sentences += _told_apart(
        comparison,
        "By predicting each push from the others",
        is_worse=lambda model: model.predicts_worse,
        reason=lambda model: (
            f"elpd lower by {-(model.elpd_difference or 0.0):.1f} ± "
            f"{model.elpd_difference_se:.1f}"
        ),
    )
    sound = [model for model in comparison.models if model.status is FitStatus.OK]
    unpredicted = [model_name(model) for model in sound if model.densities is None]
    if unpredicted:
        sentences.append(
            f"No push is predicted from the others by {join_and(unpredicted)}, whose "
            "effects are fitted to all pushes of a repeat."
        )
    for model in comparison.models:
        densities = model.densities
        if densities is not None and densities.n_unreliable:
            largest = float(densities.pareto_k.max())
            sentences.append(
                f"The elpd of {model_name(model)} is not reliable: "
                f"{densities.n_unreliable} of {densities.elpd.size} pushes have a "
                f"Pareto k above {densities.max_pareto_k:.2f}, "
                + (
                    f"the largest {largest:.2f}."
                    if math.isfinite(largest)
                    else "or draws so few that none can be told."
                )
            )
    return sentences


def comparison_dict(comparison: Comparison) -> dict[str, Json]:
    """The same as one JSON-safe document."""
    content = {
        "schema": SCHEMA,
        "status": comparison.status.name.lower(),
        "n_pushes": comparison.n_pushes,
        "mechanics": comparison.mechanics,
        "noise": comparison.noise,
        "seed": comparison.seed,
        "why_no_evidence": comparison.why_no_evidence,
        "models": {model.name: _entry(model) for model in comparison.models},
        "left_out": list(comparison.left_out),
        "sentences": [*_warnings(comparison), *comparison_sentences(comparison)],
    }
    return {key: json_safe(value) for key, value in content.items()}


def model_name(model: ModelScore) -> str:
    """Name of a model in prose."""
    name = model.name.replace("_", " ")
    if model.name in NOISES:
        return name
    if model.sharpness is None:
        return f"{name} (p free)"
    return name if math.isinf(model.sharpness) else f"{name} (p = {model.sharpness:g})"


def _warnings(comparison: Comparison) -> list[str]:
    sentences = [
        f"Do not use the numbers of {model_name(model)}: {model.status.value}."
        for model in comparison.models
        if model.status is not FitStatus.OK
    ]
    if not any(model.is_adequate for model in comparison.models):
        verdict = comparison.models[0].verdict
        name = model_name(comparison.models[0])
        sentences.append(
            "None of the models describes these heights within their noise; the best "
            f"of them is not for that reason right. Of {name}: {verdict}"
        )
    return sentences


def _told_apart(
    comparison: Comparison,
    criterion: str,
    *,
    is_worse: Callable[[ModelScore], bool | None],
    reason: Callable[[ModelScore], str],
) -> list[str]:
    """One sentence on the models that a criterion ranks; none with fewer than two."""
    ranked = [model for model in comparison.models if is_worse(model) is not None]
    if len(ranked) < 2:
        return []
    level = [model_name(model) for model in ranked if not is_worse(model)]
    worse = [f"{model_name(m)} ({reason(m)})" for m in ranked if is_worse(m)]
    alike = f"cannot tell {join_and(level)} apart"
    said = alike if len(level) > 1 else f"favour {level[0]}"
    against = f", and speak against {join_and(worse)}" if worse else ""
    return [f"{criterion} these heights {said}{against}."]


def _odds(log_bayes_factor: float | None) -> str:
    """Odds against a model from its log Bayes factor."""
    exponent = -(log_bayes_factor or 0.0) / math.log(10)
    if exponent < math.log10(PLAIN_FACTOR):
        return f"{format_number(10**exponent)} to 1"
    return f"10^{exponent:.0f} to 1"


def _line(model: ModelScore) -> str:
    describes = "yes" if model.is_adequate else "no"
    return (
        f"{model_name(model):<14}{describes:>9}{_number(model.log_evidence):>13}"
        f"{_number(model.log_bayes_factor):>10}"
        f"{_with_se(model.elpd_loo, model.elpd_loo_se):>18}"
        f"{_with_se(model.elpd_difference, model.elpd_difference_se):>16}"
    )


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _with_se(value: float | None, se: float | None) -> str:
    """A number with its standard error; that of the best is exactly 0."""
    if value is None:
        return "-"
    return f"{value:.1f} ± {se:.1f}" if se else f"{value:.1f}"


def _entry(model: ModelScore) -> dict[str, object]:
    densities = model.densities
    return {
        "sharpness": _transition(model.sharpness),
        "engine": model.engine,
        "status": model.status.name.lower(),
        "is_adequate": model.is_adequate,
        "verdict": model.verdict,
        "log_evidence": model.log_evidence,
        "log_evidence_error": model.log_evidence_error,
        "log_bayes_factor": model.log_bayes_factor,
        "elpd_loo": model.elpd_loo,
        "elpd_loo_se": model.elpd_loo_se,
        "p_loo": model.p_loo,
        "elpd_difference": model.elpd_difference,
        "elpd_difference_se": model.elpd_difference_se,
        "max_pareto_k": None if densities is None else float(densities.pareto_k.max()),
        "n_unreliable": None if densities is None else densities.n_unreliable,
    }


def _transition(sharpness: float | None) -> float | str:
    """As `[transition] sharpness` states it."""
    if sharpness is None:
        return "auto"
    return "hard" if math.isinf(sharpness) else sharpness


def _wrapped(sentence: str) -> str:
    return textwrap.fill(sentence, WIDTH, break_on_hyphens=False)
