"""The files of a batch: tables of results, failures and the population, and a page.

Cells of a spreadsheet that begin like a formula would be run by it, so text that starts
so gets an apostrophe in front; numbers are left alone, and Parquet needs none.
Excluded: what stands in the rows (`pushfit.batch.rows`, `pushfit.batch.population`).
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path

import pandas as pd

from pushfit.atomic import atomic_path
from pushfit.batch.folders import (
    FAILURES,
    PARQUET,
    POPULATION,
    REPORT,
    RESULTS,
)
from pushfit.batch.population import COLUMNS, population_warnings
from pushfit.batch.rows import Answers, Row
from pushfit.fit.identify.result_row import Cell
from pushfit.report.html.batch import render_batch
from pushfit.report.strings import printable

# What a spreadsheet takes for a formula (OWASP, CSV injection).
REASON = ("item", "stage", "code", "message")
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")


def write_outputs(
    folder: Path,
    answers: Answers,
    population: Sequence[Row],
    *,
    pages: Mapping[str, str],
) -> tuple[Path, ...]:
    """Write what a batch found, each file complete or as it was.

    Args:
        pages: Address of the page of an item, by its name.
    """
    rows = answers.rows
    columns = list(dict.fromkeys(name for row in rows for name in row))
    _write_csv(folder / FAILURES, REASON, [asdict(f) for f in answers.failures])
    _write_csv(folder / RESULTS, columns, rows)
    written = [folder / RESULTS, folder / FAILURES]
    if find_spec("pyarrow"):
        _write_parquet(folder / PARQUET, columns, rows)
        written.append(folder / PARQUET)
    _write_csv(folder / POPULATION, COLUMNS, population)
    written.append(folder / POPULATION)
    if find_spec("jinja2"):
        _write_page(folder / REPORT, answers, population, pages)
        written.append(folder / REPORT)
    return tuple(written)


def guarded(cell: Cell) -> Cell:
    """Cell that no terminal obeys and no spreadsheet runs.

    Returns:
        The same; text with control characters escaped, and with an apostrophe in front
        where a spreadsheet would take it for a formula.
    """
    if not isinstance(cell, str):
        return cell
    return f"'{printable(cell)}" if cell.startswith(FORMULA) else printable(cell)


def _write_csv(path: Path, columns: Sequence[str], rows: Iterable[Row]) -> None:
    with (
        atomic_path(path) as temporary,
        open(temporary, "w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([guarded(name) for name in columns])
        for row in rows:
            writer.writerow([guarded(row.get(name)) for name in columns])


def _write_parquet(path: Path, columns: Sequence[str], rows: Sequence[Row]) -> None:
    frame = pd.DataFrame(
        {name: _typed([row.get(name) for row in rows]) for name in columns}
    )
    with atomic_path(path) as temporary:
        frame.to_parquet(temporary, index=False, engine="pyarrow")


def _write_page(
    path: Path,
    answers: Answers,
    population: Sequence[Row],
    pages: Mapping[str, str],
) -> None:
    messages = {failure.item: failure.message for failure in answers.failures}
    frame = pd.DataFrame(
        [
            {**row, "message": messages.get(name), "link": pages.get(name)}
            for row, name in ((row, str(row["item"])) for row in answers.rows)
        ]
    )
    notes = [warning.text for warning in population_warnings(population)]
    page = render_batch(frame, population, notes=notes)
    with atomic_path(path) as temporary:
        Path(temporary).write_text(page, encoding="utf-8", newline="\n")


def _typed(cells: list[Cell]) -> pd.Series:
    kinds = {type(cell) for cell in cells if cell is not None}
    if str in kinds:
        return pd.Series([None if c is None else printable(str(c)) for c in cells])
    return pd.Series(cells, dtype="Int64" if kinds == {int} else "Float64")
