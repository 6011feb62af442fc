"""Work aside: in a process of its own, while this one loads what comes next.

Libraries are loaded under the lock of the interpreter, so that a thread would gain
nothing.
"""

import signal
import sys
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

T = TypeVar("T")


def begun(work: Callable[[], T]) -> Callable[[], T]:
    """Begin work that needs no JAX, whose threads no fork survives.

    Returns:
        What waits for it, and raises what it raised. Where JAX is loaded already, or
        forks are not safe, the work itself.
    """
    if "jax" in sys.modules or sys.platform != "linux":
        return work
    fork = get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    # A daemon ends with this process.
    fork.Process(target=_tell, args=(work, sender), daemon=True).start()
    sender.close()

    def outcome() -> T:
        try:
            found, error = receiver.recv()
        except EOFError:
            # Whatever ended it is met again here.
            return work()
        if error is not None:
            raise error
        return found

    return outcome


def _tell(work: Callable[[], T], sender: Connection) -> None:
    """Send what work returns, or what it raises; a signal ends it, whatever was set."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    try:
        message = work(), None
    except Exception as error:
        message = None, error
    sender.send(message)
