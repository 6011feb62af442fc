"""What is kept survives what happens to files and processes."""

import signal
import sqlite3
from functools import partial

import numpy as np
import pytest

from pushfit.batch.folders import STORE
from pushfit.batch.store import (
    VERSION,
    Finished,
    open_store,
    uninterrupted,
)
from pushfit.errors import ConfigError

RESULT = Finished(
    kind="table",
    values={"status": "ok", "theta_c_deg": 0.1 + 0.2, "low": None, "n": 3},
    draws={"theta_c_deg": np.array([1.5, np.nan]), "ln_A": np.array([0.1, 1 / 3])},
)


def keep(folder, *keys):
    with open_store(folder) as (store, notice):
        store.save([(key, RESULT) for key in keys])
    return notice


def test_a_result_comes_back_bit_by_bit(tmp_path):
    keep(tmp_path, "a")
    with open_store(tmp_path) as (store, _):
        found = store.get("a")
    assert found is not None
    assert found.values == RESULT.values
    for name, draws in RESULT.draws.items():
        assert found.draws[name].tobytes() == draws.tobytes()


def test_no_draws_are_no_draws(tmp_path):
    empty = Finished(kind="table", values={}, draws={})
    with open_store(tmp_path) as (store, _):
        store.save([("a", empty)])
        assert store.get("a") == empty


@pytest.mark.parametrize("content", [b"", b"not a database at all" * 100])
def test_a_store_that_is_none_is_kept_aside_and_explained(content, tmp_path):
    (tmp_path / STORE).write_bytes(content)
    assert "batch.sqlite.bad" in keep(tmp_path, "a")
    assert (tmp_path / f"{STORE}.bad").read_bytes() == content
    assert keep(tmp_path, "b") == ""


def test_a_damaged_store_is_kept_aside(tmp_path):
    keep(tmp_path, *map(str, range(100)))
    damaged = bytearray((tmp_path / STORE).read_bytes())
    damaged[len(damaged) // 2 :] = b"\xff" * (len(damaged) - len(damaged) // 2)
    (tmp_path / STORE).write_bytes(damaged)
    assert "damaged" in keep(tmp_path, "a")
    with open_store(tmp_path) as (store, _):
        assert store.get("a") is not None
        assert store.get("0") is None


def test_a_database_of_another_program_is_not_touched(tmp_path):
    with sqlite3.connect(tmp_path / STORE) as other:
        other.execute("CREATE TABLE mine (x)")
    other.close()
    before = (tmp_path / STORE).read_bytes()
    keep(tmp_path)
    assert (tmp_path / f"{STORE}.bad").read_bytes() == before


def test_a_second_bad_store_does_not_replace_the_first(tmp_path):
    for content in (b"one", b"two"):
        (tmp_path / STORE).write_bytes(content)
        keep(tmp_path)
    assert (tmp_path / f"{STORE}.bad").read_bytes() == b"one"
    assert (tmp_path / f"{STORE}.bad2").read_bytes() == b"two"


def test_two_batches_cannot_share_a_folder(tmp_path):
    with open_store(tmp_path), pytest.raises(ConfigError, match="another batch"):
        open_store(tmp_path).__enter__()


def test_a_store_of_a_later_form_is_kept_aside(tmp_path):
    keep(tmp_path, "a")
    with sqlite3.connect(tmp_path / STORE) as database:
        database.execute(f"PRAGMA user_version = {VERSION + 1}")
    database.close()
    assert "not a store of this version" in keep(tmp_path, "b")
    with open_store(tmp_path) as (store, _):
        assert [store.get(key) is None for key in "ab"] == [True, False]


def test_no_journal_of_a_bad_store_is_played_back_into_the_next(tmp_path):
    """SQLite sees to it, whatever lies beside the file."""
    (tmp_path / STORE).write_bytes(b"not a database at all" * 100)
    other = tmp_path / "other"
    for ending in ("-journal", "-wal"):
        mode = "WAL" if ending == "-wal" else "PERSIST"
        with sqlite3.connect(other) as database:
            database.execute(f"PRAGMA journal_mode = {mode}")
            database.execute(f"CREATE TABLE of_{mode} (x)")
            (tmp_path / f"{STORE}{ending}").write_bytes(
                (tmp_path / f"other{ending}").read_bytes()
            )
        database.close()
    keep(tmp_path, "a")
    with open_store(tmp_path) as (store, notice):
        assert (store.get("a") is None, notice) == (False, "")


@pytest.mark.parametrize(
    "broken",
    ["cells = '{broken'", "draws = X''", "draws = CAST('[]\n' AS BLOB)"],
)
def test_a_result_that_cannot_be_read_is_none(tmp_path, broken):
    keep(tmp_path, "a")
    with sqlite3.connect(tmp_path / STORE) as database:
        database.execute(f"UPDATE result SET {broken}")
    database.close()
    with open_store(tmp_path) as (store, _):
        assert store.get("a") is None


@pytest.fixture
def ctrl_c():
    """Python's own handler, which a process in the background has not."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_ctrl_c_waits_until_the_result_is_kept(ctrl_c):
    reached = []

    def write() -> None:
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            reached.append("the end of the block")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert reached


class Interrupted(sqlite3.Connection):
    """A database that is written while Ctrl-C is pressed."""

    def executemany(self, *args):
        signal.raise_signal(signal.SIGINT)
        return super().executemany(*args)


def test_what_is_finished_is_kept_though_ctrl_c_is_pressed(
    ctrl_c, tmp_path, monkeypatch
):
    connect = partial(sqlite3.connect, factory=Interrupted)
    with monkeypatch.context() as patch:
        patch.setattr(sqlite3, "connect", connect)
        with pytest.raises(KeyboardInterrupt):
            keep(tmp_path, "a", "b")
    with open_store(tmp_path) as (store, notice):
        assert None not in (store.get("a"), store.get("b"))
        assert notice == ""
