"""Where compiled programs are kept between runs, so that later runs start faster.

Whoever can write there can run code as the user, so the folder belongs to the user
alone. Only the command line turns it on; PUSHFIT_CACHE=off turns it off.
"""

import os
import stat
from pathlib import Path

SWITCH = "PUSHFIT_CACHE"
# Programs that compile faster than this are not worth a file [s].
SHORTEST_COMPILE = "0.2"


def cache_folder() -> Path:
    """Folder of this user's compiled programs, whether it exists or not."""
    import platformdirs

    return platformdirs.user_cache_path("pushfit") / "compiled"


def enable_compile_cache() -> str:
    """Tell JAX, before it is imported, to keep compiled programs.

    Returns:
        What was decided, for the user.
    """
    if os.environ.get(SWITCH) == "off":
        return f"off ({SWITCH}=off)"
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return f"off ({error.strerror})"
    if not is_private(folder):
        return f"off ({folder} is open to others; chmod 700 it)"
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
    os.environ.setdefault(
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", SHORTEST_COMPILE
    )
    return str(folder)


def is_private(folder: Path) -> bool:
    """Whether nobody but the user can write to a folder.

    Args:
        folder: Folder that exists.

    Returns:
        False for a folder of somebody else, or one that others may read or write.
    """
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return False
    if not hasattr(os, "getuid"):  # Windows keeps user folders private itself
        return True
    return status.st_uid == os.getuid() and not status.st_mode & 0o077
