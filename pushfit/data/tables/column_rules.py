"""What the cells of tables with one row per push may hold, by a pandera schema.

Excluded: recognising and converting columns (`pushfit.data.tables.columns`).
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import pandas as pd

from pushfit.data.recordings.units import UNITS, implausible_angles
from pushfit.data.tables.columns import Columns, Origin
from pushfit.data.text.faults import data_error
from pushfit.errors import Problem

if TYPE_CHECKING:
    from pandera.pandas import Check


def check_columns(
    columns: Columns, rules: Mapping[str, list["Check"]], origin: Origin
) -> None:
    """Check every cell, and the angles together.

    Args:
        rules: Checks by column, each with an `error` that is a key of the reasons
            here; columns without an entry may hold empty cells.

    Raises:
        DataError: Cells break their rules; all are in `problems`.
    """
    import pandera.pandas as pa  # noqa: PLC0415 - slow to load, needed only to check

    common = {
        "push": [pa.Check.ge(1, error="count")],
        "repeat": [pa.Check.ge(1, error="count")],
        "theta_deg": [pa.Check.in_range(-90, 90, error="theta")],
        "alpha_deg": [pa.Check.in_range(-360, 360, error="alpha")],
    }
    checks = {**common, **rules}
    schema = pa.DataFrameSchema(
        {
            str(name): pa.Column(
                None,
                checks.get(str(name), []),
                nullable=name not in checks,
                unique=name == "push",
            )
            for name in columns.frame.columns
        }
    )
    try:
        schema.validate(columns.frame, lazy=True)
    except pa.errors.SchemaErrors as error:
        raise data_error(_in_words(error.failure_cases, origin)) from error
    degrees = {
        stem: (columns.frame[f"{stem}_deg"].to_numpy(), UNITS["deg"])
        for stem in columns.in_degrees
    }
    implausible = implausible_angles(degrees)
    if implausible:
        given = next(iter(columns.in_degrees.values()))
        raise data_error(
            [origin.problem("implausible_angles", implausible, column=given, value="")]
        )


# By name of the check as pandera reports it: stable code, rule with remedy.
_REASONS = {
    "theta": (
        "theta_range",
        "is outside [-90, 90]; theta is the elevation out of the tangential plane; "
        "an angle from the surface normal is 90 minus it",
    ),
    "alpha": ("alpha_range", "is outside [-360, 360]; give the azimuth within a turn"),
    "finite": ("not_finite", "is not a finite number; fill the cell or remove the row"),
    "not_nullable": (
        "missing_value",
        "stands for an empty cell; fill it or remove the row",
    ),
    "sd": ("sd_range", "is no standard deviation; it must be above 0"),
    "count": ("count_range", "is below 1; number pushes and repeats from 1"),
    "field_uniqueness": ("duplicate_push", "stands for two pushes; number them apart"),
    "definition": ("unknown_definition", "is neither apex nor plateau"),
    "flags": ("unknown_flag", "is no list of known flags, joined by ';'"),
}


def _in_words(cases: pd.DataFrame, origin: Origin) -> list[Problem]:
    """Failures of a schema in the order of the rows."""
    problems = []
    for case in cases.sort_values("index", kind="stable").to_dict("records"):
        code, rule = _REASONS[str(case["check"])]
        value = case["failure_case"]
        shown = f"{value:g}" if isinstance(value, float) else repr(value)
        problems.append(
            origin.problem(
                code,
                f"{shown} {rule}",
                row=int(case["index"]),
                column=str(case["column"]),
                value=str(value),
            )
        )
    return problems
