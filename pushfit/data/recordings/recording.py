"""Read a recording in any known dialect.

Bytes become clean text (`textfile`), whose layout is recognised (`dialects`) and held
against every line (`scan`, `explain`); the columns get their roles (`roles`), only the
needed ones are parsed (`csv_reader`), and the samples must make sense as a recording
(`samples`). Bags enter at the last step (`bags`). Excluded: the pushes in it
(`pushfit.data.peaks.extract`).
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from jaxtyping import Num, Shaped

from pushfit.arguments import checked
from pushfit.config.inputs import Format, Gaps, Tail, ThetaFrom
from pushfit.data.recordings.bags.bag import read_bag
from pushfit.data.recordings.records import Recording
from pushfit.data.recordings.roles import ColumnRoles, Role, assign_roles
from pushfit.data.recordings.samples import Samples, build_recording
from pushfit.data.text.csv_reader import MAX_BYTES, read_cells, row_problems
from pushfit.data.text.dialects import Layout, find_layout
from pushfit.data.text.explain import Kind
from pushfit.data.text.faults import data_error, listed
from pushfit.data.text.files import Source, existing_file, is_bag, sha256_of
from pushfit.data.text.foreign import ForeignTable, foreign_table
from pushfit.data.text.ros_logs import NUMBER_PATTERN
from pushfit.data.text.textfile import TextFile, open_text
from pushfit.data.units import UNITS, Calibration
from pushfit.errors import DataError

_NOTHING: Mapping[str, str] = MappingProxyType({})
_UNCHANGED: Mapping[str, Calibration] = MappingProxyType({})


@checked
def read_recording(
    path: str | Path,
    *,
    format: Format = "auto",
    mapping: Mapping[str, str] = _NOTHING,
    units: Mapping[str, str] = _NOTHING,
    columns: Sequence[str] = (),
    rate: float | None = None,
    calibration: Mapping[str, Calibration] = _UNCHANGED,
    definitions: str | None = None,
    theta_from: ThetaFrom = "tangential",
    gaps: Gaps = "error",
    tail: Tail = "drop",
    missing: Sequence[str] = (),
    encoding: str | None = None,
    trust_units: bool = False,
    max_bytes: int = MAX_BYTES,
) -> Recording:
    """Read a recording, or say everything that is wrong with it.

    Every column that states a signal unit (`force_n`, `pressure_kpa`), is mapped, or
    has a unit stated in `units` becomes a channel; `theta` and `alpha` become the push
    angles. Other columns are ignored with a note.

    Args:
        path: CSV file, plain or compressed by gzip, a ROS bag, the output of
            `rostopic echo`, a ROS log, or a NumPy file.
        format: Dialect; `auto` recognises it.
        mapping: Column name by channel name, and by `time`, `theta` and `alpha`; for
            bags `/topic.field.path`.
        units: Unit by channel or column name, where the name states none.
        columns: Column names in order, for a file without a header; a last name `...`
            stands for all that follow.
        rate: Samples per second, in place of a column of times, unless `mapping` names
            one; None where a column or the file itself tells it [Hz].
        calibration: Conversion by channel name.
        definitions: Folder of `.msg` files, for ROS 2 bags that carry no definitions.
        theta_from: What a recorded theta is measured from: the tangential plane, or
            the contact normal (elevation = 90° minus it).
        gaps: What to do about missing samples: an `error`, or leave them NaN for peaks
            to be `split` there, or `interpolate` those within five usual steps.
        tail: What to do about a last line without a line end: `drop` it, `keep` it, or
            call it an `error`; `salvage` also drops zero bytes at the end, and reads
            what there is of a `.mcap` file that was cut short.
        missing: Further texts that stand for a missing sample, such as a sentinel.
        encoding: Text encoding; None to judge by the byte-order mark, else UTF-8.
        trust_units: Accept units that the samples make implausible.
        max_bytes: Most memory that the samples may take [bytes].

    Returns:
        The recording, in canonical units.

    Raises:
        ConfigError: If the path cannot be read or the options do not fit it.
        DataError: If the file breaks a rule; `.problems` lists all that were found.
    """
    given = existing_file(path)
    stated = {"mapping": mapping, "units": units}
    if format == "bag" or (format == "auto" and is_bag(given)):
        samples = read_bag(
            given,
            **stated,
            definitions=definitions,
            is_salvage=tail == "salvage",
            max_bytes=max_bytes,
        )
        samples = _without(samples, missing)
    elif foreign := foreign_table(given, columns=columns):
        samples = _foreign_samples(given, foreign, rate=rate, **stated)
        samples = _without(samples, missing)
    else:
        text = open_text(given, encoding=encoding)
        layout = find_layout(text, format=format, columns=columns)
        roles = _roles(text, layout, tail=tail, rate=rate, **stated)
        cells = read_cells(
            text,
            layout,
            _kinds(layout, roles),
            tail=tail,
            missing=missing,
            max_bytes=max_bytes,
        )
        source = Source(path=given, sha256=text.sha256, dialect=layout.description)
        samples = _samples(
            layout, roles, cells.values, rate=rate or layout.rate, source=source
        )
        samples = replace(
            samples,
            is_union=layout.writer == "plotjuggler",
            lines=cells.scan.lines,
            notes=(*samples.notes, *cells.notes),
        )
    recording = build_recording(
        samples, theta_from=theta_from, gaps=gaps, trust_units=trust_units
    )
    for channel, conversion in calibration.items():
        recording = recording.calibrated(channel, conversion)
    return recording


def _without(samples: Samples, missing: Sequence[str]) -> Samples:
    """The same, numbers that stand for missing ones left out where there are no cells.

    Args:
        missing: Texts of the numbers; others stand in cells alone.
    """
    sentinels = [
        float(text) for text in missing if re.fullmatch(NUMBER_PATTERN, text.strip())
    ]
    if not sentinels:
        return samples
    series = {
        name: (np.where(np.isin(values, sentinels), np.nan, values), unit)
        for name, (values, unit) in samples.series.items()
    }
    return replace(samples, series=series)


def _foreign_samples(
    path: str,
    table: ForeignTable,
    *,
    mapping: Mapping[str, str],
    units: Mapping[str, str],
    rate: float | None,
) -> Samples:
    """Sort the columns of a log that is no table by their roles."""
    layout = Layout(
        writer="native",
        delimiter=",",
        decimal=".",
        names=(*table.columns,),
        unit_row=tuple(table.units.get(name, "") for name in table.columns),
    )
    roles = assign_roles(layout, mapping=mapping, units=units, path=path, rate=rate)
    problems = [
        problem
        for role in (*roles.clocks, *roles.channels, *roles.angles)
        for i in role.columns
        for problem in table.problems.get(layout.names[i], ())
    ]
    if problems:
        raise data_error(problems)
    source = Source(path=path, sha256=sha256_of(path), dialect=table.dialect)
    columns, lines = dict(enumerate(table.columns.values())), table.lines
    return replace(
        _samples(layout, roles, columns, rate=rate, source=source),
        lines=None if lines is None else lambda at: lines[at],
        cautions=(*table.cautions, *roles.cautions),
    )


def _roles(
    text: TextFile,
    layout: Layout,
    *,
    mapping: Mapping[str, str],
    units: Mapping[str, str],
    tail: Tail,
    rate: float | None,
) -> ColumnRoles:
    """Give the columns their roles, or list what is wrong with names and rows."""
    try:
        return assign_roles(
            layout, mapping=mapping, units=units, path=text.path, rate=rate
        )
    except DataError as error:
        # The rows may be wrong as well: the user is to mend all in one go.
        rows = row_problems(text, layout, tail=tail)
        raise data_error([*error.problems, *rows]) from error


def _kinds(layout: Layout, roles: ColumnRoles) -> dict[int, Kind]:
    """Give what the cells of each needed column must be."""
    kinds: dict[int, Kind] = {}
    for clock in roles.clocks:
        # Nanoseconds since 1970 have 19 digits, three more than a float64 holds.
        kind: Kind = clock.stamp or ("int" if clock.unit.name == "ns" else "float")
        kinds |= dict.fromkeys(clock.columns, kind)
    for role in (*roles.channels, *roles.angles):
        kinds[role.columns[0]] = "float"
    return kinds


def _samples(
    layout: Layout,
    roles: ColumnRoles,
    columns: Mapping[int, Shaped[np.ndarray, " n"]],
    *,
    rate: float | None,
    source: Source,
) -> Samples:
    """Sort columns by their roles.

    Args:
        columns: Those that are needed, by their position.
    """
    if roles.clocks:
        clock, time = _first_filled_clock(roles, columns)
        unit = clock.unit
        origin = " and ".join(layout.names[i] for i in clock.columns)
    else:
        n_rows = len(next(iter(columns.values())))
        time, unit = np.arange(n_rows) / (rate or 1.0), UNITS["s"]
        origin = f"the rate of {rate:g} samples a second"
    notes = [f"recognised {source.dialect}; time from {origin}", *layout.notes]
    if roles.ignored:
        notes.append(f"ignored columns without a role: {listed(roles.ignored)}")
    return Samples(
        path=source.path,
        time=time,
        time_unit=unit,
        series={
            role.name: (columns[role.columns[0]], role.unit)
            for role in (*roles.channels, *roles.angles)
        },
        sources=(source,),
        notes=tuple(notes),
        cautions=roles.cautions,
        ignored=roles.ignored,
    )


def _first_filled_clock(
    roles: ColumnRoles, columns: Mapping[int, Shaped[np.ndarray, " n"]]
) -> tuple[Role, Num[np.ndarray, " n"]]:
    """Choose the first clock whose stamps were filled in."""
    for clock in roles.clocks:
        time = columns[clock.columns[0]]
        if len(clock.columns) == 2:
            time = time * 1_000_000_000 + columns[clock.columns[1]]
        if time.any():
            return clock, time
    return clock, time
