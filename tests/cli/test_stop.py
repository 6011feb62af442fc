"""Ctrl-C at any moment: over within a second, a sentence, nothing half written."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pushfit.cli.stop import say_kept, what_is_kept
from tests.batch.makers import table_text

EXAMPLE = Path(__file__).parents[2] / "examples" / "foam_box"
# What a user waits without pressing twice, and the process table under load [s].
AT_ONCE = 1.0
# First moment [s], and the last in durations of a command, which differ by what else
# the machine does: where one was over before its moment, the next is stopped after this
# share of the time that it took, and so on so many times.
FIRST, LAST, SOONER, N_SOONER = 0.15, 0.95, 0.8, 6
PREPARED = (
    "import sys, time\nfrom pushfit.cli.session import CommandSession\n"
    "from pushfit.cli.stop import stoppable\n"
    "words = 'is_quiet', 'is_verbose', 'is_debug', 'is_json'\n"
    "s = CommandSession(**dict.fromkeys(words, False))\n"
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


def test_what_is_kept_in_a_file_is_said_once_that_is_there(tmp_path):
    """A chain by emcee may never begin, and a journal begins with the first push."""
    file = tmp_path / "chain"
    say_kept("the chain is kept", once=file)
    assert what_is_kept() == "nothing was written"
    file.touch()
    assert what_is_kept() == "the chain is kept"


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    path = tmp_path_factory.mktemp("stop") / "peaks.csv"
    path.write_text(table_text(1, n=17))
    return path


def started(words, place):
    """A command that runs in a folder of its own."""
    place.mkdir()
    return subprocess.Popen(
        [sys.executable, "-m", "pushfit", *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=place,
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
    )


def duration(words, place) -> float:
    """Time of a command whose programs are kept by a run before it [s]."""
    for name in ("compiles", "runs"):
        begun = time.perf_counter()
        with started(words, place / name) as process:
            assert process.communicate()[0]
        assert process.returncode == 0
    return time.perf_counter() - begun


def stopped_at(moment, words, place):
    """A command stopped at a moment, or sooner where a quick run was over by then.

    Returns:
        What it said, and the names of what it left.
    """
    for attempt in range(N_SOONER):
        begun = time.perf_counter()
        with started(words, place / str(attempt)) as process:
            try:
                process.wait(moment)
            except subprocess.TimeoutExpired:
                assert stopped(process) < AT_ONCE
                assert process.returncode == 130
                said = process.stderr.read() if process.stderr else ""
                return said, {path.name for path in (place / str(attempt)).iterdir()}
        assert process.returncode == 0
        moment = SOONER * (time.perf_counter() - begun)
    raise AssertionError(f"over before {moment:.2f} s, {N_SOONER} times")


@pytest.mark.slow
@pytest.mark.parametrize("command", ["fit", "identify", "batch"])
def test_a_real_command_stops_at_every_moment(command, table, tmp_path):
    """Twenty moments from the first import to the last picture, closer at the start."""
    sweep = str(EXAMPLE / "alpha_sweep.csv")
    schedule = str(EXAMPLE / "alpha_schedule.csv")
    words = {
        "fit": ["fit", str(table)],
        "identify": ["identify", sweep, "-s", schedule, "--out", "out"],
        "batch": ["batch", str(table), "--out", "out"],
    }[command]
    end = LAST * duration(words, tmp_path)
    even, early = np.linspace(FIRST, end, 12)[1:-1], np.geomspace(FIRST, end, 10)
    # Two moments may be one to the millisecond.
    for k, moment in enumerate(sorted([*even, *early])):
        place = tmp_path / str(k)
        place.mkdir()
        said, left = stopped_at(moment, words, place)
        assert "interrupted; " in said, moment
        assert "Traceback" not in said
        may_be_there = command == "batch" or "out is complete" in said
        assert left <= ({"out"} if may_be_there else set()), moment
