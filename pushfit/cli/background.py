"""Work aside: in a process of its own, while this one loads what comes next.

Libraries are loaded under the lock of the interpreter, so that a thread would gain
nothing. Excluded: work that needs JAX, and the workers of a batch
(`pushfit.batch.workers`).
"""

import contextlib
import signal
import sys
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import TypeVar

from pushfit.errors import PushfitError

T = TypeVar("T")

SIGNALS = (signal.SIGINT, signal.SIGTERM)


def aside(work: Callable[[], T]) -> Callable[[], T]:
    """Begin work that needs no JAX, whose threads no fork survives.

    Returns:
        What waits for it, and raises what it raised. Where JAX is loaded already, or
        forks are not safe, the work itself.
    """
    if "jax" in sys.modules or sys.platform != "linux":
        return work
    fork = get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    # A daemon ends with this process, or when nobody is left to be told.
    process = fork.Process(target=_tell, args=(work, receiver, sender), daemon=True)
    # What signals do here they must not do there, not even once.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    process.start()
    signal.pthread_sigmask(signal.SIG_SETMASK, before)
    sender.close()

    def outcome() -> T:
        try:
            found, error = receiver.recv()
        except (EOFError, OSError):
            # Whatever ended it is met again here.
            return work()
        if error is not None:
            raise error
        return found

    return outcome


def _tell(work: Callable[[], T], receiver: Connection, sender: Connection) -> None:
    """Send what work returns, or what the user can mend; a signal ends it."""
    receiver.close()
    signal.set_wakeup_fd(-1)
    for number in SIGNALS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    with contextlib.suppress(Exception):
        try:
            message = work(), None
        except PushfitError as error:
            message = None, error
        sender.send(message)
