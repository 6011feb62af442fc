"""The journal of an exploration: one JSON object a line, on disk before it counts.

A push is in it as `asked` before the finger moves, and as `told` or `failed`
afterwards, so that a process killed at any moment leaves a journal from which the same
exploration goes on. Excluded: what the lines say (`pushfit.explore.journal.events`).
"""

import json
import os
import sys
import weakref
from collections.abc import Mapping
from pathlib import Path

if sys.platform != "win32":  # which has no lock that leaves a file readable
    import fcntl

from pushfit.atomic import naming, sync
from pushfit.errors import ConfigError, DataError

JOURNAL_SCHEMA = "pushfit.exploration/2"
# Of the first event, and how its line begins.
START = "start"
BEGINNING = b'{"event": "start"'
Event = dict[str, object]


class Journal:
    """A file that events are appended to, each forced to disk; None keeps nothing.

    No other process has the same file as a journal while an object of this one does.
    """

    def __init__(self, path: Path | None) -> None:
        """Read what there is; a last line that was cut off never happened.

        Raises:
            ConfigError: It can be no file, or another process writes it.
            DataError: It is no journal, and stays as it is, or a line is no event.
        """
        if path is not None and (path.is_dir() or not path.parent.is_dir()):
            raise ConfigError(
                f"{path}: a journal is a file in a folder that exists", code="journal"
            )
        self.path = path
        self.events: tuple[Event, ...] = ()
        if path is not None:
            if not path.exists():
                path.touch()
                sync(path.parent)
            self._lock = _locked(path)
            self.events = _read(path)

    def write(self, event: Mapping[str, object]) -> None:
        """Append an event; returns when it is on the disk, or leaves nothing of it."""
        if self.path is None:
            return
        line = json.dumps(event, ensure_ascii=False, allow_nan=False)
        # Without a buffer, which would be written once more when the file is closed.
        with naming(self.path), self.path.open("ab", buffering=0) as file:
            end, left = file.tell(), f"{line}\n".encode()
            try:
                while left:  # a disk that fills up takes a part
                    left = left[file.write(left) :]
                os.fsync(file.fileno())
            except BaseException:
                file.truncate(end)
                raise


class _Lock:
    """A file that this process alone may write until the lock is collected."""

    def __init__(self, path: Path) -> None:
        """Take the lock; the system gives it back when the process dies, however."""
        file = path.open("rb")
        weakref.finalize(self, file.close)
        if sys.platform == "win32":
            return
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise ConfigError(
                f"{path}: another pushfit is exploring with this journal, and two "
                "would mix their pushes; wait for its end or end it, or begin another "
                "journal",
                code="journal_in_use",
            ) from error
        except OSError:  # a file system without locks
            pass


# Of this process, by device and inode: a cell of a notebook that is run again goes on.
_locks: weakref.WeakValueDictionary[tuple[int, int], _Lock] = (
    weakref.WeakValueDictionary()
)


def _locked(path: Path) -> _Lock:
    """The lock of a file, to be kept for as long as it may be written."""
    status = path.stat()
    key = status.st_dev, status.st_ino
    lock = _locks.get(key)
    if lock is None:
        _locks[key] = lock = _Lock(path)
    return lock


def _read(path: Path) -> tuple[Event, ...]:
    """Events of a journal; what follows the last whole line is cut off the file."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    events = tuple(
        _event(path, number, line)
        for number, line in enumerate(whole.split(b"\n")[:-1], start=1)
    )
    is_journal = content[: len(BEGINNING)] == BEGINNING[: len(content)]
    if events:
        is_journal = events[0]["event"] == START
    if not is_journal:  # before anything of a file that is not ours is cut off
        raise damaged(path, 1, "no start of an exploration")
    if len(whole) < len(content):
        with path.open("r+b") as file:
            file.truncate(len(whole))
            os.fsync(file.fileno())
    return events


def _event(path: Path, number: int, line: bytes) -> Event:
    try:
        event = json.loads(line.decode("utf-8"))
    except ValueError as error:
        raise damaged(path, number, f"no JSON ({error})") from error
    if not isinstance(event, dict) or not isinstance(event.get("event"), str):
        raise damaged(path, number, 'no event, which is {"event": "told", ...}')
    return event


def damaged(path: Path | None, number: int, what: str) -> DataError:
    """That a line of a journal is not as it was written, and how to go on."""
    return DataError(
        f"{path}, line {number}: {what}; a journal is only ever appended to: keep the "
        "lines before it, restore it, or begin another",
        code="journal_damaged",
    )
