"""`summary.json`: everything that the reports say, as one JSON-safe dictionary."""

from dataclasses import fields, replace
from typing import Any

import numpy as np

from pushfit.fit.assess.reporting_rules import quoted
from pushfit.fit.results import (
    Diagnostics,
    FitResult,
    Identification,
    PosteriorResult,
    Quantity,
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
    """The document with records where the file has objects."""
    free, status = identification.alpha_star_model_free, identification.status
    found, table = identification.identifiability, identification.table

    def shown(quantities: tuple[Quantity, ...]) -> dict[str, Quantity]:
        return {q.name: quoted(q, identification) for q in quantities}

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
        by_mechanics=tuple(
            replace(answer, theta_c=quoted(answer.theta_c, identification))
            for answer in identification.by_mechanics
        ),
        theta_c_deg=quoted(identification.theta_c, identification),
        reference_alpha_deg=identification.reference_alpha_deg,
        alpha_star_deg=quoted(identification.alpha_star, identification),
        alpha_star_model_free_deg=(
            None if free is None else quoted(free, identification)
        ),
        parameters=shown(identification.parameters),
        combinations=shown(identification.combinations),
        correlations=correlations(identification),
        goodness_of_fit=identification.goodness_of_fit,
        fit=_fit(
            identification.fit, has_length=identification.config.push.length_known
        ),
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


def _fit(fit: FitResult, *, has_length: bool) -> Fit:
    """The fit; stiffnesses, which need a push length, are among the coordinates."""
    modes = fit.modes if has_length else [replace(m, coordinates={}) for m in fit.modes]
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
        modes=tuple(modes),
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
