"""The journal of an exploration: one JSON object a line, on disk before it counts.

A push is in it as `asked` before the finger moves, and as `told` or `failed`
afterwards, so that a process killed at any moment leaves a journal from which the same
exploration goes on. Excluded: what the lines say (`pushfit.explore.journal.events`).
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path

from pushfit.atomic import sync
from pushfit.errors import ConfigError, DataError

SCHEMA = "pushfit.exploration/1"
Event = dict[str, object]


class Journal:
    """A file that events are appended to, each forced to disk; None keeps nothing."""

    def __init__(self, path: Path | None) -> None:
        """Read what there is; a last line that was cut off never happened."""
        if path is not None and (path.is_dir() or not path.parent.is_dir()):
            raise ConfigError(
                f"{path}: a journal is a file in a folder that exists", code="journal"
            )
        self.path = path
        self.events: tuple[Event, ...] = ()
        if path is not None and path.exists():
            self.events = _read(path)

    def write(self, event: Mapping[str, object]) -> None:
        """Append an event; returns when it is on the disk."""
        if self.path is None:
            return
        is_new = not self.path.exists()
        line = json.dumps(event, ensure_ascii=False, allow_nan=False)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")
            file.flush()
            os.fsync(file.fileno())
        if is_new:
            sync(self.path.parent)


def _read(path: Path) -> tuple[Event, ...]:
    """Events of a journal; what follows the last whole line is cut off the file."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        with path.open("r+b") as file:
            file.truncate(len(whole))
            os.fsync(file.fileno())
    events = []
    for number, line in enumerate(whole.decode("utf-8").splitlines(), start=1):
        try:
            event = json.loads(line)
        except json.JSONDecodeError as error:
            raise DataError(
                f"{path}, line {number}: no JSON ({error.msg}); a journal is only ever "
                "appended to: restore it, or begin another",
                code="journal_damaged",
            ) from error
        events.append(event)
    return tuple(events)
