"""SIGKILL after every line of a journal: the same exploration goes on."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "tests.explore.journal.killed", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=ROOT,
    )


def told(path):
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    return [
        {key: value for key, value in row.items() if key != "number"}
        for row in rows
        if row["event"] == "told"
    ]


@pytest.mark.slow
def test_killed_after_any_line_the_same_command_ends_the_same(tmp_path):
    whole = tmp_path / "whole.jsonl"
    expected = run(whole)
    assert expected.returncode == 0, expected.stderr
    n_lines = len(whole.read_text().splitlines())
    assert n_lines >= 8
    for n in range(1, n_lines):
        path = tmp_path / f"{n}.jsonl"
        assert run(path, n).returncode == -signal.SIGKILL
        assert len(path.read_text().splitlines()) == n
        again = run(path)
        assert again.stdout == expected.stdout, again.stderr
        assert told(path) == told(whole)
