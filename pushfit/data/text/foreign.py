"""Logs that are no tables: `rostopic echo` without `-p`, ROS logs, NumPy files.

Each is brought into the one form that everything else reads: columns with names.
Excluded: NumPy files themselves (`pushfit.data.text.numpy_files`), and what the columns
mean, told by the same rules as for any other file (`pushfit.data.recordings.roles`).
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from pushfit.data.text.faults import refuse
from pushfit.data.text.files import NUMPY
from pushfit.data.text.numpy_files import Table, numpy_table

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LEVEL = "(?:DEBUG|INFO|WARN(?:ING)?|ERROR|FATAL)"
# What a node prints, what it writes to its own log, and what rosout writes to its.
_LOG = re.compile(
    rf"(?:\[{_LEVEL}\]\s*\[(?:WallTime:\s*)?(?P<time>{_NUMBER})[^\]]*\]:?"
    rf"|\[[\w./]+\]\[{_LEVEL}\] (?P<date>\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d,\d+):"
    rf"|(?P<stamp>{_NUMBER})\s+{_LEVEL} /\S+(?:\s+\[[^\]]*\])*)\s*(?P<text>.*)",
    re.M,
)
_PAIR = re.compile(
    rf"(?P<key>[A-Za-z_]\w*)\s*[:=]\s*(?P<value>{_NUMBER})?\s*(?:,|$|\s)"
)
_YAML = re.compile(
    rf"(?P<indent>[ ]*)(?P<key>[A-Za-z_]\w*):\s*(?P<value>\[.*\]|{_NUMBER})?\s*$"
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
    start = head.decode(errors="replace")
    first = start.lstrip("-\n ").partition("\n")[0]
    if re.search(r"^---\s*$", start, re.M) and _YAML.match(first):
        return _columns(_messages(path), path), "rostopic echo"
    if re.search(rf"^{_LOG.pattern}", start, re.M):
        return _columns(_logged(path), path), "ROS log"
    return None


def _messages(path: str) -> Iterator[dict[str, float]]:
    """Numbers of each message between lines of dashes, by their path."""
    message: dict[str, float] = {}
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
                cells = re.findall(_NUMBER, value)
                message |= {f"{name}[{k}]": float(c) for k, c in enumerate(cells)}
            else:
                message[name] = float(value)
    if message:
        yield message


def _logged(path: str) -> Iterator[dict[str, float]]:
    """Numbers of each log record; a value may be on the line below its name."""
    record: dict[str, float] = {}
    waiting: str | None = None
    with open(path, encoding="utf-8", errors="replace") as file:
        for line in file:
            match = _LOG.match(line)
            text = line.strip() if match is None else match["text"].strip()
            if match is not None:
                now = _seconds(match)
                if len(record) > 1 and now != record["time_s"]:
                    yield record
                    record = {}
                record["time_s"] = now
            if waiting is not None and re.fullmatch(_NUMBER, text):
                record[waiting], waiting = float(text), None
                continue
            if match is not None and re.fullmatch(_NUMBER, text):
                record["value"] = float(text)
            for found in _PAIR.finditer(text):
                if found["value"] is None:
                    waiting = found["key"]
                else:
                    record[found["key"]] = float(found["value"])
    if len(record) > 1:
        yield record


def _seconds(match: re.Match[str]) -> float:
    """Time of a log line [s]."""
    if match["date"] is None:
        return float(match["time"] or match["stamp"])
    date = datetime.strptime(match["date"], "%Y-%m-%d %H:%M:%S,%f")
    return date.replace(tzinfo=UTC).timestamp()


def _columns(records: Iterator[dict[str, float]], path: str) -> Table:
    """Columns of those records that have all numbers that most of them have."""
    rows = list(records)
    if not rows:
        raise refuse(
            "no_rows",
            "holds no record with a number; log the readings of the sensor, or record "
            "their topic as a bag",
            path=path,
        )
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
