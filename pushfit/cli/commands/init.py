"""`pushfit init`: a commented `grasp.toml` to start from."""

from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.output import refuse_existing, write_text
from pushfit.cli.session import Session


def init(
    session: Session,
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write, - for stdout.")
    ] = Path("grasp.toml"),
    force: options.Force = False,
) -> None:
    """Write a commented grasp.toml with all defaults."""
    from pushfit.config import template

    target = None if str(path) == "-" else path
    if target is not None:
        refuse_existing(target, force=force)
    remark = "; set push.length_mm, then run `pushfit identify`"
    write_text(session, template(), target, remark=remark)
