"""Logs that are no tables: NumPy arrays, `rostopic echo` without `-p`, rospy logs.

Each is brought into the one form that everything else reads: columns with names. What
the columns mean is told by the same rules as for any other file.
"""

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pushfit.data.text.faults import refuse

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LOG = re.compile(
    rf"\[(?:DEBUG|INFO|WARN|ERROR)\]\s*\[(?:WallTime:\s*)?(?P<time>{_NUMBER})[^\]]*\]:"
    r"?\s*(?P<text>.*)"
)
_PAIR = re.compile(
    rf"(?P<key>[A-Za-z_]\w*)\s*[:=]\s*(?P<value>{_NUMBER})?\s*(?:,|$|\s)"
)
_YAML = re.compile(
    rf"(?P<indent>[ ]*)(?P<key>[A-Za-z_]\w*):\s*(?P<value>\[.*\]|{_NUMBER})?\s*$"
)
_HEAD = 1 << 14

Table = dict[str, np.ndarray]


def foreign_table(
    path: str, *, columns: Sequence[str] = ()
) -> tuple[Table, str] | None:
    """Read a log that is no table.

    Args:
        path: File as the user named it.
        columns: Names of the columns of a bare array.

    Returns:
        Columns by name, and what was recognised; None if it is none of these logs.

    Raises:
        DataError: If it is one that cannot be read.
    """
    suffix = Path(path).suffix.lower()
    if suffix in (".npy", ".npz"):
        return _arrays(path, columns), f"NumPy {suffix}"
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
    if _LOG.match(start):
        return _columns(_logged(path), path), "rospy log"
    return None


def _arrays(path: str, columns: Sequence[str]) -> Table:
    """Columns of a NumPy file: by field, by array, or by the names that are stated."""
    try:
        loaded = np.load(path, allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise refuse(
            "unreadable", f"is no NumPy file of numbers ({error})", path=path
        ) from error
    if not isinstance(loaded, np.ndarray):
        with loaded:
            found = {name: np.ravel(loaded[name]) for name in loaded.files}
        sizes = {values.size for values in found.values()}
        if len(sizes) != 1:
            raise refuse(
                "field_count",
                f"its arrays {', '.join(found)} are of different lengths; keep those "
                "of one clock",
                path=path,
            )
        return {name: values.astype(float) for name, values in found.items()}
    if loaded.dtype.names:
        return {name: loaded[name].astype(float) for name in loaded.dtype.names}
    rows = np.atleast_2d(loaded.T).T
    names = [name for name in columns if name != "..."]
    if not names or len(names) > rows.shape[1]:
        raise refuse(
            "no_header",
            f"holds {rows.shape[1]} columns without names; state them in order, for "
            "example --columns time_s,pressure_kpa",
            path=path,
        )
    return {name: rows[:, k].astype(float) for k, name in enumerate(names)}


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
                now = float(match["time"])
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


def _columns(records: Iterator[dict[str, float]], path: str) -> Table:
    """Columns of records; NaN where one lacks a number that the first has."""
    rows = list(records)
    if not rows:
        raise refuse("no_rows", "holds no record with a number", path=path)
    names = list(rows[0])
    table = {n: np.array([row.get(n, np.nan) for row in rows]) for n in names}
    for seconds in [n for n in names if n.endswith("stamp.secs")]:
        parts = (seconds, seconds.replace("secs", "nsecs"))
        if all(part in table for part in parts):
            # Seconds since 1970 and their nanoseconds are one clock.
            time = table.pop(parts[0]) + table.pop(parts[1]) / 1e9
            table = {"time_s": time, **table}
    return table
