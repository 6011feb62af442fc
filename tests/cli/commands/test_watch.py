"""A folder is watched: what arrives is identified once, when it has stopped growing."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from pushfit.batch import run
from pushfit.batch.items import ItemFailure
from pushfit.cli import main
from pushfit.cli.commands import batch as watch_module
from pushfit.cli.commands.batch import stamps
from pushfit.errors import ConfigError, DataError


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "runs"
    folder.mkdir()
    return folder


@pytest.fixture
def batches(runs, monkeypatch):
    """Files of the folder at each call for a batch."""
    seen = []

    def batch(inputs, out, **options):
        seen.append({Path(path).name: Path(path).stat().st_size for path in inputs})
        return run.Batch(
            rows=(),
            population=(),
            failures=(),
            files=(),
            n_computed=1,
            n_kept=0,
            left_out=(),
            notice="",
        )

    monkeypatch.setattr(run, "identify_batch", batch)
    return seen


@pytest.fixture
def clock(monkeypatch):
    """Time that passes only while the command sleeps, and what happens meanwhile."""
    events, now = [], [0.0]

    def sleep(seconds):
        now[0] += seconds
        if events:
            events.pop(0)()

    fake = SimpleNamespace(sleep=sleep, monotonic=lambda: now[0])
    monkeypatch.setattr(watch_module, "time", fake)
    return events


def watch() -> int:
    return main(["watch", "runs", "-o", "out", "--every", "1", "--idle", "8"])


def test_what_is_there_is_identified_once(runs, batches, clock):
    (runs / "a.csv").write_text("x")
    assert watch() == 0
    assert batches == [{"a.csv": 1}]


def test_what_arrives_later_is_identified_when_it_has_stopped_growing(
    runs, batches, clock
):
    (runs / "a.csv").write_text("x")

    def grow(length):
        return lambda: (runs / "b.csv").write_text("y" * length)

    clock += [lambda: None, lambda: None, grow(1), grow(2), grow(3)]
    assert watch() == 0
    assert batches == [{"a.csv": 1}, {"a.csv": 1, "b.csv": 3}]


def test_a_file_that_waits_for_its_second_look_is_no_idleness(runs, batches, clock):
    (runs / "a.csv").write_text("x")
    arguments = ["watch", "runs", "-o", "out", "--every", "2", "--idle", "1"]
    assert main(arguments) == 0
    assert batches == [{"a.csv": 1}]


def test_failures_are_in_the_exit_code(runs, monkeypatch, clock):
    failure = ItemFailure(item="a.csv", stage="peaks", code="none", message="none")
    found = run.Batch(
        rows=(),
        population=(),
        failures=(failure,),
        files=(),
        n_computed=0,
        n_kept=0,
        left_out=(),
        notice="",
    )
    monkeypatch.setattr(run, "identify_batch", lambda *_, **__: found)
    (runs / "a.csv").write_text("x")
    assert watch() == 5


def test_an_empty_folder_is_waited_for(runs, batches, clock):
    assert watch() == 0
    assert batches == []


def test_a_folder_without_a_recording_is_no_end(runs, monkeypatch, clock, capsys):
    def refuse(inputs, out, **options):
        raise DataError("no recording or table there", code="nothing_to_do")

    monkeypatch.setattr(run, "identify_batch", refuse)
    (runs / "notes.txt").write_text("x")
    assert watch() == 0
    assert "warning: no recording or table there" in capsys.readouterr().err


def test_results_inside_the_folder_are_not_inputs(runs):
    (runs / "a.csv").write_text("x")
    (runs / "out").mkdir()
    (runs / "out" / "results.csv").write_text("x")
    # By a relative name as well, whichever way the other one is written.
    assert set(stamps(Path("runs"), runs / "out")) == {"runs/a.csv"}


def test_a_file_that_grows_all_night_keeps_no_other_waiting(runs, batches, clock):
    for name in ("a.csv", "b.csv", "robot.log"):
        (runs / name).write_text("x")

    def grow(*names):
        def write():
            for name in names:
                (runs / name).write_text("x" + (runs / name).read_text())

        return write

    clock += [grow("b.csv", "robot.log")] * 3
    clock += [grow("robot.log")] * 20
    assert watch() == 0
    assert batches == [{"a.csv": 1}, {"a.csv": 1, "b.csv": 4}]


def test_settings_that_are_half_saved_end_no_watch(runs, monkeypatch, clock, capsys):
    """As they did no harm before; what is wrong from the beginning ends it."""
    calls = []

    def batch(inputs, out, **options):
        calls.append(len(inputs))
        if len(calls) != wrong:
            raise DataError("nothing", code="nothing_to_do")
        raise ConfigError("half a file", code="config")

    monkeypatch.setattr(run, "identify_batch", batch)
    (runs / "a.csv").write_text("x")
    clock += [lambda: None] * 3 + [lambda: (runs / "b.csv").write_text("y")]
    wrong = 2
    assert watch() == 0
    assert calls == [1, 2]
    assert "warning: half a file" in capsys.readouterr().err
    wrong = 3
    assert watch() == 2


def test_a_missing_folder_is_said(runs, capsys):
    assert main(["watch", "none", "-o", "out"]) == 2
    assert "no such file" in capsys.readouterr().err


def test_a_file_is_no_folder_to_watch(runs, capsys):
    (runs / "a.csv").write_text("x")
    assert main(["watch", "runs/a.csv", "-o", "out"]) == 2
    assert "is no folder" in capsys.readouterr().err


@pytest.mark.parametrize("is_there", [False, True])
def test_results_that_can_go_nowhere_are_said_before_anything_is_waited_for(
    is_there, runs, clock, monkeypatch, capsys
):
    def refused(*_, **__):
        raise PermissionError(13, "Permission denied", "out")

    if is_there:
        Path("out").mkdir()
        monkeypatch.setattr("pushfit.atomic.tempfile.TemporaryFile", refused)
    else:
        monkeypatch.setattr("pathlib.Path.mkdir", refused)
    assert main(["watch", "runs", "--out", "out", "--idle", "1"]) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: out")
    assert "Permission denied" in captured.err
