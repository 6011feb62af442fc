"""Small files with one row per push, as cells with their line numbers."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pushfit.data.recordings.records import Source
from pushfit.data.tables.columns import Origin
from pushfit.data.text.csv_reader import read_csv_strict


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Cells of a file as they stand there.

    Args:
        frame: Numbers, NaN where blank, or text, by column name.
        origin: Path and line numbers, for messages.
        source: Provenance.
        notes: What the reader has to say.
    """

    frame: pd.DataFrame
    origin: Origin
    source: Source
    notes: tuple[str, ...]


def read_rows(path: str | Path, *, texts: tuple[str, ...] = ()) -> Rows:
    """Read a CSV file with one row per push.

    Raises:
        ConfigError: The file is not there.
        DataError: The file is no regular table of numbers.
    """
    frame, source, notes = read_csv_strict(
        path, is_text=lambda name: name.strip().lower() in texts
    )
    lines = np.asarray(frame.index, dtype=int)
    origin = Origin(path=str(path), lines=lines)
    return Rows(frame=frame, origin=origin, source=source, notes=notes)
