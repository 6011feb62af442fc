"""Which numbers in the messages of a bag are channels, and how to get at them.

Excluded: opening a bag and going through it (`pushfit.data.recordings.bags.bag`).
"""

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pushfit.data.recordings.recognise import DIRECTION_COLUMNS
from pushfit.data.text.faults import listed, refuse
from pushfit.data.text.layout_guess import NUMBER
from pushfit.data.units import UNITS, Unit, parse_unit, split_unit, volts_of
from pushfit.errors import ConfigError, DataError, stated

# What messages of known types hold, in units that their definitions fix.
_TACTILE = (
    ("biotac_sensors/msg/BioTacHand", "bt_data", "pdc_data"),
    ("sr_robot_msgs/msg/BiotacAll", "tactiles", "pdc"),
)
_WRENCH = "geometry_msgs/msg/WrenchStamped"
_KNOWN = (*(known[0] for known in _TACTILE), _WRENCH)
# Numbers of a message that are listed.
_MAX_LISTED = 24
# Indices of an array, as they are listed.
_RANGE = re.compile(r"\[0\.\.\d+\]")
# A number that is no part of a word, such as of the serial of a sensor.
_NUMBER_IN_TEXT = re.compile(rf"(?<![\w.]){NUMBER['.'].pattern}(?![\w.])", re.ASCII)
# Whatever Python raises where a path leads nowhere.
NOT_THERE = (LookupError, AttributeError, TypeError, ValueError)
_GLUED_INDEX = re.compile(r"(?P<name>.*?\D)(?P<index>\d+)")


@dataclass(slots=True, kw_only=True)
class Field:
    """One number of each message of a topic."""

    name: str
    topic: str
    path: tuple[str, ...]
    unit: Unit
    values: list[float] = field(default_factory=list)


def mapped_fields(
    path: str, mapping: Mapping[str, str], *, units: Mapping[str, str], reader: Any
) -> list[Field]:
    """Resolve the mapped fields against the bag's topics.

    Raises:
        ConfigError: If a unit is missing or wrong, or the time is mapped.
        DataError: If there is no such topic (`missing_column`).
    """
    fields = []
    for key, target in mapping.items():
        name, suffix = split_unit(key)
        topic, _, rest = target.partition(".")
        # ROS 1 lets topics be without the slash that users write.
        topic = next(
            (t for t in (topic, topic.lstrip("/"), f"/{topic}") if t in reader.topics),
            topic,
        )
        if name == "time":
            raise ConfigError(
                f"{path}: the time of a bag comes from its stamps; map channels only",
                code="time_in_bag",
            )
        if topic not in reader.topics or not rest:
            raise refuse(
                "missing_column",
                f"{stated(mapping={key: target})} is not /topic.field of this bag; "
                f"name a field of one of its topics: {_described(reader)}",
                path=path,
            )
        volts = volts_of(target) or volts_of(key)
        known = [
            unit.of_volts(volts or unit.volts)
            for unit in (suffix, *_stated(units, name, key))
            if unit
        ]
        quantity = "angle" if name in DIRECTION_COLUMNS else "signal"
        unit = known[0] if known and all(map(known[0].equals, known)) else None
        if unit is None or unit.quantity != quantity:
            found = " and ".join(dict.fromkeys(u.name for u in known)) or "none"
            example = "deg" if quantity == "angle" else "counts"
            raise ConfigError(
                f"{path}: {name} needs one {quantity} unit, stated is {found}; state "
                f"{stated(units={name: example})}",
                code="missing_unit",
            )
        steps = tuple(filter(None, re.split(r"[.\[\]]+", rest)))
        fields.append(Field(name=name, topic=topic, path=steps, unit=unit))
    return fields


def _stated(units: Mapping[str, str], *names: str) -> list[Unit]:
    return [parse_unit(units[name]) for name in names if name in units]


def _described(reader: Any) -> str:
    return ", ".join(f"{t} ({info.msgtype})" for t, info in reader.topics.items())


def known_fields(path: str, reader: Any, first: Callable[[str], Any]) -> list[Field]:
    """Find the signals of the one topic whose message type is known.

    Args:
        first: Gives the first message of a topic, None if it has none.

    Raises:
        DataError: If there is no topic (`no_rows`), none that is known (`no_channel`),
            or several (`ambiguous_topic`).
    """
    if not reader.topics:
        raise refuse("no_rows", "the bag holds no messages; record again", path=path)
    topics = [t for t, info in reader.topics.items() if info.msgtype in _KNOWN]
    if len(topics) != 1:
        count = "no topic" if not topics else f"{len(topics)} topics"
        paths = _paths(reader, first)
        path_shown = _RANGE.sub("[0]", paths[-1]) if paths else "/topic.field"
        known = listed(paths, _MAX_LISTED) or "none"
        raise refuse(
            "no_channel" if not topics else "ambiguous_topic",
            f"{count} of a known type among {_described(reader)}; state "
            f"{stated(mapping={'pressure': path_shown}, units={'pressure': 'counts'})}"
            f"; the numbers in the first messages are {known}{_meaning(known)}",
            path=path,
        )
    topic = topics[0]
    msgtype = reader.topics[topic].msgtype
    if msgtype == _WRENCH:
        unit = UNITS["n"]
        found = {f"force_{axis}": ("wrench", "force", axis) for axis in "xyz"}
    else:
        unit = UNITS["counts"]
        _, array, number = next(known for known in _TACTILE if known[0] == msgtype)
        stem = number.removesuffix("_data")
        n_fingers = len(getattr(first(topic), array, ()))
        found = {f"{stem}{i}": (array, str(i), number) for i in range(n_fingers)}
    return [
        Field(name=name, topic=topic, path=steps, unit=unit)
        for name, steps in found.items()
    ]


def numbers_in(message: Any, prefix: str = "") -> list[str]:
    """Paths of all numbers of a message, also of those that a text holds.

    Of an array or a text there is one path for all: `data[0..2]` has three numbers.
    """
    if message is None or isinstance(message, bool | bytes):
        return []
    if isinstance(message, str):
        is_read = _NUMBER_IN_TEXT.search(message)
        return [f"{prefix}{_indices(len(_parts(message)))}"] if is_read else []
    if isinstance(message, int | float | np.number):
        return [prefix]
    if hasattr(message, "__len__"):
        n = len(message)
        return numbers_in(message[0], f"{prefix}{_indices(n)}") if n else []
    return [
        path
        for name in _fields_of(message)
        for path in numbers_in(getattr(message, name), f"{prefix}.{name}")
    ]


def _fields_of(message: Any) -> list[str]:
    """Names of the fields of a message; none of what is no message."""
    names = vars(type(message)).get("__slots__") or getattr(message, "__dict__", ())
    return [name for name in names if not name.startswith("_")]


def _indices(n: int) -> str:
    """Indices of so many numbers, counted from 0."""
    return "[0]" if n == 1 else f"[0..{n - 1}]"


def _parts(value: Any) -> Any:
    """What an index counts: numbers in a text, elements of an array; None of others."""
    if isinstance(value, str):
        return NUMBER["."].findall(value)
    return value if hasattr(value, "__len__") else None


def _paths(reader: Any, first: Callable[[str], Any]) -> list[str]:
    """Numbers of all topics, as `mapping` takes them."""
    paths = [
        path for topic in reader.topics for path in numbers_in(first(topic), topic)
    ]
    return [path for path in paths if ".header." not in path]


def number_at(message: Any, path: Sequence[str]) -> float:
    """Follow a path into a message; raises whatever Python does where it ends.

    Args:
        path: Names of fields, indices into arrays and texts, names of joints.
    """
    value, parent = message, message
    for step in path:
        value, parent = _stepped(value, parent, step)
    return float(value)


def _stepped(value: Any, parent: Any, step: str) -> tuple[Any, Any]:
    """What a step of a path leads to, and the message that this is in."""
    parts = _parts(value)
    if parts is not None:
        is_joint = not (isinstance(value, str) or step.isdigit())
        index = _joints(parent).index(step) if is_joint else int(step)
        return parts[index], parent
    glued = _GLUED_INDEX.fullmatch(step)
    if not hasattr(value, step) and glued:
        return getattr(value, glued["name"])[int(glued["index"])], value
    return getattr(value, step), value


def _joints(message: Any) -> list[str]:
    """Names of the joints of a joint state; none of another message."""
    return list(getattr(message, "name", ()))


def bad_field(path: str, item: Field, *, message: Any, count: int) -> DataError:
    """Say that a message does not hold a field, and what it holds."""
    value, parent, passed = message, message, 0
    with contextlib.suppress(*NOT_THERE):
        for step in item.path:
            value, parent = _stepped(value, parent, step)
            passed += 1
    parts, there = _parts(value), _written(item.path[:passed])
    if parts is None or not there:
        paths = [p for p in numbers_in(message) if not p.startswith(".header.")]
        known = listed([p.lstrip(".") for p in paths], _MAX_LISTED)
        held = f"map what it holds: {known or 'no number'}{_meaning(known)}"
    elif len(parts) == 0:
        held = f"{there} is empty in it; map another field"
    else:
        held = f"{there} has {_counted(len(parts))}; map one of these"
        joints = _joints(parent)
        if len(joints) == len(parts):
            held += f", or a joint: {listed(joints, _MAX_LISTED)}"
    return refuse(
        "missing_column",
        f"message {count} of {item.topic} has no number {_written(item.path)}; {held}",
        path=path,
    )


def _counted(n: int) -> str:
    """How many numbers there are, and their indices."""
    return "1 number, [0]" if n == 1 else f"{n} numbers, [0] to [{n - 1}]"


def _meaning(known: str) -> str:
    """What a range of indices among paths stands for, where there is one."""
    return ", where [0..n] is an index from 0 to n" if _RANGE.search(known) else ""


def _written(path: Sequence[str]) -> str:
    """A path as `mapping` takes it."""
    steps = [f"[{step}]" if step.isdigit() else f".{step}" for step in path]
    return "".join(steps).lstrip(".")
