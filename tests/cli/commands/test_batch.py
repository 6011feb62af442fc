"""`pushfit batch` and the script beside it, as a shell sees them."""

import importlib.util
import json
from functools import partial
from pathlib import Path

import pytest

import pushfit
from pushfit.batch import run
from pushfit.cli.app import main
from tests.batch import fake
from tests.batch.makers import write_tables

SCRIPT = Path(__file__).parents[3] / "scripts" / "identify_batch.py"


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """Two tables in `runs`, and nothing that takes long."""
    cheap = partial(run.identify_batch, identify=fake.identify)
    # First the name that is loaded from the second when it is asked for.
    monkeypatch.setattr(pushfit, "identify_batch", cheap)
    monkeypatch.setattr(run, "identify_batch", cheap)
    monkeypatch.chdir(tmp_path)
    return write_tables(tmp_path / "runs", "a", "b")


def document(capsys, *arguments: str):
    code = main(["batch", *arguments, "--json"])
    return code, json.loads(capsys.readouterr().out)


def test_what_a_batch_left_out_is_named(runs, capsys):
    for name in ("notes.md", "a.toml", "grasp.toml", "lab.toml"):
        Path("runs", name).touch()
    profile = ["--profile", "runs/lab.toml"]
    assert main(["batch", "runs", *profile, "--out", "out"]) == 0
    shown = capsys.readouterr().out
    assert f"left_out     1 ({Path('runs', 'notes.md')})" in shown


def test_a_batch_counts_what_it_did(runs, capsys):
    code, first = document(capsys, "runs", "--out", "out")
    assert (code, first["schema"], first["status"]) == (0, "pushfit.batch/1", "ok")
    assert (first["items"], first["computed"], first["kept"]) == (2, 2, 0)
    code, again = document(capsys, "runs", "--out", "out")
    assert (code, again["computed"], again["kept"]) == (0, 0, 2)


def test_some_failures_have_an_exit_code_of_their_own(runs, capsys):
    write_tables(runs, "reject")
    assert main(["batch", "runs", "--out", "out"]) == 5
    captured = capsys.readouterr()
    assert "runs/reject.csv" in captured.err
    assert "failed       1" in captured.out


def test_failures_speak_of_settings_as_a_command_does(runs, capsys):
    rows = "\n".join(["force_n", *(str(k % 7) for k in range(200)), ""])
    Path(runs, "log.csv").write_text(rows)
    assert main(["batch", "runs", "--out", "out"]) == 5
    assert "by recording.rate" in capsys.readouterr().err
    for name in ("failures.csv", "report.html"):
        text = Path("out", name).read_text(encoding="utf-8")
        assert "by recording.rate" in text
        assert "`rate`" not in text


def test_nothing_to_do_is_a_rejected_input(runs, tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    assert main(["batch", "empty", "--out", "out"]) == 3


def test_a_missing_input_is_a_usage_error_before_any_work(runs, tmp_path):
    assert main(["batch", "runs", "nowhere.csv", "--out", "out"]) == 2
    assert not (tmp_path / "out").exists()


def test_a_stopped_batch_says_how_to_go_on(runs, monkeypatch, capsys):
    def stop(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(run, "identify_batch", stop)
    assert main(["batch", "runs", "--out", "out"]) == 130
    assert "nothing was written" in capsys.readouterr().err
    (runs.parent / "out").mkdir()
    (runs.parent / "out" / "batch.sqlite").touch()
    assert main(["batch", "runs", "--out", "out"]) == 130
    assert "the same command goes on" in capsys.readouterr().err


def test_the_script_does_the_same_by_one_library_call(runs, tmp_path, capsys):
    spec = importlib.util.spec_from_file_location("identify_batch", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    assert script.main(["runs", "--out", "scripted"]) == 0
    assert main(["batch", "runs", "--out", "out"]) == 0
    results = (tmp_path / folder / "results.csv" for folder in ("scripted", "out"))
    first, second = (path.read_bytes() for path in results)
    assert first == second
