"""Strict reading of tables: scan all lines first, then parse what is needed.

pandas' C parser is fast and exact on a regular table, and silently shifts, renames or
coerces an irregular one. So it only ever sees rows that the scan found regular, without
their header, and cells that it cannot parse are looked up and reported by line.
Excluded: which layout a table has (`pushfit.data.text.dialects`).

Memory: one block of 4 MiB with its masks (about 20 MiB) for the scan; then 8 bytes per
row and needed column, twice over for one chunk of rows.
"""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, cast

import numpy as np
import pandas as pd
from jaxtyping import Int, Shaped

from pushfit.config.inputs import Tail
from pushfit.data.text.dialects import Layout
from pushfit.data.text.explain import MISSING_WORDS, Kind, slow_scan
from pushfit.data.text.faults import data_error, no_rows, refuse, refuse_too_large
from pushfit.data.text.layout_guess import STAMPS, Stamp
from pushfit.data.text.scan import Body, Scan, fast_scan, find_body
from pushfit.data.text.textfile import BlockReader, TextFile
from pushfit.errors import DataError, InputProblem

# Samples may take so much memory where the caller says nothing else.
MAX_BYTES = 1 << 30
# The parser holds all fields of a chunk, also those that are not needed.
_CHUNK_CELLS = 1 << 18
# Types that pandas parses to, else text, and that the result keeps, else int64.
_PARSED = {"float": np.float64, "int": np.int64}
_STORED = {"float": np.float64, "text": object}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """The needed columns of a table.

    Args:
        values: By the column's position: numbers (float64, NaN where a cell is
            missing), whole numbers or times since 1970 [ns] (int64), or text.
        scan: The rows' place in the file.
        notes: What was left out, for the user.
    """

    values: dict[int, Shaped[np.ndarray, " n"]]
    scan: Scan
    notes: tuple[str, ...]


def read_cells(
    text: TextFile,
    layout: Layout,
    kinds: Mapping[int, Kind],
    *,
    tail: Tail = "drop",
    missing: Sequence[str] = (),
    max_bytes: int = MAX_BYTES,
) -> Cells:
    """Scan a table and parse the needed columns.

    Args:
        kinds: What the cells of each needed column must be, by the column's position.
        tail: What to do about a damaged end, see `pushfit.data.text.scan.find_body`.
        missing: Further texts that stand for a missing number.

    Raises:
        DataError: If any line or needed cell breaks a rule; `.problems` lists all.
    """
    tokens = tuple(missing)
    body = find_body(text, layout, tail)
    scan = fast_scan(body) or _slow(body, kinds, tokens)
    if scan.n_rows == 0:
        raise no_rows(text.path)
    # Text costs its characters and a reference; 64 bytes is a long label.
    needed = scan.n_rows * sum(64 if kind == "text" else 8 for kind in kinds.values())
    what = f"{scan.n_rows} rows of {len(kinds)} columns"
    remedy = "split the file, drop columns"
    refuse_too_large(text.path, what, needed=needed, max_bytes=max_bytes, remedy=remedy)
    values = _parse(body, kinds=kinds, missing=tokens, n_rows=scan.n_rows)
    if values is None:
        _slow(body, kinds, tokens)
        raise refuse(
            "unreadable",
            f"the rows from line {layout.data_line} on cannot be read as numbers; "
            "export the table again",
            path=text.path,
        )
    text.stamp.check()
    return Cells(values=values, scan=scan, notes=body.notes)


def row_problems(text: TextFile, layout: Layout, *, tail: Tail) -> list[InputProblem]:
    """Find the rows that do not fit a layout, whatever their cells hold."""
    try:
        body = find_body(text, layout, tail)
    except DataError as error:
        return list(error.problems)
    return [] if fast_scan(body) else slow_scan(body, {})[1]


def _slow(body: Body, kinds: Mapping[int, Kind], missing: tuple[str, ...]) -> Scan:
    scan, problems = slow_scan(body, kinds, missing)
    body.text.stamp.check()
    if problems:
        raise data_error(problems)
    return scan


def _parse(
    body: Body, *, kinds: Mapping[int, Kind], missing: tuple[str, ...], n_rows: int
) -> dict[int, Shaped[np.ndarray, " n"]] | None:
    """Parse the rows by pandas; None if a cell is not what it must be."""
    columns = {
        i: np.empty(n_rows, _STORED.get(kind, np.int64)) for i, kind in kinds.items()
    }
    words: set[int] = set()
    done = 0
    try:
        for frame in _chunks(body, kinds, missing):
            stop = done + len(frame)
            if stop > n_rows:
                return None
            for i, kind in kinds.items():
                values = np.asarray(frame[i])
                if kind in STAMPS:
                    values = _nanoseconds(values.tolist(), kind)
                if kind == "float" and np.isinf(values).any():
                    return None
                if kind == "float" and _may_be_words(values):
                    words.add(i)
                columns[i][done:stop] = values
            done = stop
    except (ValueError, OverflowError, pd.errors.ParserError):
        return None
    if words:
        # pandas reads a chunk of nothing but True and False as 1 and 0.
        _slow(body, {i: kinds[i] for i in words}, missing)
    return columns if done == n_rows else None


def _may_be_words(values: Shaped[np.ndarray, " n"]) -> bool:
    """Tell whether parsed cells might have been True and False."""
    # The first cell alone tells nearly always, and saves looking at all of them.
    return bool(values.size and values[0] in (0, 1) and np.isin(values, (0, 1)).all())


def _chunks(
    body: Body, kinds: Mapping[int, Kind], missing: tuple[str, ...]
) -> Iterator[pd.DataFrame]:
    """Parse the rows, without their header, some at a time."""
    layout = body.layout
    blocks = body.text.blocks(layout.data_start, body.end)
    tokens = [*MISSING_WORDS, *missing]
    with pd.read_csv(
        cast(IO[bytes], BlockReader(blocks)),
        sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
        decimal=layout.decimal,
        header=None,
        names=list(range(layout.n_fields)),
        index_col=False,
        usecols=sorted(kinds),
        dtype={i: _PARSED.get(kind, str) for i, kind in kinds.items()},
        na_values={i: tokens for i, kind in kinds.items() if kind == "float"},
        keep_default_na=False,
        skipinitialspace=body.has_padding,
        quoting=csv.QUOTE_MINIMAL if body.has_quotes else csv.QUOTE_NONE,
        on_bad_lines="error",
        encoding="utf-8",
        chunksize=max(1, _CHUNK_CELLS // layout.n_fields),
        low_memory=False,
    ) as frames:
        yield from frames


def _nanoseconds(texts: list[str], kind: Stamp) -> Int[np.ndarray, " n"]:
    """Read ISO 8601 times as nanoseconds since 1970, exactly; as UTC without a zone."""
    # pandas alone would also take a date without time, but no decimal comma.
    if not all(map(STAMPS[kind].fullmatch, texts)):
        raise ValueError("not an ISO 8601 time")
    points = [text.replace(",", ".") for text in texts]
    times = pd.DatetimeIndex(pd.to_datetime(points, utc=True, format="ISO8601"))
    return times.as_unit("ns").asi8
