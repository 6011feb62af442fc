"""Logs that are no tables: `rostopic echo` without `-p`, ROS logs, NumPy files.

Each is brought into the one form that everything else reads: columns with names.
Excluded: messages that are printed (`pushfit.data.text.echo`), lines of ROS logs
(`pushfit.data.text.ros_logs`), NumPy files themselves
(`pushfit.data.text.numpy_files`), and what the columns mean, told by the same rules as
for any other file (`pushfit.data.recordings.roles`).
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pushfit.data.text.echo import echo_records, is_echo
from pushfit.data.text.faults import refuse_columns
from pushfit.data.text.files import NUMPY
from pushfit.data.text.numpy_files import Table, numpy_table
from pushfit.data.text.ros_logs import (
    LogRecord,
    is_log,
    log_records,
    uncoloured,
)

# What tells a log from a table: a message of `rostopic echo` ends within.
_HEAD = 1 << 14


def foreign_table(
    path: str, *, columns: Sequence[str] = ()
) -> tuple[Table, str] | None:
    """Columns of a log that is no table, and what it is; None for any other.

    Args:
        columns: Names of the columns of a bare table of numbers.

    Raises:
        ConfigError: If names are stated for columns that have some.
        DataError: If it is one that cannot be read.
    """
    if Path(path).suffix.lower() in NUMPY:
        return numpy_table(path, columns)
    if Path(path).is_dir():  # a bag of ROS 2, or a mistake that others name
        return None
    with open(path, "rb") as file:
        head = file.read(_HEAD)
    if b"\x00" in head:
        return None
    start = uncoloured(head.decode(errors="replace"))
    if is_echo(start):
        records, kind = echo_records(path), "rostopic echo"
    elif is_log(start):
        records, kind = log_records(path), "ROS log"
    else:
        return None
    table = _columns(records)
    refuse_columns(columns, [*table], path=path)
    return table, kind


def _columns(rows: list[LogRecord]) -> Table:
    """Columns of those records that have all numbers that most of them have."""
    names = Counter(map(tuple, rows)).most_common(1)[0][0]
    rows = [row for row in rows if row.keys() >= set(names)]
    table = {n: np.array([row[n] for row in rows]) for n in names}
    for seconds in [n for n in names if n.endswith("stamp.secs")]:
        parts = (seconds, seconds.replace("secs", "nsecs"))
        if all(part in table for part in parts):
            # Seconds since 1970 and their nanoseconds are one clock.
            time = table.pop(parts[0]) + table.pop(parts[1]) / 1e9
            table = {"time_s": time, **table}
    return table
