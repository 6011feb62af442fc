"""Many results as one HTML page: a population, and every item with its intervals.

The table is sorted by a few lines of script that the policy names by their hash, and
reads without them. Which columns a frame of results has is known here only. Excluded:
the page of one result (`pushfit.report.html.result`).
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from pushfit.fit.results import Piece, Verdict
from pushfit.parameters import ANGLES
from pushfit.report.fact_rows import SET_VERDICTS, verdict_word
from pushfit.report.html.pages import render_page
from pushfit.report.strings import (
    format_angle,
    format_estimate,
    format_number,
    format_p_value,
    format_range,
    join_or,
    unit_label,
    with_unit,
)

NUMBERS = ("A", "B", "C_rr")
OK = "ok"
# Width of an interval's picture, in its own units.
WIDTH = 100.0
# Quantities that differ by more than this among items are drawn over their logarithm.
WIDE = 10.0
LOG = "ln_"

Record = Mapping[str, object]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """What a row says of one quantity.

    Args:
        estimate: None if not quoted.
        pieces: Interval or set to draw; None for an open end.
        unit: Unit of both.
        is_axis: Whether 180° is 0°.
        verdict: What may be said, in a word.
    """

    estimate: float | None
    pieces: tuple[Piece, ...]
    unit: str
    is_axis: bool
    verdict: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Common scale of the pictures of one quantity; of a log equal steps are ratios."""

    low: float
    high: float
    is_log: bool

    def place(self, value: float | None, *, default: float) -> float:
        """Position of a value in a picture, inside it.

        Args:
            value: None for an open end.
            default: Position of an open end.
        """
        if value is None:
            return default
        ends = (self.low, value, self.high)
        low, at, high = map(math.log, ends) if self.is_log else ends
        share = (at - low) / (high - low) if high > low else 0.5
        return round(WIDTH * share, 1)


EMPTY = Axis(low=0.0, high=1.0, is_log=False)


def render_batch(
    frame: pd.DataFrame,
    population: Sequence[Record] = (),
    *,
    title: str = "Batch",
    notes: Sequence[str] = (),
) -> str:
    """The whole batch as one page.

    Args:
        frame: One row per item. Read are `item`, `link` (address of its page beside
            this one), `status`, `chi_square_p_value`, `warnings` (codes joined by
            ";") and `message`; of the angles `theta_c` and `alpha_star` the columns
            `<name>_deg`, `<name>_low_deg`, `<name>_high_deg`,
            `<name>_sets` (JSON), `<name>_verdict` and, of an axis,
            `<name>_period_deg`; of `A`, `B` and `C_rr` the same without `_deg`, and
            `<name>_unit`. Columns and cells may be missing.
        population: One row per quantity: `quantity`, `unit`, `mean`, `mean_low`,
            `mean_high`, `spread`, `spread_low`, `spread_high`, `n_items`, and
            `outliers`, `not_usable` and `provisional`, names of items joined by
            ";". With an upper end alone a number is below it.
        notes: What is said of the population, as clauses.
    """
    records = frame.to_dict("records")
    names = [n for n in (*ANGLES, *NUMBERS) if n in frame or f"{n}_deg" in frame]
    entries = {name: [_entry(record, name) for record in records] for name in names}
    axes = {name: _axis(column) for name, column in entries.items()}
    n_ok = sum(_word(record, "status") == OK for record in records)
    content = {
        "title": title,
        "n_items": len(records),
        "n_ok": n_ok,
        "population": [_population_row(row) for row in population],
        "notes": notes,
        "columns": [{"name": n, "scale": _scale(axes[n], n)} for n in names],
        "rows": [
            {
                "item": _word(record, "item") or str(index),
                "status": _word(record, "status"),
                "is_ok": _word(record, "status") == OK,
                "cells": [_cell(entries[n][index], axes[n]) for n in names],
                "p_value": _p_value(_number(record, "chi_square_p_value")),
                "warnings": _word(record, "warnings").replace(";", ", "),
                "message": _word(record, "message"),
                "link": _word(record, "link"),
            }
            for index, record in enumerate(records)
        ],
    }
    return render_page("batch.html.j2", content, script="sort.js")


def _entry(record: Record, name: str) -> Entry:
    suffix = "_deg" if name in ANGLES else ""
    low = _number(record, f"{name}_low{suffix}")
    high = _number(record, f"{name}_high{suffix}")
    sets = _word(record, f"{name}_sets")
    pieces = tuple((p[0], p[1]) for p in json.loads(sets)) if sets else ()
    verdict = _word(record, f"{name}_verdict")
    is_known = verdict in {known.value for known in Verdict}
    has_shape = is_known and Verdict(verdict) in SET_VERDICTS
    if not (has_shape and pieces) and low is not None and high is not None:
        pieces = ((low, high),)
    return Entry(
        estimate=_number(record, f"{name}{suffix}"),
        pieces=pieces,
        unit="deg" if suffix else _word(record, f"{name}_unit"),
        is_axis=_number(record, f"{name}_period_deg") is not None,
        verdict=verdict_word(Verdict(verdict)) if is_known else verdict,
    )


def _number(record: Record, column: str) -> float | None:
    """Finite number of a cell, None for anything else."""
    value = record.get(column)
    if isinstance(value, int | float) and math.isfinite(value):
        return float(value)
    return None


def _word(record: Record, column: str) -> str:
    """Text of a cell, empty where there is none."""
    value = record.get(column)
    return value if isinstance(value, str) else ""


def _axis(entries: Sequence[Entry]) -> Axis:
    ends = [e for entry in entries for piece in entry.pieces for e in piece]
    values = [v for v in (*ends, *(e.estimate for e in entries)) if v is not None]
    if not values:
        return EMPTY
    low, high = min(values), max(values)
    is_log = 0 < low and high / low > WIDE and entries[0].unit != "deg"
    if not is_log:
        margin = 0.03 * (high - low) or 0.5
        low, high = low - margin, high + margin
    return Axis(low=low, high=high, is_log=is_log)


def _scale(axis: Axis, name: str) -> str:
    """Ends of the pictures in words; none where nothing is drawn."""
    if axis == EMPTY:
        return ""
    unit = "deg" if name in ANGLES else ""
    words = format_range(axis.low, axis.high, unit)
    return f"{words}, logarithmic" if axis.is_log else words


def _cell(entry: Entry, axis: Axis) -> dict[str, object]:
    estimate, value = entry.estimate, ""
    ranges = join_or(
        [format_range(*p, entry.unit, is_axis=entry.is_axis) for p in entry.pieces]
    )
    if estimate is not None:
        value = format_number(estimate)
        if entry.unit == "deg":
            value = format_angle(estimate)
        match entry.pieces:
            case [(float(low), float(high))] if low < high:
                value, ranges = format_estimate(
                    estimate, (low, high), entry.unit, is_axis=entry.is_axis
                )
        value = value if entry.unit == "deg" else with_unit(value, entry.unit)
    bars = []
    for low, high in entry.pieces:
        start = axis.place(low, default=0.0)
        end = axis.place(high, default=WIDTH)
        bars.append((start, round(max(end - start, 0.6), 1)))
    dot = None if estimate is None else axis.place(estimate, default=0.0)
    return {
        "sort": "" if estimate is None else repr(estimate),
        "value": value,
        "range": ranges,
        "verdict": entry.verdict,
        "bars": bars,
        "dot": dot,
    }


def _p_value(value: float | None) -> str:
    return "" if value is None else format_p_value(value).removeprefix("= ")


def _population_row(row: Record) -> dict[str, object]:
    name, unit = _word(row, "quantity"), _word(row, "unit")
    n_items = _number(row, "n_items")
    is_ratio = name.startswith(LOG)
    if is_ratio:
        # Pooled as logarithms, so the mean is geometric and the spread a ratio.
        name, row = name.removeprefix(LOG), _exponentials(row)
    spread = _with_range(row, "spread")
    if is_ratio and spread:
        spread = f"a factor {'' if spread.startswith('below') else 'of '}{spread}"
    return {
        "name": name,
        "unit": unit_label(unit),
        "mean": _with_range(row, "mean"),
        "spread": spread,
        "n_items": "" if n_items is None else f"{n_items:.0f}",
        "outliers": _word(row, "outliers").replace(";", ", "),
        "not_usable": _word(row, "not_usable").replace(";", ", "),
        "provisional": _word(row, "provisional").replace(";", ", "),
    }


def _exponentials(row: Record) -> Record:
    """Row of a logarithm as one of the quantity itself."""
    changed = dict(row)
    for name in ("mean", "spread"):
        for column in (name, f"{name}_low", f"{name}_high"):
            value = _number(row, column)
            if value is not None:
                changed[column] = math.exp(value)
    return changed


def _with_range(row: Record, name: str) -> str:
    """Number with its interval in brackets."""
    value = _number(row, name)
    low, high = _number(row, f"{name}_low"), _number(row, f"{name}_high")
    if value is None:
        return "" if high is None else f"below {format_number(high)}"
    if low is None or high is None or not low < high:
        return format_number(value)
    number, interval = format_estimate(value, (low, high), "")
    return f"{number} ({interval})"
