"""Go through an irregular table line by line and name everything that is wrong.

This is the slow pass: it runs for files with quoted fields, and for files that the fast
pass or the parser did not accept. Excluded: the fast pass (`pushfit.data.text.scan`).
"""

import csv
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pushfit.data.text.dialects import Layout
from pushfit.data.text.faults import MAX_LISTED, problem
from pushfit.data.text.layout_guess import NUMBER, STAMPS, Stamp, split_line
from pushfit.data.text.scan import Body, Scan, whole_lines
from pushfit.errors import InputProblem

Kind = Stamp | Literal["float", "int", "text"]

# Texts that stand for a missing number.
MISSING_WORDS = ("", "nan", "NaN", "NAN")
_WHOLE = re.compile(r"[+-]?\d+", re.ASCII)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.IGNORECASE)
_EXPECTED = {
    "float": "a decimal number",
    "int": "a whole number",
    "zoned": "an ISO 8601 time such as 2024-05-01T12:00:00.25Z",
    "local": "an ISO 8601 time such as 2024-05-01T12:00:00.25, here without a zone",
}


def slow_scan(
    body: Body, kinds: Mapping[int, Kind], missing: tuple[str, ...] = ()
) -> tuple[Scan, list[InputProblem]]:
    """Check every row and every needed cell.

    Returns:
        The scan and the problems: the first ones of each kind, and how many more.
    """
    layout = body.layout
    check = _RowCheck(
        path=body.text.path,
        layout=layout,
        kinds=kinds,
        missing=frozenset((*MISSING_WORDS, *missing)),
    )
    n_rows = 0
    skips: list[int] = []
    for line, row in _rows(body, check):
        if not any(cell.strip(" \t") for cell in row) and len(row) <= 1:
            continue
        skips += [n_rows] * (line - layout.data_line - n_rows - len(skips))
        check.row(line, row)
        n_rows += 1
    skip_array = np.array(skips, dtype=np.int64)
    result = Scan(n_rows=n_rows, data_line=layout.data_line, skips=skip_array)
    return result, check.finish()


def cell_problems(
    path: str, column: str, cells: Iterable[tuple[int, str]]
) -> list[InputProblem]:
    """Check cells, each with its line, that are to be numbers and in no rows."""
    layout = Layout(writer="native", delimiter=",", decimal=".", names=(column,))
    check = _RowCheck(
        path=path, layout=layout, kinds={}, missing=frozenset(MISSING_WORDS)
    )
    for line, cell in cells:
        check.cell(line, column, cell=cell, kind="float")
    return check.finish()


def _rows(body: Body, check: "_RowCheck") -> Iterator[tuple[int, list[str]]]:
    """Give each row with the line where it begins."""
    layout = body.layout
    lines = (
        line + "\n"
        for block in whole_lines(body)
        for line in block.decode().split("\n")[:-1]
    )
    if layout.delimiter == " ":
        for number, line in enumerate(lines, layout.data_line):
            yield number, split_line(line, " ")
        return
    reader = csv.reader(
        lines, delimiter=layout.delimiter, skipinitialspace=True, strict=True
    )
    begin = layout.data_line
    try:
        for row in reader:
            yield begin, row
            begin = layout.data_line + reader.line_num
    except csv.Error as error:
        check.add(
            "bad_quotes",
            begin,
            f"the quotes cannot be read ({error}); export the table again",
        )


@dataclass(slots=True, kw_only=True)
class _RowCheck:
    """Collects the problems of rows, listing the first ones of each kind."""

    path: str
    layout: Layout
    kinds: Mapping[int, Kind]
    missing: frozenset[str]
    problems: list[InputProblem] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def add(self, code: str, line: int, text: str, **cell: str) -> None:
        """Note a problem, unless enough of its kind are listed."""
        self.counts[code] += 1
        if self.counts[code] <= MAX_LISTED:
            self.problems.append(problem(code, text, path=self.path, line=line, **cell))

    def row(self, line: int, row: list[str]) -> None:
        """Check the number of fields and the needed cells."""
        names = self.layout.names
        n = len(names)
        start = tuple(cell.strip(" \t") for cell in row[:n])
        if self.layout.header_line is not None and start == names:
            self.add(
                "repeated_header",
                line,
                f"the header of line {self.layout.header_line} comes again, as in "
                "appended logs; split the file here",
            )
        elif len(row) != self.layout.n_fields or any(c.strip(" \t") for c in row[n:]):
            self.add("field_count", line, self._miscount(row))
        else:
            for position, kind in self.kinds.items():
                self.cell(
                    line, names[position], cell=row[position].strip(" \t"), kind=kind
                )

    def _miscount(self, row: list[str]) -> str:
        n = len(self.layout.names)
        where = (
            "columns were named"
            if self.layout.header_line is None
            else f"columns are named on line {self.layout.header_line}"
        )
        if len(row) == n + 1 and not row[-1].strip(" \t"):
            hint = "this row alone ends in a delimiter"
        elif self.layout.delimiter == "," and len(row) > n:
            hint = (
                "a decimal comma, or a comma inside unquoted text, splits a field: "
                "export with another delimiter"
            )
        else:
            hint = "mend or remove the row"
        return f"{len(row)} fields, but {n} {where}; {hint}"

    def cell(self, line: int, column: str, *, cell: str, kind: Kind) -> None:
        """Check that a cell is what its column must be."""
        if kind == "text" or (kind == "float" and cell in self.missing):
            return
        if kind in STAMPS:
            is_good = STAMPS[kind].fullmatch(cell)
        elif kind == "int":
            is_good = _WHOLE.fullmatch(cell) and abs(int(cell)) < 2**63
        else:
            is_good = NUMBER[self.layout.decimal].fullmatch(cell)
        shown = _shown(cell)
        if _INFINITE.fullmatch(cell) or (
            kind == "float" and is_good and math.isinf(float(cell.replace(",", ".")))
        ):
            text = f"{shown} is not finite; mend the cell or remove the row"
            self.add("not_finite", line, text, column=column, value=cell)
        elif not is_good:
            what = "time" if kind in STAMPS else "number"
            text = (
                f"{shown} is not a {what}; {_EXPECTED[kind]} is expected; "
                "mend the cell or remove the row"
            )
            self.add("not_a_number", line, text, column=column, value=cell)

    def finish(self) -> list[InputProblem]:
        """Give the problems in file order, then how many more there are."""
        found = sorted(self.problems, key=lambda p: p.line or 0)
        for code, count in self.counts.items():
            if count > MAX_LISTED:
                more = f"{count - MAX_LISTED} more of {count} problems {code!r}"
                found.append(problem(code, f"{more} are not listed", path=self.path))
        return found


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= 40 else cell[:37] + "...")
