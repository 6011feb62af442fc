"""Where compiled programs are kept between runs, so that later runs start faster.

Whoever can write there can run code as the user, so the folder belongs to the user
alone. The command line and `pushfit.identify` turn it on, for themselves and the
processes they start; PUSHFIT_CACHE=off turns it off.
"""

import os
import stat
from pathlib import Path

SWITCH = "PUSHFIT_CACHE"
# Where programs are, handed on to child processes.
PROGRAMS = "PUSHFIT_PROGRAMS"


def cache_folder() -> Path:
    """Folder of this user's compiled programs, whether it exists or not."""
    import platformdirs

    return platformdirs.user_cache_path("pushfit") / "compiled"


def enable_compile_cache() -> str:
    """Keep programs, and say what was decided."""
    os.environ.pop(PROGRAMS, None)
    if os.environ.get(SWITCH) == "off":
        return f"off ({SWITCH}=off)"
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return f"off ({error.strerror})"
    if not is_private(folder):
        return f"off ({folder} is open to others; chmod 700 it)"
    os.environ[PROGRAMS] = str(folder)
    return str(folder)


def programs_folder() -> Path | None:
    """Folder where programs are kept; None where none are."""
    folder = os.environ.get(PROGRAMS)
    return Path(folder) if folder else None


def is_private(folder: Path) -> bool:
    """Whether a folder is a user's own, and nobody else may read or write it."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    if not hasattr(os, "getuid"):  # Windows keeps user folders private itself
        return True
    return status.st_uid == os.getuid() and not status.st_mode & 0o077
