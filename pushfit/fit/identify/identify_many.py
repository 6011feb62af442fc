"""Many tables through the same question, each for itself, as one row each.

What comes out for a table depends on that table, the configuration and its seed, never
on the tables beside it; a table that cannot be identified gives its error in its place.
Excluded: files and workers (`pushfit.batch`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.identify.fitted import Fitted, Listener
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.identify.result_row import Cell, pooled_draws, row_values
from pushfit.fit.problem.problem import Problem
from pushfit.fit.sweep.prior import marginal_priors


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemResult:
    """What one table told, as one row.

    Args:
        values: Cells by column; see `pushfit.fit.identify.result_row.row_values`.
        draws: Posterior draws by name, draw by draw; see
            `pushfit.fit.identify.result_row.pooled_draws`.
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
    """Rows of tables that share a configuration, or the errors against them.

    Args:
        engine: "auto", "sweep" or "emcee"; see `identify_table`.
    """
    return [
        _identify_one(table, config, seed=seed, engine=engine)
        for table, seed in zip(tables, seeds, strict=True)
    ]


def _identify_one(
    table: PeakTable, config: GraspConfig, *, seed: int, engine: str
) -> ItemResult | PushfitError:
    """One table, its error as a value."""
    heard = _Heard()
    try:
        found = identify_table(
            table, config, seed=seed, engine=engine, is_brief=True, listener=heard
        )
    except PushfitError as error:
        return error
    priors = marginal_priors(heard.problems[found.mechanics])
    return ItemResult(values=row_values(found), draws=pooled_draws(found, priors))


class _Heard(Listener):
    """Keeps the problems that a table poses, by mechanics."""

    def __init__(self) -> None:
        self.problems: dict[str, Problem] = {}

    def fitted(self, fitted: Fitted) -> None:
        self.problems[fitted.mechanics] = fitted.setup.problem
