"""`pushfit batch`: many recordings or tables, each for itself.

Excluded: the batch itself (`pushfit.batch.run`).
"""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pushfit.batch.folders import STORE
from pushfit.cli import options
from pushfit.cli.output import warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.report.store.output_folder import PARTS

if TYPE_CHECKING:
    from pushfit.batch.run import Batch

SCHEMA = "pushfit.batch/1"
# Exit code, of which docs/promises.md has the list.
SOME_FAILED = 5
# Items that failed and are named; failures.csv lists all.
N_SHOWN = 5


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
    """Say what came out.

    Returns:
        Exit code.
    """
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
        session.print_json(
            {"schema": SCHEMA, "status": status, **facts, "files": files}
        )
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
