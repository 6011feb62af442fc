"""How a table of text is laid out: delimiter, decimal mark, header, kind of writer.

The layout is judged from the first lines only (`pushfit.data.text.layout_guess`);
`pushfit.data.text.csv_reader` then holds every line against it. Excluded: what the
columns mean for a recording (`pushfit.data.recordings.roles`).
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from pushfit.config.inputs import Format
from pushfit.data.text.faults import data_error, problem, refuse
from pushfit.data.text.layout_guess import (
    DELIMITERS,
    Guess,
    best_guess,
    split_line,
    uncommented,
)
from pushfit.data.text.textfile import TextFile
from pushfit.errors import ConfigError

# What a layout is found by, however long the file: preamble, header, first rows. Of
# wide rows 200 lines are a quarter of a megabyte.
_HEAD_BYTES = 1 << 18
_HEAD_LINES = 200
_DESCRIBED = {
    "native": "native csv",
    "rostopic": "rostopic echo -p",
    "plotjuggler": "PlotJuggler csv",
    "mcapcsv": "mcap cat --format=csv",
    "ros2csv": "ros2 topic echo --csv",
    "ddf": "Aurora indenter log",
}
# An Aurora indenter log (`.ddf`): its first line, and what its preamble says of rate
# and units. Of outputs nothing is measured.
_LOG, _RATE, _IN_VOLTS = "DMCv", "Sample Frequency (Hz)", "Test Data in Volts"
_OUTPUT = "AO"


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Where the fields of a table are.

    Args:
        writer: Which of the known dialects it is, a `Format` other than `auto`.
        delimiter: Character between fields; a blank stands for runs of blanks.
        decimal: Decimal mark of the numbers.
        names: Column names, cleaned.
        unit_row: Units given in a row below the names, else empty.
        first_row: Cells of the first data row.
        has_trailing: Whether each data row ends in one more, empty field.
        header_line: Line of the names, counted from 1; None if the user gave them.
        data_line: First line of data, counted from 1.
        data_start: Byte of the clean text where that line begins.
        notes: What was passed over, for the user.
        rate: Samples per second, where the file states it [Hz].
    """

    writer: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    unit_row: tuple[str, ...] = ()
    first_row: tuple[str, ...] = ()
    has_trailing: bool = False
    header_line: int | None = None
    data_line: int = 1
    data_start: int = 0
    notes: tuple[str, ...] = ()
    rate: float | None = None

    @property
    def n_fields(self) -> int:
        """Fields of a data row."""
        return len(self.names) + self.has_trailing

    @property
    def description(self) -> str:
        """The layout in words."""
        parts = [DELIMITERS[self.delimiter]]
        if self.decimal == ",":
            parts.append("decimal comma")
        if self.header_line is None:
            parts.append("columns as given")
        else:
            parts.append(f"header on line {self.header_line}")
        return f"{_DESCRIBED[self.writer]}: {', '.join(parts)}"


def find_layout(
    text: TextFile, *, format: Format = "auto", columns: Sequence[str] = ()
) -> Layout:
    """Recognise the layout from the first lines.

    Args:
        columns: Column names, for a file without a header.

    Raises:
        ConfigError: If `columns` or `format` do not fit the file.
        DataError: If no table is found, or its names are missing or doubled.
    """
    head = text.head(_HEAD_BYTES)
    if len(head) == _HEAD_BYTES:
        head = head[: head.rfind(b"\n") + 1]
    if not head:
        raise refuse(
            "no_line_ends",
            f"no line end in the first {_HEAD_BYTES} bytes; export the signals as a "
            "text table, one sample per line",
            path=text.path,
        )
    lines = head.decode(errors="replace").split("\n")[:_HEAD_LINES]
    columns = _all_columns(columns, lines)
    guess = best_guess(lines, columns, text.path)
    if columns:
        _refuse_names_above(
            lines[: guess.data], guess.delimiter, columns, path=text.path
        )
    header = "" if guess.header is None else uncommented(lines[guess.header])
    names, notes = _clean_names(columns or split_line(header, guess.delimiter))
    _refuse_doubled(names, text.path, guess.header)
    preamble = lines[: guess.header or 0]
    is_log = bool(preamble) and preamble[0].startswith(_LOG)
    unit_row = _log_units(preamble, names) if is_log else _unit_row(lines, guess)
    writer = _writer(names, format, has_columns=bool(columns), path=text.path)
    return Layout(
        writer="ddf" if is_log else writer,
        delimiter=guess.delimiter,
        decimal=guess.decimal,
        names=names,
        unit_row=unit_row,
        first_row=tuple(split_line(lines[guess.data], guess.delimiter)),
        has_trailing=guess.has_trailing,
        header_line=None if guess.header is None else guess.header + 1,
        data_line=guess.data + 1,
        data_start=sum(len(line) + 1 for line in head.split(b"\n")[: guess.data]),
        notes=(*notes, *_layout_notes(lines, guess, () if is_log else unit_row)),
        rate=_log_rate(preamble) if is_log else None,
    )


def _all_columns(columns: Sequence[str], lines: list[str]) -> tuple[str, ...]:
    """Columns as named, the last `...` replaced by as many without a name."""
    if not columns or columns[-1] != "...":
        return tuple(columns)
    named = tuple(columns[:-1])
    widths = [
        max(len([c for c in split_line(line, d) if c]) for d in DELIMITERS)
        for line in lines
        if line.strip()
    ]
    return named + ("",) * (max(widths, default=0) - len(named))


def _unit_row(lines: list[str], guess: Guess) -> tuple[str, ...]:
    """Give the cells between names and data, which are units."""
    first = guess.data if guess.header is None else guess.header + 1
    between = [line for line in lines[first : guess.data] if line.strip()]
    if not between:
        return ()
    return tuple(c.strip("()[] ") for c in split_line(between[0], guess.delimiter))


def _log_units(preamble: list[str], names: tuple[str, ...]) -> tuple[str, ...]:
    """Unit of each column of an indenter log, as `500 mN/V`; empty without one.

    The program writes volts, and above them the unit and the scale of each channel.
    """
    in_volts = any(line.startswith(_IN_VOLTS) for line in preamble)
    rows = {
        cells[0].partition(" (")[0].strip(): [cell.strip() for cell in cells[1:]]
        for line in preamble
        if len(cells := line.split("\t")) > 2
    }
    channels, units, scales = (rows.get(n, []) for n in ("Channel", "Units", "Scale"))
    said = {
        channel: f"{scale} {unit}/V" if in_volts else unit
        for channel, unit, scale in zip(channels, units, scales, strict=False)
        if unit and not channel.startswith(_OUTPUT)
    }
    return tuple(said.get(name, "") for name in names)


def _log_rate(preamble: list[str]) -> float | None:
    """Samples per second of an indenter log; None without a positive number [Hz]."""
    said = [line.partition(":")[2] for line in preamble if line.startswith(_RATE)]
    try:
        rate = float(said[0]) if said else math.nan
    except ValueError:
        return None
    return rate if 0 < rate < math.inf else None


def _layout_notes(
    lines: list[str], guess: Guess, unit_row: tuple[str, ...]
) -> list[str]:
    """Tell what besides names and data was passed over."""
    notes = []
    if unit_row:
        notes.append("took the units from the row below the names")
    if guess.has_trailing:
        notes.append("each row ends in an empty field more than there are names")
    first = guess.data if guess.header is None else guess.header
    n_preamble = sum(bool(line.strip()) for line in lines[:first])
    if n_preamble:
        notes.append(f"skipped {n_preamble} lines before line {first + 1}")
    return notes


def _refuse_names_above(
    lines: list[str], delimiter: str, columns: Sequence[str], *, path: str
) -> None:
    """Refuse columns from the user where the file has names of its own."""
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if filled and len(split_line(lines[filled[-1]], delimiter)) == len(columns):
        raise ConfigError(
            f"{path}: columns were named, but line {filled[-1] + 1} seems to hold "
            "names; leave out columns, or remove the line",
            code="columns_and_header",
        )


def _clean_names(cells: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Strip names and drop characters that cannot be printed."""
    names = tuple("".join(c for c in cell if c.isprintable()).strip() for cell in cells)
    changed = [n for n, cell in zip(names, cells, strict=True) if n != cell.strip()]
    notes = [f"dropped control characters from the name {n!r}" for n in changed]
    n_unnamed = names.count("")
    if n_unnamed:
        notes.append(f"ignored {n_unnamed} columns without a name")
    return names, notes


def _refuse_doubled(names: tuple[str, ...], path: str, header: int | None) -> None:
    """Refuse names that differ only in case or blanks, or by pandas' `.1`."""
    seen: dict[str, str] = {}
    problems = []
    for name in filter(None, names):
        key = re.sub(r"\s+", "", name).casefold()
        stem, _, number = key.rpartition(".")
        twin = seen.get(key) or (seen.get(stem) if number == "1" else None)
        if twin is not None:
            problems.append(
                problem(
                    "duplicate_column",
                    f"the column names {twin!r} and {name!r} are the same but for "
                    "case, blanks or a copy's number; rename one",
                    path=path,
                    line=None if header is None else header + 1,
                    column=name,
                )
            )
        seen.setdefault(key, name)
    if problems:
        raise data_error(problems)


def _writer(
    names: tuple[str, ...], format: Format, *, has_columns: bool, path: str
) -> str:
    """Recognise who wrote the file by its column names."""
    fits = {
        "native": True,
        "ros2csv": has_columns,
        "rostopic": names[0] == "%time",
        "plotjuggler": "__time" in names or "time" in names,
        "mcapcsv": "log_time" in names,
    }
    if format != "auto":
        if not fits.get(format):
            raise ConfigError(
                f"{path}: format {format!r} was stated, but the columns do not fit it: "
                f"{', '.join(names[:8])}; leave the format to be recognised",
                code="format_mismatch",
            )
        return format
    if fits["rostopic"]:
        return "rostopic"
    if fits["mcapcsv"] and "publish_time" in names:
        return "mcapcsv"
    if "__time" in names or ("time" in names and any(n.startswith("/") for n in names)):
        return "plotjuggler"
    has_pair = any(re.search(r"[._]?nano?sec", name) for name in names)
    return "ros2csv" if has_columns and has_pair else "native"
