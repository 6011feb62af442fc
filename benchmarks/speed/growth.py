"""How the cost grows with tables, rows and worker processes.

    python -m benchmarks.speed.growth [--tables 32 128 512] [--workers 1 2] [--items 64]

Tables go from their heights to the draws of their posteriors; the host's part poses
their problems, the compiled part fits them and sweeps their posteriors.
Times are processor times, the smallest of the rounds. Workers are those of `pushfit
batch` on a folder of tables, by the clock, start and all, its programs compiled by a
run before.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks import tables
from pushfit.data.tables.peak_table import PeakTable, write_table
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.fit.sweep.posterior import sweep_posterior

# Elevations and repeats: 17, 51 and 204 rows of the same directions, then 204 of more.
DESIGNS = ((17, 1), (17, 3), (17, 12), (68, 3))
# Of all designs in turns, so that whatever else runs hits all of them.
ROUNDS = 3
# Tables that compile everything, and those of each design.
N_WARM, N_ROWS = 2, 32
CONFIG_TEXT = f"[push]\nlength_mm = {1000 * tables.PUSH_LENGTH}\n{tables.HARD}"


def costs(simulated: Sequence[PeakTable]) -> tuple[float, float]:
    """Processor time per table of the host's part and of the compiled part [s]."""
    start = time.process_time()
    setups = tables.setups(simulated)
    host = time.process_time() - start
    start = time.process_time()
    for setup in setups:
        fit_least_squares(setup, reference_alpha=0.0)
        sweep_posterior(setup, seed=0, reference_alpha=0.0, reach=(0.0, np.pi))
    return host / len(setups), (time.process_time() - start) / len(setups)


def print_costs(what: str, groups: dict[str, Sequence[PeakTable]]) -> None:
    """One line for each group, the groups in turns."""
    for simulated in groups.values():
        costs(simulated[:N_WARM])
    rounds = [[costs(group) for group in groups.values()] for _ in range(ROUNDS)]
    best = 1e3 * np.min(rounds, axis=0)
    print(f"| {what} | host, per table | compiled, per table |\n|---|---|---|")
    for name, (host, compiled) in zip(groups, best, strict=True):
        print(f"| {name} | {host:.1f} ms | {compiled:.1f} ms |")


def seconds_of_batch(folder: Path, n_workers: int) -> float:
    """Duration of a batch over a folder of tables [s]."""
    with tempfile.TemporaryDirectory() as results:
        command = [sys.executable, "-m", "pushfit", "batch", str(folder / "tables")]
        command += ["--config", str(folder / "grasp.toml"), "--out", results]
        command += ["--workers", str(n_workers), "--quiet"]
        start = time.perf_counter()
        subprocess.run(command, check=True)
        return time.perf_counter() - start


def print_workers(n_items: int, workers: Sequence[int]) -> None:
    """Durations of a batch by the number of its workers."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "tables").mkdir()
        (folder / "grasp.toml").write_text(CONFIG_TEXT)
        for index, table in enumerate(tables.prior_tables(n_items)):
            write_table(table, folder / "tables" / f"{index}.csv")
        seconds_of_batch(folder, 1)
        print(f"| workers, {n_items} tables | seconds |\n|---|---|")
        for n in workers:
            print(f"| {n} | {seconds_of_batch(folder, n):.1f} |")


def main() -> None:
    """Print three tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, nargs="*", default=[32, 128, 512])
    parser.add_argument("--workers", type=int, nargs="*", default=[1, 2])
    parser.add_argument("--items", type=int, default=64)
    options = parser.parse_args()
    if options.tables:
        simulated = tables.prior_tables(max(options.tables))
        print_costs("tables", {str(n): simulated[:n] for n in options.tables})
        by_rows = {
            f"{n * repeats} in {n} directions": tables.prior_tables(
                N_ROWS, n_angles=n, repeats=repeats
            )
            for n, repeats in DESIGNS
        }
        print_costs("rows", by_rows)
    if options.workers:
        print_workers(options.items, options.workers)


if __name__ == "__main__":
    enable_compile_cache()
    main()
