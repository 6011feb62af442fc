"""The work on one chunk of items, here or in a worker process.

Nothing is raised: whatever happens to an item becomes its outcome, and its neighbours
go on. Excluded: who does it (`pushfit.batch.workers`).
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from pushfit.batch.folders import SUMMARY, folder_name
from pushfit.batch.items import Item, ItemFailure
from pushfit.batch.store import Finished
from pushfit.data.check import file_kind
from pushfit.data.load import (
    configured_peaks,
    configured_recording,
    reader_options,
)
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.data.text.files import sha256_of
from pushfit.errors import DataError, PushfitError
from pushfit.explore.advice import with_next_push
from pushfit.fit.identify.identify_many import ItemResult, identify_many
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.results import Recipe
from pushfit.report.store.folder import write_result_folder

Chunk = tuple[Item, ...]
# What identifies tables that share a configuration, as `identify_many` does.
IdentifyMany = Callable[..., list[ItemResult | PushfitError]]


def identify_chunk(
    chunk: Chunk, *, engine: str, identify: IdentifyMany = identify_many
) -> list[Finished | ItemFailure]:
    """Read the items of a chunk, which share a configuration, and identify them."""
    loaded = [load_item(item) for item in chunk]
    good = [
        (item, *found)
        for item, found in zip(chunk, loaded, strict=True)
        if not isinstance(found, ItemFailure)
    ]
    results = iter(_identify(good, engine, identify)) if good else iter(())
    return [
        found if isinstance(found, ItemFailure) else next(results) for found in loaded
    ]


def load_item(item: Item) -> tuple[str, PeakTable] | ItemFailure:
    """Peaks of a "recording" or "table", and which it is, or why there are none."""
    stage = "read"
    try:
        if item.rows is not None:
            return "table", item.rows.table()
        kind = file_kind(item.path, **reader_options(item.config))
        if kind == "schedule":
            raise DataError(
                f"{item.path}: is a schedule; name the recording, and its schedule by "
                "`schedule` or as NAME.schedule.csv beside it",
                code="is_a_schedule",
            )
        if kind == "table":
            table = read_table(item.path)
        else:
            recording = configured_recording(item.path, item.config)
            stage = "peaks"
            table = configured_peaks(recording, item.schedule, item.config)
        _check_unchanged(item, table)
    except Exception as error:
        return ItemFailure.of(item.name, stage, error)
    return kind, table


def write_folder(
    chunk: Chunk, *, engine: str, folder: Path, worded: Callable[[str], str]
) -> list[str | ItemFailure]:
    """Identify and write each item alone; digests of `summary.json`, or failures."""
    return [_write_folder(item, engine, folder, worded) for item in chunk]


def _write_folder(
    item: Item, engine: str, folder: Path, worded: Callable[[str], str]
) -> str | ItemFailure:
    found = load_item(item)
    if isinstance(found, ItemFailure):
        return found
    kind, table = found
    table = replace(table, notes=tuple(map(worded, table.notes)))
    plan = (item.schedule,) if item.schedule is not None else ()
    given = item.config.model_dump(mode="json")
    recipe = Recipe(config=given, recordings=(item.path,), schedules=plan)
    if kind == "table":
        recipe = Recipe(config=given, table=item.path)
    try:
        result = identify_table(table, item.config, seed=item.seed, engine=engine)
        # Rows of a long table are no file that could be read again by itself.
        result = replace(
            with_next_push(result), recipe=recipe if item.rows is None else None
        )
        out = write_result_folder(result, folder / folder_name(item.name), force=True)
        return sha256_of(out / SUMMARY)
    except Exception as error:
        return ItemFailure.of(item.name, "folder", error)


def _identify(
    good: Sequence[tuple[Item, str, PeakTable]], engine: str, identify: IdentifyMany
) -> list[Finished | ItemFailure]:
    try:
        found = identify(
            [table for _, _, table in good],
            good[0][0].config,
            seeds=[item.seed for item, _, _ in good],
            engine=engine,
        )
    except Exception as error:
        if len(good) > 1:
            # One by one, so that only the table behind the bug pays for it.
            return [_identify([one], engine, identify)[0] for one in good]
        return [ItemFailure.of(good[0][0].name, "fit", error)]
    return [
        Finished(kind=kind, values=result.values, draws=result.draws)
        if isinstance(result, ItemResult)
        else ItemFailure.of(item.name, "fit", result)
        for (item, kind, _), result in zip(good, found, strict=True)
    ]


def _check_unchanged(item: Item, table: PeakTable) -> None:
    """Refuse what was read if it is not what the key of the item stands for."""
    read = {source.sha256 for source in table.sources}
    if not os.path.isdir(item.path) and item.sha256 not in read:
        raise DataError(
            f"{item.path}: the file changed since the batch began; run it again",
            code="file_changed",
        )
