"""`summary.json`: everything that the reports say, as one JSON-safe dictionary.

Excluded: its keys and their types (`pushfit.report.store.summary_schema`).
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from pushfit.fit.results import FitResult, Identification, PosteriorResult
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.frames import correlations
from pushfit.report.json_values import Json, json_safe
from pushfit.report.store.summary_schema import (
    Chain,
    Fit,
    Identifiability,
    Posterior,
    Sentences,
    Summary,
    made_of,
)

ANGLE_KEYS = ("theta_c", "alpha_star", "alpha_star_model_free")


def summary_dict(identification: Identification) -> dict[str, Json]:
    """All that an identification says, of the form of `summary_schema`."""
    content: Any = json_safe(_summary(identification))
    for _, entry in quantities_in(content):
        del entry["name"]  # the key says it
    return content


def quantities_in(content: Mapping[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name and entry of every quantity of a summary."""
    angles = ((name, content[f"{name}_deg"]) for name in ANGLE_KEYS)
    yield from ((name, entry) for name, entry in angles if entry is not None)
    yield from content["parameters"].items()
    yield from content["combinations"].items()
    yield from (("theta_c", answer["theta_c"]) for answer in content["by_mechanics"])


def _summary(identification: Identification) -> Summary:
    status = identification.status
    table = identification.table
    return made_of(
        Summary,
        identification,
        status=status.name.lower(),
        status_text=status.value,
        n_pushes=table.n_pushes,
        n_used=int(np.sum(identification.used)),
        height_unit=table.unit,
        sentences=Sentences(
            theta_c=theta_c_answer(identification).sentence,
            alpha_star=alpha_star_answer(identification).sentence,
        ),
        theta_c_deg=identification.theta_c,
        alpha_star_deg=identification.alpha_star,
        alpha_star_model_free_deg=identification.alpha_star_model_free,
        parameters={q.name: q for q in identification.parameters},
        combinations={q.name: q for q in identification.combinations},
        correlations=correlations(identification),
        fit=_fit(identification.fit),
        posterior=_posterior(identification.posterior),
        identifiability=made_of(Identifiability, identification.identifiability),
        notes=table.notes,
        inputs=table.sources,
        config=identification.config.model_dump(mode="json"),
    )


def _fit(fit: FitResult) -> Fit:
    return made_of(
        Fit,
        fit,
        status=fit.status.name.lower(),
        singular_values=tuple(fit.singular_values.tolist()),
        sigma=(
            float(np.min(fit.sigma, initial=np.inf)),
            float(np.max(fit.sigma, initial=-np.inf)),
        ),
    )


def _posterior(posterior: PosteriorResult) -> Posterior:
    chain = posterior.diagnostics
    if chain is not None:
        accepted = float(np.mean(chain.acceptance_fraction))
        chain = made_of(Chain, chain, acceptance_fraction=accepted)
    return made_of(
        Posterior,
        posterior,
        status=posterior.status.name.lower(),
        n_draws=int(posterior.log_prob.size),
        diagnostics=chain,
    )
