"""What the items of a batch have in common: one row for each quantity.

All items of the batch are one population; equal content counts once. A and B are
pooled where their units agree. What may not have an interval of its own lends none to
the others: provisional items are left out. Excluded: the statistics
(`pushfit.fit.population.pooling`).
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import compress

from pushfit.batch.items import Item
from pushfit.batch.rows import Row
from pushfit.batch.store import Finished
from pushfit.fit.identify.result_row import LOG_PRIOR, Cell
from pushfit.fit.population.item_likelihoods import ItemDraws
from pushfit.fit.population.pooling import pool
from pushfit.fit.results import ResultWarning, Verdict
from pushfit.parameters import HALF_TURN

COLUMNS = (
    "quantity",
    "unit",
    "mean",
    "mean_low",
    "mean_high",
    "spread",
    "spread_low",
    "spread_high",
    "n_items",
    "n_left_out",
    "effective_draws",
    "outliers",
    "not_usable",
    "provisional",
    "warnings",
)

# Azimuths within this are one: a robot that is sent to it misses by less [deg].
MAX_AZIMUTH_SPREAD_DEG = 5.0
# What is said of a population, by its code.
WARNINGS = {
    "grid_edge": "the means and spreads that were tried hold too little of what is "
    "likely, so that ends of the population's intervals may be wrong",
    "open_transition": "items leave the sharpness p of the transition open, and its "
    "prior moves θ_c, B and C_rr of all of them the same way, which no number of items "
    "averages out: where one transition holds for all, state transition.sharpness",
    "several_azimuths": "θ_c of the items belongs to azimuths that are more than "
    f"{MAX_AZIMUTH_SPREAD_DEG:g}° apart, and differs between them wherever the support "
    "is not alike all round: state grasp.reference_alpha_deg, or pool those of one "
    "azimuth in a batch of their own",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PooledQuantity:
    """A quantity that is pooled.

    Args:
        quantity: Name in `population.csv`.
        column: Name of its draws in the result of an item.
        scale: How much items may well differ [unit of the draws].
        unit: Unit, or the column of the row of an item that has it.
    """

    quantity: str
    column: str
    scale: float
    unit: str


# Hand-held things differ by factors; a third of all directions is a wide spread.
POOLED = (
    PooledQuantity(quantity="theta_c", column="theta_c_deg", scale=30.0, unit="deg"),
    PooledQuantity(quantity="ln_A", column="ln_A", scale=1.0, unit="A_unit"),
    PooledQuantity(quantity="ln_B", column="ln_B", scale=1.0, unit="B_unit"),
    PooledQuantity(quantity="ln_C_rr", column="ln_C_rr", scale=1.0, unit="1"),
)


def pool_items(
    items: Iterable[Item], find: Callable[[str], Finished | None]
) -> tuple[Row, ...]:
    """Pool what the items of a batch tell, each content once.

    Returns:
        Rows with the cells of `COLUMNS`; none for a quantity with fewer than three
        usable items. They do not depend on the order of the items.
    """
    ordered = sorted(items, key=lambda item: item.name)
    return tuple(row for pooled in POOLED for row in _rows(pooled, ordered, find))


def _rows(
    pooled: PooledQuantity,
    items: Sequence[Item],
    find: Callable[[str], Finished | None],
) -> list[Row]:
    """Rows of one quantity, one for each unit."""
    groups: dict[str, list[ItemDraws]] = {}
    n_all: dict[str, int] = {}
    provisional: dict[str, list[str]] = {}
    open_transition: set[str] = set()
    azimuths: list[float] = []
    for item in items:
        finished = find(item.key)
        if finished is None:
            continue
        unit = pooled.unit
        if unit.endswith("_unit"):
            unit = str(finished.values.get(unit) or "")
        n_all[unit] = n_all.get(unit, 0) + 1
        if is_provisional(finished.values):
            provisional.setdefault(unit, []).append(item.name)
            continue
        draws = finished.draws.get(pooled.column)
        log_prior = finished.draws.get(f"{LOG_PRIOR}{pooled.column}")
        if draws is not None and log_prior is not None:
            one = ItemDraws(name=item.name, draws=draws, log_prior=log_prior)
            groups.setdefault(unit, []).append(one)
            if finished.values.get("p_verdict") not in (None, Verdict.FIXED.value):
                open_transition.add(unit)
            if pooled.quantity == "theta_c":
                azimuths.append(float(finished.values["reference_alpha_deg"] or 0.0))
    rows: list[Row] = []
    for unit, group in sorted(groups.items()):
        found = pool(group, scale=pooled.scale)
        if found is not None:
            shown = (
                found.is_edge_reached,
                unit in open_transition,
                are_apart(azimuths),
            )
            cells: tuple[Cell, ...] = (
                pooled.quantity,
                unit,
                found.mean,
                *found.mean_interval,
                found.spread,
                *found.spread_interval,
                found.n_items,
                n_all[unit] - found.n_items,
                round(found.effective_draws),
                ";".join(found.outliers),
                ";".join(found.not_usable),
                ";".join(provisional.get(unit, ())),
                ";".join(compress(WARNINGS, shown)),
            )
            rows.append(dict(zip(COLUMNS, cells, strict=True)))
    return rows


def population_warnings(rows: Iterable[Row]) -> tuple[ResultWarning, ...]:
    """What is said of rows of a population, each once."""
    said = {code for row in rows for code in str(row["warnings"]).split(";")}
    return tuple(
        ResultWarning(code=code, text=text)
        for code, text in WARNINGS.items()
        if code in said
    )


def are_apart(azimuths: Sequence[float]) -> bool:
    """Whether azimuths, as axes of pushes, are not all the same [deg]."""
    turned = [azimuth - azimuths[0] for azimuth in azimuths]
    past = [(turn + HALF_TURN / 2) % HALF_TURN - HALF_TURN / 2 for turn in turned]
    return bool(past) and max(past) - min(past) > MAX_AZIMUTH_SPREAD_DEG


def is_provisional(row: Row) -> bool:
    """Whether the model does not describe an item, or its table cannot be right."""
    return "model_inadequate" in str(row.get("warnings")).split(";")
