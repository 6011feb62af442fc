"""Write files so that they are complete or absent, never half written.

What is not a regular file (a device, a FIFO, the standard output of a process) is
written into and stays what it is, and a symbolic link goes on pointing where it did.
Excluded: folders of several files (`pushfit.report.store.folder`).
"""

import contextlib
import itertools
import os
import re
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

from pushfit.errors import ConfigError

# Descriptors of a process: replacing the file behind one would leave the process, or
# the shell that opened it, with a file that has no name any more.
_DESCRIPTOR = re.compile(r"/dev/(fd/\d+|std(in|out|err))|/proc/[^/]+/fd/\d+")

_unfinished: set[Path] = set()
# Held where stopping the process would leave neither the old nor the new.
_whole = threading.Lock()


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Lend a temporary file that takes the place of a file when the block succeeds.

    The old file stays as it was if the block raises or the process dies: the data
    reach the disk before the name does, and the rename is one step.

    Args:
        path: File to write, or a link to it; or something to write into.

    Yields:
        Path of an empty temporary file, in the folder of the file.
    """
    if is_stream(path):
        with naming(path), _passed_on(Path(path)) as temporary:
            yield temporary
        return
    target = Path(os.path.realpath(path))
    # The same folder, because a rename across file systems is a copy.
    handle, name = tempfile.mkstemp(
        prefix=f".{target.name}.", suffix=".tmp", dir=target.parent
    )
    os.close(handle)
    temporary = Path(name)
    with naming(path), unfinished(temporary):
        yield temporary
        # mkstemp makes files private; results are to be read like any other file.
        temporary.chmod(0o666 & ~_umask())
        sync(temporary)
        os.replace(temporary, target)
        sync(target.parent)


def check_parent(path: str | Path) -> None:
    """Refuse a name under which nothing can be written.

    Raises:
        ConfigError: Its folder does not exist (`no_output_folder`).
    """
    parent = followed(Path(path)).parent
    if not parent.is_dir():
        raise ConfigError(
            f"{path}: the folder {parent} does not exist; create it first",
            code="no_output_folder",
        )


def check_writable(path: str | Path) -> None:
    """Refuse, before any work, a name under which nothing can be written now.

    Raises:
        ConfigError: As of `check_parent`; or its folder takes no file
            (`output_folder_closed`).
    """
    check_parent(path)
    parent = followed(Path(path)).parent
    try:
        # Permissions alone do not tell, as on a disk of another machine.
        with tempfile.TemporaryFile(dir=parent):
            pass
    except OSError as error:
        raise ConfigError(
            f"{path}: the folder {parent} takes no file ({error.strerror}); name "
            "another, or change its permissions",
            code="output_folder_closed",
        ) from error


def check_file(path: str | Path) -> None:
    """Refuse, before any work, a name under which no file can be written now.

    Raises:
        ConfigError: As of `check_writable`; or it is a folder (`output_is_a_folder`).
    """
    if Path(path).is_dir():
        raise ConfigError(
            f"{path}: is a folder; name a file", code="output_is_a_folder"
        )
    if not is_stream(path):
        check_writable(path)


def followed(path: Path) -> Path:
    """What a name stands for: itself, or what a link leads to."""
    return Path(os.path.realpath(path)) if path.is_symlink() else path


def is_stream(path: str | Path) -> bool:
    """Whether a path can only be written into: a device, a FIFO, a descriptor."""
    if _DESCRIPTOR.fullmatch(os.path.abspath(path)):
        return True
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


@contextlib.contextmanager
def _passed_on(stream: Path) -> Iterator[Path]:
    """Lend a temporary file whose content goes into a stream afterwards."""
    with tempfile.TemporaryDirectory() as folder, unfinished(Path(folder)):
        temporary = Path(folder) / stream.name
        temporary.touch()
        yield temporary
        with temporary.open("rb") as source, stream.open("wb") as sink:
            shutil.copyfileobj(source, sink)


@contextlib.contextmanager
def naming(path: str | Path) -> Iterator[None]:
    """Have the system's refusals say what is being written, as a full disk does not."""
    try:
        yield
    except OSError as error:
        # Without a number it is a library's own, whose words a name would hide.
        if error.errno is not None and error.filename is None:
            error.filename = str(path)
        raise


@contextlib.contextmanager
def unfinished(path: Path) -> Iterator[None]:
    """Have a file or folder removed at the end of the block, or of the process."""
    _unfinished.add(path)
    try:
        yield
    finally:
        _remove(path)
        _unfinished.discard(path)


@contextlib.contextmanager
def whole() -> Iterator[None]:
    """Keep `discard_unfinished`, and so the end of the process, out of a block."""
    with _whole:
        yield


def discard_unfinished(*, patience: float) -> None:
    """Remove what is half written, for a process that ends without unwinding.

    Args:
        patience: Longest wait for the end of a `whole` block [s].
    """
    _whole.acquire(timeout=patience)
    for path in tuple(_unfinished):
        _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _umask() -> int:
    """Permission bits that new files lack; only setting them tells what they are."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def spare_name(path: Path) -> Path:
    """First free name for a file that cannot be used: the same ending in `.bad`."""
    endings = itertools.chain([""], itertools.count(2))
    names = (path.with_name(f"{path.name}.bad{n}") for n in endings)
    return next(name for name in names if not name.exists())


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, are on the disk."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except PermissionError:  # Windows does not open folders
        return
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
