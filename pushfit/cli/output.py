"""Where results go, and what is in their way."""

from pathlib import Path

from pushfit.errors import ConfigError


def refuse_existing(path: Path, *, force: bool) -> None:
    """Protect what is already there.

    Args:
        path: File or folder to be written.
        force: Whether the user allows replacing it.

    Raises:
        ConfigError: It exists and may not be replaced, or its folder does not exist.
    """
    if path.exists() and not force:
        raise ConfigError(
            f"{path}: exists already; name another, or replace it with --force",
            code="output_exists",
        )
    if not path.parent.is_dir():
        raise ConfigError(
            f"{path}: the folder {path.parent} does not exist; create it first",
            code="no_output_folder",
        )
