"""Where results go, and what is in their way.

Excluded: the files of a result (`pushfit.report.store.folder`).
"""

from pathlib import Path

from pushfit.atomic import atomic_path, check_file, is_stream
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError
from pushfit.report.picture_file import picture_format
from pushfit.report.store.output_folder import left_out


def refuse_existing(path: Path, *, force: bool) -> None:
    """Protect what is already there.

    A device or a FIFO is written into and loses nothing.

    Raises:
        ConfigError: It exists and may not be replaced, or its folder does not exist or
            takes no file.
    """
    if is_stream(path):
        return
    if str(path) == "-":
        raise ConfigError(
            "-: is no name of a file; name one, or leave the option out where the "
            "command prints",
            code="output_name",
        )
    check_file(path)
    if path.exists() and not force:
        raise ConfigError(
            f"{path}: exists already; name another, or replace it with --force",
            code="output_exists",
        )


def refuse_picture(path: Path | None, *, force: bool) -> None:
    """The same for a picture, whose suffix has to name a format."""
    if path is not None:
        picture_format(path)
        refuse_existing(path, force=force)


def warn_of_missing(session: CommandSession, *libraries: str) -> None:
    """Say, before the work, what results will lack because a library is missing."""
    lacking = left_out(*libraries)
    if lacking:
        session.warn(lacking)


def write_text(
    session: CommandSession, text: str, path: Path | None, *, remark: str = ""
) -> None:
    """Put a text into a file, complete or not at all; None is standard output."""
    if path is None:
        print(text, end="")
        return
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")
    session.wrote(path, remark)
