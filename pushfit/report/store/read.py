"""A result folder read back: the same record that wrote it, nothing computed again.

Excluded: numbers that were not to be quoted, which are not in the folder.
"""

import itertools
import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from pydantic import ValidationError

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.data.tables.traces import ComponentTrace, SignedHeights, Trace
from pushfit.errors import DataError, PushfitError
from pushfit.fit.results import (
    Band,
    Diagnostics,
    FitResult,
    FitStatus,
    IdentifiabilityResult,
    Identification,
    LikelihoodProfile,
    PosteriorResult,
    Verdict,
)
from pushfit.report.json_values import from_json
from pushfit.report.store.archive import CURVES, SIGNED_COLUMNS, one_row
from pushfit.report.store.output_folder import EXPLORED
from pushfit.report.store.summary import quantities_in
from pushfit.report.store.summary_schema import SUMMARY_SCHEMA, Fit, Summary, made_of

if TYPE_CHECKING:
    from xarray import Dataset

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
        fault = getattr(error, "strerror", None) or error
        reason = (
            f"not a result, because {path.name} cannot be read ({fault}); name the "
            "folder of a result"
        )
        if (Path(folder) / "batch.sqlite").exists():
            reason = (
                "is the folder of a batch, and its page is report.html; name the "
                "result of an item in items/, which a batch writes where folders are "
                "asked for"
            )
        raise DataError(f"{folder}: {reason}", code="not_a_result") from error
    schema = summary.get("schema") if isinstance(summary, dict) else None
    if schema != SUMMARY_SCHEMA:
        raise DataError(
            f"{path}: has the schema {schema!r}, and this version knows "
            f"{SUMMARY_SCHEMA!r}; use the version of pushfit that wrote it",
            code="other_schema",
        )
    return summary


def read_extra(folder: str | Path) -> dict[str, bytes]:
    """Journal and picture of an explored grasp, which no identification makes."""
    paths = [Path(folder) / name for name in EXPLORED]
    return {path.name: path.read_bytes() for path in paths if path.exists()}


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
        for name, entry in quantities_in(summary):
            entry["name"] = name
        document: Summary = from_json(Summary, summary)
        for name in ("peaks.csv", "result.nc"):
            if not (folder / name).exists():
                raise FileNotFoundError(f"{name} is missing")
        table = read_table(folder / "peaks.csv")
        with open_datatree(folder / "result.nc", engine="h5netcdf") as tree:
            groups = {name: node.to_dataset() for name, node in tree.children.items()}
            return _identification(document, table, groups)
    except (*BROKEN, PushfitError) as error:
        raise not_whole(folder, error) from error


def not_whole(folder: Path, error: Exception) -> DataError:
    """What to say of a folder in which a part is missing or broken."""
    fault = str(error).partition("\n")[0]
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        fault = f"summary.json, {place}: {first['msg']}"
    elif isinstance(error, KeyError):
        fault = f"{fault} is missing"
    return DataError(
        f"{folder}: not a whole result ({fault}); restore it, or make it again with "
        "`force=True`",
        code="result_not_whole",
    )


def _identification(
    document: Summary, table: PeakTable, groups: Groups
) -> Identification:
    if table.n_pushes != document.n_pushes:
        raise ValueError(
            f"peaks.csv has {table.n_pushes} pushes of {document.n_pushes}"
        )
    table = replace(
        table, sources=document.inputs, notes=document.notes, traces=_traces(groups)
    )
    return made_of(
        Identification,
        document,
        table=table,
        used=table.is_used,
        config=GraspConfig.model_validate(document.config),
        fit=_fit(document.fit, groups),
        posterior=_posterior(document, groups),
        theta_c=document.theta_c_deg,
        alpha_star=document.alpha_star_deg,
        alpha_star_model_free=document.alpha_star_model_free_deg,
        parameters=tuple(document.parameters.values()),
        combinations=tuple(document.combinations.values()),
        profiles=_profiles(groups),
        identifiability=made_of(IdentifiabilityResult, document.identifiability),
        bands=_bands(groups),
        status=_status(document.status),
        versions=dict(document.versions),
    )


def _status(word: str) -> FitStatus:
    return FitStatus[word.upper()]


def _fit(fit: Fit, groups: Groups) -> FitResult:
    stored = groups["fit"]
    arrays = ("estimate", "covariance", "jacobian", "sigma", "predicted")
    return made_of(
        FitResult,
        fit,
        names=_words(stored, "coordinate"),
        singular_values=np.array(fit.singular_values),
        channel=_words(stored, "datum"),
        row=tuple(int(row) for row in stored["row"].to_numpy()),
        status=_status(fit.status),
        **{name: _array(stored, name) for name in arrays},
    )


def _posterior(document: Summary, groups: Groups) -> PosteriorResult:
    posterior, ensembles = document.posterior, groups.get("ensembles")
    chain, names, thin = None, (), 1
    diagnostics = posterior.diagnostics
    if ensembles is not None:
        chain, thin = _array(ensembles, "chain"), int(ensembles.attrs["thin"])
        names = _words(ensembles, "coordinate")
    if diagnostics is not None:
        accepted = _array(groups["ensembles"], "acceptance_fraction")
        diagnostics = made_of(Diagnostics, diagnostics, acceptance_fraction=accepted)
    return made_of(
        PosteriorResult,
        posterior,
        samples=_draws(groups["posterior"]),
        prior_samples=_draws(groups["prior"]),
        log_prob=one_row(_array(groups["sample_stats"], "lp")),
        chain=chain,
        chain_names=names,
        thin=thin,
        diagnostics=diagnostics,
        seed=document.seed,
        status=_status(posterior.status),
    )


def _array(group: "Dataset", name: str) -> Float[np.ndarray, "..."]:
    return group[name].to_numpy().astype(float)


def _words(group: "Dataset", name: str) -> tuple[str, ...]:
    return tuple(str(word) for word in group[name].to_numpy())


def _draws(group: "Dataset") -> dict[str, Float[np.ndarray, " n"]]:
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
            pieces=tuple(map(tuple, json.loads(attributes["pieces"]))),
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
                components=tuple(_components(groups, index)),
            )
        )
    return tuple(traces)


def _components(groups: Groups, index: int) -> Iterator[ComponentTrace]:
    """Force components of one trace, in order."""
    # One channel has none, nor have results of before they were drawn.
    stored = groups.get("components")
    keys = (f"{index}_{k}" for k in itertools.count())
    for key in keys:
        if stored is None or f"component_{key}" not in stored:
            return
        samples = stored[f"component_{key}"]
        heights = stored[f"heights_{key}"].to_numpy()
        yield ComponentTrace(
            name=samples.attrs["name"],
            time=_array(stored, f"time_{key}"),
            signal=_array(stored, f"component_{key}"),
            is_jerk=stored[f"is_jerk_{key}"].to_numpy().astype(bool),
            heights=SignedHeights(**dict(zip(SIGNED_COLUMNS, heights, strict=True))),
        )
