"""The posterior as netCDF: draws, prior, observations, and what they came from.

An `xarray.DataTree` in the ArviZ layout, so that any ArviZ function reads it. Draws are
one chain: the independent ensembles of an emcee run are kept apart in the group
`ensembles`, in fitting coordinates.
"""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pushfit.fit.results import Identification
from pushfit.report.summary import SCHEMA, json_safe

if TYPE_CHECKING:
    from xarray import Dataset, DataTree


def posterior_tree(identification: Identification) -> "DataTree":
    """Posterior with its prior, data and provenance.

    Args:
        identification: The result.

    Returns:
        Groups `posterior`, `prior`, `observed_data`, `sample_stats` and, from emcee,
        `ensembles`. The root says seed, versions, sha256 of the inputs, config, status
        and ci_prob; `status` other than "ok" means that no interval of these draws is
        to be quoted.
    """
    import arviz_base
    from xarray import DataTree

    posterior, fit = identification.posterior, identification.fit
    table = identification.table
    rows = np.array(fit.row, dtype=int)
    observed = {
        channel: table.heights(channel)[rows[np.array(fit.channel) == channel]]
        for channel in table.channels
    }
    tree = arviz_base.from_dict(
        {
            "posterior": _one_chain(posterior.samples),
            "prior": _one_chain(posterior.prior_samples),
            "sample_stats": {"lp": posterior.log_prob[np.newaxis]},
            "observed_data": observed,
        },
        dims={name: [f"{name}_push"] for name in observed},
        coords={
            f"{name}_push": table.frame["push"].to_numpy()[
                rows[np.array(fit.channel) == name]
            ]
            for name in observed
        },
    )
    for group in tree.children.values():
        # A time stamp would make equal results different files.
        group.attrs.pop("created_at", None)
    _add_units(tree, identification)
    if posterior.chain is not None:
        tree["ensembles"] = DataTree(_ensembles(identification))
    tree.attrs = root_attributes(identification)
    return tree


def root_attributes(identification: Identification) -> dict[str, str | int | float]:
    """What a result file says of itself; lists and tables as JSON text.

    Args:
        identification: The result.
    """
    sources = identification.table.sources
    parts: dict[str, object] = {
        "sha256": [source.sha256 for source in sources],
        "versions": identification.versions,
        "config": identification.config.model_dump(mode="json"),
    }
    return {
        "schema": SCHEMA,
        "status": identification.status.name.lower(),
        "engine": identification.posterior.engine,
        "seed": identification.seed,
        "ci_kind": "eti",
        "ci_prob": identification.theta_c.prob,
        "reference_alpha_deg": identification.reference_alpha_deg,
        **{name: json.dumps(json_safe(part)) for name, part in parts.items()},
    }


def _one_chain(
    samples: Mapping[str, Float[np.ndarray, " n"]],
) -> dict[str, Float[np.ndarray, "1 n"]]:
    """Draws with the leading axis that ArviZ takes for chains."""
    return {name: draws[np.newaxis] for name, draws in samples.items()}


def _add_units(tree: "DataTree", identification: Identification) -> None:
    """Write the unit of every variable into its attributes."""
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


def _ensembles(identification: Identification) -> "Dataset":
    """Chains of the independent ensembles, in fitting coordinates."""
    from xarray import Dataset

    posterior = identification.posterior
    dims = ("ensemble", "step", "walker", "coordinate")
    return Dataset(
        {"chain": (dims, posterior.chain)},
        coords={"coordinate": list(posterior.chain_names)},
        attrs={"thin": posterior.thin},
    )
