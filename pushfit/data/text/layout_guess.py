"""Guess delimiter, decimal mark and header of a table from its first lines.

A guess is only where to begin. Excluded: holding every line against it
(`pushfit.data.text.scan`).
"""

import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pushfit.data.text.faults import STATE_COLUMNS, listed, no_rows, refuse
from pushfit.data.units import find_unit
from pushfit.errors import ConfigError, DataError

# Blanks come last: they also separate the fields of tabbed files.
DELIMITERS = {";": "semicolon", "\t": "tab", ",": "comma", " ": "blanks"}
NUMBER = {
    mark: re.compile(
        rf"[+-]?(?:\d+{re.escape(mark)}?\d*|{re.escape(mark)}\d+)(?:[eE][+-]?\d+)?",
        re.ASCII,
    )
    for mark in ".,"
}
_DATE = r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d:\d\d(?:[.,]\d{1,9})?"
Stamp = Literal["zoned", "local"]
STAMPS: dict[Stamp, re.Pattern[str]] = {
    "zoned": re.compile(rf"{_DATE}(?:Z|[+-]\d\d:\d\d)", re.ASCII),
    "local": re.compile(_DATE, re.ASCII),
}
_NAN = ("nan", "inf", "-inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Guess:
    """One delimiter and decimal mark tried on the first lines.

    Args:
        delimiter: Character between fields.
        decimal: Decimal mark.
        header: Index of the line of names, if there is one.
        data: Index of the first line of data.
        has_trailing: Whether data rows have one field more than there are names.
        score: Share of rows that fit times share of their cells that are numbers.
    """

    delimiter: str
    decimal: str
    header: int | None
    data: int
    has_trailing: bool
    score: float


def split_line(line: str, delimiter: str) -> list[str]:
    """Split one line into its stripped fields."""
    if delimiter == " ":
        return re.findall(r"[^ \t\n]+", line)
    try:
        row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
    except csv.Error:
        row = line.split(delimiter)
    return [cell.strip() for cell in row]


def uncommented(line: str) -> str:
    """Cut off the `#` that numpy.savetxt puts before names, and nothing else.

    A tab before the first name is a field of its own.
    """
    return re.sub(r"^ *#+", "", line)


def stamp_of(cell: str) -> Stamp | None:
    """Which kind of time a cell holds, with its zone or without; None if no time."""
    return next((kind for kind, form in STAMPS.items() if form.fullmatch(cell)), None)


def _is_value(cell: str, decimal: str) -> bool:
    return bool(
        NUMBER[decimal].fullmatch(cell) or stamp_of(cell) or cell.lower() in _NAN
    )


def best_guess(lines: list[str], columns: Sequence[str], path: str) -> Guess:
    """Choose delimiter and decimal mark by what makes most fields numbers.

    Raises:
        ConfigError: If `columns` do not fit.
        DataError: If the lines hold no table, or decimal points and commas.
    """
    guesses = [
        guess
        for delimiter in DELIMITERS
        if columns or any(delimiter in line for line in lines)
        for decimal in (".," if delimiter != "," else ".")
        if (
            guess := _guess(
                lines, delimiter=delimiter, decimal=decimal, columns=columns
            )
        )
    ]
    if not guesses:
        # One column has no delimiter; nothing else that has none is a table.
        one = _guess(lines, delimiter=",", decimal=".", columns=columns, least=1)
        if one is None or one.score < 1.0:
            raise _no_table(lines, columns, path)
        guesses = [one]
    best = max(guesses, key=lambda guess: guess.score)
    rows = [split_line(line, best.delimiter) for line in lines[best.data :]]
    has_mark = {
        mark: any(mark in c and number.fullmatch(c) for row in rows for c in row)
        for mark, number in NUMBER.items()
    }
    if all(has_mark.values()):
        raise refuse(
            "ambiguous_decimal",
            "decimal points and decimal commas are mixed; write all numbers with "
            "decimal points",
            path=path,
            line=best.data + 1,
        )
    return best


def _guess(
    lines: list[str],
    *,
    delimiter: str,
    decimal: str,
    columns: Sequence[str],
    least: int = 2,
) -> Guess | None:
    """Try one delimiter and decimal mark; None if they give no table."""
    split = [split_line(uncommented(line), delimiter) for line in lines]
    is_value = [[_is_value(cell, decimal) for cell in row] for row in split]
    n_values = [sum(row) for row in is_value]
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if columns:
        data = next((i for i in filled if n_values[i]), None)
        header, n_names = None, len(columns)
    else:
        header, data = _find_header(
            split, is_value=is_value, filled=filled, least=least
        )
        n_names = len(split[header]) if header is not None else 0
    if data is None or n_names < least:
        return None
    if delimiter == " " and header is not None and lines[header].startswith("\t"):
        # Tabs that delimit: the first name is empty, which runs of blanks would hide.
        return None
    rows = [i for i in filled if i >= data]
    has_trailing = all(len(split[i]) == n_names + 1 for i in rows)
    n_fields = n_names + has_trailing
    fitting = [i for i in rows if len(split[i]) == n_fields]
    n_cells = sum(sum(map(bool, split[i])) for i in fitting)
    n_numbers = sum(n_values[i] for i in fitting)
    return Guess(
        delimiter=delimiter,
        decimal=decimal,
        header=header,
        data=data,
        has_trailing=has_trailing,
        score=len(fitting) / len(rows) * n_numbers / max(n_cells, 1),
    )


def _find_header(
    split: list[list[str]], *, is_value: list[list[bool]], filled: list[int], least: int
) -> tuple[int | None, int | None]:
    """Find the line of names and the first line of data below it.

    It is the last line of words above the first rows that are like most: a preamble may
    hold pairs, numbers and tables of its own, and what is wrong in a few rows is to be
    told.
    """
    like = Counter(tuple(is_value[i]) for i in filled if any(is_value[i]))
    most = max(like.values(), default=0)
    alike = [i for i in filled if like[tuple(is_value[i])] == most]
    runs = [i for i, k in zip(alike, alike[2:], strict=False) if k == i + 2]
    usual = next(iter(runs or alike), -1)
    header, data = None, None
    for k, i in enumerate(filled[:-1]):
        n, below = len(split[i]), filled[k + 1 :]
        is_names = n >= least and any(split[i]) and not any(is_value[i])
        # Between names and data there are units.
        if not is_names or i > usual or (data is not None and i < data):
            continue
        units = split[below[0]]
        is_unit_row = len(below) > 1 and len(units) == n and _is_unit_row(units)
        rows = below[is_unit_row : is_unit_row + 3]
        fit = [len(split[j]) in (n, n + 1) and any(is_value[j]) for j in rows]
        if any(is_value[rows[0]]) and any(fit):
            header, data = i, rows[0]
    return header, data


def _is_unit_row(cells: list[str]) -> bool:
    words = [cell.strip("[]()") for cell in cells]
    # What a gain may be stated for are volts.
    return any(cells) and all(
        word in ("", "-") or find_unit(word) or find_unit(f"n/{word}") for word in words
    )


def _no_table(
    lines: list[str], columns: Sequence[str], path: str
) -> DataError | ConfigError:
    """Say why the first lines are no table."""
    filled = [i for i, line in enumerate(lines) if line.strip()]
    if not filled:
        text = "the file holds blank lines only; record or export it again"
        return refuse("empty_file", text, path=path)
    first = filled[0]
    by_delimiter = {d: split_line(uncommented(lines[first]), d) for d in DELIMITERS}
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
            f"holds {len(cells)} fields but no column names; {STATE_COLUMNS}",
            path=path,
            line=first + 1,
        )
    if len(cells) < 2:
        return refuse(
            "no_table",
            "no comma, semicolon, tab or blank separates fields; name the only column, "
            "for example `columns=['pressure_kpa'], rate=100`, or export time and "
            "signal",
            path=path,
            line=first + 1,
        )
    if len(filled) == 1:
        return no_rows(path)
    row = split_line(lines[filled[1]], delimiter)
    if len(row) == len(cells) and not any(_is_value(cell, ".") for cell in row):
        return refuse(
            "no_table",
            f"the row has no number below the names on line {first + 1}: "
            f"{listed([repr(cell) for cell in row])}; export the readings themselves",
            path=path,
            line=filled[1] + 1,
        )
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
