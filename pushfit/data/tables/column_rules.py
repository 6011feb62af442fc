"""What the cells of tables with one row per push may hold.

Excluded: recognising and converting columns (`pushfit.data.tables.columns`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from jaxtyping import Bool

from pushfit.data.recordings.units import UNITS, implausible_angles
from pushfit.data.tables.columns import Columns, Origin, failure
from pushfit.errors import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """What every filled cell of a column has to be.

    Args:
        name: Key of the reasons here.
        is_met: Whether each of the cells is.
    """

    name: str
    is_met: Callable[[pd.Series], pd.Series]


COMMON = {
    "push": [Rule(name="count", is_met=lambda cells: cells >= 1)],
    "repeat": [Rule(name="count", is_met=lambda cells: cells >= 1)],
    "theta_deg": [Rule(name="theta", is_met=lambda cells: cells.between(-90, 90))],
    "alpha_deg": [Rule(name="alpha", is_met=lambda cells: cells.between(-360, 360))],
}


def check_columns(
    columns: Columns, rules: Mapping[str, Sequence[Rule]], origin: Origin
) -> None:
    """Check every cell, and the angles together.

    Args:
        columns: What `read_columns` gave.
        rules: Rules by column; columns without an entry may hold empty cells.
        origin: Where the rows come from.

    Raises:
        DataError: Cells break their rules; all are in `problems`.
    """
    every = {**COMMON, **rules}
    broken = [
        (int(row), name, str(column), cells.tolist()[row])
        for column, cells in columns.frame.items()
        for name, is_broken in _breaches(cells, every.get(str(column), ()))
        for row in np.flatnonzero(is_broken)
    ]
    if broken:
        # In the order of the rows.
        broken.sort(key=lambda case: case[0])
        raise failure([_in_words(*case, origin) for case in broken])
    degrees = {
        stem: (columns.frame[f"{stem}_deg"].to_numpy(), UNITS["deg"])
        for stem in columns.in_degrees
    }
    implausible = implausible_angles(degrees)
    if implausible:
        given = next(iter(columns.in_degrees.values()))
        raise failure(
            [origin.problem("implausible_angles", implausible, column=given, value="")]
        )


def _breaches(
    cells: pd.Series, rules: Sequence[Rule]
) -> Iterator[tuple[str, Bool[np.ndarray, " n"]]]:
    """Names of rules with the cells that break them."""
    is_empty = cells.isna().to_numpy()
    if rules:
        yield "empty", is_empty
    if cells.name == "push":
        yield "unique", cells.duplicated(keep=False).to_numpy() & ~is_empty
    for rule in rules:
        yield rule.name, ~rule.is_met(cells).to_numpy(dtype=bool) & ~is_empty


# By name of the rule: stable code, rule with remedy.
_REASONS = {
    "theta": (
        "theta_range",
        "is outside [-90, 90]; theta is the elevation out of the tangential plane; "
        "an angle from the surface normal is 90 minus it",
    ),
    "alpha": ("alpha_range", "is outside [-360, 360]; give the azimuth within a turn"),
    "finite": ("not_finite", "is not a finite number; fill the cell or remove the row"),
    "empty": (
        "missing_value",
        "stands for an empty cell; fill it or remove the row",
    ),
    "sd": ("sd_range", "is no standard deviation; it must be above 0"),
    "count": ("count_range", "is below 1; number pushes and repeats from 1"),
    "unique": ("duplicate_push", "stands for two pushes; number them apart"),
    "definition": ("unknown_definition", "is neither apex nor plateau"),
    "flags": ("unknown_flag", "is no list of known flags, joined by ';'"),
}


def _in_words(
    row: int, name: str, column: str, value: object, origin: Origin
) -> Problem:
    """What is wrong with one cell."""
    code, rule = _REASONS[name]
    shown = f"{value:g}" if isinstance(value, float) else repr(value)
    return origin.problem(
        code, f"{shown} {rule}", row=row, column=column, value=str(value)
    )
