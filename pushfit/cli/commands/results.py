"""`report` and `diff`: what finished results say, without fitting again.

Excluded: computing a result again (`pushfit.cli.commands.verify`).
"""

import sys
from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.output import refuse_existing, refuse_picture, write_text
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError


def report(
    session: CommandSession,
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="Folder that --out wrote.")
    ],
    output: options.OutFile = None,
    *,
    force: options.Force = False,
) -> None:
    """One HTML page of a finished result, figures inside."""
    if output is None and sys.stdout.isatty():
        raise ConfigError(
            "a page of HTML is nothing to read on a terminal; name a file by --out, or "
            "redirect it by > report.html",
            code="page_on_terminal",
        )
    from pushfit.report.html.pages import check_templates

    check_templates()
    if output is not None:
        refuse_existing(output, force=force)
    from pushfit.report.html.result import render_html
    from pushfit.report.store.read import read_extra, read_result

    page = render_html(read_result(result), extra=read_extra(result))
    write_text(session, page, output)


def diff(
    session: CommandSession,
    first: Annotated[Path, typer.Argument(metavar="A", help="Result folder.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="Another one.")],
    *,
    plot: options.PlotFile = None,
    json: options.JsonOption = False,
    force: options.Force = False,
) -> None:
    """What differs between two results, by how much and how surely."""
    refuse_picture(plot, force=force)
    from pushfit.report.figures.posterior import forest_figure
    from pushfit.report.figures.style import save_figure
    from pushfit.report.store.read import read_result
    from pushfit.report.text.difference import (
        compare_results,
        difference_dict,
        difference_text,
    )

    found = compare_results(read_result(first), read_result(second))
    if plot is not None and not found.differences:
        reasons = "; ".join(found.left_out)
        session.warn(f"{plot} is not drawn: nothing can be compared ({reasons})")
    elif plot is not None:
        labels = (first.name, second.name)
        save_figure(forest_figure(found.differences, labels=labels), plot)
        session.wrote(plot)
    session.answer(difference_dict(found) if json else difference_text(found))
