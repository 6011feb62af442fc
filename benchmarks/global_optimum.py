"""How often least squares misses the best fit that many random starts find.

    python -m benchmarks.global_optimum [--tables 200] [--starts 32] [--seed 0]

Tables of 27 pushes, 9 elevations with three repeats, have truths from the priors.
Starts are drawn from the priors too and polished by the solver of single tables. A miss
is a fit that is worse by more than 0.5 in half its chi-square; where the random starts
are the worse ones is counted beside it, because they may miss too. So is lmfit, from
one start at the medians of the priors.
"""

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float
from pushfit.fit.lane_fit import fit_lanes
from pushfit.fit.lane_profile import profile_lanes
from pushfit.fit.lane_results import N_LANES, Ready

from benchmarks import tables
from benchmarks.peers import MEDIANS, SPREADS, arrays, combined, fit_by_lmfit
from pushfit.fit.least_squares import polish

N_ANGLES, REPEATS = 9, 3
# A likelihood ratio of exp(0.5): less than this nobody would notice.
MISS = 0.5


def by_lanes(items: Sequence[Ready]) -> tuple[np.ndarray, np.ndarray]:
    """Least misfits of the fits alone, and of fits and profiles."""
    padded = [*items, *items[-1:] * (N_LANES - len(items))]
    lanes = tables.stacked(padded)
    fits = fit_lanes(lanes)
    fit, profile = (
        np.min(np.asarray(values), axis=1)[: len(items)]
        for values in (fits.chi_square, profile_lanes(lanes, fits).misfit)
    )
    # A lane leaves out what no parameter changes: the scatter of the repeats.
    within = np.array([np.sum(item.lane.within) for item in items])
    return fit + within, np.minimum(fit + within, profile)


def by_random_starts(
    item: Ready, n_starts: int, rng: np.random.Generator
) -> Float[np.ndarray, " k"]:
    """Sums of squares that starts from the priors end in, best first."""
    logs = MEDIANS + SPREADS * rng.standard_normal((n_starts, MEDIANS.size))
    columns = dict(zip(("ln_A", "ln_B", "ln_C_rr"), combined(logs).T, strict=True))
    problem = item.setup.problem
    starts = np.stack([columns[name] for name in problem.data_names], axis=1)
    _, costs, _ = polish(problem, starts)
    return costs


def differences(
    n_tables: int, n_starts: int, seed: int
) -> Iterator[tuple[float, float, float]]:
    """Half the chi-square of fit, of fit and profile, and of lmfit.

    Each is less that of the best of all random starts.
    """
    rng = np.random.default_rng(seed)
    simulated = tables.prior_tables(
        n_tables, n_angles=N_ANGLES, repeats=REPEATS, seed=seed
    )
    for first in range(0, n_tables, N_LANES):
        items = tables.in_lanes(simulated[first : first + N_LANES])
        fits, profiles = by_lanes(items)
        for item, fit, profile in zip(items, fits, profiles, strict=True):
            random = by_random_starts(item, n_starts, rng)
            lmfit = 2 * fit_by_lmfit(arrays(item.table))
            yield tuple((np.array([fit, profile, lmfit]) - random[0]) / 2)


def main() -> None:
    """Print the shares."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--starts", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = np.array(list(differences(options.tables, options.starts, options.seed)))
    print(f"{options.tables} tables, {options.starts} random starts each")
    names = (
        "least squares in lanes",
        "the same with its profile",
        "lmfit from one start",
    )
    for name, column in zip(names, found.T, strict=True):
        print(
            f"{name}: {np.sum(column > MISS)} miss the best random start, "
            f"{np.sum(column < -MISS)} beat it; worst {np.max(column):.2g}"
        )


if __name__ == "__main__":
    main()
