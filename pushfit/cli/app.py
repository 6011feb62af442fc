"""The application: every command, and the way in.

Excluded: the commands (`pushfit.cli.commands`) and what they share
(`pushfit.cli.session`).
"""

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

import pushfit
from pushfit.cli.commands import (
    analysis,
    batch,
    doctor,
    explore,
    files,
    look,
    results,
    verify,
)
from pushfit.cli.session import CommandSession, command, say_no_more
from pushfit.cli.stop import stoppable

app = typer.Typer(
    no_args_is_help=True,
    # Plain help and usage errors: readable in logs, and rich stays unloaded.
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> bool:
    if wanted:
        print(f"pushfit {pushfit.__version__}")
        raise typer.Exit
    return wanted


@app.callback()
def pushfit_command(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            help="Show it and exit.",
        ),
    ] = False,
) -> None:
    """From recordings of slight pushes to contact parameters, theta_c and alpha*.

    Exit codes: 0 ok, 1 a bug, 2 usage or config, 3 input rejected, 4 numerics not to
    be trusted, 5 some items of a batch failed, 130 interrupted.
    """


for function in (
    analysis.identify,
    files.validate,
    files.peaks,
    look.look,
    analysis.fit,
    files.simulate,
    analysis.demo,
    files.init,
    results.report,
    verify.verify,
    analysis.coverage,
    analysis.compare,
    results.diff,
    batch.batch,
    batch.watch,
    explore.next,
    explore.explore,
    doctor.doctor,
):
    command(app)(function)
command(app, "sample", help="Another name of fit.")(analysis.fit)
command(app, "calibrate", help="The former name of coverage.")(analysis.coverage)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; None takes the words after `pushfit`."""
    try:
        with stoppable():
            app(args=arguments, prog_name="pushfit")
    except SystemExit as stop:
        words = sys.argv[1:] if arguments is None else arguments
        return _ended(stop, is_json="--json" in words)
    except BrokenPipeError:
        return say_no_more()
    return 0


def _ended(stop: SystemExit, *, is_json: bool) -> int:
    """Exit code; of words that typer did not understand, with the document for it."""
    code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    if isinstance(stop.__context__, BrokenPipeError):
        return say_no_more()
    # That of what typer raises, a class without a public name.
    message = getattr(stop.__context__, "format_message", None)
    if not is_json or message is None:
        return code
    session = CommandSession(
        is_quiet=False, is_verbose=False, is_debug=False, is_json=True
    )

    def work() -> int:
        session.print_failure("usage", message())
        return code

    return session.run(work)
