"""A batch from its inputs to its files: plan, compute what is missing, write.

Equal inputs give equal files, byte by byte, whatever the number of workers, the order
of the inputs, and however often the run was killed on the way. Excluded: the work on an
item (`pushfit.batch.identify_chunk`).
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from pushfit.arguments import checked
from pushfit.batch.folders import (
    FOLDER,
    REPORT,
    begin_folder,
    folder_name,
    is_current,
    remove_leftovers,
)
from pushfit.batch.identify_chunk import IdentifyMany, identify_chunk, write_folder
from pushfit.batch.inputs import find_inputs
from pushfit.batch.items import Item, ItemFailure, Plan, Planner
from pushfit.batch.outputs import write_outputs
from pushfit.batch.population import pool_items
from pushfit.batch.rows import Row, collect
from pushfit.batch.store import Store, open_store
from pushfit.batch.workers import Outcome, Work, Workers
from pushfit.data.text.faults import listed
from pushfit.errors import DataError, check_seed
from pushfit.fit.identify.fitted import check_engine
from pushfit.fit.identify.identify_many import identify_many
from pushfit.fit.identify.progress import Progress, stages_of
from pushfit.fit.programs.compile import loaded_ahead

# What a first batch begins with, whose first portion takes longest.
COMPILING = "identifying (the first tables compile programs, which takes minutes)"


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """What a batch found.

    Args:
        rows: One row for each item, sorted by name; see `results.csv`.
        population: One row for each quantity that was pooled; see `population.csv`.
        failures: Items without a result, sorted by name; see `failures.csv`.
        files: Tables written, and the page.
        n_computed: Results that were computed now; duplicates count once.
        n_kept: Results that the folder had and that are still valid.
        left_out: Files among the inputs that are none and go with none.
        notice: What the user should know about store and settings; empty if nothing.
    """

    rows: tuple[Row, ...]
    population: tuple[Row, ...]
    failures: tuple[ItemFailure, ...]
    files: tuple[Path, ...]
    n_computed: int
    n_kept: int
    left_out: tuple[str, ...]
    notice: str


@checked
def identify_batch(
    inputs: str | Path | Sequence[str | Path],
    out: str | Path,
    *,
    config: str | Path | None = None,
    profile: str | Path | None = None,
    schedule: str | Path | None = None,
    seed: int = 0,
    engine: str = "auto",
    folders: bool = False,
    workers: Workers | None = None,
    progress: Progress | None = None,
    worded: Callable[[str], str] = str,
    identify: IdentifyMany = identify_many,
) -> Batch:
    """Identify every recording, every table, and every grasp of a long table.

    Results that the folder has already are kept where they are still valid: made from
    the same content, schedule, settings, message definitions, seed, engine and
    versions.

    Args:
        inputs: Files, folders with all below them, and patterns; one or several.
        out: Folder of the results, old or new; its parent exists.
        config: Settings of the items that have none of their own: a `NAME.toml` beside
            the file, or the `grasp.toml` of its folder.
        profile: Settings that a laboratory always states; those of an item have the
            last word.
        schedule: Schedule of the recordings that have none of their own: a
            `NAME.schedule.csv` beside the file, or the `schedule.csv` of its folder.
        seed: Seed from which those of the items derive.
        engine: "auto", "sweep" or "emcee".
        folders: Also write the complete result of every item.
        workers: Who works; this process if not stated.
        progress: Called with a stage and the share of it that is done.
        worded: Puts what the library says into the words of who reads it; workers
            import it by name.
        identify: What identifies tables that share settings, as `identify_many` does.

    Returns:
        Rows of what was written, of failed items too: those do not raise.

    Raises:
        ConfigError: The batch as a whole cannot be done: a missing file, a wrong
            common setting, seed, engine or workers, a folder that is not a batch's.
        DataError: There is nothing to identify.
    """
    check_seed(seed)
    check_engine(engine)
    workers, report = workers or Workers(), progress or (lambda stage, share: None)
    folder = Path(out)
    inputs = [inputs] if isinstance(inputs, (str, Path)) else inputs
    companions = {"config": config, "profile": profile, "schedule": schedule}
    common = {
        name: None if file is None else Path(file) for name, file in companions.items()
    }
    found = find_inputs(inputs, out=folder, common=common.values())
    plan = Planner(**common, seed=seed, engine=engine).plan(found.paths)
    if not (plan.items or plan.failures):
        raise DataError(
            f"{' '.join(map(str, inputs))}: no recording or table there; name files, "
            "or folders that hold some",
            code="nothing_to_do",
        )
    begin_folder(folder)
    with open_store(folder) as (store, notice):
        remove_leftovers(folder)
        # Of duplicates the first by name; the others share its result.
        unique = {item.key: item for item in reversed(plan.items)}
        missing = [item for key, item in unique.items() if store.get(key) is None]
        failed: dict[str, ItemFailure] = {}
        if missing:
            stages = "; ".join(stages_of(missing[0].config, engine))
            with loaded_ahead(stages, is_here=workers.is_here) as known:
                report("identifying" if known else COMPILING, 0.0)
                failed = _worked(
                    partial(identify_chunk, engine=engine, identify=identify),
                    workers.chunks(missing),
                    workers,
                    save=store.save,
                    report=partial(report, "identifying"),
                )
        n_failed = len(failed)
        if folders:
            whole = [item for key, item in unique.items() if key not in failed]
            write = partial(
                write_folder, engine=engine, folder=folder / FOLDER, worded=worded
            )
            failed |= _write_folders(
                write, whole, workers, folder=folder, store=store, report=report
            )
        answers = collect(plan, failed, store.get, worded=worded)
        report("pooling", 0.0)
        population = pool_items(unique.values(), store.get)
        pages = _pages(plan, unique, folder=folder, store=store)
        files = write_outputs(folder, answers, population, pages=pages)
        report("pooling", 1.0)
    return Batch(
        rows=answers.rows,
        population=population,
        failures=answers.failures,
        files=files,
        n_computed=len(missing) - n_failed,
        n_kept=len(unique) - len(missing),
        left_out=found.left_out,
        notice="; ".join(filter(None, [notice, _unread(plan, common["config"])])),
    )


def _unread(plan: Plan, config: Path | None) -> str:
    """What to know where all items have settings of their own."""
    taken = list(dict.fromkeys(item.config_from for item in plan.items))
    if config is None or not taken:
        return ""
    if config.resolve() in [Path(name).resolve() for name in taken]:
        return ""
    return (
        f"{config}: no item takes these settings, as those that lie beside the items "
        f"come first: {listed(taken)}; change or remove those, if these are to count"
    )


def _worked(
    work: Work[Outcome],
    chunks: Sequence[tuple[Item, ...]],
    workers: Workers,
    *,
    save: Callable[[list[tuple[str, Outcome]]], None],
    report: Callable[[float], None],
) -> dict[str, ItemFailure]:
    """Do work and keep what comes of it, chunk by chunk; failures by key."""
    failed: dict[str, ItemFailure] = {}
    n_done, n_items = 0, sum(map(len, chunks))
    # Closed at once when interrupted, so that no worker outlives this process.
    with contextlib.closing(workers.work_on(work, chunks)) as ended:
        for chunk, outcomes in ended:
            good = []
            for item, outcome in zip(chunk, outcomes, strict=True):
                if isinstance(outcome, ItemFailure):
                    failed[item.key] = outcome
                else:
                    good.append((item.key, outcome))
            save(good)
            n_done += len(chunk)
            report(n_done / n_items)
    return failed


def _write_folders(
    work: Work[str],
    items: Sequence[Item],
    workers: Workers,
    *,
    folder: Path,
    store: Store,
    report: Progress,
) -> dict[str, ItemFailure]:
    """Result folders that are missing or stale; failures by key."""
    place = folder / FOLDER
    place.mkdir(exist_ok=True)
    written = store.folders()
    names = {item.key: folder_name(item.name) for item in items}
    stale = [
        item
        for item in items
        if not is_current(place / names[item.key], item.key, written)
    ]

    def save(done: list[tuple[str, str]]) -> None:
        for key, sha256 in done:
            store.save_folder(names[key], key, sha256)

    chunks = replace(workers, chunk=1).chunks(stale)
    told = partial(report, "writing folders")
    return _worked(work, chunks, workers, save=save, report=told)


def _pages(
    plan: Plan, unique: Mapping[str, Item], *, folder: Path, store: Store
) -> dict[str, str]:
    """Address of the page of each item whose folder holds its result, by name."""
    written, pages = store.folders(), {}
    for item in plan.items:
        own = Path(FOLDER, folder_name(unique[item.key].name))
        is_there = (folder / own / REPORT).is_file()
        if is_there and is_current(folder / own, item.key, written):
            pages[item.name] = (own / REPORT).as_posix()
    return pages
