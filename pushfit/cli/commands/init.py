"""`pushfit init`: a commented `grasp.toml` to start from."""

from pathlib import Path
from typing import Annotated

import typer

from pushfit.cli import options
from pushfit.cli.output import refuse_existing
from pushfit.cli.session import Session


def init(
    session: Session,
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="File to write, - for stdout.")
    ] = Path("grasp.toml"),
    force: options.Force = False,
) -> None:
    """Write a commented grasp.toml with all defaults."""
    from pushfit.atomic import atomic_path
    from pushfit.config import template

    if str(path) == "-":
        print(template(), end="")
        return
    refuse_existing(path, force=force)
    with atomic_path(path) as temporary:
        temporary.write_text(template(), encoding="utf-8")
    session.wrote(path, "; set push.length_mm, then run `pushfit identify`")
