"""Which columns a table of peak heights has, and what each may hold.

Names, units and ranges are checked here, whatever the rows come from; every breach is
reported by file, line, column, value, rule and remedy. Excluded: reading files
(`pushfit.data.table`) and judging heights against a model.
"""

import difflib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from jaxtyping import Float, Int

from pushfit.data.units import UNITS, Unit, implausible_angles, split_unit
from pushfit.errors import DataError, Problem

if TYPE_CHECKING:
    from pandera.pandas import DataFrameSchema

CHANNELS = ("height", "height_normal", "height_tangential")

FLAGS = {
    "saturated": "the sensor was at its limit, the height is a lower bound",
    "clipped": "the recording starts or ends inside the push",
    "gap": "samples are missing at the top of the push",
    "lost_contact": "the push lifted the finger off",
    "outlier": "the height is far from those of the same direction",
}

# Heights under these flags are not what the model predicts; the others are opinions.
EXCLUDING_FLAGS = frozenset({"saturated", "clipped", "gap", "lost_contact"})

_SIGNALS = (*(name for c in CHANNELS for name in (c, f"{c}_sd")), "baseline")
_TIMES = ("t_start", "t_peak", "t_end")
_ANGLES = ("theta", "alpha")
_COUNTS = ("push", "repeat")
_STEMS = (*_ANGLES, *_SIGNALS, *_TIMES)
_BARE = (*_COUNTS, "flags")
_SIGNAL_UNITS = tuple(u.name for u in UNITS.values() if u.quantity == "signal")

# Names at least this alike are one name misspelt: `heigth` and `height` are 0.83
# alike, `height_left` and `height` 0.71.
_ALIKE = 0.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where the rows of a frame come from, for messages.

    Args:
        path: File as the user named it; None for tables made in memory.
        lines: Line of the file of every row.
    """

    path: str | None = None
    lines: Int[np.ndarray, " n"] | None = None

    def problem(
        self, code: str, text: str, *, row: int | None = None, column: str, value: str
    ) -> Problem:
        """Make a problem whose message starts with the place."""
        line = None
        place = self.path or "peak table"
        if row is not None and self.lines is not None:
            line = int(self.lines[row])
            place += f", line {line}"
        elif row is not None:
            place += f", row {row}"
        return Problem(
            code=code,
            message=f"{place}, column {column}: {text}",
            path=self.path,
            line=line,
            column=column,
            value=value,
        )


def failure(problems: list[Problem]) -> DataError:
    """Error that shows the first problem and carries them all."""
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return DataError(
        problems[0].message + more, code=problems[0].code, problems=tuple(problems)
    )


def canonical_frame(
    raw: pd.DataFrame, origin: Origin
) -> tuple[pd.DataFrame, str, tuple[str, ...]]:
    """Recognise, convert and check the columns of a table of peak heights.

    Args:
        raw: Columns as named by the user; cells are numbers or text.
        origin: Where the rows come from.

    Returns:
        Frame with canonical columns and units, unit of its heights, and notes on what
        was left out or filled in.

    Raises:
        DataError: A column is missing, doubtful, twice there or in a wrong unit, or a
            cell breaks its rule; all breaches are in `problems`.
    """
    if raw.empty:
        raise DataError(
            f"{origin.path or 'peak table'}: 0 data rows; give one row per push",
            code="empty_table",
        )
    columns, unit, left_out = _recognise(raw, origin)
    frame = _convert(raw, columns, unit, origin)
    notes = _number(frame, origin)
    if left_out:
        notes.append(f"columns not used: {', '.join(left_out)}")
    _check(frame, unit, origin)
    _check_angles(frame, columns, origin)
    return _ordered(frame, unit), unit, tuple(notes)


@dataclass(frozen=True, slots=True)
class _Column:
    """A column of the user's, what it is, and its unit."""

    given: str
    stem: str
    unit: Unit | None


def _recognise(
    raw: pd.DataFrame, origin: Origin
) -> tuple[dict[str, _Column], str, list[str]]:
    """Which column is what, the unit of the signals, and the columns left out."""
    found: dict[str, _Column] = {}
    left_out, problems = [], []
    for given in map(str, raw.columns):
        column = _identify(given)
        if column is None:
            left_out.append(given)
        elif column.stem in found:
            first = found[column.stem].given
            text = f"{first!r} and {given!r} are both {column.stem}; remove one of them"
            problems.append(
                origin.problem("duplicate_column", text, column=given, value=given)
            )
        else:
            found[column.stem] = column
    problems += _missing(found, left_out, origin)
    signals = {
        c.given: c.unit.canonical
        for c in found.values()
        if c.stem in _SIGNALS and c.unit
    }
    if len(set(signals.values())) > 1:
        text = "one table has one unit, found " + ", ".join(
            f"{name} in {unit}" for name, unit in signals.items()
        )
        problems.append(
            origin.problem("mixed_units", text, column=next(iter(signals)), value="")
        )
    if problems:
        raise failure(problems)
    return found, next(iter(signals.values())), left_out


def _identify(given: str) -> _Column | None:
    """What a column is by its name, None where it is nothing of ours."""
    stem, unit = split_unit(given)
    stem = stem.strip().lower()
    if unit is None:
        return _Column(given, stem, None) if stem in _BARE else None
    expected = {"signal": _SIGNALS, "time": _TIMES, "angle": _ANGLES}
    if stem in expected.get(unit.quantity, ()):
        return _Column(given, stem, unit)
    return None


def _missing(
    found: dict[str, _Column], left_out: list[str], origin: Origin
) -> Iterator[Problem]:
    """Columns that a table cannot do without, and names that look like a slip."""
    for given in left_out:
        name = split_unit(given)[0].strip().lower()
        near = difflib.get_close_matches(name, (*_STEMS, *_BARE), n=1, cutoff=_ALIKE)
        if near and near[0] not in found:
            wanted = _full_names(near[0])
            text = f"is not a column of a peak table; did you mean {wanted}?"
            yield origin.problem("near_miss_column", text, column=given, value=given)
            found[near[0]] = _Column(given, near[0], None)
    have = ", ".join([*(c.given for c in found.values()), *left_out])
    for stem in _ANGLES:
        if stem not in found:
            text = f"is missing; the columns are {have}; add it or rename one"
            yield origin.problem(
                "missing_column", text, column=f"{stem}_deg", value=have
            )
    if not any(channel in found for channel in CHANNELS):
        text = (
            f"is missing; the columns are {have}; name the heights with their unit: "
            f"{_full_names('height')}"
        )
        yield origin.problem("missing_column", text, column="height", value=have)


def _full_names(stem: str) -> str:
    """A stem with the suffixes it may have."""
    if stem in _BARE:
        return stem
    if stem in _ANGLES:
        return f"{stem}_deg or {stem}_rad"
    if stem in _TIMES:
        return f"{stem}_s"
    return ", ".join(f"{stem}_{unit}" for unit in _SIGNAL_UNITS)


def _convert(
    raw: pd.DataFrame, columns: dict[str, _Column], unit: str, origin: Origin
) -> pd.DataFrame:
    """Canonical names and units; text that should be a number is a problem."""
    converted: dict[str, object] = {}
    problems: list[Problem] = []
    for stem, column in columns.items():
        cells = [
            "" if cell is None else str(cell).strip() for cell in raw[column.given]
        ]
        if stem == "flags":
            converted["flags"] = ["" if cell == "nan" else cell for cell in cells]
            continue
        values = _numbers(cells, column.given, origin, problems)
        if column.unit is None:
            converted[stem] = values
        elif stem in _ANGLES:
            converted[f"{stem}_deg"] = _degrees(values, column.unit)
        else:
            suffix = "s" if stem in _TIMES else unit
            converted[f"{stem}_{suffix}"] = column.unit.to_canonical(values)
    if problems:
        raise failure(problems)
    return pd.DataFrame(converted)


def _numbers(
    cells: list[str], column: str, origin: Origin, problems: list[Problem]
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


def _degrees(values: Float[np.ndarray, " n"], unit: Unit) -> Float[np.ndarray, " n"]:
    """Angles in degrees, untouched where they are: 15 must stay 15."""
    return values if unit.name == "deg" else np.degrees(values)


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
    if "flags" not in frame:
        frame["flags"] = ""
    problems = []
    for name in _COUNTS:
        column = frame[name].to_numpy(dtype=float)
        for row in np.flatnonzero(~(np.isfinite(column) & (column == np.rint(column)))):
            text = f"{column[row]:g} is not a whole number; number them 1, 2, ..."
            problems.append(
                origin.problem(
                    "not_whole", text, row=int(row), column=name, value=str(column[row])
                )
            )
    if problems:
        raise failure(problems)
    for name in _COUNTS:
        frame[name] = frame[name].astype(int)
    return notes


def _check(frame: pd.DataFrame, unit: str, origin: Origin) -> None:
    """Run the schema and put its findings into words."""
    import pandera.errors  # noqa: PLC0415 - slow to load, needed only to check

    try:
        _schema(frame, unit).validate(frame, lazy=True)
    except pandera.errors.SchemaErrors as error:
        cases = error.failure_cases.sort_values("index", kind="stable")
        problems = []
        for case in cases.itertuples():
            code, rule = _REASONS.get(str(case.check), (str(case.check), "is wrong"))
            value = case.failure_case
            shown = f"{value:g}" if isinstance(value, float) else repr(value)
            problems.append(
                origin.problem(
                    code,
                    f"{shown} {rule}",
                    row=int(case.index),
                    column=str(case.column),
                    value=str(value),
                )
            )
        raise failure(problems) from error


def _check_angles(
    frame: pd.DataFrame, columns: dict[str, _Column], origin: Origin
) -> None:
    """Refuse radians in columns that say degrees."""
    degrees = UNITS["deg"]
    stated = [stem for stem in _ANGLES if columns[stem].unit == degrees]
    angles = {stem: (frame[f"{stem}_deg"].to_numpy(), degrees) for stem in stated}
    implausible = implausible_angles(angles)
    if implausible:
        given = columns[stated[0]].given
        raise failure(
            [origin.problem("implausible_angles", implausible, column=given, value="")]
        )


# Names of the checks, as pandera reports them: stable code, and rule with remedy.
_REASONS = {
    "theta": (
        "theta_range",
        "is outside [-90, 90]; theta is the elevation out of the tangential plane; "
        "an angle from the surface normal is 90 minus it",
    ),
    "alpha": ("alpha_range", "is outside [-360, 360]; give the azimuth within a turn"),
    "finite": ("not_finite", "is not a finite number; fill the cell or remove the row"),
    "not_nullable": (
        "missing_value",
        "stands for an empty cell; fill it or remove the row",
    ),
    "sd": ("sd_range", "is no standard deviation; it must be above 0"),
    "count": ("count_range", "is below 1; number pushes and repeats from 1"),
    "field_uniqueness": ("duplicate_push", "stands for two pushes; number them apart"),
    "flags": (
        "unknown_flag",
        "is no list of flags; known, joined by ';': " + ", ".join(FLAGS),
    ),
}


def _schema(frame: pd.DataFrame, unit: str) -> "DataFrameSchema":
    """Schema of the columns that a frame has."""
    import pandera.pandas as pa  # noqa: PLC0415 - as above

    finite = pa.Check(np.isfinite, error="finite")
    rules = {
        "push": [pa.Check.ge(1, error="count")],
        "repeat": [pa.Check.ge(1, error="count")],
        "theta_deg": [pa.Check.in_range(-90, 90, error="theta")],
        "alpha_deg": [pa.Check.in_range(-360, 360, error="alpha")],
        "flags": [pa.Check(_are_flags, element_wise=True, error="flags")],
    }
    for channel in CHANNELS:
        rules[f"{channel}_{unit}"] = [finite]
        rules[f"{channel}_sd_{unit}"] = [pa.Check.gt(0, error="sd"), finite]
    optional = {f"{time}_s" for time in _TIMES} | {f"baseline_{unit}"}
    return pa.DataFrameSchema(
        {
            str(name): pa.Column(
                None,
                rules.get(str(name), []),
                nullable=name in optional,
                unique=name == "push",
            )
            for name in frame.columns
        }
    )


def _are_flags(text: str) -> bool:
    """Whether a cell holds known flag words only."""
    return all(word in FLAGS for word in text.split(";") if word)


def _ordered(frame: pd.DataFrame, unit: str) -> pd.DataFrame:
    """Columns in the documented order."""
    names = [
        "push",
        "theta_deg",
        "alpha_deg",
        "repeat",
        *(f"{name}_{unit}" for name in _SIGNALS),
        *(f"{name}_s" for name in _TIMES),
        "flags",
    ]
    return frame.reindex(columns=[name for name in names if name in frame])
