"""Every array of a result as netCDF: draws, prior, observations, fit and pictures.

An `xarray.DataTree` in the ArviZ layout, so that any ArviZ function reads it: every
walker of emcee is a chain. In the group `ensembles` the chains are kept by ensemble, in
sampling coordinates, for the convergence checks of pushfit. With `summary.json` and
`peaks.csv` it is all that a report shows (`pushfit.report.store.read` reads it back).
Excluded: writing the file (`pushfit.report.store.folder`).
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from pushfit.fit.results import Identification, PosteriorResult
from pushfit.report.json_values import json_safe
from pushfit.report.store.summary_schema import SUMMARY_SCHEMA

if TYPE_CHECKING:
    from xarray import DataTree

# What makes an `xarray.Dataset`, which takes long to load.
DatasetParts = dict[str, Any]
# What ArviZ makes R-hat of by default.
INDEPENDENT_CHAINS = 4


def posterior_tree(identification: Identification) -> "DataTree":
    """Posterior with its prior, data, fit and provenance.

    Returns:
        Groups `posterior`, `prior`, `observed_data`, `sample_stats`, `fit`, `profiles`,
        `bands`, `traces`, of forces `components` and, from emcee, `ensembles`. The root
        says seed, versions, sha256 of the inputs, config, status and ci_prob; `status`
        other than "ok" means that no interval of these draws is to be quoted.
    """
    import arviz_base
    from xarray import Dataset, DataTree

    posterior, fit = identification.posterior, identification.fit
    table = identification.table
    rows, channel = np.array(fit.row, dtype=int), np.array(fit.channel)
    used = {name: rows[channel == name] for name in table.channels}
    pushes = table.frame["push"].to_numpy()
    n_chains = number_of_chains(posterior)
    tree = arviz_base.from_dict(
        {
            "posterior": _chains(posterior.samples, n_chains),
            "prior": _chains(posterior.prior_samples, 1),
            "sample_stats": _chains({"lp": posterior.log_prob}, n_chains),
            "observed_data": {n: table.heights(n)[own] for n, own in used.items()},
        },
        dims={name: [f"{name}_push"] for name in used},
        coords={f"{name}_push": pushes[own] for name, own in used.items()},
    )
    for group in tree.children.values():
        # A time stamp would make equal results different files.
        group.attrs.pop("created_at", None)
    _add_units(tree, identification)
    groups = {"ensembles": _ensembles} if posterior.chain is not None else {}
    if any(trace.components for trace in table.traces):
        groups["components"] = _components
    groups |= {"fit": _fit, "profiles": _profiles, "bands": _bands, "traces": _traces}
    for name, parts in groups.items():
        tree[name] = DataTree(Dataset(**parts(identification)))
    tree.attrs = root_attributes(identification)
    return tree


def chains_tree(identification: Identification) -> "DataTree":
    """The same for ArviZ, with the walkers of emcee, if any, as chains.

    Draws of the reported quantities are a shuffled part of these chains, whose R-hat
    would always be 1; they are in the group `draws`.
    """
    from xarray import Dataset, DataTree

    tree, posterior = posterior_tree(identification), identification.posterior
    chain = posterior.chain
    if chain is None or number_of_chains(posterior) > 1:
        return tree
    walkers = np.moveaxis(chain, 2, 1).reshape(-1, chain.shape[1], chain.shape[3])
    variables = {}
    for index, name in enumerate(posterior.chain_names):
        variables[name] = (("chain", "draw"), walkers[..., index])
        if name.startswith("ln_"):
            variables[name[3:]] = (("chain", "draw"), np.exp(walkers[..., index]))
    coords = {"chain": np.arange(len(walkers)), "draw": np.arange(chain.shape[1])}
    tree["draws"] = tree["posterior"].copy()
    tree["posterior"] = DataTree(Dataset(variables, coords=coords))
    del tree["sample_stats"]  # by draw, not by walker
    return tree


def root_attributes(identification: Identification) -> dict[str, str | int | float]:
    """What a result file says of itself; lists and tables as JSON text."""
    sources = identification.table.sources
    parts: dict[str, object] = {
        "sha256": [source.sha256 for source in sources],
        "versions": identification.versions,
        "config": identification.config.model_dump(mode="json"),
    }
    return {
        "schema": SUMMARY_SCHEMA,
        "status": identification.status.name.lower(),
        "engine": identification.posterior.engine,
        "seed": identification.seed,
        "ci_kind": "eti",
        "ci_prob": identification.theta_c.prob,
        "reference_alpha_deg": identification.reference_alpha_deg,
        **{name: _as_text(part) for name, part in parts.items()},
    }


def _as_text(value: object) -> str:
    return json.dumps(json_safe(value))


def number_of_chains(posterior: PosteriorResult) -> int:
    """Chains among which ArviZ is to compare draws.

    Args:
        posterior: Draws, those of emcee step by step, all walkers of a step together.

    Returns:
        Walkers of all ensembles. Independent draws make any number of chains; where
        they cannot be shared out evenly, one.
    """
    n_draws = posterior.log_prob.size
    if posterior.chain is not None:
        n_ensembles, n_steps, n_walkers, _ = posterior.chain.shape
        if n_ensembles * n_steps * n_walkers == n_draws:
            return n_ensembles * n_walkers
        return 1
    return INDEPENDENT_CHAINS if n_draws % INDEPENDENT_CHAINS == 0 else 1


def _chains(
    samples: Mapping[str, Float[np.ndarray, " n"]], n_chains: int
) -> dict[str, Float[np.ndarray, "c d"]]:
    return {name: draws.reshape(-1, n_chains).T for name, draws in samples.items()}


def one_row(chains: Float[np.ndarray, "c d"]) -> Float[np.ndarray, " n"]:
    """Draws in the order of the record, from their chains."""
    return chains.T.ravel()


def _add_units(tree: "DataTree", identification: Identification) -> None:
    quantities = (*identification.parameters, *identification.combinations)
    units = {quantity.name: quantity.unit for quantity in quantities}
    units |= {"theta_c": "deg", "alpha_star": "deg"}
    heights = dict.fromkeys(identification.table.channels, identification.table.unit)
    for group, known in (
        ("posterior", units),
        ("prior", units),
        ("observed_data", heights),
    ):
        for name in tree[group].data_vars:
            tree[group][str(name)].attrs["units"] = known.get(str(name), "1")


def _ensembles(identification: Identification) -> DatasetParts:
    posterior = identification.posterior
    variables: dict[str, object] = {
        "chain": (("ensemble", "step", "walker", "coordinate"), posterior.chain)
    }
    if posterior.diagnostics is not None:
        accepted = posterior.diagnostics.acceptance_fraction
        variables["acceptance_fraction"] = (("ensemble", "walker"), accepted)
    return DatasetParts(
        data_vars=variables,
        coords={"coordinate": list(posterior.chain_names)},
        attrs={"thin": posterior.thin},
    )


def _fit(identification: Identification) -> DatasetParts:
    fit = identification.fit
    return DatasetParts(
        data_vars={
            "estimate": ("coordinate", fit.estimate),
            "covariance": (("coordinate", "other_coordinate"), fit.covariance),
            "jacobian": (("residual", "coordinate"), fit.jacobian),
            "sigma": ("datum", fit.sigma),
            "predicted": ("datum", fit.predicted),
            "row": ("datum", np.array(fit.row, dtype=int)),
        },
        coords={"coordinate": list(fit.names), "datum": list(fit.channel)},
    )


def _profiles(identification: Identification) -> DatasetParts:
    return DatasetParts(
        data_vars={
            name: (
                f"{name}_value",
                profile.delta_chi_square,
                {
                    "units": profile.unit,
                    "pieces": _as_text(profile.pieces),
                    "prob": profile.prob,
                    "verdict": profile.verdict.value,
                    "degrees_of_freedom": profile.degrees_of_freedom,
                },
            )
            for name, profile in identification.profiles.items()
        },
        coords={
            f"{name}_value": profile.values
            for name, profile in identification.profiles.items()
        },
    )


# The curves of a band, in the order of the second axis.
CURVES = ("lower", "median", "upper", "best_fit")


def _bands(identification: Identification) -> DatasetParts:
    """Predictions along the sweeps, one variable each, numbered."""
    bands = dict(enumerate(identification.bands))
    return DatasetParts(
        data_vars={
            f"band_{index}": (
                ("curve", f"angle_{index}"),
                np.stack([getattr(band, curve) for curve in CURVES]),
                {
                    "units": identification.table.unit,
                    "channel": band.channel,
                    "swept": band.swept,
                    "fixed_deg": band.fixed_deg,
                    "prob": band.prob,
                    "rows": _as_text(band.rows),
                },
            )
            for index, band in bands.items()
        },
        coords={f"angle_{index}": band.angle_deg for index, band in bands.items()}
        | {"curve": list(CURVES)},
    )


def _traces(identification: Identification) -> DatasetParts:
    traces = dict(enumerate(identification.table.traces))
    return DatasetParts(
        data_vars={
            f"trace_{index}": (
                f"time_{index}",
                trace.signal,
                {
                    "units": trace.unit,
                    "path": json_safe(trace.path),
                    "name": json_safe(trace.name),
                    "first_row": trace.first_row,
                    "n_rows": trace.n_rows,
                    "sign": trace.sign,
                },
            )
            for index, trace in traces.items()
        },
        coords={f"time_{index}": trace.time for index, trace in traces.items()},
    )


# Of pushes in a force component, in the order of the first axis.
SIGNED_COLUMNS = ("start", "end", "baseline", "height")


def _components(identification: Identification) -> DatasetParts:
    """Force components of the traces, three variables each, numbered."""
    data_vars: dict[str, object] = {}
    coords: dict[str, object] = {"height": list(SIGNED_COLUMNS)}
    for index, trace in enumerate(identification.table.traces):
        for k, component in enumerate(trace.components):
            key, moment = f"{index}_{k}", f"time_{index}_{k}"
            heights = [getattr(component.heights, name) for name in SIGNED_COLUMNS]
            attributes = {"units": trace.unit, "name": json_safe(component.name)}
            data_vars |= {
                f"component_{key}": (moment, component.signal, attributes),
                f"is_jerk_{key}": (moment, component.is_jerk.astype(np.int8)),
                f"heights_{key}": (["height", f"row_{index}"], np.stack(heights)),
            }
            coords[moment] = component.time
    return DatasetParts(data_vars=data_vars, coords=coords)
