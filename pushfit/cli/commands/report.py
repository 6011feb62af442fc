"""`pushfit report`: the HTML page of a finished result, without fitting again."""

from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.output import refuse_existing
from pushfit.cli.session import Session


def report(
    session: Session,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder that --out wrote.")
    ],
    output: options.OutFile = None,
    force: options.Force = False,
) -> None:
    """One HTML page of a finished result, with all its figures inside."""
    from pushfit.atomic import atomic_path
    from pushfit.report.html.result import render_html
    from pushfit.report.store.read import read_result

    if output is not None:
        refuse_existing(output, force=force)
    page = render_html(read_result(result))
    if output is None:
        print(page, end="")
        return
    with atomic_path(output) as temporary:
        temporary.write_text(page, encoding="utf-8")
    session.wrote(output)
