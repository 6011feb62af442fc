"""`batch` and `watch`: many recordings or tables, each for itself, there or to come.

Excluded: the batch itself (`pushfit.batch.run`).
"""

import contextlib
import os
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pushfit.atomic import check_writable
from pushfit.batch.folders import STORE
from pushfit.cli import options
from pushfit.cli.output import warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.errors import ConfigError, DataError
from pushfit.report.store.output_folder import PARTS

if TYPE_CHECKING:
    from pushfit.batch.run import Batch

SCHEMA = "pushfit.batch/1"
# Exit code, of which docs/promises.md has the list.
SOME_FAILED = 5
# Items that failed and are named; failures.csv lists all.
N_SHOWN = 5
# By the path of an input, sizes and times of change of it and of what goes with it.
Stamps = dict[str, tuple[tuple[int, int], ...]]


def batch(
    session: CommandSession,
    inputs: Annotated[
        list[Path],
        typer.Argument(metavar="INPUT...", help="Files, folders and patterns."),
    ],
    *,
    items: options.Items,
    workers: Annotated[
        int, typer.Option("--workers", min=1, help="Worker processes; 1 is this one.")
    ] = 1,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="A running dask scheduler."
        ),
    ] = None,
    chunk: Annotated[
        int, typer.Option("--chunk", min=1, help="Most items worked on together.")
    ] = 64,
    time_limit: Annotated[
        float | None,
        typer.Option("--time-limit", metavar="SECONDS", min=1, help="For one item."),
    ] = None,
    folders: Annotated[
        bool, typer.Option("--folders", help="Also a result folder for each item.")
    ] = False,
    json: options.JsonOption = False,
) -> int:
    """Identify many files; run again, it does what is missing."""
    warn_of_missing(session, *(PARTS if folders else ["jinja2"]))
    say_kept(
        f"what is finished is kept in {items.out}; the same command goes on",
        once=items.out / STORE,
    )
    from pushfit.batch.run import identify_batch
    from pushfit.batch.workers import Workers

    those = Workers(n=workers, scheduler=scheduler, chunk=chunk, time_limit=time_limit)
    with session.progress() as progress:
        found = identify_batch(
            inputs,
            **asdict(items),
            folders=folders,
            workers=those,
            progress=progress,
            worded=session.worded,
        )
    return report(session, found, is_json=json)


def report(session: CommandSession, found: "Batch", *, is_json: bool) -> int:
    """Say what came out; the exit code says whether all of it did."""
    code = SOME_FAILED if found.failures else 0
    if found.notice:
        session.warn(found.notice)
    for failure in found.failures[:N_SHOWN]:
        session.complain(f"{failure.item}: {failure.message}")
    if len(found.failures) > N_SHOWN:
        n_more = len(found.failures) - N_SHOWN
        session.complain(f"and {n_more} more; failures.csv lists all")
    from pushfit.batch.population import is_provisional, population_warnings
    from pushfit.data.text.faults import listed
    from pushfit.report.strings import printable

    session.warn_of(population_warnings(found.population))
    provisional = [str(row["item"]) for row in found.rows if is_provisional(row)]
    facts = {**counts(found), "provisional": len(provisional)}
    names = {"left_out": found.left_out, "provisional": provisional}
    if is_json:
        status = "some_failed" if found.failures else "ok"
        files = [str(path) for path in found.files]
        session.answer({"schema": SCHEMA, "status": status, **facts, "files": files})
        return code
    for name, number in facts.items():
        which = f" ({listed(names[name])})" if name in names and number else ""
        print(printable(f"{name:<12} {number}{which}"))
    for path in found.files:
        session.wrote(path)
    return code


def counts(found: "Batch") -> dict[str, int]:
    """How many items went which way."""
    statuses = [row["status"] for row in found.rows]
    duplicates = [row for row in found.rows if row["duplicate_of"] is not None]
    return {
        "items": len(found.rows),
        "computed": found.n_computed,
        "kept": found.n_kept,
        "duplicates": len(duplicates),
        "failed": len(found.failures),
        "not_trusted": sum(s not in ("ok", "failed") for s in statuses),
        "left_out": len(found.left_out),
    }


def watch(
    session: CommandSession,
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder in which recordings arrive.")
    ],
    *,
    items: options.Items,
    every: Annotated[
        float,
        typer.Option("--every", metavar="SECONDS", min=0.05, help="Between two looks."),
    ] = 2.0,
    idle: Annotated[
        float | None,
        typer.Option(
            "--idle",
            metavar="SECONDS",
            min=0,
            help="End when nothing has come for so long; else Ctrl-C ends it.",
        ),
    ] = None,
) -> int:
    """Identify what arrives in a folder, on one page."""
    warn_of_missing(session, "jinja2")
    from pushfit.batch.folders import begin_folder
    from pushfit.batch.run import identify_batch

    if not folder.is_dir():
        raise ConfigError(
            f"{folder}: is no folder; name the one in which recordings arrive",
            code="no_folder",
        )
    begin_folder(items.out)
    check_writable(items.out / STORE)
    say_kept(f"what is finished is kept in {items.out}; the same command goes on")
    before: Stamps = {}
    done: Stamps = {}
    last, code, is_new = time.monotonic(), 0, False
    session.say(f"watching {folder}; Ctrl-C ends it")
    while idle is None or is_new or time.monotonic() - last < idle:
        now = stamps(folder, items.out)
        # What still grows is read when it has stopped.
        still = {
            path: stamp for path, stamp in now.items() if before.get(path) == stamp
        }
        is_new = now not in (done, {})
        if is_new and still not in (done, {}):
            try:
                found = identify_batch(
                    list(still), **asdict(items), worded=session.worded
                )
                code = report(session, found, is_json=False)
            except (DataError, ConfigError) as error:
                if isinstance(error, ConfigError) and not done:
                    raise  # nothing was ever well
                session.warn(str(error))
            done, last = still, time.monotonic()
            is_new = still != now
        before = now
        time.sleep(every)
    return code


def stamps(folder: Path, out: Path) -> Stamps:
    """What tells that an input of a folder has come, or has changed."""
    from pushfit.batch.inputs import find_inputs, schedule_for, settings_for

    found = {}
    for path in find_inputs([folder], out=out).paths:
        beside = (settings_for(path, None), schedule_for(path, None))
        with contextlib.suppress(FileNotFoundError):  # it is gone since
            files = sorted(Path(path).iterdir()) if os.path.isdir(path) else [path]
            status = [os.stat(file) for file in (*files, *beside) if file is not None]
            found[path] = tuple((one.st_size, one.st_mtime_ns) for one in status)
    return found
