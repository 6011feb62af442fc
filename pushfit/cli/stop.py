"""Ctrl-C and SIGTERM end a command at once, wherever it is.

Python runs signal handlers between two of its own steps. A compilation by JAX is one
step that may last a minute, a callback of JAX swallows what a handler raises, and emcee
prints it. So nothing is raised: a thread of its own waits for the signal, removes what
is half written and ends the process. All files are complete or absent at any moment, so
no unwinding is needed. Excluded: what is half written (`pushfit.atomic`).
"""

import contextlib
import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections.abc import Iterator
from multiprocessing import util
from pathlib import Path

from pushfit.atomic import discard_unfinished

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
# Shells report a process that a signal ended by 128 and its number.
SIGNALLED = 128
# Longest wait for a result folder that is just taking its place [s].
PATIENCE = 0.5
SHOW_CURSOR = "\r\x1b[K\x1b[?25h"
NOTHING = "nothing was written"

# What signals do belongs to the process, and so does what they say: a sentence, and the
# file without which there is nothing to say.
_kept: list[tuple[str, Path | None]] = [(NOTHING, None)]


def say_kept(sentence: str, *, once: Path | None = None) -> None:
    """Say, from now on, what a user has who stops the command.

    Args:
        once: File that has to be there for it.
    """
    _kept[0] = sentence, once


def what_is_kept() -> str:
    """What to tell a user who stops the command now."""
    sentence, once = _kept[0]
    return sentence if once is None or once.exists() else NOTHING


@contextlib.contextmanager
def stoppable() -> Iterator[None]:
    """Have the two signals end the process while the block runs."""
    say_kept(NOTHING)
    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may say what signals do
        return
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    # The bytes are written by the handler in C, which waits for nobody.
    descriptor = signal.set_wakeup_fd(writer.fileno(), warn_on_full_buffer=False)
    before = {number: signal.signal(number, _leave_to_thread) for number in WORDS}
    thread = threading.Thread(target=_watch, args=(reader,), daemon=True)
    thread.start()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(descriptor)
        # Closed it would go on in processes that were forked meanwhile.
        writer.shutdown(socket.SHUT_WR)
        writer.close()
        thread.join()
        reader.close()


def _leave_to_thread(number: int, frame: object) -> None:
    """Handler that keeps Python's own from raising."""


def _watch(reader: socket.socket) -> None:
    """Wait for one of the signals, or for the end of the block."""
    while received := reader.recv(1):
        number = received[0]
        if number in WORDS:
            _end(signal.Signals(number))


def _end(number: signal.Signals) -> None:
    """Leave nothing half written, and nobody at work, and go."""
    for child in multiprocessing.active_children():
        child.kill()
    # Semaphores that were shared with them: else the tracker of multiprocessing warns.
    util._run_finalizers(0)  # pyright: ignore
    discard_unfinished(patience=PATIENCE)
    # The bar of a terminal hides the cursor.
    start = SHOW_CURSOR if sys.stderr.isatty() else ""
    with contextlib.suppress(OSError):
        os.write(
            2, f"{start}{WORDS[number]}; {what_is_kept()}\n".encode(errors="replace")
        )
    os._exit(SIGNALLED + number)
