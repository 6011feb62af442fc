"""What a posterior by the sweep costs, for every kind of problem in the tests.

    python -m benchmarks.sweep_cost [--seeds 8] [--kinds paper tilting]

Per kind: seconds of the first table, compiling included; median and largest
milliseconds of the others; effective draws, Pareto k of the weights, and how many
tables needed a fitted mixture.
"""

import argparse
import time

import numpy as np

from pushfit.fit.sweep.posterior import N_REFINED, weighted_draws
from pushfit.fit.sweep.prior import make_target
from tests.fit.kinds import KINDS


def main() -> None:
    """Print one line for each kind."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=KINDS)
    options = parser.parse_args()
    print("| kind | first | median | slowest | least ESS | largest k | refined |")
    print("|---|---|---|---|---|---|---|")
    for name in options.kinds:
        setups = [KINDS[name].setup(seed) for seed in range(options.seeds)]
        seconds, draws = [], []
        for seed, setup in enumerate(setups):
            start = time.perf_counter()
            target = make_target(setup.problem, np.pi / 2)
            draws.append(weighted_draws(target, seed=seed))
            seconds.append(time.perf_counter() - start)
        later = 1e3 * np.array(seconds[1:])
        n_refined = sum(len(found.x) == N_REFINED for found in draws)
        print(
            f"| {name} | {seconds[0]:.1f} s | {np.median(later):.0f} ms "
            f"| {np.max(later):.0f} ms | {min(d.ess for d in draws):.0f} "
            f"| {max(d.pareto_k for d in draws):.2f} | {n_refined} of {len(draws)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
