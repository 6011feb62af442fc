"""Two programs in turns, and one table of all that was measured.

Rounds alternate between pushfit and its peer, so that whatever else the machine does
hits both; the ratio is the median over the rounds. Times are processor times: what one
core has to do, on both sides.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from pushfit.fit.programs.folder import enable_compile_cache

# Before any test imports JAX, so that a second run compiles nothing.
enable_compile_cache()

# What a call did: tables, effective draws, rows. Cost is time divided by it.
Work = Callable[[], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One comparison.

    Args:
        what: What pushfit does.
        peer: What it is compared with.
        seconds: Median processor time of both for a unit of work [s].
        ratio: Time of the peer over that of pushfit, or the inverse if `is_cost`.
        is_cost: Whether the target is an upper limit.
        target: Bound on the ratio; None without one.
    """

    what: str
    peer: str
    seconds: tuple[float, float]
    ratio: float
    is_cost: bool
    target: float | None

    def cells(self) -> tuple[str, ...]:
        """The row as text."""
        bound = ""
        if self.target is not None:
            is_met = (self.ratio <= self.target) == self.is_cost
            sign = "≤" if self.is_cost else "≥"
            bound = f"{sign} {self.target:g}, {'met' if is_met else 'missed'}"
        ours, other = (
            f"{value:.3g} s" if value >= 1 else f"{1e3 * value:.3g} ms"
            for value in self.seconds
        )
        return self.what, ours, self.peer, other, f"{self.ratio:.3g}", bound


# What benchmarks have printed so far, for the table at the end.
ROWS = pytest.StashKey[list[Row]]()
HEADER = ("what", "pushfit", "peer", "time", "ratio", "target")


@pytest.fixture
def compare(benchmark, request) -> Callable[..., None]:
    """Times pushfit against a peer, in turns."""

    def measure(
        ours: tuple[str, Work],
        peer: tuple[str, Work],
        *,
        rounds: int,
        target: float | None = None,
        is_cost: bool = False,
        is_peer_warm: bool = False,
    ) -> None:
        (what, run), (other, run_peer) = ours, peer
        # What is loaded or compiled once does not count.
        run()
        if not is_peer_warm:
            run_peer()
        done, costs = [], []

        def turn_of_peer() -> None:
            start = time.process_time()
            amount = run_peer()
            costs.append((time.process_time() - start) / amount)

        benchmark.pedantic(
            lambda: done.append(run()), setup=turn_of_peer, rounds=rounds
        )
        own = np.array(benchmark.stats.stats.data) / np.array(done)
        ratios = own / costs if is_cost else costs / own
        row = Row(
            what=what,
            peer=other,
            seconds=(float(np.median(own)), float(np.median(costs))),
            ratio=float(np.median(ratios)),
            is_cost=is_cost,
            target=target,
        )
        benchmark.extra_info["ratio"] = row.ratio
        request.config.stash.setdefault(ROWS, []).append(row)

    return measure


def pytest_terminal_summary(terminalreporter, config) -> None:
    """One table of all comparisons."""
    rows = [row.cells() for row in config.stash.get(ROWS, [])]
    for cells in (HEADER, tuple("---" for _ in HEADER), *rows) if rows else ():
        terminalreporter.write_line(f"| {' | '.join(cells)} |")
