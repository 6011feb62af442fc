"""How often intervals and likelihood sets hold the truth, for any kind in the tests.

    python -m benchmarks.coverage.kinds [--kind paper] [--tables 1000] [--seed 0]

Truths are drawn from the priors and heights from the model; noise is that of the kind.
Prints coverage of θ_c and α* by intervals of the sweep, and of θ_c by likelihood sets,
beside what binomial scatter allows once in a thousand, how many tables needed a fitted
mixture or were not to be trusted, and the time.
"""

import argparse
import time

import numpy as np
from scipy import stats

from benchmarks.tables import prior_problems
from pushfit.fit.coverage import holds
from pushfit.fit.problem.derived import equal_tailed_interval, samples_mapping
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.profiles.profile_sets import profile_set
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.fit.results import Piece
from pushfit.fit.sweep.posterior import N_RETURNED, weighted_draws
from pushfit.fit.sweep.prior import make_target
from tests.fit.kinds import KINDS

# Azimuth of θ_c, across the supports, and those of α*: all axes [rad].
ALPHA, REACH = np.pi / 2, (0.0, np.pi)
# Probabilities that people quote.
PROBS = (0.5, 0.9, 0.95)
# Chance that right intervals leave the limits.
ALARM = 1e-3


def is_inside(interval: tuple[float, float], truth: float, *, is_axis: bool) -> bool:
    """Whether an interval, of an axis modulo 180°, holds a truth."""
    low, high = interval
    if is_axis:
        return (truth - low) % 180.0 <= high - low
    return low <= truth <= high


def likelihood_sets(setup: Setup) -> dict[float, tuple[Piece, ...]]:
    """Those of θ_c at each level, with the noise settled."""
    setup = settle_noise(setup, ALPHA)
    fit = fit_least_squares(setup, reference_alpha=ALPHA, throw=False)
    found = likelihood_profiles(
        setup,
        fit,
        reference_alpha=ALPHA,
        prob=max(PROBS),
        reach=REACH,
        wanted=("theta_c",),
    )
    return {prob: profile_set(found["theta_c"], prob) for prob in PROBS}


def main() -> None:
    """Print one line for each angle, kind of set and level."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--kind", default="paper", choices=KINDS)
    parser.add_argument("--tables", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    hits: dict[tuple[str, float], list[bool]] = {}
    n_refined = n_lost = 0
    start = time.perf_counter()
    drawn = prior_problems(options.kind, options.tables, rng)
    for i, (setup, truth) in enumerate(drawn):
        data = setup.problem
        truths = samples_mapping(data, truth[None], ALPHA, reach=REACH)
        theta_c = float(truths["theta_c"][0])
        if np.isfinite(theta_c):
            for prob, pieces in likelihood_sets(setup).items():
                held = holds(pieces, theta_c)
                hits.setdefault(("theta_c, likelihood", prob), []).append(held)
        found = weighted_draws(make_target(data, ALPHA), seed=options.seed + i)
        n_refined += found.n_refinements > 0
        if not found.is_trusted:
            n_lost += 1
            continue
        points, _ = found.resampled(N_RETURNED, rng)
        samples = samples_mapping(data, points, ALPHA, reach=REACH)
        for name in ("theta_c", "alpha_star"):
            if name not in samples or not np.isfinite(truths[name][0]):
                continue
            is_axis = name == "alpha_star"
            for prob in PROBS:
                interval = equal_tailed_interval(samples[name], prob, is_axis=is_axis)
                held = is_inside(interval, float(truths[name][0]), is_axis=is_axis)
                hits.setdefault((name, prob), []).append(held)
    seconds = time.perf_counter() - start
    print(
        f"{options.tables} tables of kind {options.kind}: {n_refined} refined, ", end=""
    )
    print(f"{n_lost} not trusted, {1e3 * seconds / options.tables:.0f} ms per table")
    print("| angle | level | coverage | limits | tables |\n|---|---|---|---|---|")
    for (name, prob), held in hits.items():
        low, high = stats.binom.ppf([ALARM / 2, 1 - ALARM / 2], len(held), prob)
        limits = f"{low / len(held):.3f} to {high / len(held):.3f}"
        print(f"| {name} | {prob} | {np.mean(held):.3f} | {limits} | {len(held)} |")


if __name__ == "__main__":
    enable_compile_cache()
    main()
