"""Logs that are no tables: `rostopic echo` without `-p`, ROS logs, NumPy files.

Each is brought into the one form that everything else reads: columns with names.
Excluded: lines of ROS logs (`pushfit.data.text.ros_logs`), NumPy files themselves
(`pushfit.data.text.numpy_files`), and what the columns mean, told by the same rules as
for any other file (`pushfit.data.recordings.roles`).
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pushfit.data.text.faults import refuse, refuse_columns
from pushfit.data.text.files import NUMPY
from pushfit.data.text.numpy_files import Table, numpy_table
from pushfit.data.text.ros_logs import (
    NUMBER,
    LogRecord,
    is_log,
    log_records,
    uncoloured,
)

_YAML = re.compile(
    rf"(?P<indent>[ ]*)(?P<key>[A-Za-z_]\w*):\s*(?P<value>\[.*\]|{NUMBER})?\s*$"
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
    first = start.lstrip("-\n ").partition("\n")[0]
    if re.search(r"^---\s*$", start, re.M) and _YAML.match(first):
        records, kind = _echoed(path), "rostopic echo"
    elif is_log(start):
        records, kind = log_records(path), "ROS log"
    else:
        return None
    table = _columns(records)
    refuse_columns(columns, [*table], path=path)
    return table, kind


def _echoed(path: str) -> list[LogRecord]:
    """Numbers of all messages that have some."""
    messages = list(_messages(path))
    if not messages:
        raise refuse(
            "no_rows",
            "holds no message with a number; print the topic of the sensor, or record "
            "it as a bag",
            path=path,
        )
    return messages


def _messages(path: str) -> Iterator[LogRecord]:
    """Numbers of each message between lines of dashes, by their path."""
    message: LogRecord = {}
    parents: list[tuple[int, str]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            if line.startswith("---"):
                if message:
                    yield message
                message, parents = {}, []
                continue
            match = _YAML.match(line.rstrip("\n"))
            if match is None:
                continue
            depth = len(match["indent"])
            parents = [(d, name) for d, name in parents if d < depth]
            name = ".".join([*(key for _, key in parents), match["key"]])
            value = match["value"]
            if value is None:
                parents.append((depth, match["key"]))
            elif value.startswith("["):
                cells = re.findall(NUMBER, value)
                message |= {f"{name}[{k}]": float(c) for k, c in enumerate(cells)}
            else:
                message[name] = float(value)
    if message:
        yield message


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
