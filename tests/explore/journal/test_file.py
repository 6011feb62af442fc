"""The file of a journal: who may write it."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from pushfit.errors import ConfigError
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
