"""`pushfit watch`: a folder in which recordings arrive, and one page that keeps up.

Excluded: what is made of the recordings (`pushfit.batch.run`).
"""

import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.commands.batch import report
from pushfit.cli.output import warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.errors import DataError


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
    from pushfit.batch.run import identify_batch

    say_kept(f"what is finished is kept in {items.out}; the same command goes on")
    before, done, last = None, None, time.monotonic()
    session.say(f"watching {folder}; Ctrl-C ends it")
    while idle is None or time.monotonic() - last < idle:
        now = stamps(folder, items.out)
        # A file that still grows is read when it has stopped.
        if now and now == before and now != done:
            try:
                found = identify_batch([folder], **asdict(items), worded=session.worded)
                report(session, found, is_json=False)
            except DataError as error:
                session.warn(str(error))
            done, last = now, time.monotonic()
        before = now
        time.sleep(every)
    return 0


def stamps(folder: Path, out: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of change of every file, those of the results left out."""
    found = {}
    for path in folder.rglob("*"):
        if out in path.parents or not path.is_file():
            continue
        status = path.stat()
        found[path] = (status.st_size, status.st_mtime_ns)
    return found
