"""Where compiled programs are kept between runs, so that later runs start faster.

Whoever can write there can run code as the user, so the folder belongs to the user
alone. The command line, `pushfit.identify` and `pushfit.Explorer` turn it on, for
themselves and the processes they start, and say so (`-v`, and a line of the log);
PUSHFIT_CACHE names another folder, or turns it off. Excluded: what is kept there
(`pushfit.fit.programs.compile`).
"""

import logging
import os
import stat
from pathlib import Path

# Names a folder, or says that none is wanted.
SWITCH, OFF = "PUSHFIT_CACHE", "off"
# Where programs are, handed on to child processes.
PROGRAMS = "PUSHFIT_PROGRAMS"
# What callers in Python were told already.
_told: set[str] = set()


def cache_folder() -> Path:
    """Folder of this user's compiled programs, whether it exists or not."""
    import platformdirs

    named = os.environ.get(SWITCH)
    if named:
        return Path(named).absolute()
    return platformdirs.user_cache_path("pushfit") / "compiled"


def enable_compile_cache() -> str:
    """Keep programs, and say what was decided."""
    os.environ.pop(PROGRAMS, None)
    if os.environ.get(SWITCH) == OFF:
        return f"off ({SWITCH}={OFF})"
    try:
        folder = cache_folder()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        return f"off ({error.strerror})"
    if not is_private(folder):
        return f"off ({folder} is open to others; chmod 700 it)"
    os.environ[PROGRAMS] = str(folder)
    return str(folder)


def keep_programs() -> None:
    """Keep programs for a caller in Python, and log once what was decided.

    A folder that is new is told of as a warning, which everybody sees.
    """
    is_new = not cache_folder().exists()
    where = enable_compile_cache()
    if where in _told:
        return
    _told.add(where)
    is_seen = is_new and programs_folder() is not None
    logging.getLogger(__name__).log(
        logging.WARNING if is_seen else logging.INFO,
        "compiled programs for later calls: %s (a first call compiles them, for "
        "minutes); %s=%s in the environment keeps none",
        where,
        SWITCH,
        OFF,
    )


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
