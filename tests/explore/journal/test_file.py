"""The file of a journal: who may write it."""

import errno
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from pushfit.errors import ConfigError, DataError
from pushfit.explore.journal.file import Journal

ROOT = Path(__file__).parents[3]
OTHER = """\
import pathlib, sys
from pushfit.explore.journal.file import Journal
journal = Journal(pathlib.Path(sys.argv[1]))
journal.write({"event": "start"})
print("kept", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def other(tmp_path):
    """Another process that has the journal."""
    path = tmp_path / "run.jsonl"
    process = subprocess.Popen(
        [sys.executable, "-c", OTHER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    with process:
        assert process.stdout.readline() == "kept\n"
        yield path, process
        process.kill()


def test_two_processes_do_not_write_one_journal(other):
    path, _ = other
    with pytest.raises(ConfigError, match="another pushfit is exploring") as refused:
        Journal(path)
    assert str(path) in str(refused.value)
    assert "begin another journal" in str(refused.value)
    assert path.read_text() == '{"event": "start"}\n'


def test_a_killed_process_leaves_its_journal_to_others(other):
    path, process = other
    process.kill()
    process.wait()
    assert Journal(path).events == ({"event": "start"},)


def test_a_cell_that_is_run_again_has_its_own_journal(tmp_path):
    """The object of before is still there when the new one is made."""
    first = Journal(tmp_path / "run.jsonl")
    first.write({"event": "start"})
    assert Journal(first.path).events == ({"event": "start"},)


def test_a_full_disk_is_said_by_the_name_of_the_journal(tmp_path, monkeypatch):
    def refuse(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    journal = Journal(tmp_path / "journal.jsonl")
    monkeypatch.setattr(os, "fsync", refuse)
    with pytest.raises(OSError, match="No space left") as raised:
        journal.write({"event": "start"})
    assert raised.value.filename == str(tmp_path / "journal.jsonl")


@pytest.mark.parametrize("room", [0, 9])
def test_a_line_that_the_disk_takes_a_part_of_is_none(tmp_path, room):
    """The same process goes on once there is room again."""
    path = tmp_path / "run.jsonl"
    journal = Journal(path)
    journal.write({"event": "start"})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + room, hard))
    try:
        with pytest.raises(OSError, match="too large"):
            journal.write({"event": "told", "number": 1})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    journal.write({"event": "told", "number": 2})
    expected = {"event": "start"}, {"event": "told", "number": 2}
    assert Journal(path).events == expected


@pytest.mark.parametrize(
    "content", [b"notes", b"a,b\n1,2", b'{"event": "told"}\n{"ev', b'{"event": "st\xff']
)
def test_a_file_that_is_no_journal_stays_as_it_is(tmp_path, content):
    """Nothing of it is taken for a line that was cut off."""
    path = tmp_path / "peaks.csv"
    path.write_bytes(content)
    with pytest.raises(DataError, match="line 1: no "):
        Journal(path)
    assert path.read_bytes() == content
