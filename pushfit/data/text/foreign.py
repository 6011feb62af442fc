"""Logs that are no tables: `rostopic echo` without `-p`, ROS logs, NumPy files.

Each is brought into the one form that everything else reads: columns with names.
Excluded: messages that are printed (`pushfit.data.text.echo`), lines of ROS logs
(`pushfit.data.text.ros_logs`), NumPy files themselves
(`pushfit.data.text.numpy_files`), and what the columns mean, told by the same rules as
for any other file (`pushfit.data.recordings.roles`).
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Int

from pushfit.data.text.echo import echo_records, is_echo
from pushfit.data.text.explain import cell_problems
from pushfit.data.text.faults import listed, problem, refuse_columns
from pushfit.data.text.files import NUMPY
from pushfit.data.text.numpy_files import Table, numpy_table
from pushfit.data.text.ros_logs import (
    LogRecord,
    is_log,
    log_records,
    uncoloured,
)
from pushfit.data.units import Unit
from pushfit.errors import InputProblem

# What tells a log from a table: a message of `rostopic echo` ends within.
_HEAD = 1 << 14
# Seconds of a stamp, and their nanoseconds, in ROS 1 and in ROS 2.
_STAMP = re.compile(r"(?<=stamp\.)secs?$")
_NANOSECONDS = {"secs": "nsecs", "sec": "nanosec"}


@dataclass(frozen=True, slots=True, kw_only=True)
class ForeignTable:
    """Columns of a log that is no table.

    Args:
        columns: Numbers by name, NaN where one is missing.
        dialect: What the log is.
        units: Units that are written beside the numbers, by column.
        lines: Line in the file of each row; None where there are no lines.
        problems: What is wrong with cells, by column.
        cautions: What was left out, for the user.
    """

    columns: Table
    dialect: str
    units: Mapping[str, str] = field(default_factory=dict)
    lines: Int[np.ndarray, " n"] | None = None
    problems: Mapping[str, Sequence[InputProblem]] = field(default_factory=dict)
    cautions: tuple[str, ...] = ()


def foreign_table(path: str, *, columns: Sequence[str] = ()) -> ForeignTable | None:
    """Columns of a log that is no table; None for any other file.

    Args:
        columns: Names of the columns of a bare table of numbers.

    Raises:
        ConfigError: If names are stated for columns that have some.
        DataError: If it is one that cannot be read.
    """
    if Path(path).suffix.lower() in NUMPY:
        table, dialect = numpy_table(path, columns)
        return ForeignTable(columns=table, dialect=dialect)
    if Path(path).is_dir():  # a bag of ROS 2, or a mistake that others name
        return None
    with open(path, "rb") as file:
        head = file.read(_HEAD)
    if b"\x00" in head:
        return None
    start = uncoloured(head.decode(errors="replace"))
    if is_echo(start):
        bare = {"bare": columns[0]} if len(columns) == 1 else {}
        table = _table(path, echo_records(path, **bare), "rostopic echo")
        if [*table.columns] == [*columns]:
            return table
    elif is_log(start):
        table = _table(path, log_records(path), "ROS log")
    else:
        return None
    refuse_columns(columns, [*table.columns], path=path)
    return table


def _table(path: str, records: list[LogRecord], dialect: str) -> ForeignTable:
    """Columns of those records that have all numbers that most of them have."""
    usual = Counter(tuple(record.numbers) for record in records if record.numbers)
    names = usual.most_common(1)[0][0]
    held = [record.numbers.keys() | record.words.keys() for record in records]
    pairs = list(zip(records, held, strict=True))
    rows = [record for record, own in pairs if own.issuperset(names)]
    short = [(r, own) for r, own in pairs if 0 < len(own & set(names)) < len(names)]
    table = {n: np.array([row.numbers.get(n, np.nan) for row in rows]) for n in names}
    for name in names:
        nanoseconds = _STAMP.sub(lambda found: _NANOSECONDS[found[0]], name)
        if nanoseconds != name and nanoseconds in table:
            # Seconds since 1970 and their nanoseconds are one clock.
            time = table.pop(name) + table.pop(nanoseconds) / 1e9
            table = {"time_s": time, **table}
    if rows[0].time_s is not None:
        table = {"time_s": np.array([row.time_s for row in rows]), **table}
    cautions: tuple[str, ...] = ()
    if short:
        first, own = short[0]
        lacking = listed([name for name in names if name not in own])
        cautions = (
            f"left out {len(short)} of {len(rows) + len(short)} records, which lack "
            f"numbers of the others: that of line {first.line} has no {lacking}",
        )
    said = {n: [row.units[n] for row in rows if n in row.units] for n in names}
    return ForeignTable(
        columns=table,
        dialect=dialect,
        units={name: units[0][1].name for name, units in said.items() if units},
        lines=np.array([row.line for row in rows]),
        problems={
            name: [
                *cell_problems(
                    path, name, [row.words[name] for row in rows if name in row.words]
                ),
                *_other_units(path, name, said[name]),
            ]
            for name in names
        },
        cautions=cautions,
    )


def _other_units(
    path: str, name: str, said: list[tuple[int, Unit]]
) -> list[InputProblem]:
    """Find the first line of a column that has another unit than the one before."""
    for (_, unit), (line, other) in pairwise(said):
        if not other.equals(unit):
            text = (
                f"the unit is {other.name} here, but {unit.name} on the lines before; "
                "write all in one unit, or split the file"
            )
            code = "unit_conflict"
            return [problem(code, text, path=path, line=line, column=name)]
    return []
