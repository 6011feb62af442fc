"""One table of peak heights from the tables of several recordings of one grasp.

Excluded: tables of many grasps (`pushfit.data.tables.grasps`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from pushfit.arguments import checked
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError


@checked
def merge_tables(tables: Sequence[PeakTable]) -> PeakTable:
    """Put tables below each other in order and number pushes and repeats through.

    A repeat is a pass through a plan, so that those of another recording are others.

    Args:
        tables: At least one; all in one unit and with the same height channels.

    Returns:
        One table with the columns that all have; a single one as it is.

    Raises:
        DataError: There is no table (`no_tables`), units or channels differ
            (`mixed_units`), or two tables come from one recording
            (`duplicate_recording`).
    """
    if not tables:
        raise DataError("no tables to merge; give one or more", code="no_tables")
    if len(tables) == 1:
        return tables[0]
    _refuse_duplicates(tables)
    kinds = sorted({f"{', '.join(own.channels)} in {own.unit}" for own in tables})
    if len(kinds) > 1:
        raise DataError(
            f"the recordings have {' and '.join(kinds)}; analyse one sensor at a time, "
            "or record the same of all of them in one unit",
            code="mixed_units",
        )
    frames, n_repeats = [], 0
    for table in tables:
        repeat = table.frame["repeat"] + n_repeats
        frames.append(table.frame.assign(repeat=repeat))
        n_repeats = int(repeat.to_numpy().max())
    # A column that one table lacks, such as the sd, is known for no fit of them all.
    frame = pd.concat(frames, ignore_index=True, join="inner")
    frame["push"] = np.arange(1, len(frame) + 1)
    ends = np.cumsum([table.n_pushes for table in tables])
    origins = [
        f"pushes {end - table.n_pushes + 1} to {end} are from {table.sources[0].path}"
        for table, end in zip(tables, ends, strict=True)
        if table.sources
    ]
    merged = PeakTable.from_frame(
        frame,
        sources=tuple(source for table in tables for source in table.sources),
        notes=(*origins, *(note for table in tables for note in table.notes)),
    )
    traces = tuple(
        replace(trace, first_row=trace.first_row + int(end) - table.n_pushes)
        for table, end in zip(tables, ends, strict=True)
        for trace in table.traces
    )
    return replace(merged, traces=traces)


def _refuse_duplicates(tables: Sequence[PeakTable]) -> None:
    """Find recordings of the same bytes: counted twice, their pushes claim too much."""
    first: dict[str, str] = {}
    for table in tables:
        # The first source is the recording, the second its schedule.
        for source in table.sources[:1]:
            if source.sha256 in first:
                raise DataError(
                    f"{source.path}: has the same bytes as {first[source.sha256]}; its "
                    "pushes would count twice, so name each recording once",
                    code="duplicate_recording",
                )
            first[source.sha256] = source.path
