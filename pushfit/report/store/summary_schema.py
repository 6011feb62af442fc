"""What `summary.json` holds, declared once: its schema is made from these records.

The identifier of the schema changes when a reader of the old one would break. Excluded:
the values (`pushfit.report.store.summary`).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, Literal, TypeVar, get_args

from pydantic import Field, TypeAdapter
from pydantic.fields import FieldInfo

from pushfit.data.text.files import Source
from pushfit.fit.results import (
    Combination,
    FitStatus,
    GoodnessOfFit,
    MechanicsAnswer,
    Mode,
    Quantity,
    Recipe,
    ResultWarning,
)
from pushfit.parameters import SensorUnit
from pushfit.report.frames import Correlation

SUMMARY_SCHEMA = "pushfit.summary/2"
DIALECT = "https://json-schema.org/draft/2020-12/schema"

T = TypeVar("T")


def _one_of(*words: str) -> FieldInfo:
    return Field(json_schema_extra={"enum": list(words)})


Status = Annotated[str, _one_of(*(status.name.lower() for status in FitStatus))]
HeightUnit = Annotated[str, _one_of(*get_args(SensorUnit))]
# By name, which is therefore no part of the entry itself.
Quantities = Mapping[str, Quantity]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sentences:
    """The two answers in words.

    Args:
        theta_c: The critical angle.
        alpha_star: The best push direction.
    """

    theta_c: str
    alpha_star: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The least-squares fit and all its optima.

    Args:
        status: "ok", or why the estimate is not to be trusted.
        chi_square: Sum of squared weighted residuals at the best fit.
        n_data: Number of residuals of data.
        n_free: Number of data coordinates that only the data hold.
        singular_values: Of the Jacobian of the residuals, descending.
        sigma: Smallest and largest sd of the heights [height_unit].
        modes: Every local optimum found, best first.
    """

    status: Status
    chi_square: float
    n_data: int
    n_free: int
    singular_values: tuple[float, ...]
    sigma: tuple[float, float]
    modes: tuple[Mode, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """Convergence of a chain in numbers.

    Args:
        n_ensembles: Independent ensembles.
        n_walkers: Walkers per ensemble.
        n_steps: Steps kept per walker.
        autocorr_time: Integrated autocorrelation time by name [steps].
        ess: Effective sample size by name, over all ensembles.
        rhat: Nested R-hat by name, across ensembles.
        acceptance_fraction: Share of moves accepted, mean over the walkers.
        problems: Sentences, one per failed check; none where it has converged.
    """

    n_ensembles: int
    n_walkers: int
    n_steps: int
    autocorr_time: Mapping[str, float]
    ess: Mapping[str, float]
    rhat: Mapping[str, float]
    acceptance_fraction: float
    problems: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Posterior:
    """How the posterior was computed and whether it may be believed.

    Args:
        engine: "sweep" or "emcee".
        status: "ok", or why no interval is to be quoted.
        n_draws: Number of draws.
        log_evidence: Log marginal likelihood; null where unknown.
        log_evidence_error: Its standard error.
        ess: Effective number of the weighted draws of the sweep; null where emcee alone
            was asked.
        pareto_k: Shape of the tail of their weights; likewise.
        diagnostics: Convergence of a chain; null for the sweep.
    """

    engine: str
    status: Status
    n_draws: int
    log_evidence: float | None
    log_evidence_error: float | None
    ess: float | None
    pareto_k: float | None
    diagnostics: Chain | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Identifiability:
    """What the data can and cannot tell.

    Args:
        rank: Number of directions that the data fix.
        n_parameters: Number of free parameters.
        directions: Directions in the logs of the parameters, best determined first.
        advice: Sentences: one measurement each and what it would determine.
    """

    rank: int
    n_parameters: int
    directions: tuple[Combination, ...]
    advice: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Summary:
    """What an identification found. Unknown is null, as is the open end of a set.

    Args:
        schema: Identifier of this form.
        status: "ok", or why no number is to be trusted.
        status_text: The same in words.
        n_pushes: Pushes in the table.
        n_used: Pushes that entered the fit.
        height_unit: Unit of the heights.
        sentences: The two answers in words.
        by_mechanics: Answers of all mechanics computed; the first one leads, and
            everything else is by it.
        theta_c_deg: Critical angle at `reference_alpha_deg` [deg].
        reference_alpha_deg: Azimuth at which it is quoted [deg].
        alpha_star_deg: Best push direction [deg].
        alpha_star_model_free_deg: The same from a cosine fit to the heights [deg]; null
            without an azimuth sweep.
        parameters: The parameters and sigma by name, each in its own unit.
        combinations: A, B and other combinations that the data meet, by name.
        correlations: Strong ones among parameters, and among combinations.
        goodness_of_fit: Whether the model describes the heights.
        fit: Least squares.
        posterior: How the draws were made.
        identifiability: What the data can and cannot tell.
        warnings: What to know before a number is quoted.
        notes: What was recognised, left out or filled in.
        inputs: Files behind the table.
        recipe: Which inputs are what, for `pushfit verify`; null for a table made in
            Python.
        config: The configuration in force, by section and key.
        seed: Seed of all randomness.
        versions: Versions of what computed, of Python, and the platform.
    """

    schema: Literal["pushfit.summary/2"] = SUMMARY_SCHEMA
    status: Status
    status_text: str
    n_pushes: int
    n_used: int
    height_unit: HeightUnit
    sentences: Sentences
    by_mechanics: tuple[MechanicsAnswer, ...]
    theta_c_deg: Quantity
    reference_alpha_deg: float
    alpha_star_deg: Quantity
    alpha_star_model_free_deg: Quantity | None
    parameters: Quantities
    combinations: Quantities
    correlations: tuple[Correlation, ...]
    goodness_of_fit: GoodnessOfFit
    fit: Fit
    posterior: Posterior
    identifiability: Identifiability
    warnings: tuple[ResultWarning, ...]
    notes: tuple[str, ...]
    inputs: tuple[Source, ...]
    recipe: Recipe | None
    config: Mapping[str, Any]
    seed: int
    versions: Mapping[str, str]


def made_of(kind: type[T], source: object, **own: object) -> T:
    """A record with what another has under the same names, and parts of its own."""
    names = [field.name for field in fields(kind)]  # pyright: ignore
    shared = {n: getattr(source, n) for n in names if hasattr(source, n)}
    return kind(**shared | own)


def summary_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of `summary.json`."""
    schema = TypeAdapter(Summary).json_schema()
    del schema["$defs"]["Quantity"]["properties"]["name"]
    return {"$schema": DIALECT, "$id": SUMMARY_SCHEMA, **_strict(schema)}


def _strict(node: Any) -> Any:
    """The same with nothing left out or added, and null for a number not known."""
    if isinstance(node, list):
        return [_strict(item) for item in node]
    if not isinstance(node, dict):
        return node
    strict = {k: _strict(v) for k, v in node.items() if k not in ("default", "title")}
    if strict.get("type") == "number":
        strict["type"] = ["number", "null"]
    if isinstance(strict.get("properties"), dict):
        required = list(strict["properties"])
        strict |= {"required": required, "additionalProperties": False}
    return strict


if __name__ == "__main__":
    print(json.dumps(summary_schema(), indent=2))
