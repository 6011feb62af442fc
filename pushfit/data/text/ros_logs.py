"""Logs of ROS nodes, as printed, as nodes write them, and as rosout does.

A program may print its readings in any words. Names with `:` or `=` before numbers are
looked for first; sentences of one number and lists in brackets are taken only where
next to nothing else has numbers, for there are many of them that are no readings.
Excluded: which records make the columns of a table (`pushfit.data.text.foreign`).
"""

import re
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime

from pushfit.data.text.faults import refuse
from pushfit.data.units import find_unit
from pushfit.errors import DataError

LogRecord = dict[str, float]

NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_LEVEL = "(?:DEBUG|INFO|WARN(?:ING)?|ERROR|FATAL)"
# What a node prints, what it writes to its own log, and what rosout writes to its.
_LOG = re.compile(
    rf"(?:\[{_LEVEL}\]\s*\[(?:WallTime:\s*)?(?P<time>{NUMBER})[^\]]*\]:?"
    r"(?:\s*\[[A-Za-z][\w./]*\]:)?"  # the node, which ROS 2 names
    rf"|\[[\w./]+\]\[{_LEVEL}\] (?P<date>\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d,\d+):"
    rf"|(?P<stamp>{NUMBER})\s+{_LEVEL} /\S+(?:\s+\[[^\]]*\])*)\s*(?P<text>.*)",
    re.M,
)
_NAME = r"[A-Za-z_]\w*"
_PAIR = re.compile(rf"(?P<key>{_NAME})\s*[:=]\s*(?P<value>{NUMBER})?\s*(?:,|$|\s)")
# A name may have its unit, as in `force (N): 2.3`, and a sentence that of its number.
_NAMED = rf"(?P<key>{_NAME}(?:\s*[\[(][^\W\d][^\s\])]*[\])])?)"
_NAMED_PAIR = re.compile(rf"{_NAMED}\s*[:=]\s*(?P<value>{NUMBER})\s*(?:,|;|$|\s)")
_SENTENCE = re.compile(
    rf"{_NAMED}\s+(?:is\s+)?(?P<value>{NUMBER})\s*(?P<unit>[^\W\d]\S*?)?\.?"
)
_LIST = re.compile(
    rf"(?:(?P<key>{_NAME})\s*(?:[:=]|is\b)?\s*)?"
    rf"[\[(]\s*(?P<cells>{NUMBER}(?:(?:\s*,\s*|\s+){NUMBER})*)\s*[\])]"
)
# What colours a terminal.
_COLOURS = re.compile(r"\x1b\[[\d;]*m")
# Lines with pairs are no readings, but say how a program was started, where sentences
# are so many times as many. Not tuned.
_FEW = 0.02
# Characters of a line that are shown.
_SHOWN = 80


def uncoloured(text: str) -> str:
    """Text without what colours it on a terminal."""
    return _COLOURS.sub("", text)


def is_log(text: str) -> bool:
    """Whether lines of a text, without colours, are of a log."""
    return re.search(rf"^{_LOG.pattern}", text, re.M) is not None


def log_records(path: str) -> list[LogRecord]:
    """Numbers of each moment by their names, with its time.

    Raises:
        DataError: If no line has a number that is understood (`no_rows`).
    """
    pairs = list(_records(path, _pairs))
    if len(pairs) >= _FEW * sum(1 for _ in _lines(path)):
        return pairs
    others = list(_records(path, _sentences))
    records = pairs if len(pairs) >= _FEW * len(others) else others
    if not records:
        raise _not_understood(path)
    return records


def _lines(path: str) -> Iterator[str]:
    with open(path, encoding="utf-8", errors="replace") as file:
        yield from map(uncoloured, file)


def _records(
    path: str, read: Callable[[str, bool], dict[str, float | None]]
) -> Iterator[LogRecord]:
    """Numbers of each log record; a value may be on the line below its name.

    Args:
        read: Gives the numbers of a text by name, None for one that is to come. It is
            told whether a record begins with the text.
    """
    record: LogRecord = {}
    waiting: str | None = None
    for line in _lines(path):
        match = _LOG.match(line)
        text = line.strip() if match is None else match["text"].strip()
        if match is not None:
            now = _seconds(match)
            if len(record) > 1 and now != record["time_s"]:
                yield record
                record = {}
            record["time_s"] = now
        if waiting is not None and re.fullmatch(NUMBER, text):
            record[waiting], waiting = float(text), None
            continue
        for name, value in read(text, match is not None).items():
            if value is None:
                waiting = name
            else:
                record[name] = value
    if len(record) > 1:
        yield record


def _pairs(text: str, begins: bool) -> dict[str, float | None]:
    """Numbers after names with `:` or `=`, or a number alone."""
    if begins and re.fullmatch(NUMBER, text):
        return {"value": float(text)}
    return {
        found["key"]: float(found["value"]) if found["value"] else None
        for found in _PAIR.finditer(text)
    }


def _sentences(text: str, begins: bool) -> dict[str, float | None]:
    """Numbers of a list, after names with their units, or in a sentence of one."""
    if not begins:
        return {}
    if row := _LIST.fullmatch(text):
        cells = re.findall(NUMBER, row["cells"])
        return {f"{row['key'] or 'value'}[{k}]": float(c) for k, c in enumerate(cells)}
    named = list(_NAMED_PAIR.finditer(text))
    if named:
        return {pair["key"]: float(pair["value"]) for pair in named}
    said = _SENTENCE.fullmatch(text)
    if said is None or (said["unit"] and find_unit(said["unit"]) is None):
        return {}
    unit = f" ({said['unit']})" if said["unit"] else ""
    return {f"{said['key']}{unit}": float(said["value"])}


def _not_understood(path: str) -> DataError:
    """Say which form lines are to have, beside the first of those most alike."""
    first: dict[str, tuple[int, str]] = {}
    alike: Counter[str] = Counter()
    for i, line in enumerate(_lines(path), 1):
        match = _LOG.match(line)
        if match is not None and re.search(NUMBER, match["text"]):
            form = re.sub(NUMBER, "0", match["text"])
            alike[form] += 1
            first.setdefault(form, (i, match["text"].strip()))
    if not alike:
        text = (
            "holds no record with a number; log the readings of the sensor, or record "
            "their topic as a bag"
        )
        return refuse("no_rows", text, path=path)
    place, shown = first[alike.most_common(1)[0][0]]
    return refuse(
        "no_rows",
        f"{shown[:_SHOWN]!r} is no form of a reading that is understood, nor is that "
        "of other lines; log 'force: 2.3', 'fx=0.1, fy=0.2', 'force (N): 2.3', 'force "
        "is 2.3 N', 'force 2.3', '[0.1, 0.2]' or '2.3', or record the topic as a bag",
        path=path,
        line=place,
    )


def _seconds(match: re.Match[str]) -> float:
    """Time of a log line [s]."""
    if match["date"] is None:
        return float(match["time"] or match["stamp"])
    date = datetime.strptime(match["date"], "%Y-%m-%d %H:%M:%S,%f")
    return date.replace(tzinfo=UTC).timestamp()
