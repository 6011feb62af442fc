"""Finished results on disk, found again by the key of their item.

One SQLite file, written by the coordinating process alone, each chunk in one
transaction: whatever kills the process, what was finished is whole and what was not is
absent. The process holds the file's lock, so two batches cannot mix in one folder.
Excluded: result folders of items (`pushfit.batch.folders`).
"""

import contextlib
import io
import json
import os
import signal
import sqlite3
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

import numpy as np
from jaxtyping import Float

from pushfit.atomic import spare_name
from pushfit.batch.folders import STORE
from pushfit.errors import ConfigError
from pushfit.fit.identify.result_row import Cell

# "push" in ASCII, so that a file of another program is not taken for ours.
APPLICATION_ID = 0x70757368
# Of what a store holds: a later form gets another number.
VERSION = 1
SCHEMA = (
    "CREATE TABLE result (key TEXT PRIMARY KEY, kind TEXT NOT NULL, "
    "cells TEXT NOT NULL, draws BLOB NOT NULL) WITHOUT ROWID",
    "CREATE TABLE folder (name TEXT PRIMARY KEY, key TEXT NOT NULL, "
    "sha256 TEXT NOT NULL) WITHOUT ROWID",
)

Draws = Mapping[str, Float[np.ndarray, " n"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """Result of one item.

    Args:
        kind: "recording" or "table".
        values: Cells of its row, by column.
        draws: Posterior draws of what is pooled, and their log prior, by name.
    """

    kind: str
    values: Mapping[str, Cell]
    draws: Draws


class Store:
    """Results by key, in a locked database of the form of `SCHEMA`."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        """Take over a checked database."""
        self._connection = connection

    def get(self, key: str) -> Finished | None:
        """Find a result; None if there is none that can be read."""
        found = self._connection.execute(
            "SELECT kind, cells, draws FROM result WHERE key = ?", (key,)
        ).fetchone()
        if found is None:
            return None
        kind, cells, draws = found
        try:
            return Finished(kind=kind, values=json.loads(cells), draws=_unpack(draws))
        except (ValueError, EOFError):
            return None

    def save(self, results: Iterable[tuple[str, Finished]]) -> None:
        """Keep results, all of them or, if the process dies, none."""
        rows: list[tuple[str | bytes, ...]] = [
            (key, r.kind, json.dumps(r.values, allow_nan=False), _pack(r.draws))
            for key, r in results
        ]
        self._write("INSERT OR REPLACE INTO result VALUES (?, ?, ?, ?)", rows)

    def folders(self) -> dict[str, tuple[str, str]]:
        """Key of the item and digest of the `summary.json` written, by folder."""
        rows = self._connection.execute("SELECT name, key, sha256 FROM folder")
        return {name: (key, sha256) for name, key, sha256 in rows}

    def save_folder(self, name: str, key: str, sha256: str) -> None:
        """Keep that the folder of an item was written."""
        statement = "INSERT OR REPLACE INTO folder VALUES (?, ?, ?)"
        self._write(statement, [(name, key, sha256)])

    def _write(self, statement: str, rows: list[tuple[str | bytes, ...]]) -> None:
        try:
            with uninterrupted(), self._connection:
                self._connection.executemany(statement, rows)
        except sqlite3.OperationalError as error:
            raise ConfigError(
                f"{STORE}: cannot be written ({error}); what was finished before is "
                "kept, so make room and run the same command again",
                code="store_full",
            ) from error


@contextlib.contextmanager
def open_store(folder: Path) -> Iterator[tuple[Store, str]]:
    """Open the store of a batch, or begin one.

    Yields:
        The store, and what the user should know about it; empty if nothing.

    Raises:
        ConfigError: Another process works in this folder, or it cannot be written.
    """
    path = folder / STORE
    notice = ""
    try:
        connection = _opened(path)
        if connection is None:
            notice = _set_aside(path)
            connection = _opened(path)
    except sqlite3.OperationalError as error:
        raise ConfigError(
            f"{path}: cannot be opened for writing ({error}); wait if another batch is "
            "running here, otherwise check the permissions or choose another `out`",
            code="store_locked",
        ) from error
    if connection is None:
        raise ConfigError(
            f"{path}: cannot be begun; choose another `out`", code="store"
        )
    try:
        yield Store(connection), notice
    finally:
        connection.close()


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C and SIGTERM back until a block is through."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    held: list[int] = []

    def hold(number: int, frame: FrameType | None) -> None:
        held.append(number)

    before = {n: signal.signal(n, hold) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for number in held:
        signal.raise_signal(number)


def _opened(path: Path) -> sqlite3.Connection | None:
    """Database under lock; None if what is there is damaged or not ours."""
    is_new = not path.exists()
    connection = sqlite3.connect(path, timeout=0)
    try:
        # The lock goes with the process, however it ends.
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("BEGIN EXCLUSIVE")
        if is_new:
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.execute(f"PRAGMA user_version = {VERSION}")
            for statement in SCHEMA:
                connection.execute(statement)
        is_ours = _is_ours(connection)
        # What is not ours stays as it is, to the byte.
        connection.commit() if is_ours else connection.rollback()
    except sqlite3.OperationalError:
        connection.close()
        raise
    except sqlite3.DatabaseError:
        is_ours = False
    if is_ours:
        return connection
    connection.close()
    return None


def _is_ours(connection: sqlite3.Connection) -> bool:
    facts = {
        "application_id": APPLICATION_ID,
        "user_version": VERSION,
        "quick_check": "ok",
    }
    return all(
        connection.execute(f"PRAGMA {name}").fetchone() == (value,)
        for name, value in facts.items()
    )


def _set_aside(path: Path) -> str:
    """Rename a store that cannot be used, and say so."""
    bad = spare_name(path)
    os.replace(path, bad)
    return (
        f"{path}: is damaged or not a store of this version of pushfit; kept as "
        f"{bad.name}, and everything is computed again"
    )


def _pack(draws: Draws) -> bytes:
    """Draws as a line of names and a NumPy array."""
    buffer = io.BytesIO()
    buffer.write(json.dumps(list(draws)).encode() + b"\n")
    columns = np.array([draws[name] for name in draws], dtype=np.float64)
    np.save(buffer, columns, allow_pickle=False)
    return buffer.getvalue()


def _unpack(packed: bytes) -> Draws:
    """Draws from what `_pack` made.

    Raises:
        ValueError: The bytes are not of that form.
    """
    buffer = io.BytesIO(packed)
    names = json.loads(buffer.readline())
    columns = np.load(buffer, allow_pickle=False)
    return dict(zip(names, columns, strict=True))
