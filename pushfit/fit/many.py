"""Many tables through the same question, each for itself.

What comes out for a table depends on that table, the configuration and its seed, never
on the tables beside it; a table that cannot be identified gives its error in its place.
Tables that fit into a lane go through compiled programs together.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.flat import Cell, flat_values, pooled_draws
from pushfit.fit.identify import identify_table, prepared
from pushfit.fit.lane_results import identify_lanes, ready
from pushfit.fit.log_density import Table
from pushfit.fit.results import Identification
from pushfit.fit.setup import build_problem
from pushfit.fit.shared_priors import shared_prior


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemResult:
    """What one table told, as one row.

    Args:
        values: Cells by column; see `pushfit.fit.flat.flat_values`.
        draws: Posterior draws by name, draw by draw; see
            `pushfit.fit.flat.pooled_draws`.
    """

    values: Mapping[str, Cell]
    draws: Mapping[str, Float[np.ndarray, " n"]]


def identify_many(
    tables: Sequence[PeakTable],
    config: GraspConfig,
    *,
    seeds: Sequence[int],
    engine: str,
) -> list[ItemResult | PushfitError]:
    """Identify tables that share a configuration.

    Args:
        tables: Peak heights, one table for each grasp.
        config: Configuration in force for all of them.
        seeds: Seed of each table.
        engine: "auto", "sweep" or "emcee"; see `identify_table`.

    Returns:
        For each table its row, or the error that stands against it.
    """
    found: list[ItemResult | PushfitError | None] = [None] * len(tables)
    items = {}
    for index, (table, seed) in enumerate(zip(tables, seeds, strict=True)):
        if engine == "emcee":
            break
        try:
            item = ready(table, config, seed=seed)
        except PushfitError as error:
            found[index] = error
        else:
            if item is not None:
                items[index] = item
    together = identify_lanes(list(items.values()))
    for (index, item), result in zip(items.items(), together, strict=True):
        if result is not None:
            found[index] = _as_item(result, item.prior.tables)
    return [
        _identify_one(table, config, seed=seed, engine=engine)
        if result is None
        else result
        for table, seed, result in zip(tables, seeds, found, strict=True)
    ]


def _identify_one(
    table: PeakTable, config: GraspConfig, *, seed: int, engine: str
) -> ItemResult | PushfitError:
    """One table, its error as a value."""
    try:
        found = identify_table(table, config, seed=seed, engine=engine)
        in_force, _ = prepared(found.table, found.config)
        prior = shared_prior(build_problem(found.table, in_force).problem)
        return _as_item(found, prior.tables)
    except PushfitError as error:
        return error


def _as_item(found: Identification, priors: Mapping[str, Table]) -> ItemResult:
    """A result as a row."""
    return ItemResult(values=flat_values(found), draws=pooled_draws(found, priors))
