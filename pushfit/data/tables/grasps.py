"""Long tables: the pushes of many grasps in one file, told apart by a column.

Excluded: tables of one grasp (`pushfit.data.tables.peak_table`).
"""

import gzip
import hashlib
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import UInt64
from pandas.util import hash_pandas_object

from pushfit.data.tables.columns import Origin, is_parquet, read_rows
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.data.tables.rules import GRASP, KNOWN, grasp_names
from pushfit.data.text.faults import data_error, refuse
from pushfit.data.text.files import Source
from pushfit.errors import ConfigError, DataError, InputProblem

# The header of a table is in its first bytes.
_HEAD = 4096


@dataclass(frozen=True, slots=True, kw_only=True)
class GraspRows:
    """Rows of one grasp in a long table, not yet judged.

    Args:
        grasp: Text of the cell that names it.
        sha256: Digest of the cells, not of the file: other grasps may change.
        frame: The rows, without the column of names.
        origin: Places of the rows, for messages.
        source: The whole file with its digest.
    """

    grasp: str
    sha256: str
    frame: pd.DataFrame
    origin: Origin
    source: Source

    def table(self) -> PeakTable:
        """The peak table of the grasp."""
        return PeakTable.from_frame(
            self.frame, origin=self.origin, sources=(self.source,)
        )


def is_long_table(path: str | Path) -> bool:
    """Tell cheaply whether a file may hold many grasps; never raises for its content.

    Returns:
        Whether it has a column `grasp` that names some. Folders are no tables.
    """
    if Path(path).is_dir():
        return False
    if is_parquet(path):
        return _names_grasps(path)
    with open(path, "rb") as file:
        start = file.read(_HEAD)
    if start.startswith(b"\x1f\x8b"):
        try:
            with gzip.open(path) as file:
                start = file.read(_HEAD)
        except (OSError, EOFError, zlib.error):
            return False
    if GRASP.encode() not in start.replace(b"\x00", b"").lower():
        return False
    return _names_grasps(path)


def read_grasps(path: str | Path) -> Iterator[GraspRows]:
    """Split a long table into its grasps.

    Args:
        path: Table of peak heights, CSV or Parquet, with a column `grasp`.

    Yields:
        The rows of each grasp, in the order of first appearance.

    Raises:
        DataError: The file is no regular table, or a row names no grasp.
    """
    rows = read_rows(path, KNOWN)
    names = grasp_names(rows.frame)
    if names is None:
        raise refuse("no_grasp", "has no column grasp", path=str(path))
    column = str(names.name)
    if (names == "").any():
        first = int(np.flatnonzero(names == "")[0])
        text = "is empty; name the grasp of every push"
        raise data_error(
            [rows.origin.problem("no_grasp", text, row=first, column=column, value="")]
        )
    cells = rows.frame.drop(columns=column).reset_index(drop=True)
    hashes = _row_hashes(cells)
    header = "\n".join(map(str, cells.columns)).encode()
    positions = cells.groupby(names.to_numpy(), sort=False).indices
    for grasp, where in positions.items():
        lines = None if rows.origin.lines is None else rows.origin.lines[where]
        yield GraspRows(
            grasp=str(grasp),
            sha256=hashlib.sha256(header + hashes[where].tobytes()).hexdigest(),
            frame=cells.iloc[where].reset_index(drop=True),
            origin=Origin(path=rows.origin.path, lines=lines, rows=where),
            source=rows.sources[-1],
        )


def read_tables(path: str | Path) -> dict[str | None, PeakTable]:
    """The table of every grasp in a file.

    Returns:
        Tables by grasp, of which a file without the column names none.

    Raises:
        DataError: The file, or rows of some grasps, break a rule; `.problems` has all.
    """
    if not is_long_table(path):
        return {None: read_table(path)}
    tables: dict[str | None, PeakTable] = {}
    problems: list[InputProblem] = []
    for rows in read_grasps(path):
        try:
            tables[rows.grasp] = rows.table()
        except DataError as error:
            whole = InputProblem(code=error.code, message=str(error), path=str(path))
            problems += error.problems or (whole,)
    if problems:
        raise data_error(problems)
    return tables


def _row_hashes(cells: pd.DataFrame) -> UInt64[np.ndarray, " n"]:
    """A number for each row that depends on its cells alone."""
    # As floats: one fraction in a column must not change the other grasps' digests.
    numbers = {c: float for c in cells if pd.api.types.is_numeric_dtype(cells[c])}
    cells = cells.astype(numbers)
    return hash_pandas_object(cells, index=False).to_numpy()  # pyright: ignore


def _names_grasps(path: str | Path) -> bool:
    """Whether a file is a table whose rows name grasps, or some of them."""
    try:
        names = grasp_names(read_rows(path, KNOWN).frame)
    except (DataError, ConfigError):
        return False
    return names is not None and bool((names != "").any())
