"""Work in a process of its own: the same outcome, whatever happens to it."""

import pickle
import signal
import subprocess
import sys

import pytest

from pushfit.cli.background import aside
from pushfit.errors import ConvergenceError, DataError, InputProblem

# Without JAX, as commands begin.
SCRIPT = """
import os, sys
from pushfit.cli.background import aside
from pushfit.errors import DataError

HERE = os.getpid()

def refuse():
    raise DataError("no such push", code="no_push")

def die():
    if os.getpid() != HERE:
        os._exit(1)
    return "done here"

def fail():
    raise KeyError("a bug")

def much():
    return bytes(10**6), os.getpid() != HERE

assert "jax" not in sys.modules
is_aside = aside(os.getpid)() != HERE
assert is_aside is (sys.platform == "linux")
assert aside(die)() == "done here"
assert aside(much)() == (bytes(10**6), is_aside)
try:
    aside(fail)()
except KeyError as error:
    # With the traceback of the work.
    assert error.__traceback__.tb_next.tb_next is not None
try:
    aside(refuse)()
except DataError as error:
    print(error.code, error, os.getpid() == HERE)
"""


def ran(script: str) -> tuple[int, str, str]:
    """Code, output and errors of a script, once nobody can write to it any more."""
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    return done.returncode, done.stdout, done.stderr


def test_what_comes_of_work_aside_is_what_would_come_of_it_here():
    assert ran(SCRIPT) == (0, "no_push no such push True\n", "")


def test_a_command_that_does_not_wait_for_work_aside_ends_at_once():
    script = """
import time
from functools import partial
from pushfit.cli.background import aside
from pushfit.cli.stop import stoppable

with stoppable():
    aside(partial(time.sleep, 3600))
    print("refused")
"""
    assert ran(script) == (0, "refused\n", "")


@pytest.mark.skipif(sys.platform != "linux", reason="work is not done aside")
def test_work_aside_ends_when_nobody_is_left_to_be_told():
    script = """
import os, signal, time
from pushfit.cli.background import aside

def work():
    print(os.getpid(), flush=True)
    time.sleep(0.5)
    return bytes(10**6)

aside(work)
time.sleep(0.2)
os.kill(os.getpid(), signal.SIGKILL)
"""
    code, out, errors = ran(script)
    assert (code, errors) == (-signal.SIGKILL, "")
    assert out.strip().isdigit()


def test_beside_jax_work_is_done_when_it_is_waited_for():
    def work() -> int:
        return 1

    assert aside(work) is work


@pytest.mark.parametrize(
    "error",
    [
        DataError(
            "row 3: no", code="no", problems=(InputProblem(code="no", message="row 3"),)
        ),
        ConvergenceError("stopped", code="stopped", names=("K_sn",), costs=(1.0,)),
    ],
)
def test_errors_go_from_process_to_process_whole(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
