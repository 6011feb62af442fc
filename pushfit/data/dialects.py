"""How a table of text is laid out: delimiter, decimal mark, header, kind of writer.

The layout is judged from the first lines only; `pushfit.data.prescan` then holds every
line against it. What the columns mean for a recording is decided in
`pushfit.data.roles`.
"""

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pushfit.data.textfile import TextFile, data_error, problem, refuse
from pushfit.errors import ConfigError, Problem

Format = Literal[
    "auto", "native", "rostopic", "plotjuggler", "mcapcsv", "ros2csv", "bag"
]

_HEAD_BYTES = 1 << 18
_HEAD_LINES = 200
# Blanks come last: they also separate the fields of tabbed files.
_DELIMITERS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "blanks"}
_DESCRIBED = {
    "native": "native csv",
    "rostopic": "rostopic echo -p",
    "plotjuggler": "PlotJuggler csv",
    "mcapcsv": "mcap cat --format=csv",
    "ros2csv": "ros2 topic echo --csv",
}
NUMBER = {
    mark: re.compile(
        rf"[+-]?(?:\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?",
        re.ASCII,
    )
    for mark in ".,"
}
STAMP = re.compile(
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:\.\d{1,9})?(?:Z|[+-]\d\d:\d\d)", re.ASCII
)
_NAN = ("nan", "inf", "-inf")


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
    """

    writer: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    unit_row: tuple[str, ...]
    first_row: tuple[str, ...]
    has_trailing: bool
    header_line: int | None
    data_line: int
    data_start: int
    notes: tuple[str, ...]

    @property
    def n_fields(self) -> int:
        """Fields of a data row."""
        return len(self.names) + self.has_trailing

    @property
    def description(self) -> str:
        """The layout in words."""
        parts = [_DELIMITERS[self.delimiter]]
        if self.decimal == ",":
            parts.append("decimal comma")
        if self.header_line is None:
            parts.append("columns as given")
        else:
            parts.append(f"header on line {self.header_line}")
        return f"{_DESCRIBED[self.writer]}: {', '.join(parts)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Guess:
    """One delimiter and decimal mark tried on the first lines."""

    delimiter: str
    decimal: str
    header: int | None
    data: int
    has_trailing: bool
    score: tuple[float, float]


def split_line(line: str, delimiter: str) -> list[str]:
    """Split one line into its stripped fields."""
    if delimiter == " ":
        return re.findall(r"[^ \t\n]+", line)
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        row = line.split(delimiter)
    return [cell.strip() for cell in row]


def find_layout(
    text: TextFile,
    *,
    format: Format = "auto",
    columns: Sequence[str] = (),
) -> Layout:
    """Recognise the layout from the first lines.

    Args:
        text: The file.
        format: Dialect that the user states.
        columns: Column names, for a file without a header.

    Returns:
        The layout.

    Raises:
        ConfigError: If `columns` or `format` do not fit the file.
        DataError: If no table is found, or its names are missing or doubled.
    """
    head = text.head(_HEAD_BYTES)
    lines = head.decode(errors="replace").split("\n")
    if len(head) == _HEAD_BYTES:
        lines.pop()
    lines = lines[:_HEAD_LINES]
    guess = _best_guess(lines, columns, text.path)
    if columns:
        _refuse_names_above(lines[: guess.data], guess.delimiter, columns, text.path)
    header = None if guess.header is None else lines[guess.header]
    names, notes = _clean_names(
        columns or split_line(_uncommented(header), guess.delimiter)
    )
    doubled = _doubled_names(names, text.path, guess.header)
    if doubled:
        raise data_error(doubled)
    unit_row: tuple[str, ...] = ()
    if guess.header is not None:
        unit_line = next(
            (ln for ln in lines[guess.header + 1 : guess.data] if ln.strip()), None
        )
        if unit_line is not None:
            unit_row = tuple(_unit_cells(split_line(unit_line, guess.delimiter)))
            notes.append(f"took the units from the row below line {guess.header + 1}")
    if guess.has_trailing:
        notes.append("each row ends in an empty field more than there are names")
    first = guess.data if guess.header is None else guess.header
    n_preamble = sum(bool(line.strip()) for line in lines[:first])
    if n_preamble:
        notes.append(f"skipped {n_preamble} lines before line {first + 1}")
    return Layout(
        writer=_writer(names, format, bool(columns), text.path),
        delimiter=guess.delimiter,
        decimal=guess.decimal,
        names=names,
        unit_row=unit_row,
        first_row=tuple(split_line(lines[guess.data], guess.delimiter)),
        has_trailing=guess.has_trailing,
        header_line=None if guess.header is None else guess.header + 1,
        data_line=guess.data + 1,
        data_start=_byte_of_line(head, guess.data),
        notes=tuple(notes),
    )


def _refuse_names_above(
    lines: list[str], delimiter: str, columns: Sequence[str], path: str
) -> None:
    """Refuse columns from the user where the file has names of its own."""
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if filled and len(split_line(lines[filled[-1]], delimiter)) == len(columns):
        raise ConfigError(
            f"{path}: columns were named, but line {filled[-1] + 1} seems to hold "
            "names; leave out columns, or remove the line",
            code="columns_and_header",
        )


def _byte_of_line(head: bytes, line: int) -> int:
    position = 0
    for _ in range(line):
        position = head.index(b"\n", position) + 1
    return position


def _uncommented(line: str | None) -> str:
    """Names after `#`, as numpy.savetxt writes them."""
    return (line or "").lstrip().lstrip("#")


def _is_value(cell: str, decimal: str) -> bool:
    return bool(
        NUMBER[decimal].fullmatch(cell) or STAMP.fullmatch(cell) or cell.lower() in _NAN
    )


def _unit_cells(cells: list[str]) -> list[str]:
    return [cell.strip("()[] ") for cell in cells]


def _best_guess(lines: list[str], columns: Sequence[str], path: str) -> _Guess:
    """Choose delimiter and decimal mark by what makes most fields numbers."""
    guesses = [
        guess
        for delimiter in _DELIMITERS
        for decimal in (".," if delimiter != "," else ".")
        if (guess := _guess(lines, delimiter, decimal, columns))
    ]
    if not guesses:
        raise _no_table(lines, columns, path)
    best = max(guesses, key=lambda guess: guess.score)
    rival = [g for g in guesses if g.delimiter == best.delimiter and g is not best]
    if rival and rival[0].score == best.score and best.score[1] < 1.0:
        rows = lines[best.data :]
        if any("," in row for row in rows) and any("." in row for row in rows):
            raise refuse(
                "ambiguous_decimal",
                "decimal points and decimal commas are mixed; write all numbers with "
                "decimal points",
                path=path,
                line=best.data + 1,
            )
    return best


def _guess(
    lines: list[str], delimiter: str, decimal: str, columns: Sequence[str]
) -> _Guess | None:
    """Try one delimiter and decimal mark; None if they give no table."""
    split = [split_line(_uncommented(line), delimiter) for line in lines]
    n_values = [sum(_is_value(cell, decimal) for cell in row) for row in split]
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if columns:
        data = next((i for i in filled if n_values[i]), None)
        header, n_names = None, len(columns)
    else:
        header, data = _find_header(split, n_values, filled)
        n_names = len(split[header]) if header is not None else 0
    if data is None or n_names < 2:
        return None
    rows = [i for i in filled if i >= data]
    has_trailing = all(len(split[i]) == n_names + 1 for i in rows)
    n_fields = n_names + has_trailing
    fitting = [i for i in rows if len(split[i]) == n_fields]
    n_cells = sum(sum(map(bool, split[i])) for i in fitting)
    return _Guess(
        delimiter=delimiter,
        decimal=decimal,
        header=header,
        data=data,
        has_trailing=has_trailing,
        score=(
            len(fitting) / len(rows),
            sum(n_values[i] for i in fitting) / max(n_cells, 1),
        ),
    )


def _find_header(
    split: list[list[str]], n_values: list[int], filled: list[int]
) -> tuple[int | None, int | None]:
    """Find the line of names and the first line of data below it."""
    for k, i in enumerate(filled[:-1]):
        n = len(split[i])
        if n < 2 or n_values[i] or not any(split[i]):
            continue
        below = filled[k + 1 :]
        is_unit_row = (
            len(below) > 1
            and len(split[below[0]]) == n
            and _is_unit_row(split[below[0]])
        )
        rows = below[is_unit_row : is_unit_row + 3]
        if n_values[rows[0]] and any(
            len(split[j]) in (n, n + 1) and n_values[j] for j in rows
        ):
            return i, rows[0]
    return None, None


_UNIT_WORD = re.compile(
    r"[\[(]?(?:n|mn|kpa|pa|counts|au|s|ms|us|ns|min|rad|deg|m|mm|-|)[\])]?", re.I
)


def _is_unit_row(cells: list[str]) -> bool:
    return any(cells) and all(_UNIT_WORD.fullmatch(cell) for cell in cells)


def _no_table(lines: list[str], columns: Sequence[str], path: str) -> Exception:
    """Say why the first lines are no table."""
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if not filled:
        return refuse("empty_file", "the file holds blank lines only", path=path)
    first = filled[0]
    by_delimiter = {d: split_line(_uncommented(lines[first]), d) for d in _DELIMITERS}
    delimiter, cells = max(by_delimiter.items(), key=lambda item: len(item[1]))
    has_values = any(_is_value(cell, ".") for cell in cells)
    if columns:
        return ConfigError(
            f"{path}: {len(columns)} columns were named, line {first + 1} has "
            f"{len(cells)} fields; name every field in order",
            code="columns_mismatch",
        )
    if len(cells) >= 2 and has_values:
        return refuse(
            "no_header",
            f"holds {len(cells)} fields but no column names; state them in order, for "
            'example columns=["time_s", "pressure_kpa"]',
            path=path,
            line=first + 1,
        )
    if len(cells) < 2:
        return refuse(
            "no_table",
            "no comma, semicolon, tab or blank separates fields; a recording needs a "
            "header and at least a time and a signal column",
            path=path,
            line=first + 1,
        )
    if len(filled) == 1:
        return refuse("no_rows", "has a header but 0 data rows", path=path)
    row = split_line(lines[filled[1]], delimiter)
    hint = ""
    if delimiter == "," and len(row) > len(cells):
        hint = (
            "; if the comma is the decimal mark, export with semicolons between fields"
        )
    return refuse(
        "field_count",
        f"the row has {len(row)} fields but the header on line {first + 1} names "
        f"{len(cells)} columns; export the table again{hint}",
        path=path,
        line=filled[1] + 1,
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


def _doubled_names(
    names: tuple[str, ...], path: str, header: int | None
) -> list[Problem]:
    """Find names that differ only in case or blanks, or by pandas' `.1`."""
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
    return problems


def _writer(
    names: tuple[str, ...], format: Format, has_columns: bool, path: str
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
