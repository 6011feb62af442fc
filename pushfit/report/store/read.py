"""A result folder read back: the same record that wrote it, nothing computed again.

Numbers that were not to be quoted are not in the folder, and so not in the record.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

import numpy as np
from pydantic import TypeAdapter

from pushfit.config import GraspConfig
from pushfit.data.recordings.records import Source
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.data.tables.traces import Trace
from pushfit.errors import DataError
from pushfit.fit.results import (
    Band,
    Combination,
    Diagnostics,
    FitResult,
    FitStatus,
    GoodnessOfFit,
    IdentifiabilityResult,
    Identification,
    LikelihoodProfile,
    MechanicsAnswer,
    Mode,
    Piece,
    PosteriorResult,
    Quantity,
    Recipe,
    ResultWarning,
    Verdict,
)
from pushfit.report.store.archive import CURVES, one_row
from pushfit.report.store.document import SCHEMA

if TYPE_CHECKING:
    from xarray import Dataset

T = TypeVar("T")
Groups = Mapping[str, "Dataset"]

# What a file that was cut, changed or written by another version makes readers raise.
BROKEN = (
    *(OSError, RuntimeError, KeyError, ValueError),
    *(TypeError, AttributeError, IndexError),
)


def read_summary(folder: str | Path) -> dict[str, Any]:
    """`summary.json` of a result folder.

    Raises:
        DataError: The folder holds no result, or one of another schema.
    """
    path = Path(folder) / "summary.json"
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DataError(
            f"{folder}: not a result, because {path.name} cannot be read "
            f"({error}); name a folder that --out wrote",
            code="not_a_result",
        ) from error
    schema = summary.get("schema") if isinstance(summary, dict) else None
    if schema != SCHEMA:
        raise DataError(
            f"{path}: has the schema {schema!r}, and this version knows {SCHEMA!r}; "
            "use the version of pushfit that wrote it",
            code="other_schema",
        )
    return summary


def read_result(folder: str | Path) -> Identification:
    """The result that a folder holds.

    Raises:
        DataError: The folder is no result (`not_a_result`), lacks a part
            (`result_not_whole`) or is of another schema (`other_schema`).
    """
    from xarray import open_datatree

    folder = Path(folder)
    summary = read_summary(folder)
    try:
        table = read_table(folder / "peaks.csv")
        with open_datatree(folder / "result.nc", engine="h5netcdf") as tree:
            groups = {name: node.to_dataset() for name, node in tree.children.items()}
            return _identification(summary, table, groups)
    except (*BROKEN, DataError) as error:
        raise not_whole(folder, error) from error


def not_whole(folder: Path, error: Exception) -> DataError:
    """What to say of a folder in which a part is missing or broken."""
    return DataError(
        f"{folder}: not a whole result ({type(error).__name__}: {error}); restore it, "
        "or make it again with --force",
        code="result_not_whole",
    )


def _identification(
    summary: dict[str, Any], table: PeakTable, groups: Groups
) -> Identification:
    if table.n_pushes != summary["n_pushes"]:
        raise ValueError(
            f"peaks.csv has {table.n_pushes} pushes of {summary['n_pushes']}"
        )
    table = replace(
        table,
        sources=_records(Source, summary["inputs"]),
        notes=tuple(summary["notes"]),
        traces=_traces(groups),
    )
    recipe, free = summary["recipe"], summary["alpha_star_model_free_deg"]
    return Identification(
        table=table,
        used=table.is_used,
        config=GraspConfig.model_validate(summary["config"]),
        fit=_fit(summary["fit"], groups),
        posterior=_posterior(summary, groups),
        by_mechanics=_records(
            MechanicsAnswer,
            [
                answer | {"theta_c": answer["theta_c"] | {"name": "theta_c"}}
                for answer in summary["by_mechanics"]
            ],
        ),
        theta_c=_quantity("theta_c", summary["theta_c_deg"]),
        reference_alpha_deg=float(summary["reference_alpha_deg"]),
        alpha_star=_quantity("alpha_star", summary["alpha_star_deg"]),
        alpha_star_model_free=None
        if free is None
        else _quantity("alpha_star_model_free", free),
        parameters=_quantities(summary["parameters"]),
        combinations=_quantities(summary["combinations"]),
        profiles=_profiles(groups),
        identifiability=_identifiability(summary["identifiability"]),
        goodness_of_fit=_record(GoodnessOfFit, summary["goodness_of_fit"]),
        bands=_bands(groups),
        warnings=_records(ResultWarning, summary["warnings"]),
        status=_status(summary["status"]),
        seed=summary["seed"],
        versions=dict(summary["versions"]),
        recipe=None if recipe is None else _record(Recipe, recipe),
    )


def _status(word: str) -> FitStatus:
    return FitStatus[word.upper()]


def _number(value: float | None) -> float:
    """JSON has no NaN."""
    return np.nan if value is None else float(value)


def _record(kind: type[T], fields: Mapping[str, Any]) -> T:
    """A record of plain values, lists of JSON being its tuples."""
    hints = get_type_hints(kind)
    filled = {
        name: _number(value) if hints.get(name) is float else value
        for name, value in fields.items()
    }
    return TypeAdapter(kind).validate_python(filled)


def _records(kind: type[T], entries: Sequence[Mapping[str, Any]]) -> tuple[T, ...]:
    return tuple(_record(kind, entry) for entry in entries)


def _pieces(pieces: list[list[float | None]]) -> tuple[Piece, ...]:
    return tuple((low, high) for low, high in pieces)


def _quantities(group: Mapping[str, Any]) -> tuple[Quantity, ...]:
    return tuple(_quantity(name, fields) for name, fields in group.items())


def _quantity(name: str, fields: Mapping[str, Any]) -> Quantity:
    return _record(Quantity, {**fields, "name": name})


def _identifiability(fields: Mapping[str, Any]) -> IdentifiabilityResult:
    return IdentifiabilityResult(
        combinations=_records(Combination, fields["directions"]),
        rank=fields["rank"],
        n_parameters=fields["n_parameters"],
        advice=tuple(fields["advice"]),
    )


def _fit(fields: Mapping[str, Any], groups: Groups) -> FitResult:
    stored = groups["fit"]
    return FitResult(
        names=_words(stored, "coordinate"),
        estimate=_array(stored, "estimate"),
        covariance=_array(stored, "covariance"),
        jacobian=_array(stored, "jacobian"),
        singular_values=np.array([_number(v) for v in fields["singular_values"]]),
        modes=_records(Mode, fields["modes"]),
        chi_square=_number(fields["chi_square"]),
        n_data=fields["n_data"],
        n_free=fields["n_free"],
        sigma=_array(stored, "sigma"),
        predicted=_array(stored, "predicted"),
        channel=_words(stored, "datum"),
        row=tuple(int(row) for row in stored["row"].to_numpy()),
        status=_status(fields["status"]),
    )


def _posterior(summary: Mapping[str, Any], groups: Groups) -> PosteriorResult:
    fields = summary["posterior"]
    has_chain = "ensembles" in groups
    diagnostics = fields["diagnostics"]
    if diagnostics is not None:
        accepted = _array(groups["ensembles"], "acceptance_fraction")
        numbers: dict[str, Any] = {
            name: {key: _number(value) for key, value in diagnostics[name].items()}
            for name in ("autocorr_time", "ess", "rhat")
        }
        numbers["acceptance_fraction"] = accepted
        numbers["problems"] = tuple(diagnostics["problems"])
        diagnostics = Diagnostics(**diagnostics | numbers)
    return PosteriorResult(
        samples=_draws(groups["posterior"]),
        prior_samples=_draws(groups["prior"]),
        log_prob=one_row(_array(groups["sample_stats"], "lp")),
        chain=_array(groups["ensembles"], "chain") if has_chain else None,
        chain_names=_words(groups["ensembles"], "coordinate") if has_chain else (),
        thin=int(groups["ensembles"].attrs["thin"]) if has_chain else 1,
        engine=fields["engine"],
        diagnostics=diagnostics,
        log_evidence=fields["log_evidence"],
        log_evidence_error=fields["log_evidence_error"],
        seed=summary["seed"],
        status=_status(fields["status"]),
        ess=fields["ess"],
        pareto_k=fields["pareto_k"],
    )


def _array(group: "Dataset", name: str) -> np.ndarray:
    return group[name].to_numpy().astype(float)


def _words(group: "Dataset", name: str) -> tuple[str, ...]:
    return tuple(str(word) for word in group[name].to_numpy())


def _draws(group: "Dataset") -> dict[str, np.ndarray]:
    return {str(name): one_row(_array(group, str(name))) for name in group.data_vars}


def _profiles(groups: Groups) -> dict[str, LikelihoodProfile]:
    profiles = {}
    for key, curve in groups["profiles"].data_vars.items():
        name, attributes = str(key), curve.attrs
        profiles[name] = LikelihoodProfile(
            name=name,
            unit=attributes["units"],
            values=_array(groups["profiles"], f"{name}_value"),
            delta_chi_square=_array(groups["profiles"], name),
            pieces=_pieces(json.loads(attributes["pieces"])),
            prob=float(attributes["prob"]),
            verdict=Verdict(attributes["verdict"]),
            degrees_of_freedom=float(attributes["degrees_of_freedom"]),
        )
    return profiles


def _bands(groups: Groups) -> tuple[Band, ...]:
    bands, stored = [], groups["bands"]
    for index in range(len(stored.data_vars)):
        curves = stored[f"band_{index}"]
        bands.append(
            Band(
                channel=curves.attrs["channel"],
                swept=curves.attrs["swept"],
                fixed_deg=float(curves.attrs["fixed_deg"]),
                angle_deg=_array(stored, f"angle_{index}"),
                prob=float(curves.attrs["prob"]),
                rows=tuple(json.loads(curves.attrs["rows"])),
                **dict(zip(CURVES, curves.to_numpy(), strict=True)),
            )
        )
    return tuple(bands)


def _traces(groups: Groups) -> tuple[Trace, ...]:
    traces, stored = [], groups["traces"]
    for index in range(len(stored.data_vars)):
        attributes = stored[f"trace_{index}"].attrs
        traces.append(
            Trace(
                path=attributes["path"],
                name=attributes["name"],
                unit=attributes["units"],
                time=_array(stored, f"time_{index}"),
                signal=_array(stored, f"trace_{index}"),
                first_row=int(attributes["first_row"]),
                n_rows=int(attributes["n_rows"]),
                # Results of before baselines were turned do not say it.
                sign=int(attributes.get("sign", 1)),
            )
        )
    return tuple(traces)
