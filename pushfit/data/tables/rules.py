"""Which columns a table of peak heights has, and what each may hold.

Excluded: how columns are recognised and breaches reported
(`pushfit.data.tables.columns`), and judging heights against a model.
"""

import numpy as np
import pandas as pd

from pushfit.data.tables.column_rules import check_columns
from pushfit.data.tables.columns import Layout, Origin, read_columns
from pushfit.errors import DataError

CHANNELS = ("height", "height_normal", "height_tangential")

FLAGS = {
    "saturated": "the sensor was at its limit, the height is a lower bound",
    "clipped": "the recording starts or ends inside the push",
    "gap": "samples are missing at the top of the push",
    "drift": "the baseline moved by more than 15 % of the height",
    "missing": "no hump at the planned moment, the height is what is there",
    "lost_contact": "the push lifted the finger off",
    "outlier": "the height is far from those of the same direction",
}

# What a height may be, see `pushfit.data.peaks.heights`.
DEFINITIONS = ("apex", "plateau")

# Heights under these flags are not what the model predicts; the others are opinions.
EXCLUDING_FLAGS = frozenset(
    {"saturated", "clipped", "gap", "drift", "missing", "lost_contact"}
)

_HEIGHTS = tuple(name for c in CHANNELS for name in (c, f"{c}_sd"))
LAYOUT = Layout(
    signals=(*_HEIGHTS, "baseline"),
    times=("t_start", "t_peak", "t_end"),
    texts=("definition", "flags"),
    any_of=CHANNELS,
)


def canonical_frame(
    raw: pd.DataFrame, origin: Origin
) -> tuple[pd.DataFrame, str, tuple[str, ...]]:
    """Recognise, convert and check the columns of a table of peak heights.

    Args:
        raw: Columns as named by the user; cells are numbers or text.

    Returns:
        Frame with canonical columns and units, unit of its heights, and notes on what
        was left out or filled in.

    Raises:
        DataError: A column is missing, doubtful, twice there or in a wrong unit, or a
            cell breaks its rule; all breaches are in `problems`.
    """
    columns = read_columns(raw, LAYOUT, origin)
    frame, unit = columns.frame, columns.unit
    if unit is None:
        raise DataError("a peak table needs heights", code="missing_column")
    if "flags" not in frame:
        frame["flags"] = ""
    check_columns(columns, _rules(unit), origin)
    names = [
        "push",
        "theta_deg",
        "alpha_deg",
        "repeat",
        *(f"{name}_{unit}" for name in LAYOUT.signals),
        *(f"{name}_s" for name in LAYOUT.times),
        "definition",
        "flags",
    ]
    ordered = frame.reindex(columns=[name for name in names if name in frame])
    return ordered, unit, columns.notes


def _rules(unit: str) -> dict[str, list]:
    """Checks of the columns that only peak tables have."""
    import pandera.pandas as pa  # noqa: PLC0415 - slow to load, needed only to check

    finite = pa.Check(np.isfinite, error="finite")
    positive = pa.Check.gt(0, error="sd")
    rules = {f"{channel}_{unit}": [finite] for channel in CHANNELS}
    rules |= {f"{channel}_sd_{unit}": [positive, finite] for channel in CHANNELS}
    rules["definition"] = [pa.Check.isin([*DEFINITIONS, ""], error="definition")]
    rules["flags"] = [pa.Check(_are_flags, element_wise=True, error="flags")]
    return rules


def _are_flags(text: str) -> bool:
    """Whether a cell holds known flag words only."""
    return all(word in FLAGS for word in text.split(";") if word)
