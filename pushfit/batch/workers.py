"""Who works on a batch, and in which portions."""

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass

from pushfit.batch.cluster import Outcome, Work, on_cluster
from pushfit.batch.items import Failure, Item
from pushfit.batch.work import Chunk

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

    def chunks(self, items: Sequence[Item]) -> list[Chunk]:
        """Portions of items of one configuration.

        Returns:
            Chunks; neighbours are alike in size, and so in shape.
        """
        size = min(self.chunk, self._share(len(items)))
        groups: dict[str, list[Item]] = {}
        for item in sorted(items, key=lambda item: (item.size, item.key)):
            groups.setdefault(item.config.digest(), []).append(item)
        return [
            tuple(group[start : start + size])
            for group in groups.values()
            for start in range(0, len(group), size)
        ]

    def _share(self, n_items: int) -> int:
        return max(math.ceil(n_items / (SHARES * self.n)), 1)

    def work_on(
        self, work: Work[Outcome], chunks: Sequence[Chunk]
    ) -> Generator[tuple[Chunk, Sequence[Outcome | Failure]]]:
        """Do the work, here or elsewhere.

        Yields:
            Each chunk, or a part of it, with its outcomes, as they come.

        Raises:
            ConfigError: The workers cannot be had or cannot work.
        """
        if not chunks:
            return
        is_here = self.n == 1 and self.scheduler is None
        if is_here and self.time_limit is None:
            for chunk in chunks:
                yield chunk, work(chunk)
            return
        yield from on_cluster(
            work,
            chunks,
            workers=self.n,
            scheduler=self.scheduler,
            time_limit=self.time_limit,
        )
