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
from pushfit.errors import ConfigError, DataError


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

    if not folder.is_dir():
        raise ConfigError(
            f"{folder}: is no folder; name the one in which recordings arrive",
            code="no_folder",
        )
    say_kept(f"what is finished is kept in {items.out}; the same command goes on")
    before, done, last, code = None, None, time.monotonic(), 0
    is_new = False
    session.say(f"watching {folder}; Ctrl-C ends it")
    while idle is None or is_new or time.monotonic() - last < idle:
        now = stamps(folder, items.out)
        is_new = bool(now) and now != done
        # A file that still grows is read when it has stopped.
        if is_new and now == before:
            try:
                found = identify_batch([folder], **asdict(items), worded=session.worded)
                code = report(session, found, is_json=False)
            except DataError as error:
                session.warn(str(error))
            done, last, is_new = now, time.monotonic(), False
        before = now
        time.sleep(every)
    return code


def stamps(folder: Path, out: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of change of every file, those of the results left out."""
    found = {}
    for path in folder.rglob("*"):
        if out in path.parents or not path.is_file():
            continue
        status = path.stat()
        found[path] = (status.st_size, status.st_mtime_ns)
    return found
