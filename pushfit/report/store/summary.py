"""`summary.json`: everything that the reports say, as one JSON-safe dictionary."""

from dataclasses import fields
from typing import Any

import numpy as np

from pushfit.fit.results import (
    Diagnostics,
    FitResult,
    Identification,
    PosteriorResult,
)
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.frames import correlations
from pushfit.report.plain import Json, json_safe
from pushfit.report.store.document import (
    Chain,
    Fit,
    Identifiability,
    Posterior,
    Sentences,
    Summary,
)

ANGLES = ("theta_c_deg", "alpha_star_deg", "alpha_star_model_free_deg")


def summary_dict(identification: Identification) -> dict[str, Json]:
    """All that an identification says, ready for `json.dumps`.

    Returns:
        Dictionary of the form of `summary_schema`.
    """
    content: Any = json_safe(_summary(identification))
    entries = [content[angle] for angle in ANGLES if content[angle] is not None]
    for group in (content["parameters"], content["combinations"]):
        entries += group.values()
    entries += [answer["theta_c"] for answer in content["by_mechanics"]]
    for entry in entries:
        del entry["name"]  # the key says it
    return content


def _summary(identification: Identification) -> Summary:
    status = identification.status
    found, table = identification.identifiability, identification.table

    return Summary(
        status=status.name.lower(),
        status_text=status.value,
        n_pushes=table.n_pushes,
        n_used=int(np.sum(identification.used)),
        height_unit=table.unit,
        sentences=Sentences(
            theta_c=theta_c_answer(identification).sentence,
            alpha_star=alpha_star_answer(identification).sentence,
        ),
        by_mechanics=identification.by_mechanics,
        theta_c_deg=identification.theta_c,
        reference_alpha_deg=identification.reference_alpha_deg,
        alpha_star_deg=identification.alpha_star,
        alpha_star_model_free_deg=identification.alpha_star_model_free,
        parameters={q.name: q for q in identification.parameters},
        combinations={q.name: q for q in identification.combinations},
        correlations=correlations(identification),
        goodness_of_fit=identification.goodness_of_fit,
        fit=_fit(identification.fit),
        posterior=_posterior(identification.posterior),
        identifiability=Identifiability(
            rank=found.rank,
            n_parameters=found.n_parameters,
            directions=found.combinations,
            advice=found.advice,
        ),
        warnings=identification.warnings,
        notes=table.notes,
        inputs=table.sources,
        recipe=identification.recipe,
        config=identification.config.model_dump(mode="json"),
        seed=identification.seed,
        versions=identification.versions,
    )


def _fit(fit: FitResult) -> Fit:
    return Fit(
        status=fit.status.name.lower(),
        chi_square=fit.chi_square,
        n_data=fit.n_data,
        n_free=fit.n_free,
        singular_values=tuple(fit.singular_values.tolist()),
        sigma=(
            float(np.min(fit.sigma, initial=np.inf)),
            float(np.max(fit.sigma, initial=-np.inf)),
        ),
        modes=fit.modes,
    )


def _posterior(posterior: PosteriorResult) -> Posterior:
    diagnostics = posterior.diagnostics
    return Posterior(
        engine=posterior.engine,
        status=posterior.status.name.lower(),
        n_draws=int(posterior.log_prob.size),
        log_evidence=posterior.log_evidence,
        log_evidence_error=posterior.log_evidence_error,
        ess=posterior.ess,
        pareto_k=posterior.pareto_k,
        diagnostics=None if diagnostics is None else _chain(diagnostics),
    )


def _chain(diagnostics: Diagnostics) -> Chain:
    parts = {part.name: getattr(diagnostics, part.name) for part in fields(Chain)}
    parts["acceptance_fraction"] = float(np.mean(diagnostics.acceptance_fraction))
    return Chain(**parts)
