"""Read recordings from ROS bags: ROS 1 `.bag`, ROS 2 `.db3` and `.mcap`.

Message types are decoded by the definitions that the bag carries. The time of a sample
is the stamp in its header, or where that was never filled in, when it was received.
Excluded: which numbers in messages are channels
(`pushfit.data.recordings.bags.fields`).
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from pushfit.data.recordings.bags.fields import (
    NOT_THERE,
    Field,
    bad_field,
    known_fields,
    mapped_fields,
    number_at,
)
from pushfit.data.recordings.bags.repair import (
    is_whole_mcap,
    message_types,
    salvaged_mcap,
)
from pushfit.data.recordings.recognise import DIRECTION_COLUMNS
from pushfit.data.recordings.samples import Samples
from pushfit.data.text.faults import listed, refuse, refuse_too_large
from pushfit.data.text.files import FileStamp, Source, sha256_of
from pushfit.data.units import UNITS
from pushfit.errors import ConfigError, installed_by, stated


@dataclass(slots=True, kw_only=True)
class _Clock:
    """When the messages of a topic were stamped and received [ns]."""

    stamped: list[int] = field(default_factory=list)
    received: list[int] = field(default_factory=list)

    def times(self) -> tuple[Int[np.ndarray, " n"], str]:
        """Give the better of the two, and its name."""
        # A stamp of 0 means, by ROS convention, that nobody filled it in.
        if any(self.stamped):
            return np.array(self.stamped, dtype=np.int64), "header stamp"
        return np.array(self.received, dtype=np.int64), "time of receipt"


def read_bag(
    path: str,
    *,
    mapping: Mapping[str, str],
    units: Mapping[str, str],
    definitions: str | None,
    is_salvage: bool,
    max_bytes: int,
) -> Samples:
    """Read the mapped fields of a bag, or the signals of a message type that is known.

    Known are BioTac hands (`pdc0`, `pdc1`, … in counts) and wrenches (`force_x` … in
    newtons). A mapped field is named `/topic.field.path`; an element of an array as
    `bt_data[0]`, of a joint state as `effort[joint_name]`, of a text with numbers as
    `data[5]`. With `is_salvage` a `.mcap` file that was cut short is read as far as it
    goes.

    Args:
        definitions: Folder of `.msg` files, for bags that carry no definitions.

    Returns:
        The samples; several topics are merged to the union of their times.

    Raises:
        ConfigError: If rosbags is not installed, or the mapping does not fit.
        DataError: If the bag is damaged, or holds no such fields.
    """
    stamp = FileStamp.of(path)
    notes: tuple[str, ...] = ()
    with ExitStack() as stack:
        readable = path
        if is_salvage and not is_whole_mcap(path):
            readable, note = stack.enter_context(salvaged_mcap(path))
            notes = (note,)
        reader = stack.enter_context(closing(_open_reader(path, readable, definitions)))
        fields = mapped_fields(path, mapping, units=units, reader=reader)
        fields = fields or known_fields(path, reader, partial(_first, path, reader))
        _refuse_too_large(path, fields, reader, max_bytes=max_bytes)
        types = {f.topic: reader.topics[f.topic].msgtype for f in fields}
        others = [
            f"{topic} ({reader.topics[topic].msgtype})"
            for topic in sorted(reader.topics.keys() - types.keys())
        ]
        if others:
            notes = (*notes, f"topics not used: {listed(others)}")
        clocks = _collect(path, reader, fields)
    stamp.check()
    time, series, origins = _merged(path, fields, clocks)
    files = _storage_files(path)
    kind = (
        "ROS 1 bag" if files[0].suffix == ".bag" else f"ROS 2 bag ({files[0].suffix})"
    )
    dialect = f"{kind}: {', '.join(f'{t} ({types[t]})' for t in sorted(types))}"
    fields = sorted(fields, key=lambda own: own.name in DIRECTION_COLUMNS)
    return Samples(
        path=path,
        time=time,
        time_unit=UNITS["ns"],
        series={f.name: (series[f.name], f.unit) for f in fields},
        is_union=len(types) > 1,
        sources=tuple(
            Source(path=str(file), sha256=sha256_of(file), dialect=dialect)
            for file in files
        ),
        notes=(f"recognised {dialect}", *notes, *origins),
    )


def _open_reader(path: str, readable: str, definitions: str | None) -> Any:
    """Open a bag, or what was salvaged of it, by rosbags' reader for all kinds."""
    try:
        rosbags = import_module("rosbags.highlevel")
        types = import_module("rosbags.typesys")
    except ImportError as error:
        raise ConfigError(
            f"{path}: bags need the library rosbags, which is not installed; "
            f"{installed_by('ros')}",
            code="ros_not_installed",
        ) from error
    # Bags from before ROS 2 Iron carry no definitions; the standard types have stayed
    # the same.
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    if definitions is not None:
        store.register(message_types(definitions))
    with _library_errors(path):
        reader = rosbags.AnyReader([Path(readable)], default_typestore=store)
        reader.open()
    return reader


@contextmanager
def _library_errors(path: str) -> Iterator[None]:
    """Turn whatever the library raises on a damaged bag into a `DataError`."""
    try:
        yield
    # A cut or damaged file surfaces as errors of sqlite, struct, YAML and more.
    except Exception as error:
        raise refuse(
            "bad_bag",
            f"the bag cannot be read ({type(error).__name__}: {error}); if it was "
            "cut short, try `rosbag reindex`, `ros2 bag reindex` or, for a .mcap file "
            f"itself, {stated(tail='salvage')}",
            path=path,
        ) from error


def _messages(
    path: str, reader: Any, topics: Set[str]
) -> Iterator[tuple[str, int, Any]]:
    """Give topic, time of receipt [ns] and content of each message."""
    wanted = [c for c in reader.connections if c.topic in topics]
    if unknown := {c.msgtype for c in wanted} - reader.typestore.fielddefs.keys():
        raise refuse(
            "no_definition",
            f"the bag carries no definition of {', '.join(sorted(unknown))}; state the "
            f"folder of its package, as in {stated(definitions='src/biotac_sensors')}",
            path=path,
        )
    with _library_errors(path):
        messages = reader.messages(wanted)
    while True:
        with _library_errors(path):
            item = next(messages, None)
            if item is None:
                return
            connection, received, raw = item
            message = reader.deserialize(raw, connection.msgtype)
        yield connection.topic, received, message


def _first(path: str, reader: Any, topic: str) -> Any:
    return next((message for _, _, message in _messages(path, reader, {topic})), None)


def _refuse_too_large(
    path: str, fields: Sequence[Field], reader: Any, *, max_bytes: int
) -> None:
    topics = sorted({f.topic for f in fields})
    n = sum(reader.topics[topic].msgcount for topic in topics)
    if n == 0:
        raise refuse(
            "no_rows",
            f"the bag holds no messages of {', '.join(topics) or 'a known field'}; map "
            "a topic that has some, or record again with the sensor switched on",
            path=path,
        )
    needed = n * 8 * (len(fields) + 1)
    refuse_too_large(
        path,
        f"{n} messages",
        needed=needed,
        max_bytes=max_bytes,
        remedy="split the bag",
    )


def _collect(path: str, reader: Any, fields: Sequence[Field]) -> dict[str, _Clock]:
    """Read all messages of the fields' topics."""
    clocks = {f.topic: _Clock() for f in fields}
    for topic, received, message in _messages(path, reader, clocks.keys()):
        clock = clocks[topic]
        clock.received.append(received)
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        clock.stamped.append(stamp.sec * 10**9 + stamp.nanosec if stamp else 0)
        for item in fields:
            if item.topic == topic:
                try:
                    value = number_at(message, item.path)
                except NOT_THERE as error:
                    count = len(clock.received)
                    raise bad_field(path, item, message=message, count=count) from error
                item.values.append(value)
    return clocks


def _merged(
    path: str, fields: Sequence[Field], clocks: Mapping[str, _Clock]
) -> tuple[Int[np.ndarray, " n"], dict[str, Float[np.ndarray, " n"]], tuple[str, ...]]:
    """Bring the topics to the union of their times, NaN where one has no sample."""
    times, notes = {}, []
    for topic, clock in clocks.items():
        times[topic], origin = clock.times()
        notes.append(f"{topic}: time from the {origin}")
    if len(times) == 1:
        series = {f.name: np.array(f.values, dtype=float) for f in fields}
        return next(iter(times.values())), series, tuple(notes)
    for topic, own in times.items():
        wrong = np.flatnonzero(np.diff(own) <= 0)
        if wrong.size:
            raise refuse(
                "time_not_increasing",
                f"the time of {topic} does not increase at its message {wrong[0] + 2}; "
                "split the bag there",
                path=path,
            )
    time = np.unique(np.concatenate(list(times.values())))
    series = {}
    for item in fields:
        series[item.name] = np.full(time.size, np.nan)
        series[item.name][np.searchsorted(time, times[item.topic])] = item.values
    return time, series, tuple(notes)


def _storage_files(path: str) -> list[Path]:
    """Give the bag's own file, or the files in its folder that hold messages."""
    given = Path(path)
    if not given.is_dir():
        return [given]
    return sorted(p for p in given.iterdir() if p.suffix in (".db3", ".mcap"))
