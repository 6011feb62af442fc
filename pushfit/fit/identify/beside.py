"""Work on a thread of its own, beside that of its caller.

Compiling, and what is compiled, leave Python free: two analyses side by side end sooner
than one after the other. What one would say meanwhile waits until it is asked for, so
that what is heard has an order. Excluded: processes (`pushfit.batch.workers`).
"""

from collections.abc import Callable
from concurrent.futures import Future
from queue import SimpleQueue
from threading import Thread
from typing import Generic, TypeVar

T = TypeVar("T")
# Something to be said, and who passes it on: at once, or when it is asked for.
News = Callable[[], None]
Tell = Callable[[News], None]


def at_once(news: News) -> None:
    """Pass on a piece of news as soon as it is there: a `Tell`."""
    news()


class Beside(Generic[T]):
    """Work that has begun on a thread.

    A process that ends does not wait for it.

    Args:
        work: Called with whom to tell of its news.
    """

    def __init__(self, work: Callable[[Tell], T]) -> None:
        """Begin the work on a thread of its own."""
        self._news: SimpleQueue[News | None] = SimpleQueue()
        self._outcome: Future[T] = Future()
        Thread(target=self._run, args=(work,), daemon=True).start()

    def result(self) -> T:
        """What it returned, or raised, when all its news are said, in order."""
        while (news := self._news.get()) is not None:
            news()
        return self._outcome.result()

    def _run(self, work: Callable[[Tell], T]) -> None:
        try:
            self._outcome.set_result(work(self._news.put))
        except BaseException as error:
            self._outcome.set_exception(error)
        finally:
            self._news.put(None)
