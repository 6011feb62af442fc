"""Who works on a batch: this process, others beside it, or a running dask cluster.

A worker that dies, or passes the time limit, costs no item but its own: dask tries the
chunk again elsewhere, then it is split, and what still fails is tried once more alone,
so that nobody pays for a neighbour's crash. Excluded: the work itself
(`pushfit.batch.identify_chunk`).
"""

import contextlib
import faulthandler
import logging
import math
import numbers
import os
import tempfile
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from pushfit.atomic import unfinished
from pushfit.batch.identify_chunk import Chunk
from pushfit.batch.items import Item, ItemFailure
from pushfit.errors import ConfigError, installed_by

if TYPE_CHECKING:
    from distributed import Client

Outcome = TypeVar("Outcome")
Work = Callable[[Chunk], Sequence[Outcome | ItemFailure]]

# One thread each: the workers share the cores among them, and linear algebra or XLA in
# many threads would only stand in line. NPROC is how XLA is told.
ENVIRONMENT = {
    "NPROC": 1,
    "OMP_NUM_THREADS": 1,
    "MKL_NUM_THREADS": 1,
    "OPENBLAS_NUM_THREADS": 1,
    # What dask says of a lost worker is said in the failures, without tracebacks.
    "DASK_LOGGING__DISTRIBUTED": "critical",
}
# Ctrl-C reaches all processes of a terminal; this one ends the workers.
DEAF = "import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
TALKATIVE = ("distributed", "distributed.client")
# Seconds to wait for a scheduler.
PATIENCE = 20
# Portions per worker of a large batch, so that no worker goes on alone for long.
SHARES = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Workers:
    """Who works.

    Args:
        n: Number of processes; 1 is this one.
        scheduler: Address of a running dask scheduler, instead.
        chunk: Most items that are worked on, and lost, together.
        time_limit: Longest time for one item [s]; needs a process that can be ended.
    """

    n: int = 1
    scheduler: str | None = None
    chunk: int = 64
    time_limit: float | None = None

    def __post_init__(self) -> None:
        """Refuse numbers that no work can be shared by.

        Raises:
            ConfigError: One of them is not positive, or a count no whole number.
        """
        for name, n in {"n": self.n, "chunk": self.chunk}.items():
            if not (isinstance(n, numbers.Integral) and n > 0):
                raise ConfigError(
                    f"workers: {name} = {n!r}: state a whole number, 1 or above",
                    code="workers",
                )
        limit = self.time_limit
        if limit is not None and not (isinstance(limit, numbers.Real) and limit > 0):
            raise ConfigError(
                f"workers: time_limit = {limit!r}: state a number of seconds above 0, "
                "or None for no limit",
                code="workers",
            )

    @property
    def is_here(self) -> bool:
        """Whether this process does the work itself."""
        return self.n == 1 and self.scheduler is None and self.time_limit is None

    def chunks(self, items: Sequence[Item]) -> list[Chunk]:
        """Portions of items of one configuration, alike in size and so in shape."""
        share = max(math.ceil(len(items) / (SHARES * self.n)), 1)
        size = min(self.chunk, share)
        groups: dict[str, list[Item]] = {}
        for item in sorted(items, key=lambda item: (item.size, item.key)):
            groups.setdefault(item.config.digest(), []).append(item)
        return [
            tuple(group[start : start + size])
            for group in groups.values()
            for start in range(0, len(group), size)
        ]

    def work_on(
        self, work: Work[Outcome], chunks: Sequence[Chunk]
    ) -> Generator[tuple[Chunk, Sequence[Outcome | ItemFailure]]]:
        """Do the work, here or elsewhere.

        Args:
            work: What to do with a chunk; importable by name in a fresh process.
            chunks: Portions, as `chunks` makes them.

        Yields:
            Each chunk, or a part of it, with its outcomes, as they come.

        Raises:
            ConfigError: dask is not installed, the scheduler cannot be reached or is
                lost, or its workers cannot run pushfit.
        """
        if self.is_here:
            yield from ((chunk, work(chunk)) for chunk in chunks)
        elif chunks:
            yield from _on_cluster(work, chunks, self)


def _on_cluster(
    work: Work[Outcome], chunks: Sequence[Chunk], workers: Workers
) -> Generator[tuple[Chunk, Sequence[Outcome | ItemFailure]]]:
    guarded = partial(_guarded, work, workers.time_limit)
    waiting = list(chunks)
    with _client(workers) as client:
        # All chunks at once, then all items at once, then one item after the other.
        for is_split, is_alone in ((False, False), (True, False), (True, True)):
            if is_split:
                waiting = [(item,) for chunk in waiting for item in chunk]
            lost = []
            for batch in [[chunk] for chunk in waiting] if is_alone else [waiting]:
                for chunk, found in _finished(client, guarded, batch):
                    if found is None:
                        lost.append(chunk)
                    else:
                        yield chunk, found
            waiting = lost
    for chunk in waiting:
        yield chunk, [_died(item.name, workers.time_limit) for item in chunk]


def _finished(
    client: "Client", work: Work[Outcome], chunks: Iterable[Chunk]
) -> Iterator[tuple[Chunk, Sequence[Outcome | ItemFailure] | None]]:
    """Chunks as they end; None for those whose worker died."""
    from distributed import KilledWorker, as_completed

    futures = {client.submit(work, chunk, pure=False): chunk for chunk in chunks}
    for future in as_completed(list(futures), loop=client.loop):
        chunk = futures.pop(future)
        if future.status == "finished":
            yield chunk, future.result()
            continue
        error = None if future.status == "cancelled" else future.exception()
        if error is None:
            raise ConfigError(
                "the scheduler was lost; what is finished is kept, and the same "
                "command goes on from there",
                code="scheduler_lost",
            )
        if not isinstance(error, KilledWorker):
            raise ConfigError(
                f"the workers cannot run pushfit ({type(error).__name__}: {error}); "
                "install the same version and its files where they run",
                code="worker_unusable",
            )
        yield chunk, None


def _guarded(
    work: Work[Outcome], time_limit: float | None, chunk: Chunk
) -> Sequence[Outcome | ItemFailure]:
    """Work under a time limit, at which the process ends."""
    if time_limit is None:
        return work(chunk)
    with open(os.devnull, "w") as nowhere:
        # A thread in C, which also ends a process that is stuck in C itself.
        faulthandler.dump_traceback_later(
            time_limit * len(chunk), exit=True, file=nowhere
        )
        try:
            return work(chunk)
        finally:
            faulthandler.cancel_dump_traceback_later()


def _died(item: str, time_limit: float | None) -> ItemFailure:
    """What is known of an item whose worker died every time."""
    limit = "" if time_limit is None else f", or it took longer than {time_limit:g} s"
    return ItemFailure(
        item=item,
        stage="worker",
        code="worker_died",
        message=f"the worker process died whenever it worked on this item{limit}; "
        "identify it by itself to see more",
    )


@contextlib.contextmanager
def _client(workers: Workers) -> Iterator["Client"]:
    """Connection to a cluster, that of the user or one for this run."""
    if find_spec("distributed") is None:
        raise ConfigError(
            "worker processes need dask.distributed, which is not installed; "
            f"{installed_by('distributed')}, or do without `workers`",
            code="no_distributed",
        )
    from dask import config
    from distributed import Client, LocalCluster

    if not logging.getLogger("pushfit").isEnabledFor(logging.DEBUG):
        for name in TALKATIVE:
            logging.getLogger(name).setLevel(logging.CRITICAL)
    settings = {
        "distributed.nanny.pre-spawn-environ": ENVIRONMENT,
        # A chunk that took too long would take as long again.
        "distributed.scheduler.allowed-failures": 0
        if workers.time_limit is not None
        else 1,
        # No chunk waits at a worker that may die.
        "distributed.scheduler.worker-saturation": 1.0,
        "distributed.worker.multiprocessing-method": "spawn",
        "distributed.worker.preload": [DEAF],
    }
    with contextlib.ExitStack() as stack:
        if workers.scheduler is None:
            stack.enter_context(config.set(settings))
            scratch = stack.enter_context(tempfile.TemporaryDirectory())
            stack.enter_context(unfinished(Path(scratch)))
            cluster = LocalCluster(
                n_workers=workers.n,
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                # Any free port: a fixed one may be taken.
                dashboard_address="127.0.0.1:0",
                local_directory=scratch,
            )
            address = stack.enter_context(cluster)
        else:
            address = workers.scheduler
        try:
            client = Client(address, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError) as error:
            raise ConfigError(
                f"{workers.scheduler}: no scheduler answers ({error}); start one by "
                "`dask scheduler` and name its address, such as tcp://host:8786",
                code="no_scheduler",
            ) from error
        yield stack.enter_context(client)
