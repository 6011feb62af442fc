"""Many tables through `pushfit batch`: time, memory, and what its answers are worth.

    python -m benchmarks.coverage.batch [--tables 10000] [--workers 2] [--seed 1]
    python -m benchmarks.coverage.batch --kind paper --tables 1000 [--kill 120]

Truths are drawn from the default priors and pushed in one sweep of 17 elevations with
three repeats, as in `benchmarks.coverage.one_sweep`, or by the pushes and settings of a
kind of the tests' registry, the transition open. All tables go into one long table
and through the command line, killed on the way if that is asked for, and begun again;
what is counted are the intervals and sets of θ_c that its results.csv quotes, and how
often it quotes none.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.coverage.one_sweep import LIMITS_PROB, is_held, pushes
from benchmarks.tables import HARD, PUSH_LENGTH
from pushfit.config import parse_config
from pushfit.fit.coverage import simulate_tables
from pushfit.fit.identify.fit_table import fit_table
from tests.fit.kinds import KINDS

# Of the intervals and sets that pushfit quotes by default.
PROB = 0.9
# The push length of `one_sweep`, as a configuration states it.
PUSH = f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"


def write_tables(folder: Path, kind: str | None, n_tables: int, seed: int) -> pd.Series:
    """One long table and its settings; true θ_c by the name of the item."""
    fitted, settings = pushes(), PUSH + HARD
    if kind is not None:
        settings = PUSH + KINDS[kind].text
        # Truths are of the hard switch.
        hard = parse_config(settings + HARD, path="grasp.toml")
        fitted = fit_table(KINDS[kind].table(0), hard)
    simulation = simulate_tables(fitted, n_tables, np.random.default_rng(seed))
    frames = [
        table.frame.assign(grasp=f"{index:06d}")
        for index, table in enumerate(simulation.tables)
    ]
    path = folder / "tables.parquet"
    pd.concat(frames, ignore_index=True).to_parquet(path)
    (folder / "grasp.toml").write_text(settings, encoding="utf-8")
    names = [f"{index:06d}" for index in range(n_tables)]
    return pd.Series(simulation.truths["theta_c"], index=names)


def identified(
    folder: Path, n_workers: int, kill_after: float | None
) -> tuple[pd.DataFrame, float, float]:
    """Results of the command, its seconds, and the memory of its largest process."""
    command = [sys.executable, "-m", "pushfit", "batch", str(folder / "tables.parquet")]
    command += ["--out", str(folder / "out"), "--workers", str(n_workers)]
    start = time.perf_counter()
    if kill_after is not None:
        # With its workers, which have the same group.
        with subprocess.Popen(command, start_new_session=True) as process:
            time.sleep(kill_after)
            os.killpg(process.pid, signal.SIGKILL)
    subprocess.run(command, check=True)
    seconds = time.perf_counter() - start
    megabytes = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    rows = pd.read_csv(folder / "out" / "results.csv")
    rows.index = rows["item"].str.rsplit("#", n=1).str[-1]
    return rows, seconds, megabytes


def line(name: str, hits: list[bool]) -> str:
    """How many answers of a kind hold the truth."""
    if not hits:
        return f"{name:40} none"
    low, high = stats.binom.interval(LIMITS_PROB, len(hits), PROB)
    share, n = np.mean(hits), len(hits)
    return f"{name:40} {share:.3f} of {n} (limits {low / n:.3f}-{high / n:.3f})"


def report(rows: pd.DataFrame, truth: pd.Series) -> str:
    """Verdicts, and how often what is quoted holds the truth."""
    truth = truth[rows.index]
    quoted = rows["theta_c_low_deg"].notna()
    ends = rows[["theta_c_low_deg", "theta_c_high_deg"]].to_numpy()
    inside = (ends[:, 0] <= truth) & (truth <= ends[:, 1])
    sets = rows["theta_c_sets"].dropna()
    held = [is_held(tuple(json.loads(s)), truth[name]) for name, s in sets.items()]
    counts = rows["theta_c_verdict"].value_counts().to_string()
    return "\n".join(
        [
            counts,
            line("intervals quoted", inside[quoted].tolist()),
            line("sets quoted", held),
            f"{'engines':40} {rows['engine'].value_counts().to_dict()}",
        ]
    )


def main() -> None:
    """Print time, memory and coverage."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--kill", type=float, help="seconds after which to kill it")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        truth = write_tables(folder, options.kind, options.tables, options.seed)
        rows, seconds, megabytes = identified(folder, options.workers, options.kill)
    print(
        f"{options.tables} tables, {options.workers} workers: {seconds:.0f} s, "
        f"largest process {megabytes:.0f} MB"
    )
    print(report(rows, truth))


if __name__ == "__main__":
    main()
