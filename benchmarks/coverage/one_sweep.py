"""How often intervals and sets of θ_c hold the truth, over truths from the priors.

    python -m benchmarks.coverage.one_sweep [--tables 1000] [--seed 0] [--noise 0.03]

One sweep of 17 elevations with three repeats. Every table has a truth of its own from
the default priors, and noise of 3 % of the tallest height of one firm grasp. Intervals
are equal-tailed ones of the sweep, sets those of the profile likelihood. An
interval averages over the priors as the truths do, so it holds the truth as often as
it says; a set promises that only for many data and a smooth likelihood, so what it
really does is printed beside it. Interrupted, the run prints what it has.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.tables import CONFIG, FIRM, GRASP, PUSH_LENGTH
from pushfit.data.simulate import simulate_table
from pushfit.fit.coverage import PROBS, simulate_tables
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import Fitted
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.derived import equal_tailed_interval
from pushfit.fit.profiles.profile_sets import profile_set
from pushfit.fit.results import FitStatus, Identification, Piece

# Between 0° and 90°, where either the sine or the cosine says nothing [rad].
THETA = np.radians(np.arange(5.0, 90.0, 5.0))
# Repeats as in the paper; noise as a share of the tallest height.
REPEATS, NOISE = 3, 0.03
# Of the firm grasp [N]; 3 % of it is the noise of every table.
TALLEST = 520 * PUSH_LENGTH
# What is counted, and what it is called in print.
QUANTITIES = ("theta_c", "A", "B", "C_rr")
WORDS = {"interval": "interval", "set": "profile set"}
# Probability of the binomial limits that a right count keeps.
LIMITS_PROB = 0.999

# One table's answers: (quantity, kind, prob) -> whether it holds the truth.
Answers = dict[tuple[str, str, float], bool]


def pushes(noise: float = NOISE) -> Fitted:
    """The sweep with its noise, fitted once."""
    table = simulate_table(
        FIRM,
        GRASP,
        theta=THETA,
        alpha=0.0,
        repeats=REPEATS,
        noise=noise * TALLEST,
        rng=np.random.default_rng(0),
        state_sd=True,
    )
    return fit_table(table, CONFIG)


def answers(found: Identification, truth: dict[str, float]) -> Answers:
    """What both kinds of statement say of one table."""
    held = {}
    for name in QUANTITIES:
        draws = found.posterior.samples[name]
        for prob in PROBS:
            interval = equal_tailed_interval(draws, prob)
            held[name, "interval", prob] = is_held((interval,), truth[name])
            if name == "theta_c":
                pieces = profile_set(found.profiles[name], prob)
                held[name, "set", prob] = is_held(pieces, truth[name])
    return held


def is_held(pieces: tuple[Piece, ...], truth: float) -> bool:
    """Whether a piece holds the truth; an open end holds everything beyond."""
    return any(
        (-np.inf if low is None else low) <= truth <= (np.inf if high is None else high)
        for low, high in pieces
    )


def run(
    n_tables: int, seed: int, noise: float
) -> Iterator[tuple[float, Answers | None]]:
    """True θ_c and answers of table after table; None where there is no result."""
    simulation = simulate_tables(pushes(noise), n_tables, np.random.default_rng(seed))
    for index, table in enumerate(simulation.tables):
        result = identify_table(
            table, CONFIG, seed=seed + index, engine="sweep", is_brief=True
        )
        truth = {n: float(simulation.truths[n][index]) for n in QUANTITIES}
        is_usable = result.status is FitStatus.OK
        yield truth["theta_c"], answers(result, truth) if is_usable else None


def summary(found: list[tuple[float, Answers | None]]) -> str:
    """One line for each quantity and kind, one column for each probability."""
    lowest, highest = np.degrees(THETA[[0, -1]])
    hits = defaultdict(list)
    for theta_c, held in found:
        for (name, kind, prob), is_hit in (held or {}).items():
            hits[name, WORDS[kind], prob].append(is_hit)
            if name == "theta_c":
                is_between = lowest < theta_c < highest
                where = "between pushes" if is_between else "beyond them"
                hits[f"theta_c {where}", WORDS[kind], prob].append(is_hit)
    cells = defaultdict(dict)
    for (name, kind, prob), of_this in sorted(hits.items()):
        n, n_held = len(of_this), sum(of_this)
        low, high = stats.binom.interval(LIMITS_PROB, n, prob)
        mark = "" if low <= n_held <= high else " *"
        row = cells[name, kind]
        row["tables"] = n
        row[f"{prob:.0%}"] = f"{n_held / n:.3f}{mark}"
        row[f"limits of {prob:.0%}"] = f"{low / n:.3f}-{high / n:.3f}"
    n_failed = sum(held is None for _, held in found)
    table = pd.DataFrame.from_dict(cells, orient="index").to_string()
    return f"{table}\n{len(found)} tables, {n_failed} without a result; * beyond limits"


def main() -> None:
    """Print the coverage of every quantity."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--noise", type=float, default=NOISE)
    options = parser.parse_args()
    found = []
    try:
        for result in run(options.tables, options.seed, options.noise):
            found.append(result)
            if len(found) % 50 == 0:
                print(summary(found), file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    print(summary(found))


if __name__ == "__main__":
    main()
