"""Ctrl-C at any moment: over within a second, a sentence, nothing half written."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.batch.makers import table_text

EXAMPLE = Path(__file__).parents[2] / "examples" / "foam_box"
# What a user waits without pressing twice, and the process table under load [s].
AT_ONCE = 1.0
PREPARED = (
    "import sys, time\nfrom pushfit.cli.session import Session\n"
    "from pushfit.cli.stop import stoppable\n"
    "s = Session(is_quiet=False, is_verbose=False, is_debug=False, is_json=False)\n"
)
# A callback of JAX swallows what a signal handler raises, as this does.
SWALLOWING = """
def work():
    print('ready', flush=True)
    while True:
        try:
            time.sleep(60)
        except BaseException:
            pass
with stoppable():
    sys.exit(s.run(work))
"""
# One step of Python that lasts: no handler in Python runs before it is over.
COMPILING = """
import jax, jax.numpy as jnp
def work():
    x = jnp.ones((3000, 3000))
    print('ready', flush=True)
    jax.lax.fori_loop(0, 200, lambda i, y: y @ x, x).block_until_ready()
with stoppable():
    sys.exit(s.run(work))
"""
HALF_WRITTEN = """
from pushfit.atomic import atomic_path
def work():
    with atomic_path('out.csv') as temporary:
        temporary.write_text('half')
        print('ready', flush=True)
        time.sleep(60)
with stoppable():
    sys.exit(s.run(work))
"""


def stopped(process: subprocess.Popen, number: int = signal.SIGINT) -> float:
    """Time that a process takes to end after a signal [s]."""
    sent = time.perf_counter()
    process.send_signal(number)
    try:
        process.wait(timeout=20)
    finally:
        process.kill()
    return time.perf_counter() - sent


@pytest.mark.parametrize("work", [SWALLOWING, COMPILING, HALF_WRITTEN])
@pytest.mark.parametrize(
    ("number", "word"), [(signal.SIGINT, "interrupted"), (signal.SIGTERM, "terminated")]
)
def test_a_command_ends_and_says_what_is_kept(work, number, word, tmp_path):
    with subprocess.Popen(
        [sys.executable, "-c", PREPARED + work],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        stopped(process, number)
        assert process.returncode == 128 + number
        assert process.stderr is not None
        assert process.stderr.read() == f"{word}; nothing was written\n"
    assert os.listdir(tmp_path) == []


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("stop") / "peaks.csv"
    path.write_text(table_text(1, n=17))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("command", ["fit", "identify", "batch"])
def test_a_real_command_stops_at_every_moment(command, table, tmp_path):
    """Twenty moments from the first import to the last picture."""
    sweep = str(EXAMPLE / "alpha_sweep.csv")
    schedule = str(EXAMPLE / "alpha_schedule.csv")
    words = {
        "fit": ["fit", str(table)],
        "identify": ["identify", sweep, "-s", schedule, "--out", "out"],
        "batch": ["batch", str(table), "--out", "out"],
    }[command]
    for moment in np.geomspace(0.15, 12, 20):
        place = tmp_path / f"{moment:.2f}"
        place.mkdir()
        with subprocess.Popen(
            [sys.executable, "-m", "pushfit", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=place,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        ) as process:
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                assert stopped(process) < AT_ONCE, moment
                assert process.returncode == 130, moment
                said = process.stderr.read() if process.stderr else ""
                assert "interrupted; " in said, moment
                assert "Traceback" not in said
            else:
                assert process.returncode == 0
                break  # faster than this moment
        left = {path.name for path in place.iterdir()}
        assert left <= ({"out"} if command == "batch" else set()), moment
