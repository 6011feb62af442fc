"""Work on a thread: beside its caller, heard in order, and never in the way."""

import subprocess
import sys
import threading

import pytest

from pushfit.fit.identify.beside import Beside, at_once

# Far longer than a process takes to start and end [s].
LONG = 60.0


def test_it_runs_while_its_caller_goes_on():
    """It ends only when the caller says so, after it has begun."""
    goes_on = threading.Event()
    other = Beside(lambda tell: goes_on.wait(LONG))
    goes_on.set()
    assert other.result() is True


def test_news_wait_until_they_are_asked_for_and_come_in_order():
    heard = []

    def work(tell):
        for i in range(3):
            tell(lambda i=i: heard.append((i, threading.current_thread())))
        is_done.set()
        return "found"

    is_done = threading.Event()
    other = Beside(work)
    assert is_done.wait(LONG)
    assert heard == []
    assert other.result() == "found"
    here = threading.current_thread()
    assert heard == [(0, here), (1, here), (2, here)]


def test_what_it_raises_comes_after_its_news():
    heard = []

    def work(tell):
        tell(lambda: heard.append("begun"))
        raise ValueError("no answer")

    other = Beside(work)
    with pytest.raises(ValueError, match="no answer"):
        other.result()
    assert heard == ["begun"]


def test_news_without_a_thread_are_said_at_once():
    heard = []
    at_once(lambda: heard.append("begun"))
    assert heard == ["begun"]


def test_no_process_waits_for_it():
    script = (
        "import time; from pushfit.fit.identify.beside import Beside; "
        f"Beside(lambda tell: time.sleep({10 * LONG}))"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=LONG)
