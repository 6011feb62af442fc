"""Logs that are no tables: `rostopic echo` without `-p`, ROS logs, NumPy files.

Each is brought into the one form that everything else reads: columns with names.
Excluded: lines of logs and messages that are printed (`pushfit.data.text.ros_logs`),
and what the columns mean, told by the same rules as for any other file
(`pushfit.data.recordings.roles`).
"""

import contextlib
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Int, Shaped
from numpy.lib.npyio import NpzFile

from pushfit.data.text.explain import cell_problems
from pushfit.data.text.faults import (
    STATE_COLUMNS,
    listed,
    problem,
    refuse,
    refuse_columns,
)
from pushfit.data.text.files import NUMPY
from pushfit.data.text.ros_logs import (
    LogRecord,
    echo_records,
    is_echo,
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
_SAVE_COLUMNS = "as in np.savez(NAME, time_s=time, pressure_kpa=pressure)"
# Arrays whose lengths differ by a smaller share were to be columns of one table.
_ONE_TABLE = 0.1

Table = dict[str, np.ndarray]


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
        table, dialect = _numpy_table(path, columns)
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


def _numpy_table(path: str, columns: Sequence[str]) -> tuple[Table, str]:
    """Columns of a NumPy file, and which kind of file it is."""
    try:
        loaded = np.load(path, allow_pickle=False)
        if not isinstance(loaded, np.ndarray):
            with loaded:
                return _columns_of(loaded, columns, path=path)
    except (ValueError, OSError, EOFError) as error:
        raise refuse(
            "unreadable",
            f"is no NumPy file of numbers ({error}); copy it again, or save its arrays "
            "anew by np.savez, each of numbers alone",
            path=path,
        ) from error
    if loaded.dtype.names:
        refuse_columns(columns, loaded.dtype.names, path=path)
        table = {name: loaded[name].astype(float) for name in loaded.dtype.names}
    else:
        table = _named(np.atleast_2d(loaded.T).T, columns, path=path)
    return table, "NumPy .npy"


def _columns_of(
    arrays: NpzFile, columns: Sequence[str], *, path: str
) -> tuple[Table, str]:
    """Arrays of numbers of one length: the longest that two of them have.

    What is longer or shorter has another clock, or is no column but says something of
    them, and is named as left aside. So is a table, such as a calibration, unless it is
    all there is, or names are stated for its columns.
    """
    held = _numbers_of(arrays)
    is_table = {n: sum(k != 1 for k in a.shape) > 1 for n, a in held.items()}
    lone = {name: a.ravel() for name, a in held.items() if not is_table[name]}
    tables = {name: a for name, a in held.items() if is_table[name]}
    sizes = Counter(values.size for values in lone.values())
    length = max((n for n in sizes if n > 1 and sizes[n] > 1), default=0)
    named: Table = {}
    taken = None
    if tables and (columns or not length):
        taken, rows = _only(tables, path=path)
        named, length = _named(rows, columns, path=path, array=taken), len(rows)
    else:
        length = length or _longest(lone, path=path)
        if length == 0:
            raise refuse(
                "no_rows",
                "holds no array of numbers; save one for the time and one for each "
                f"signal, {_SAVE_COLUMNS}",
                path=path,
            )
        refuse_columns(columns, list(lone), path=path)
    own = {n: a for n, a in lone.items() if a.size == length and n not in named}
    aside = ", ".join(n for n in arrays.files if n != taken and n not in own)
    return {**own, **named}, f"NumPy .npz{f', left aside {aside}' if aside else ''}"


def _longest(lone: Table, *, path: str) -> int:
    """Length of the longest of some arrays, no two of which are as long."""
    sizes = {name: array.size for name, array in lone.items()}
    length = max(sizes.values(), default=0)
    alike = [f"{n} ({k})" for n, k in sizes.items() if k > (1 - _ONE_TABLE) * length]
    if len(alike) > 1:
        raise refuse(
            "unequal_lengths",
            f"the arrays are of unequal length: {listed(alike)}; save as many samples "
            f"of each, {_SAVE_COLUMNS}",
            path=path,
        )
    return length


def _numbers_of(arrays: NpzFile) -> Table:
    """Arrays of numbers by name, also what are fields of another array."""
    held: Table = {}
    for name in arrays.files:
        # What is no array of numbers, such as a pickled setting, is no column.
        with contextlib.suppress(ValueError):
            own = arrays[name]
            fields = own.dtype.names
            parts = {field: own[field] for field in fields} if fields else {name: own}
            held |= {part: values.astype(float) for part, values in parts.items()}
    return held


def _only(tables: Table, *, path: str) -> tuple[str, np.ndarray]:
    """Name and rows of the table of a file."""
    if len(tables) == 1:
        ((name, rows),) = tables.items()
        if rows.ndim == 2:
            return name, rows
    sizes = [f"{n} ({' × '.join(map(str, a.shape))})" for n, a in tables.items()]
    raise refuse(
        "ambiguous_table",
        f"one table of rows and columns is looked for, there are: {listed(sizes)}; "
        "save it alone, or the columns that belong together by names of their own, "
        f"{_SAVE_COLUMNS}",
        path=path,
    )


def _named(
    rows: Shaped[np.ndarray, "n k"],
    columns: Sequence[str],
    *,
    path: str,
    array: str | None = None,
) -> Table:
    """Columns of a table by the names that are stated.

    Args:
        array: Name of the table among the arrays of its file.
    """
    names, n_columns = [name for name in columns if name != "..."], rows.shape[1]
    is_named = len(names) <= n_columns if "..." in columns else len(names) == n_columns
    if not names or not is_named:
        what = "holds" if array is None else f"array {array!r} holds"
        way = STATE_COLUMNS
        if names:
            way = f"named were {len(names)}; {way}"
        if len(names) == len(rows):
            way += "; if its rows are the columns, save it transposed, as table.T"
        raise refuse(
            "no_header", f"{what} {n_columns} columns without names; {way}", path=path
        )
    return {name: rows[:, k].astype(float) for k, name in enumerate(names)}
