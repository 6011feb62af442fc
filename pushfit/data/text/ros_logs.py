"""Logs of ROS: what nodes print and write, and what `topic echo` prints of messages.

A program may print its readings in any words. Names with `:` or `=` before numbers are
looked for first; sentences of one number and lists in brackets are taken only where
next to nothing else has numbers, for there are many of them that are no readings.

Of messages between lines of dashes numbers are named by the fields that lead to them,
and elements of a list by their index as in a bag: `bt_data[0].pdc_data`. Excluded:
which records make the columns of a table (`pushfit.data.text.foreign`), and tables of
`rostopic echo -p` (`pushfit.data.text.dialects`).
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

from pushfit.data.text.faults import refuse
from pushfit.data.units import Unit, find_unit
from pushfit.errors import DataError

NUMBER_PATTERN = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
# A reading, also one that is missing.
VALUE = rf"(?:{NUMBER_PATTERN}|[+-]?\.?(?i:nan))"
_LEVEL = "(?:DEBUG|INFO|WARN(?:ING)?|ERROR|FATAL)"
# What a node prints, what it writes to its own log, and what rosout writes to its.
_LOG = re.compile(
    rf"(?:\[ *{_LEVEL}\]\s*\[(?:WallTime:\s*)?(?P<time>{NUMBER_PATTERN})[^\]]*\]:?"
    r"(?:\s*\[[A-Za-z][\w./]*\]:)?"  # the node, which ROS 2 names
    rf"|\[[\w./]+\]\[{_LEVEL}\] (?P<date>\d{{4}}-\d\d-\d\d \d\d:\d\d:\d\d,\d+):"
    rf"|(?P<stamp>{NUMBER_PATTERN})\s+{_LEVEL} /\S+(?:\s+\[[^\]]*\])*)\s*(?P<text>.*)",
    re.M,
)
_NAME = r"[A-Za-z_]\w*"
# What begins as a number and is none, as one with a decimal comma.
_WORD = r"[+-]?(?:\.?\d(?:[^\s,;:=]|,(?=\d))*|(?i:inf(?:inity)?))"
_PAIR = re.compile(
    rf"(?P<key>{_NAME})\s*[:=]\s*(?P<value>{VALUE}(?!,\d)|{_WORD})?\s*(?:,|$|\s)"
)
# A word after a number, unless it is the next name.
_UNIT = re.compile(
    r"[\[(]?(?P<unit>[^\W\d][^\s.,;:=\])]*)[\])]?(?=[.,;]|\s|$)(?!\s*[:=])"
)
# A name may have its unit, as in `force (N): 2.3`, and a sentence that of its number.
_NAMED = rf"(?P<key>{_NAME}(?:\s*[\[(][^\W\d][^\s\])]*[\])])?)"
_NAMED_PAIR = re.compile(rf"{_NAMED}\s*[:=]\s*(?P<value>{VALUE})\s*(?:,|;|$|\s)")
_SENTENCE = re.compile(
    rf"{_NAMED}\s+(?:is\s+)?(?P<value>{VALUE})\s*(?P<unit>[^\W\d]\S*?)?\.?"
)
# Beside pairs there may be sentences: `f 3.2, state=3`. A decimal comma ends none.
_BETWEEN = re.compile(r"\s*[,;](?:\s+|$)")
_LIST = re.compile(
    rf"(?:(?P<key>{_NAME})\s*(?:[:=]|is\b)?\s*)?"
    rf"[\[(]\s*(?P<cells>{VALUE}(?:(?:\s*,\s*|\s+){VALUE})*)\s*[\])]"
)
# A line of a message, and what may stand in it.
_LINE = re.compile(
    rf"(?P<indent> *)(?P<dash>-(?:\s+|$))?(?:(?P<key>{_NAME}):\s*)?"
    r"(?P<value>.*?)\s*$"
)
_HELD = re.compile(rf"(?:\[.*\]|{VALUE})?")
_END = "---"
# Messages of one field that is printed alone.
_BARE = re.compile(rf"(?:{VALUE}\s*\n{_END}\s*\n){{2}}")
# What is printed before the first message.
_WARNED = re.compile(r"\A(?:WARNING: .*\n(?:Is /clock .*\n)?)+")
# What colours a terminal.
_COLOURS = re.compile(r"\x1b\[[\d;]*m")
# Lines with pairs are no readings, but say how a program was started, where sentences
# are so many times as many. Not tuned.
_FEW = 0.02
# Characters of a line that are shown.
_SHOWN = 80


@dataclass(slots=True, kw_only=True)
class LogRecord:
    """What a log tells of one moment, or by one message.

    Args:
        line: Where it begins, counted from 1.
        at: The line that is being read.
        time_s: The moment, where it is told beside the record [s].
        numbers: Numbers by their names, NaN where they are missing.
        words: What stands in place of numbers, with its line.
        units: Units that are written beside numbers, with their lines.
    """

    line: int
    at: int
    time_s: float | None = None
    numbers: dict[str, float] = field(default_factory=dict)
    words: dict[str, tuple[int, str]] = field(default_factory=dict)
    units: dict[str, tuple[int, Unit]] = field(default_factory=dict)

    def put(self, name: str, text: str) -> None:
        """Take a number, or what stands in its place."""
        if re.fullmatch(VALUE, text):
            is_missing = text.lower().endswith("nan")
            self.numbers[name] = math.nan if is_missing else float(text)
            self.words.pop(name, None)
        else:
            self.words[name] = (self.at, text)
            self.numbers.pop(name, None)


def uncoloured(text: str) -> str:
    """Text without what colours it on a terminal."""
    return _COLOURS.sub("", text)


def is_log(text: str) -> bool:
    """Whether lines of a text, without colours, are of a log."""
    return re.search(rf"^{_LOG.pattern}", text, re.M) is not None


def log_records(path: str) -> list[LogRecord]:
    """What is told of each moment.

    Raises:
        DataError: If no line has a number that is understood (`no_rows`).
    """
    pairs = _records(path, _pairs)
    n_pairs = sum(1 for record in pairs if record.numbers)
    if n_pairs and n_pairs >= _FEW * sum(1 for _ in _lines(path)):
        return pairs
    others = _records(path, _sentences)
    records = pairs if n_pairs and n_pairs >= _FEW * len(others) else others
    if not records:
        raise _not_understood(path)
    return records


def _lines(path: str) -> Iterator[str]:
    with open(path, encoding="utf-8", errors="replace") as file:
        yield from map(uncoloured, file)


def _records(
    path: str, read: Callable[[str, bool, LogRecord], str | None]
) -> list[LogRecord]:
    """What is told of each moment; a value may be on the line below its name.

    Args:
        read: Puts the numbers of a text into a record, and gives the name of one that
            is to come. It is told whether a line of the log begins with the text.
    """
    records: list[LogRecord] = []
    waiting: str | None = None
    for place, line in enumerate(_lines(path), 1):
        match = _LOG.match(line)
        text = line.strip() if match is None else match["text"].strip()
        if match is not None:
            now = _seconds(match)
            if not records or now != records[-1].time_s:
                records.append(LogRecord(line=place, at=place, time_s=now))
        if not records:
            continue
        record = records[-1]
        record.at = place
        if waiting is not None and re.fullmatch(VALUE, text):
            record.put(waiting, text)
            waiting = None
            continue
        waiting = read(text, match is not None, record) or waiting
    return [record for record in records if record.numbers or record.words]


def _pairs(text: str, begins: bool, record: LogRecord) -> str | None:
    """Numbers after names with `:` or `=`, and between them, or a number alone."""
    if begins and re.fullmatch(VALUE, text):
        record.put("value", text)
        return None
    waiting = None
    pairs = list(_PAIR.finditer(text))
    for part in _BETWEEN.split(text) if pairs else ():
        _say(part, record)
    for found in pairs:
        name, value = found["key"], found["value"]
        if value is None:
            waiting = name
            continue
        record.put(name, value)
        word = None if found[0].endswith(",") else _UNIT.match(text, found.end())
        unit = None if word is None else find_unit(word["unit"])
        if unit is not None:
            record.units[name] = (record.at, unit)
    return waiting


def _sentences(text: str, begins: bool, record: LogRecord) -> None:
    """Numbers of a list, after names with their units, or in a sentence of one."""
    if not begins:
        return
    if row := _LIST.fullmatch(text):
        for k, cell in enumerate(re.findall(VALUE, row["cells"])):
            record.put(f"{row['key'] or 'value'}[{k}]", cell)
        return
    named = list(_NAMED_PAIR.finditer(text))
    for pair in named:
        record.put(pair["key"], pair["value"])
    if not named:
        _say(text, record)


def _say(text: str, record: LogRecord) -> None:
    """Take the number of a sentence that says nothing else."""
    said = _SENTENCE.fullmatch(text)
    if said is None or (said["unit"] and find_unit(said["unit"]) is None):
        return
    unit = f" ({said['unit']})" if said["unit"] else ""
    record.put(f"{said['key']}{unit}", said["value"])


def _not_understood(path: str) -> DataError:
    """Say which form lines are to have, beside the first of those most alike."""
    first: dict[str, tuple[int, str]] = {}
    alike: Counter[str] = Counter()
    for i, line in enumerate(_lines(path), 1):
        match = _LOG.match(line)
        if match is not None and re.search(NUMBER_PATTERN, match["text"]):
            form = re.sub(NUMBER_PATTERN, "0", match["text"])
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


def is_echo(text: str) -> bool:
    """Whether a text begins with a message, and the message ends within."""
    text = _WARNED.sub("", text)
    if _BARE.match(text):
        return True
    first = _LINE.match(text.lstrip("-\n ").partition("\n")[0])
    is_field = first is not None and first["key"] and _HELD.fullmatch(first["value"])
    return bool(is_field) and re.search(rf"^{_END}\s*$", text, re.M) is not None


def echo_records(path: str, *, bare: str = "value") -> list[LogRecord]:
    """What all messages hold.

    Args:
        bare: Name of what is printed without one.

    Raises:
        DataError: If none has (`no_rows`).
    """
    messages = _messages(path, bare)
    if not any(message.numbers for message in messages):
        raise refuse(
            "no_rows",
            "holds no message with a number; print the topic of the sensor, or record "
            "it as a bag",
            path=path,
        )
    return messages


def _messages(path: str, bare: str) -> list[LogRecord]:
    """What each message holds, by the path that leads there."""
    messages: list[LogRecord] = []
    message: LogRecord | None = None
    above: list[tuple[int, str]] = []
    counts: Counter[str] = Counter()
    with open(path, encoding="utf-8", errors="replace") as file:
        for place, line in enumerate(file, 1):
            if line.startswith(_END):
                message, above, counts = None, [], Counter()
                continue
            match = _LINE.match(line.rstrip("\n"))
            # A last line without its end may be cut inside a number.
            if match is None or not line.endswith("\n"):
                continue
            if message is None:
                message = LogRecord(line=place, at=place)
                messages.append(message)
            message.at = place
            depth = len(match["indent"])
            if match["dash"]:
                # ROS 2 prints dashes right below the name of their list, ROS 1 deeper.
                above = [(d, step) for d, step in above if d <= depth]
                name = _joined(above)
                above.append((depth + 1, f"[{counts[name]}]"))
                counts[name] += 1
                depth += len(match["dash"])
            if match["key"]:
                above = [(d, step) for d, step in above if d < depth]
                above.append((depth, match["key"]))
            _put(message, _joined(above) or bare, match["value"])
    return messages


def _put(message: LogRecord, name: str, value: str) -> None:
    """Put a value into a message, or all of a list."""
    if value.startswith("["):
        cells = value.strip("[]").split(",") if value != "[]" else ()
        for k, cell in enumerate(cells):
            message.put(f"{name}[{k}]", cell.strip())
    elif value:
        message.put(name, value)


def _joined(above: list[tuple[int, str]]) -> str:
    """The path of the fields and indices that a line is within."""
    steps = (step if step.startswith("[") else f".{step}" for _, step in above)
    return "".join(steps).removeprefix(".")
