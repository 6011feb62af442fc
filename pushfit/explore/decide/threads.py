"""Linear algebra on one thread: what a suggestion multiplies is small.

Waking other threads for it costs more than they do, and where other programs run, ten
times as much.
"""

import functools
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import ThreadpoolController


@functools.cache
def _libraries() -> ThreadpoolController:
    # Looking for the libraries takes as long as a survey.
    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Products of matrices on one thread; `@one_thread()` does so for a function."""
    with _libraries().limit(limits=1, user_api="blas"):
        yield
