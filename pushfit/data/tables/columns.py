"""Columns of tables with one row per push: recognise and convert them.

Peak tables and schedules share what is here: names with unit suffixes, the numbering of
pushes and repeats, and how a breach is reported (file, line, column, value, rule,
remedy). Excluded: which columns a kind of table has, and the rules for their cells
(`pushfit.data.tables.rules`).
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from pushfit.data.recordings import recognise
from pushfit.data.recordings.recognise import DIRECTION_COLUMNS
from pushfit.data.tables.names import Known, any_name, near_names, nearest_stem
from pushfit.data.text.csv_reader import read_cells
from pushfit.data.text.dialects import find_layout
from pushfit.data.text.explain import Kind
from pushfit.data.text.faults import data_error, in_runs, problem
from pushfit.data.text.files import PARQUET_SUFFIXES, Source, sha256_of
from pushfit.data.text.textfile import open_text
from pushfit.data.units import UNITS, Unit, in_degrees
from pushfit.errors import ConfigError, DataError, InputProblem

COUNTS = ("push", "repeat")

# Those of every kind.
COMMON: Known = {
    **dict.fromkeys(DIRECTION_COLUMNS, "angle"),
    **dict.fromkeys(COUNTS, "bare"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where the rows of a frame come from, for messages.

    Args:
        path: File as the user named it; None for tables made in memory.
        lines: Line of the file of every row.
        rows: Number of every row in a file without lines, from 0; None where the frame
            holds all of them.
    """

    path: str | None = None
    lines: Int[np.ndarray, " n"] | None = None
    rows: Int[np.ndarray, " n"] | None = None

    def problem(
        self, code: str, text: str, *, row: int | None = None, column: str, value: str
    ) -> InputProblem:
        """Make a problem whose message starts with the place."""
        line = None if row is None or self.lines is None else int(self.lines[row])
        place = self.path or "table"
        if row is not None and line is None:
            place += f", row {(row if self.rows is None else self.rows[row]) + 1}"
        made = problem(code, text, path=place, line=line, column=column, value=value)
        return replace(made, path=self.path)

    def places(self, rows: Int[np.ndarray, " m"]) -> str:
        """Lines of rows, or their numbers from 1 where there are no lines."""
        word, numbers = "row", (rows if self.rows is None else self.rows[rows]) + 1
        if self.lines is not None:
            word, numbers = "line", self.lines[rows]
        return f"{word}{'s' * (rows.size > 1)} {in_runs(numbers.tolist())}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Cells of a file as they stand there.

    Args:
        frame: Numbers, NaN where blank, or text, by column name.
        origin: Places that messages name.
        sources: Files behind them; the last is the file itself.
        notes: What the reader recognised or left out, for the user.
    """

    frame: pd.DataFrame
    origin: Origin
    sources: tuple[Source, ...]
    notes: tuple[str, ...]


def is_parquet(path: str | Path) -> bool:
    """Whether a file is one of Parquet, by its suffix."""
    return Path(path).suffix.lower() in PARQUET_SUFFIXES


def read_rows(path: str | Path, known: Known) -> Rows:
    """Read a table whose every row counts, such as a schedule or peak heights.

    Text may have the encodings, delimiters, decimal marks and preambles that recordings
    may have; a last line without a line end is kept, with a note.

    Args:
        known: Columns whose cells must be numbers or blank, but for those "bare" that
            count nothing; all others may hold anything.

    Raises:
        ConfigError: The path cannot be read, or it is Parquet and its library is not
            installed.
        DataError: The file breaks a rule; `.problems` lists file, line, column, value,
            rule and next step of each.
    """
    if is_parquet(path):
        return _parquet_rows(path)
    text = open_text(path)
    layout = find_layout(text)
    stems = recognise.RecordingColumns(layout.names).stems
    numbers = {stem for stem, held in known.items() if held != "bare"}.union(COUNTS)
    kinds: dict[int, Kind] = {
        i: "float" if stem in numbers else "text"
        for i, stem in enumerate(stems)
        if layout.names[i]
    }
    cells = read_cells(text, layout, kinds, tail="keep")
    lines = cells.scan.lines(np.arange(cells.scan.n_rows))
    own = Source(path=text.path, sha256=text.sha256, dialect=layout.description)
    return Rows(
        frame=pd.DataFrame({layout.names[i]: v for i, v in cells.values.items()}),
        origin=Origin(path=str(path), lines=lines),
        sources=(own,),
        notes=(*layout.notes, *cells.notes),
    )


def _parquet_rows(path: str | Path) -> Rows:
    """Rows with the sources and notes that they were written with."""
    try:
        frame = pd.read_parquet(path, engine="pyarrow")
    except ImportError as error:
        raise no_parquet(path) from error
    except (OSError, ValueError) as error:
        raise DataError(
            f"{path}: cannot be read as Parquet: {error}; give the CSV",
            code="not_parquet",
        ) from error
    kept = json.loads(frame.attrs.pop("pushfit", "{}"))
    own = Source(path=str(path), sha256=sha256_of(path), dialect="parquet")
    return Rows(
        frame=frame,
        origin=Origin(path=str(path)),
        sources=(*(Source(**s) for s in kept.get("sources", ())), own),
        notes=tuple(kept.get("notes", ())),
    )


def no_parquet(path: str | Path) -> ConfigError:
    """Say how to get on without the optional library."""
    return ConfigError(
        f"{path}: Parquet needs the package pyarrow, which is not installed; "
        "install it or use a name that ends in .csv",
        code="parquet_unavailable",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """Converted columns of a table of pushes.

    Args:
        frame: Canonical names and units; push and repeat are always there.
        unit: Unit of the signals, None where the table has none.
        notes: What was left out or filled in.
        left_out: Columns that are not used.
        given: Column of the user's by its canonical name, as far as there is one.
        in_degrees: Column of each angle that states degrees.
    """

    frame: pd.DataFrame
    unit: str | None
    notes: tuple[str, ...]
    left_out: tuple[str, ...]
    given: Mapping[str, str]
    in_degrees: Mapping[str, str]


def read_columns(
    raw: pd.DataFrame, known: Known, origin: Origin, *, any_of: tuple[str, ...] = ()
) -> Columns:
    """Recognise and convert the columns of a table of pushes.

    Args:
        raw: Columns as named by the user; cells are numbers or text.
        any_of: Known ones of which at least one must be there.

    Raises:
        DataError: There are no rows; a column is missing, doubtful, twice there or in
            a wrong unit; or a cell is not the number it should be.
    """
    if raw.empty:
        raise DataError(
            f"{origin.path or 'table'}: 0 data rows; give one row per push",
            code="no_rows",
        )
    found, left_out = _recognise(raw, known, origin, any_of)
    unit = _common_unit(found, origin)
    frame = _convert(raw, found, unit=unit, origin=origin)
    given = dict(
        zip(frame.columns, (column.given for column in found.values()), strict=True)
    )
    notes = _number(frame, origin)
    if left_out:
        notes.append(f"columns not used: {', '.join(left_out)}")
    in_degrees = {
        stem: found[stem].given
        for stem in DIRECTION_COLUMNS
        if found[stem].unit == UNITS["deg"]
    }
    return Columns(
        frame=frame,
        unit=unit,
        notes=tuple(notes),
        left_out=tuple(left_out),
        given=given,
        in_degrees=in_degrees,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Column:
    """A column of the user's, what it is, and its unit."""

    given: str
    stem: str
    unit: Unit | None


def _recognise(
    raw: pd.DataFrame, known: Known, origin: Origin, any_of: tuple[str, ...]
) -> tuple[dict[str, _Column], list[str]]:
    """Which column is what, and the columns left out."""
    found: dict[str, _Column] = {}
    left_out: dict[str, _Column] = {}
    problems = []
    columns = recognise.RecordingColumns([str(name) for name in raw.columns])
    for i, (given, stem) in enumerate(zip(columns.names, columns.stems, strict=True)):
        unit = columns.unit(i)
        column = _Column(given=given, stem=stem, unit=unit)
        if known.get(stem) != (unit.quantity if unit else "bare"):
            left_out[given] = column
        elif column.stem in found:
            first = found[column.stem].given
            text = f"{first!r} and {given!r} are both {column.stem}; remove one of them"
            problems.append(
                origin.problem("duplicate_column", text, column=given, value=given)
            )
        else:
            found[column.stem] = column
    problems += _doubtful(found, left_out, known, origin=origin, any_of=any_of)
    if problems:
        raise data_error(problems)
    return found, list(left_out)


def _doubtful(
    found: dict[str, _Column],
    left_out: dict[str, _Column],
    known: Known,
    *,
    origin: Origin,
    any_of: tuple[str, ...],
) -> Iterator[InputProblem]:
    """Names that look like a slip, and columns that a table cannot do without."""
    have = ", ".join([*(c.given for c in found.values()), *left_out])
    meant = set(found)
    for given, column in left_out.items():
        stem = nearest_stem(column.stem, known, taken=meant)
        if stem and stem not in meant:
            meant.add(stem)
            names = near_names(column.stem, column.unit, stem, holds=known[stem])
            text = f"is not known here; did you mean {names}?"
            yield origin.problem("near_miss_column", text, column=given, value=given)
    for stems in (*((stem,) for stem in DIRECTION_COLUMNS), any_of):
        if stems and not meant.intersection(stems):
            text = f"is missing; the columns are {have}; add it or rename one"
            wanted = any_name(stems[0], known[stems[0]])
            yield origin.problem("missing_column", text, column=wanted, value=have)


def _common_unit(found: dict[str, _Column], origin: Origin) -> str | None:
    """Unit that all signals share."""
    units = {
        column.given: column.unit.canonical
        for column in found.values()
        if column.unit and column.unit.quantity == "signal"
    }
    if len(set(units.values())) > 1:
        text = "one table has one unit, found " + ", ".join(
            f"{name} in {unit}" for name, unit in units.items()
        )
        text += "; convert them, or leave out those of the other unit"
        first = next(iter(units))
        raise data_error([origin.problem("mixed_units", text, column=first, value="")])
    return next(iter(units.values()), None)


def _convert(
    raw: pd.DataFrame, columns: dict[str, _Column], *, unit: str | None, origin: Origin
) -> pd.DataFrame:
    """Canonical names and units; text that should be a number is a problem."""
    converted: dict[str, object] = {}
    problems: list[InputProblem] = []
    for stem, column in columns.items():
        cells = ["" if c is None else str(c).strip() for c in raw[column.given]]
        if column.unit is None and stem not in COUNTS:
            converted[stem] = ["" if cell == "nan" else cell for cell in cells]
            continue
        values = _numbers(cells, column.given, origin=origin, problems=problems)
        if column.unit is None:
            converted[stem] = values
        elif column.unit == UNITS["deg"]:
            # Not by way of radians: 15 must stay 15.
            converted[f"{stem}_deg"] = values
        elif column.unit.quantity == "angle":
            converted[f"{stem}_deg"] = in_degrees(values)
        else:
            suffix = unit if column.unit.quantity == "signal" else "s"
            converted[f"{stem}_{suffix}"] = column.unit.to_canonical(values)
    if problems:
        raise data_error(problems)
    return pd.DataFrame(converted)


def _numbers(
    cells: list[str], column: str, *, origin: Origin, problems: list[InputProblem]
) -> Float[np.ndarray, " n"]:
    """Values of cells, NaN where empty; anything else is added to the problems."""
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        try:
            values[row] = float(cell) if cell else np.nan
        except ValueError:
            text = f"{cell!r} is not a number; fix the cell or remove the row"
            problems.append(
                origin.problem("not_a_number", text, row=row, column=column, value=cell)
            )
    return values


def _number(frame: pd.DataFrame, origin: Origin) -> list[str]:
    """Fill in push and repeat where the table does not give them."""
    notes = []
    if "push" not in frame:
        frame["push"] = np.arange(1, len(frame) + 1)
    if "repeat" not in frame:
        same = frame[["theta_deg", "alpha_deg"]].round(9)
        frame["repeat"] = (
            frame.groupby([same.theta_deg, same.alpha_deg], dropna=False).cumcount() + 1
        )
        notes.append("repeats numbered within equal directions")
    problems = []
    for name in COUNTS:
        column = frame[name].to_numpy(dtype=float)
        for row in np.flatnonzero(~(np.isfinite(column) & (column == np.rint(column)))):
            value, text = "", "is empty; number them 1, 2, ..., or remove a blank row"
            if not np.isnan(column[row]):
                value = f"{column[row]:g}"
                text = f"{value} is not a whole number; number them 1, 2, ..."
            problems.append(
                origin.problem(
                    "not_whole", text, row=int(row), column=name, value=value
                )
            )
    if problems:
        raise data_error(problems)
    for name in COUNTS:
        frame[name] = frame[name].astype(int)
    return notes
