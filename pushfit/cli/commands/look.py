"""`pushfit look`: choose the pushes of a recording and name their directions.

Excluded: the page and its address (`pushfit.cli.look`).
"""

import shlex
import threading
import webbrowser
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pushfit.cli import options
from pushfit.cli.inputs import read_settings
from pushfit.cli.output import refuse_existing, write_text
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError, installed_by

if TYPE_CHECKING:
    from pushfit.cli.look.state import Look
    from pushfit.config import GraspConfig


def look(
    session: CommandSession,
    recording: options.RecordingFile,
    schedule: options.ScheduleFile = None,
    *,
    layout: options.SettingsOptions,
    search: options.PeakOptions,
    begin: options.From = None,
    end: options.To = None,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="DIR", help="Folder of what is saved."),
    ] = Path(),
    export: Annotated[
        Path | None,
        typer.Option(
            metavar="page.html", help="Write the page, to look at only, and end."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port of the page; 0: a free one.")
    ] = 0,
    browser: Annotated[bool, typer.Option(help="Open the page in a browser.")] = True,
    force: options.Force = False,
) -> None:
    """Click which humps are pushes, and name their directions."""
    save = Saver(session, recording, out, force=force)
    if export is None:
        save.refuse_taken()
    else:
        refuse_existing(export, force=force)
    if find_spec("bokeh") is None:
        raise ConfigError(
            "look needs the library Bokeh, which is not installed; "
            f"{installed_by('look')}, or take `pushfit peaks --plot`",
            code="look_unavailable",
        )
    settings = read_settings(layout, **asdict(search), begin=begin, end=end)
    shown = read_look(session, recording, schedule=schedule, settings=settings)
    from pushfit.cli.look.page import start_server, static_page

    if export is not None:
        write_text(session, static_page(shown, title=str(recording)), export)
        return
    server, address = start_server(shown, title=str(recording), save=save, port=port)
    print(address, flush=True)
    session.say("the page is on this machine only; Ctrl-C ends it")
    if browser:
        # Some browsers return only when they are closed.
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
    server.io_loop.start()


def read_look(
    session: CommandSession,
    recording: Path,
    *,
    schedule: Path | None,
    settings: "GraspConfig",
) -> "Look":
    """What the page is going to show."""
    from pushfit.cli.look.state import Look
    from pushfit.data.check import expect_kind
    from pushfit.data.load import configured_recording, reader_options
    from pushfit.data.plans.schedule import read_schedule

    expect_kind(recording, "recording", **reader_options(settings))
    plan = None if schedule is None else read_schedule(schedule)
    samples = configured_recording(recording, settings)
    for note in samples.notes:
        session.say_more(f"{recording}: {note}")
    return Look(samples, settings, plan)


class Saver:
    """Writes what was decided, under names made from that of the recording.

    Args:
        force: Whether files that are there may be replaced. Those that were written
            before by this one always are.
    """

    def __init__(
        self, session: CommandSession, recording: Path, out: Path, *, force: bool
    ) -> None:
        """Name the schedule and the settings that will be written."""
        self._session, self._recording, self._force = session, recording, force
        self.schedule = out / f"{recording.stem}_schedule.csv"
        self.config = out / f"{recording.stem}_grasp.toml"

    def refuse_taken(self) -> None:
        """Protect files that are there already."""
        for path in (self.schedule, self.config):
            refuse_existing(path, force=self._force)

    def __call__(self, look: "Look") -> str:
        """Write both files; say so, and which command to run next."""
        from pushfit.config import template
        from pushfit.data.plans.schedule import write_schedule

        plan, text = look.schedule(), template(look.settled())
        self.refuse_taken()
        write_schedule(plan, self.schedule)
        self._force = True
        self._session.wrote(self.schedule, f": {plan.n_pushes} pushes")
        write_text(self._session, text, self.config)
        files = ("--schedule", self.schedule, "--config", self.config)
        words = ("pushfit", "identify", self._recording, *files)
        command = shlex.join(str(word) for word in words)
        self._session.say(f"next: {command}")
        return f"saved; next, in a terminal: {command}"
