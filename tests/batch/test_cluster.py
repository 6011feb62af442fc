"""Real worker processes, some of which die, and a coordinator that is killed."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from distributed import LocalCluster

from pushfit.batch.run import identify_batch
from pushfit.batch.workers import Workers
from pushfit.errors import ConfigError
from tests.batch import fake
from tests.batch.makers import outputs, read_csv, write_tables

ROOT = Path(__file__).parents[2]
NAMES = [f"t{k:02d}" for k in range(24)]


@pytest.fixture
def runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return write_tables(tmp_path / "runs", *NAMES)


def run(out, **workers):
    return identify_batch(
        ["runs"], out, workers=Workers(**workers), identify=fake.identify
    )


@pytest.mark.slow
def test_the_number_of_workers_does_not_change_a_byte(runs, log, tmp_path):
    run("one")
    found = run("two", n=2, chunk=3)
    assert found.n_computed == len(NAMES)
    assert outputs(tmp_path / "one") == outputs(tmp_path / "two")


@pytest.mark.slow
def test_real_numbers_are_the_same_in_worker_processes(tmp_path, monkeypatch):
    """One thread or several: not a bit may differ."""
    monkeypatch.chdir(tmp_path)
    write_tables(tmp_path / "runs", "a", "b", n=12)
    identify_batch(["runs"], "one")
    identify_batch(["runs"], "two", workers=Workers(n=2))
    assert outputs(tmp_path / "one") == outputs(tmp_path / "two")
    rows = read_csv(tmp_path / "one" / "results.csv")
    assert [row["engine"] for row in rows] == ["sweep", "sweep"]


@pytest.mark.slow
def test_a_worker_that_dies_costs_only_its_own_item(runs, log, tmp_path):
    run("good")
    write_tables(runs, "x_kill", "x_killonce")
    found = run("out", n=2, chunk=4)
    assert [(f.item, f.stage) for f in found.failures] == [
        ("runs/x_kill.csv", "worker")
    ]
    rows = read_csv(tmp_path / "out" / "results.csv")
    assert rows[: len(NAMES)] == read_csv(tmp_path / "good" / "results.csv")
    assert rows[-1]["status"] == "ok"


@pytest.mark.slow
def test_a_worker_that_hangs_costs_only_its_own_item(runs, log, tmp_path):
    write_tables(runs, "x_hang")
    start = time.monotonic()
    found = run("out", n=2, chunk=2, time_limit=3.0)
    assert [f.item for f in found.failures] == ["runs/x_hang.csv"]
    assert "3 s" in found.failures[0].message
    # Limits of 6, 3 and 3 s and a few starts of processes, against 1000 s of sleep.
    assert time.monotonic() - start < 500


@pytest.mark.slow
def test_a_running_scheduler_is_used_and_left_running(runs, log, tmp_path):
    run("one")
    with LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        for out in ("two", "three"):
            run(out, scheduler=cluster.scheduler_address)
    assert outputs(tmp_path / "one") == outputs(tmp_path / "three")


@pytest.mark.slow
def test_a_scheduler_that_is_not_there_is_said(runs, monkeypatch):
    monkeypatch.setattr("pushfit.batch.workers.PATIENCE", 1)
    with pytest.raises(ConfigError, match="no scheduler answers"):
        run("out", scheduler="tcp://127.0.0.1:9")


def start(out: str, log: Path, *, workers: int = 1) -> subprocess.Popen:
    """A batch in a process group of its own."""
    call = (
        "from tests.batch.fake import identify\n"
        "from pushfit.batch.workers import Workers\n"
        "from pushfit.batch.run import identify_batch\n"
        "if __name__ == '__main__':\n"
        f"    identify_batch(['runs'], {out!r}, identify=identify, "
        f"workers=Workers(chunk=2, n={workers}))\n"
    )
    script = log.with_name(f"start_{workers}.py")
    script.write_text(call)
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        fake.LOG: str(log),
        fake.SECONDS: "0.3",
    }
    return subprocess.Popen(
        [sys.executable, str(script)],
        env=environment,
        start_new_session=True,
        stderr=subprocess.DEVNULL,
    )


def wait_for_lines(log: Path, n: int) -> None:
    while not log.exists() or len(log.read_text().split()) < n:
        time.sleep(0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("workers", "n_kills"), [(1, 5), (2, 2)])
def test_a_killed_batch_loses_and_repeats_nothing(workers, n_kills, runs, tmp_path):
    run("whole")
    log = tmp_path / "killed.txt"
    rng = random.Random(workers)
    n_before = 0
    for _ in range(n_kills):
        process = start("out", log, workers=workers)
        wait_for_lines(log, n_before + 2)
        time.sleep(rng.uniform(0, 0.7))
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        n_before = len(log.read_text().split())
    last = start("out", log, workers=workers)
    assert last.wait() == 0
    assert outputs(tmp_path / "out") == outputs(tmp_path / "whole")
    computed = log.read_text().split()
    assert set(computed) == {f"{name}.csv" for name in NAMES}
    # At most the chunk that each worker had in hand is done again, for each kill.
    assert len(computed) <= len(NAMES) + n_kills * 2 * workers


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("workers", [1, 2])
def test_a_batch_that_is_stopped_says_how_to_go_on(number, workers, runs, tmp_path):
    script = tmp_path / "start.py"
    script.write_text(
        "import sys\n"
        "import pushfit.batch.run as run\n"
        "from tests.batch.fake import identify\n"
        "from functools import partial\n"
        "from pushfit.cli import main\n"
        "if __name__ == '__main__':\n"
        "    run.identify_batch = partial(run.identify_batch, identify=identify)\n"
        f"    sys.exit(main(['batch', 'runs', '--out', 'out', '--chunk', '1',"
        f" '--workers', '{workers}']))\n"
    )
    log = tmp_path / "log.txt"
    environment = os.environ | {
        "PYTHONPATH": str(ROOT),
        fake.LOG: str(log),
        fake.SECONDS: "0.3",
    }
    process = subprocess.Popen(
        [sys.executable, str(script)],
        env=environment,
        start_new_session=True,
        stderr=subprocess.PIPE,
        text=True,
    )
    # Two in work, and at most two done that are on their way to the store.
    wait_for_lines(log, 6)
    # As a terminal does it: to the workers as well.
    os.killpg(process.pid, number)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert "the same command goes on" in said
    assert "Traceback" not in said
    assert "leaked" not in said
    assert run("out").n_kept >= 2
