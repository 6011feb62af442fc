"""`pushfit report`: the HTML page of a finished result, without fitting again."""

from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.output import refuse_existing, write_text
from pushfit.cli.session import Session


def report(
    session: Session,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder that --out wrote.")
    ],
    output: options.OutFile = None,
    force: options.Force = False,
) -> None:
    """One HTML page of a finished result, figures inside."""
    from pushfit.report.html.result import render_html
    from pushfit.report.store.read import read_result

    if output is not None:
        refuse_existing(output, force=force)
    write_text(session, render_html(read_result(result)), output)
