"""`summary.json`: everything that the reports say, as one JSON-safe dictionary.

The schema beside this module is the contract; its identifier changes when a reader of
the old one would break. Unknown is null, an open end of a set is null.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from importlib import resources

import numpy as np

from pushfit.fit.quoting import quoted
from pushfit.fit.results import (
    Diagnostics,
    IdentifiabilityResult,
    Identification,
    PosteriorResult,
    Quantity,
)
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.frames import correlations

SCHEMA = "pushfit.summary/2"

Json = dict[str, "Json"] | list["Json"] | str | int | float | bool | None


def summary_dict(identification: Identification) -> dict[str, Json]:
    """All that an identification says, ready for `json.dumps`.

    Args:
        identification: The result.

    Returns:
        Dictionary of the form of `summary_schema`.
    """
    free, recipe = identification.alpha_star_model_free, identification.recipe
    status = identification.status
    content = {
        "schema": SCHEMA,
        "status": status.name.lower(),
        "status_text": status.value,
        "n_pushes": identification.table.n_pushes,
        "n_used": int(np.sum(identification.used)),
        "height_unit": identification.table.unit,
        "sentences": {
            "theta_c": theta_c_answer(identification).sentence,
            "alpha_star": alpha_star_answer(identification).sentence,
        },
        "theta_c_deg": _quantity(identification.theta_c, identification),
        "reference_alpha_deg": identification.reference_alpha_deg,
        "alpha_star_deg": _quantity(identification.alpha_star, identification),
        "alpha_star_model_free_deg": (
            None if free is None else _quantity(free, identification)
        ),
        "parameters": {
            q.name: _quantity(q, identification) for q in identification.parameters
        },
        "combinations": {
            q.name: _quantity(q, identification) for q in identification.combinations
        },
        "correlations": [asdict(pair) for pair in correlations(identification)],
        "goodness_of_fit": asdict(identification.goodness_of_fit),
        "fit": _fit(identification),
        "posterior": _posterior(identification.posterior),
        "identifiability": _identifiability(identification.identifiability),
        "warnings": [asdict(notice) for notice in identification.warnings],
        "notes": list(identification.table.notes),
        "inputs": [asdict(source) for source in identification.table.sources],
        "recipe": None if recipe is None else asdict(recipe),
        "config": identification.config.model_dump(mode="json"),
        "seed": identification.seed,
        "versions": dict(identification.versions),
    }
    return {key: json_safe(value) for key, value in content.items()}


def summary_schema() -> dict[str, Json]:
    """JSON schema (draft 2020-12) of `summary.json`."""
    text = (
        resources.files("pushfit.report.store")
        .joinpath("summary.schema.json")
        .read_text()
    )
    return json.loads(text)


def json_safe(value: object) -> Json:
    """Value with NaN and infinity as null, tuples as lists, scalars as Python's own.

    Args:
        value: Mappings, sequences, arrays and scalars, nested.

    Returns:
        What `json.dumps(..., allow_nan=False)` accepts.
    """
    if isinstance(value, Mapping):
        return {str(key): json_safe(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return json_safe(value.tolist())
    if isinstance(value, list | tuple):
        return [json_safe(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int):
        # A lone surrogate, as in a file name that is not UTF-8, cannot be encoded.
        return _encodable(value) if isinstance(value, str) else value
    return str(value)


def _encodable(text: str) -> str:
    """Text with characters that UTF-8 lacks as escapes."""
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def _quantity(quantity: Quantity, identification: Identification) -> dict[str, object]:
    """One quantity, without what is not to be quoted."""
    shown: dict[str, object] = asdict(quoted(quantity, identification))
    del shown["name"]
    return shown | {"verdict": quantity.verdict.value}


def _fit(identification: Identification) -> dict[str, object]:
    """The least-squares fit and all its optima."""
    fit = identification.fit
    is_length_known = identification.config.push.length_known
    return {
        "status": fit.status.name.lower(),
        "chi_square": fit.chi_square,
        "n_data": fit.n_data,
        "n_free": fit.n_free,
        "singular_values": fit.singular_values,
        "sigma": [
            np.min(fit.sigma, initial=np.inf),
            np.max(fit.sigma, initial=-np.inf),
        ],
        "modes": [
            {
                "theta_c_deg": mode.theta_c_deg,
                "chi_square": mode.chi_square,
                # Stiffnesses are among the coordinates.
                "coordinates": mode.coordinates if is_length_known else {},
            }
            for mode in fit.modes
        ],
    }


def _posterior(posterior: PosteriorResult) -> dict[str, object]:
    """How the posterior was computed and whether it may be believed."""
    diagnostics = posterior.diagnostics
    return {
        "engine": posterior.engine,
        "status": posterior.status.name.lower(),
        "n_draws": int(posterior.log_prob.size),
        "log_evidence": posterior.log_evidence,
        "log_evidence_error": posterior.log_evidence_error,
        "ess": posterior.ess,
        "pareto_k": posterior.pareto_k,
        "diagnostics": None if diagnostics is None else _diagnostics(diagnostics),
    }


def _diagnostics(diagnostics: Diagnostics) -> dict[str, object]:
    """Convergence of a chain in numbers."""
    return {
        "n_ensembles": diagnostics.n_ensembles,
        "n_walkers": diagnostics.n_walkers,
        "n_steps": diagnostics.n_steps,
        "autocorr_time": diagnostics.autocorr_time,
        "ess": diagnostics.ess,
        "rhat": diagnostics.rhat,
        "acceptance_fraction": float(np.mean(diagnostics.acceptance_fraction)),
        "problems": list(diagnostics.problems),
    }


def _identifiability(result: IdentifiabilityResult) -> dict[str, object]:
    """What the data can and cannot tell."""
    return {
        "rank": result.rank,
        "n_parameters": result.n_parameters,
        "directions": [asdict(direction) for direction in result.combinations],
        "advice": list(result.advice),
    }
