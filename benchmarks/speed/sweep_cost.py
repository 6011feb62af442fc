"""What a table costs by the sweep, for every kind of problem in the tests.

    python -m benchmarks.speed.sweep_cost [--seeds 8] [--kinds paper tilting]

Per kind, of posteriors: seconds of the first table, compiling included; median and
largest milliseconds of the others; effective draws, Pareto k of the weights, and how
many tables needed a fitted mixture. Then the first and the median of whole
identifications, as a batch makes them.
"""

import argparse
import time
from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.identify.identify_many import ItemResult, identify_many
from pushfit.fit.problem.setup import Setup
from pushfit.fit.sweep.posterior import WeightedDraws, weighted_draws
from pushfit.fit.sweep.prior import make_target
from tests.fit.kinds import KINDS
from tests.fit.tables import config

Item, Found = TypeVar("Item"), TypeVar("Found")


def timed(
    ask: Callable[[Item], Found], items: Iterable[Item]
) -> tuple[list[Found], Float[np.ndarray, " n"]]:
    """Answers, and the seconds that each took."""
    found, seconds = [], []
    for item in items:
        start = time.perf_counter()
        found.append(ask(item))
        seconds.append(time.perf_counter() - start)
    return found, np.array(seconds)


def posterior(item: tuple[int, Setup]) -> WeightedDraws:
    """Weighted draws of a problem."""
    seed, setup = item
    return weighted_draws(make_target(setup.problem, np.pi / 2), seed=seed)


def identification(table: PeakTable, settings: GraspConfig) -> ItemResult:
    """A row of results."""
    (found,) = identify_many([table], settings, seeds=[0], engine="sweep")
    if isinstance(found, PushfitError):
        raise found
    return found


def main() -> None:
    """Print one line for each kind."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=KINDS)
    options = parser.parse_args()
    print(
        "| kind | first | median | slowest | least ESS | largest k | refined "
        "| whole, first | whole, median |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for name in options.kinds:
        kind = KINDS[name]
        tables = [kind.table(seed) for seed in range(options.seeds)]
        settings = config(kind.text)
        setups = [kind.setup(seed) for seed in range(options.seeds)]
        draws, seconds = timed(posterior, enumerate(setups))
        later = 1e3 * seconds[1:]
        _, whole = timed(partial(identification, settings=settings), tables)
        n_refined = sum(found.n_refinements > 0 for found in draws)
        print(
            f"| {name} | {seconds[0]:.1f} s | {np.median(later):.0f} ms "
            f"| {np.max(later):.0f} ms | {min(d.ess for d in draws):.0f} "
            f"| {max(d.pareto_k for d in draws):.2f} | {n_refined} of {len(draws)} "
            f"| {whole[0]:.1f} s | {1e3 * np.median(whole[1:]):.0f} ms |",
            flush=True,
        )


if __name__ == "__main__":
    main()
