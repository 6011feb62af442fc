"""Small CSV files with one row per push, as text cells with their line numbers."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from pushfit.data.columns import Origin
from pushfit.data.recording import Source
from pushfit.errors import DataError


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """Cells of a file as they stand there.

    Args:
        frame: Text by column name.
        origin: Path and line numbers, for messages.
        source: Provenance.
    """

    frame: pd.DataFrame
    origin: Origin
    source: Source


def read_rows(path: str | Path, *, kind: str) -> Rows:
    """Read a CSV file with one row per push.

    Args:
        path: File to read.
        kind: What the rows are, for the provenance.

    Returns:
        The cells, not yet judged.

    Raises:
        DataError: The file cannot be read.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise DataError(
            f"{path}: cannot be read: {error.strerror}; check the name",
            code="file_unreadable",
        ) from error
    frame = pd.read_csv(path, dtype=str, keep_default_na=False)
    digest = hashlib.sha256(content).hexdigest()
    return Rows(
        frame=frame,
        origin=Origin(path=str(path), lines=np.arange(2, len(frame) + 2)),
        source=Source(path=str(path), sha256=digest, dialect=f"{kind}, csv"),
    )
