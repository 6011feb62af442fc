"""`pushfit watch`: a folder in which recordings arrive, and one page that keeps up.

Excluded: what is made of the recordings (`pushfit.batch.run`).
"""

import contextlib
import os
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from pushfit.atomic import check_writable
from pushfit.cli import options
from pushfit.cli.commands.batch import report
from pushfit.cli.output import warn_of_missing
from pushfit.cli.session import CommandSession
from pushfit.cli.stop import say_kept
from pushfit.errors import ConfigError, DataError

Stamps = dict[str, tuple[tuple[int, int], ...]]


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
    from pushfit.batch.folders import STORE, begin_folder
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
    """Sizes and times of change of every input and what goes with it, by its path."""
    from pushfit.batch.inputs import find_inputs, schedule_for, settings_for

    found = {}
    for path in find_inputs([folder], out=out).paths:
        beside = (settings_for(path, None), schedule_for(path, None))
        with contextlib.suppress(FileNotFoundError):  # it is gone since
            files = sorted(Path(path).iterdir()) if os.path.isdir(path) else [path]
            status = [os.stat(file) for file in (*files, *beside) if file is not None]
            found[path] = tuple((one.st_size, one.st_mtime_ns) for one in status)
    return found
