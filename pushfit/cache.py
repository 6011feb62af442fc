"""Where compiled programs are kept between runs, so that later runs start faster.

Whoever can write there can run code as the user, so the folder belongs to the user
alone. The command line and `pushfit.identify` turn it on, for themselves and the
processes they start; PUSHFIT_CACHE=off turns it off.
"""

import os
import stat
import sys
from pathlib import Path

SWITCH = "PUSHFIT_CACHE"
# Where traced programs are, handed on to child processes.
PROGRAMS = "PUSHFIT_PROGRAMS"
# Setting of JAX: where it keeps compiled programs.
COMPILED = "JAX_COMPILATION_CACHE_DIR"
# The same for programs that compile faster than so many seconds.
SMALLEST = "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS"


def cache_folder() -> Path:
    """Folder of this user's compiled programs, whether it exists or not."""
    import platformdirs

    return platformdirs.user_cache_path("pushfit") / "compiled"


def enable_compile_cache() -> str:
    """Keep programs, tell JAX so before it is imported, and say what was decided.

    A folder that the user gave to JAX stays the one of compiled programs.
    """
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
    os.environ.setdefault(COMPILED, str(folder))
    # Small programs are many.
    os.environ.setdefault(SMALLEST, "0")
    _tell_loaded_jax()
    return str(folder)


def _tell_loaded_jax() -> None:
    """Repeat the settings to a JAX that has read the environment already."""
    jax = sys.modules.get("jax")
    if jax is not None and jax.config.jax_compilation_cache_dir is None:
        for name, kind in ((COMPILED, str), (SMALLEST, float)):
            jax.config.update(name.lower(), kind(os.environ[name]))


def programs_folder() -> Path | None:
    """Folder of traced programs; None where none are kept."""
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
