"""Which column is the clock, a channel or an angle, and in what unit.

Units come from the column's suffix, from a row of units, from the mapping, or from the
user; they must agree. A column without a unit is left alone unless it is needed.
Excluded: recognising columns by name (`pushfit.data.recordings.recognise`).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pushfit.data.recordings.recognise import DIRECTION_COLUMNS, RecordingColumns, if_in
from pushfit.data.text.dialects import Layout
from pushfit.data.text.faults import data_error, listed, problem
from pushfit.data.text.layout_guess import Stamp, stamp_of
from pushfit.data.units import UNITS, Dimension, Unit, parse_unit, split_unit
from pushfit.errors import ConfigError, InputProblem, did_you_mean, stated

# Names that no example should take for a signal.
NO_SIGNAL = re.compile(r"(^t|seq|time|stamp|n?secs?|frame_id|index)$")

_NANOSECONDS = UNITS["ns"]
_CLOCK_STEMS = ("time", "t", "timestamp", "stamp", "elapsed", "time_stamp")
# Clocks that a dialect defines, the better one first: the sensor's own stamp tells when
# a sample was taken, the other when it was received.
_DIALECT_CLOCKS: dict[str, tuple[tuple[str, str], ...]] = {
    "rostopic": (("field.header.stamp", "ns"), ("%time", "ns")),
    "plotjuggler": (("__time", "s"), ("time", "s")),
    "mcapcsv": (("log_time", "ns"),),
}
# Numbers that points, strokes or colons part, as of a date or of a time of day.
_DATE = re.compile(r"\d[./:-]\d+[./:-]\d")
# The index of a message in a list of messages.
_ELEMENT = re.compile(r"\[\d+\](?=\.)")
_SECONDS = re.compile(r"^(?P<stem>.*?)[._]?(?P<part>n?secs?|nanosecs?|seconds)$", re.I)


@dataclass(frozen=True, slots=True, kw_only=True)
class Role:
    """What one column is for.

    Args:
        name: `time`, a channel, `theta` or `alpha`.
        columns: Position of the column; two of them for seconds with nanoseconds.
        unit: Unit of its cells.
        stamp: What ISO 8601 times the cells are; None where they are numbers.
    """

    name: str
    columns: tuple[int, ...]
    unit: Unit
    stamp: Stamp | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ColumnRoles:
    """What the columns of a recording are for.

    Args:
        clocks: Clocks in order of preference; a later one stands in where the stamps
            of the earlier one were never filled in (all zero).
        channels: Signals.
        angles: Push angles.
        ignored: Names of columns without a role.
        cautions: Columns that look like what was stated otherwise.
    """

    clocks: tuple[Role, ...]
    channels: tuple[Role, ...]
    angles: tuple[Role, ...]
    ignored: tuple[str, ...]
    cautions: tuple[str, ...]


class _Columns(RecordingColumns):
    """The columns of one recording, what they are mapped to, and what is wrong."""

    def __init__(
        self,
        layout: Layout,
        mapping: Mapping[str, str],
        units: Mapping[str, str],
        path: str,
    ) -> None:
        names = layout.names
        units = {_indexed(key, names): unit for key, unit in units.items()}
        super().__init__(names, path=path, unit_row=layout.unit_row, units=units)
        self.line = layout.header_line
        self.first_row = layout.first_row
        self.writer, self.rate = layout.writer, layout.rate
        self.mapped = {
            split_unit(key)[0]: (key, _indexed(name, names))
            for key, name in mapping.items()
        }
        self.problems: list[InputProblem] = []

    def add(self, code: str, text: str, column: str | None = None) -> None:
        self.problems.append(
            problem(code, text, path=self.path, line=self.line, column=column)
        )


def _elements(name: str, names: Sequence[str]) -> list[str]:
    """Columns that are called so but for the index of a message in a list."""
    return [n for n in names if n != name and _ELEMENT.sub("", n) == name]


def _indexed(name: str, names: Sequence[str]) -> str:
    """Name of a column, with the index that goes without saying in a list of one."""
    elements = _elements(name, names)
    return elements[0] if len(elements) == 1 and name not in names else name


def assign_roles(
    layout: Layout,
    *,
    mapping: Mapping[str, str],
    units: Mapping[str, str],
    path: str,
    rate: float | None = None,
) -> ColumnRoles:
    """Decide what each column of a recording is for.

    Args:
        mapping: Column name by channel, or by `time`, `theta` and `alpha`.
        rate: Samples per second as the user states them; no column is the time then,
            unless it is mapped [Hz].

    Raises:
        ConfigError: If units contradict each other or are stated for nothing.
        DataError: If the clock, all channels, or a mapped column are missing, or a
            needed unit is; `.problems` lists all.
    """
    columns = _Columns(layout, mapping, units, path)
    _check_stated_names(columns)
    is_counted = rate is not None and "time" not in columns.mapped
    clocks = [] if is_counted else _clocks(columns)
    taken = {i for clock in clocks for i in clock.columns}
    angles = _angles(columns)
    taken |= {i for angle in angles for i in angle.columns}
    channels = _channels(columns, taken)
    taken |= {i for channel in channels for i in channel.columns}
    ignored = [n for i, n in enumerate(columns.names) if n and i not in taken]
    if not channels and not any(p.code == "missing_column" for p in columns.problems):
        signals = [name for name in ignored if not NO_SIGNAL.search(name.lower())]
        first = signals[0] if signals else "pdc"
        (channel, unit), how = _example(first), ""
        # A volt is no unit of a push, until a gain makes one of it.
        if first in columns.position and columns.volts(columns.position[first]):
            channel, unit, how = "force", "500mN/V", ", with the gain of the sensor"
        columns.add(
            "no_channel",
            f"no column states a signal unit: {listed(columns.names)}; rename one, "
            "such as pressure_kpa, or state "
            f"{stated(mapping={channel: first}, units={channel: unit})}{how}"
            f"{if_in(unit, 'signal')}",
        )
    if columns.problems:
        raise data_error(columns.problems)
    return ColumnRoles(
        clocks=tuple(clocks),
        channels=tuple(channels),
        angles=tuple(angles),
        ignored=tuple(ignored),
        cautions=_beside_rate(columns, rate) if rate and not clocks else (),
    )


def _beside_rate(columns: _Columns, rate: float) -> tuple[str, ...]:
    """Say so where a column looks like the time that a rate takes the place of."""
    looks = columns.called(*_CLOCK_STEMS) or columns.measuring("time")
    names = [columns.names[i] for i in looks]
    return tuple(
        f"times follow from the rate that is stated, {rate:g} samples a second, and "
        f"not from {listed(names)}; state {stated(mapping={'time': name})} for these"
        for name in names[:1]
    )


def _check_stated_names(columns: _Columns) -> None:
    """Find mapped columns that are not there, and units stated for nothing."""
    for key, name in columns.mapped.values():
        if name not in columns.position and not _pair(columns, name):
            elements = _elements(name, columns.names)
            hint = (
                f" but the elements {listed(elements)}; state one of them"
                if elements
                else did_you_mean(name, columns.position)
            )
            columns.add(
                "missing_column",
                f"{stated(mapping={key: name})} names no column{hint}; "
                f"there are: {listed(columns.names)}",
            )
    stems = {split_unit(name)[0] for name in columns.names}
    known = {*columns.position, *stems, *columns.mapped}
    known |= {"time", *DIRECTION_COLUMNS, *(key for key, _ in columns.mapped.values())}
    for key, unit in columns.units.items():
        parse_unit(unit)
        if key not in known:
            hint = did_you_mean(key, known)
            raise ConfigError(
                f"{columns.path}: a unit is stated for {key!r}, which is no column or "
                f"channel{hint}",
                code="unit_for_nothing",
            )


def _clocks(columns: _Columns) -> list[Role]:
    """Find the time column by mapping, by dialect, or by its name and unit."""
    if "time" in columns.mapped:
        key, name = columns.mapped["time"]
        candidates = [(name, None)]
    else:
        key = "time"
        candidates = [
            (name, unit)
            for name, unit in _DIALECT_CLOCKS.get(columns.writer, ())
            if name in columns.position
        ]
        if columns.writer == "ros2csv" and (pair := _first_pair(columns)):
            candidates = [(pair, None)]
        candidates = candidates or [(name, None) for name in _named_clocks(columns)]
    found = [
        role
        for name, unit in candidates
        if (role := _clock(columns, name, unit, key)) is not None
    ]
    if not found and not columns.problems and columns.rate is None:
        columns.add(
            "no_time",
            f"no time column among {listed(columns.names)}; name one time_s, or state "
            f"{stated(mapping={'time': 'COLUMN'}, units={'time': 's'})}, or the "
            "samples per second by `rate`",
        )
    return found


def _clock(
    columns: _Columns, name: str, dialect_unit: str | None, key: str
) -> Role | None:
    if pair := _pair(columns, name):
        return Role(name="time", columns=pair, unit=_NANOSECONDS)
    if name not in columns.position:
        return None
    i = columns.position[name]
    cell = columns.first_row[i] if i < len(columns.first_row) else ""
    if stamp := stamp_of(cell):
        return Role(name="time", columns=(i,), unit=_NANOSECONDS, stamp=stamp)
    if _DATE.search(cell):
        columns.add(
            "other_date",
            f"{cell!r} is no number, and no date by ISO 8601, such as "
            "2025-05-03T10:00:00.25; write times so, or as seconds, or state the "
            "samples per second by `rate`",
            column=name,
        )
        return None
    unit = columns.unit(i, key) or (UNITS[dialect_unit] if dialect_unit else None)
    return _checked(columns, "time", i, unit, "time", "s")


def _named_clocks(columns: _Columns) -> list[str]:
    """Give the column that is a clock by name; by unit alone if there is just one."""
    timed = [columns.names[i] for i in columns.measuring("time")]
    named = [columns.names[i] for i in columns.called(*_CLOCK_STEMS)]
    both = [name for name in named if name in timed]
    choice = both or named or timed
    if len(choice) > 1:
        columns.add(
            "ambiguous_time",
            f"the columns {listed(choice)} may all be the time; state which by "
            f"{stated(mapping={'time': choice[0]})}",
        )
        return []
    return choice


def _pair(columns: _Columns, stem: str) -> tuple[int, int] | None:
    """Find the columns of seconds and nanoseconds below a common name."""
    parts: dict[bool, int] = {}
    for name, i in columns.position.items():
        match = _SECONDS.match(name)
        if match and match["stem"] == stem:
            parts[match["part"].lower().startswith("n")] = i
    return (parts[False], parts[True]) if len(parts) == 2 else None


def _first_pair(columns: _Columns) -> str | None:
    stems = [m["stem"] for name in columns.names if (m := _SECONDS.match(name))]
    return next((stem for stem in stems if _pair(columns, stem)), None)


def _angles(columns: _Columns) -> list[Role]:
    """Find the push angles by mapping or by name."""
    roles = []
    for angle in DIRECTION_COLUMNS:
        if angle in columns.mapped:
            key, name = columns.mapped[angle]
            places = [columns.position[name]] if name in columns.position else []
        else:
            key, places = angle, columns.called(angle)
        if len(places) > 1:
            names = listed([columns.names[i] for i in places])
            columns.add(
                "ambiguous_angle",
                f"{names} are all {angle}; state which by "
                f"{stated(mapping={angle: 'COLUMN'})}",
            )
        elif places:
            unit = columns.unit(places[0], key)
            role = _checked(columns, angle, places[0], unit, "angle", "deg")
            roles += [role] if role else []
    return roles


def _channels(columns: _Columns, taken: set[int]) -> list[Role]:
    """Find the signals: all that are mapped, and all that state a signal unit."""
    roles: dict[str, Role] = {}
    mapped = {
        columns.position[name]: (stem, key)
        for stem, (key, name) in columns.mapped.items()
        if name in columns.position and stem not in ("time", *DIRECTION_COLUMNS)
    }
    for i, name in enumerate(columns.names):
        if not name or (i in taken and i not in mapped):
            continue
        if i in mapped:
            stem, key = mapped[i]
            unit = columns.unit(i, stem, key)
            role = _checked(
                columns, stem, i, unit, "signal", _example(f"{stem} {name}")[1]
            )
        else:
            unit = columns.unit(i)
            if unit is None or unit.quantity != "signal":
                continue
            role = Role(name=split_unit(name)[0], columns=(i,), unit=unit)
        if role is None:
            continue
        if role.name in roles:
            other = columns.names[roles[role.name].columns[0]]
            columns.add(
                "duplicate_channel",
                f"{other} and {name} would both be the channel {role.name!r}; rename "
                "one, or map both to names of their own",
            )
        roles[role.name] = role
    return list(roles.values())


def _checked(
    columns: _Columns,
    role: str,
    i: int,
    unit: Unit | None,
    quantity: Dimension,
    example: str,
) -> Role | None:
    """Make a role if its unit is known and measures the right thing."""
    name = columns.names[i]
    if unit is not None and unit.quantity == quantity:
        return Role(name=role, columns=(i,), unit=unit)
    found = (
        "states no unit" if unit is None else f"is in {unit.name}, no {quantity} unit"
    )
    columns.add(
        "missing_unit" if unit is None else "wrong_unit",
        f"{found}; rename it to {split_unit(name)[0]}_{example}, or state "
        f"{stated(units={role: example})}{if_in(example, quantity)}",
        column=name,
    )
    return None


def _example(name: str) -> tuple[str, str]:
    """A channel and a unit that samples may have, by what they are called."""
    return ("force", "n") if "force" in name.lower() else ("pressure", "counts")
