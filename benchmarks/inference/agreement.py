"""How far answers by the sweep are from those of emcee, for every kind in the tests.

    python -m benchmarks.inference.agreement
        [--tables 6] [--kinds paper tilting] [--worst 10]

Truths are drawn from the priors. Both share the model and the priors, nothing else:
emcee runs until its own diagnostics pass, and the evidence beside it is that of draws
from a mixture fitted to its chain. Compared are mean and standard deviation of θ_c and
of every sampling coordinate, in standard deviations, and the log evidence. Prints of
each table whether any differs by more than Monte-Carlo error and the limit allow, and
the worst of all. Chains seldom visit a far tail, and their error does not know of it;
so what differs is compared with a third one, many draws of the sweep alone, which no
mixture proposes.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass

import jax
import numpy as np
from arviz_stats.base.array import array_stats
from jaxtyping import Float

from benchmarks.tables import prior_problems
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.programs.compile import in_chunks
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.fit.results import FitStatus, PosteriorResult
from pushfit.fit.sampler.emcee_posterior import sample_posterior
from pushfit.fit.sampler.mixture import fit_mixture
from pushfit.fit.sweep import posterior
from pushfit.fit.sweep.draws import n_uniforms
from pushfit.fit.sweep.posterior import WeightedDraws, weighted_draws
from pushfit.fit.sweep.prior import make_target
from pushfit.fit.sweep.target import Target
from pushfit.model import as_float
from tests.fit.kinds import KINDS

# Azimuth of θ_c, across the supports, and those of α*: all axes [rad].
ALPHA, REACH = np.pi / 2, (0.0, np.pi)
# Runs of the sweep whose answers are averaged: its own error is then below the limit.
N_SWEEPS = 4
# Of the chain that a mixture is fitted to, draws from it, and of these in one call.
N_FITTED, N_PROPOSED, N_ROWS = 8192, 32768, 4096
# Calls of the sweep alone where it differs from a chain.
N_CALLS = 128
# Largest difference of a mean or a standard deviation [standard deviations], and how
# many standard errors come on top.
LIMIT, N_ERRORS = 0.03, 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Sweep less emcee.

    Args:
        table: Kind and number of the table.
        what: Quantity and statistic.
        value: Difference.
        error: Its Monte-Carlo standard error.
        limit: What it may be without any error.
    """

    table: str
    what: str
    value: float
    error: float
    limit: float

    @property
    def is_miss(self) -> bool:
        """Whether Monte-Carlo error does not explain it."""
        return abs(self.value) > self.limit + N_ERRORS * self.error


def quantities(
    problem: Problem, x: Float[np.ndarray, "n p"]
) -> dict[str, Float[np.ndarray, " n"]]:
    """θ_c [deg], 0 where the contact never rolls, and all sampling coordinates."""
    angles = samples_mapping(problem, x, ALPHA, reach=REACH)["theta_c"]
    named = dict(zip(problem.names, x.T, strict=True))
    return {"theta_c": np.nan_to_num(angles)} | named


def differences(
    table: str, problem: Problem, sweeps: list[WeightedDraws], chain: PosteriorResult
) -> Iterator[Difference]:
    """Differences of means and standard deviations."""
    assert chain.chain is not None
    # Ensembles, walkers, steps: one row of steps for each walker.
    walkers = chain.chain.reshape(-1, *chain.chain.shape[-2:])
    theirs = quantities(problem, walkers.reshape(-1, walkers.shape[-1]))
    mine = [quantities(problem, one.x) for one in sweeps]
    weights = np.concatenate([np.exp(one.log_weights) for one in sweeps]) / len(sweeps)
    ess = sum(one.ess for one in sweeps)
    for name, values in theirs.items():
        centre, sd = values.mean(), values.std()
        swept = (np.concatenate([one[name] for one in mine]) - centre) / sd
        drawn = (values - centre).reshape(walkers.shape[:2]) / sd
        for what, power in (("mean", 1), ("sd", 2)):
            # The change of a variance is twice that of the standard deviation.
            one, other = swept**power / power, drawn**power / power
            mean = np.sum(weights * one)
            spread = np.sqrt(np.sum(weights * (one - mean) ** 2))
            error = array_stats.mcse(other, method="mean")
            yield Difference(
                table=table,
                what=f"{what} of {name}",
                value=float(mean - other.mean()),
                error=float(np.hypot(error, spread / np.sqrt(ess))),
                limit=LIMIT,
            )


def evidence(
    problem: Problem, chain: PosteriorResult, rng: np.random.Generator
) -> tuple[float, float]:
    """Log evidence by draws from a mixture that resembles a chain, and its error."""
    assert chain.chain is not None
    points = chain.chain.reshape(-1, chain.chain.shape[-1])
    mixture = fit_mixture(rng.permutation(points)[:N_FITTED], rng)
    x = mixture.sample(np.random.RandomState(rng.integers(2**31)), N_PROPOSED)
    log_prob = in_chunks(jax.jit(jax.vmap(problem.log_prob)), x, N_ROWS)
    log_weight = np.asarray(log_prob) - mixture.log_density(x)
    ratio = np.exp(log_weight - np.max(log_weight))
    error = ratio.std() / ratio.mean() / np.sqrt(ratio.size)
    return float(np.log(ratio.mean()) + np.max(log_weight)), float(error)


def by_the_sweep_alone(target: Target, rng: np.random.Generator) -> WeightedDraws:
    """Draws that the sweep proposes, however few of them count."""
    sheet = posterior._sheet(target)
    shifts = rng.uniform(size=(N_CALLS, n_uniforms(target)))
    parts = [posterior._draws(target, sheet, as_float(shift)) for shift in shifts]
    draws = jax.tree.map(lambda *a: np.concatenate(a), *parts)
    return posterior._weighed(draws.x, draws.log_prob, draws.log_weight)


def compared(table: str, setup: Setup, seed: int) -> list[Difference] | str:
    """Differences of one table, or why there are none; prints what a third one says."""
    problem = setup.problem
    target = make_target(problem, ALPHA)
    sweeps = [weighted_draws(target, seed=seed + i) for i in range(N_SWEEPS)]
    if not all(one.is_trusted for one in sweeps):
        return "the sweep says that it is not to be trusted"
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    chain = sample_posterior(setup, fit, seed=seed, reference_alpha=ALPHA, reach=REACH)
    if chain.status is not FitStatus.OK:
        return "emcee did not converge"
    found = list(_all_differences(table, problem, sweeps, chain, seed))
    missed = {one.what: one.value for one in found if one.is_miss}
    if missed:
        alone = by_the_sweep_alone(target, np.random.default_rng([seed, 4]))
        print(f"{table}: {alone.ess:.0f} of {len(alone.x)} draws of the sweep count")
        for one in differences(table, problem, [alone], chain):
            if one.what in missed:
                third = f"{one.value:+.3f} +- {one.error:.3f}"
                print(f"  {one.what} {missed[one.what]:+.3f}, by these {third}")
    return found


def _all_differences(
    table: str,
    problem: Problem,
    sweeps: list[WeightedDraws],
    chain: PosteriorResult,
    seed: int,
) -> Iterator[Difference]:
    yield from differences(table, problem, sweeps, chain)
    value, error = evidence(problem, chain, np.random.default_rng([seed, 3]))
    # Independent estimates of one number.
    swept = np.mean([one.log_evidence for one in sweeps])
    own = np.sqrt(np.sum([one.log_evidence_error**2 for one in sweeps])) / N_SWEEPS
    yield Difference(
        table=table,
        what="log evidence",
        value=float(swept - value),
        error=float(np.hypot(own, error)),
        limit=0.0,
    )


def main() -> None:
    """Print tables that were left out, misses, and the worst differences."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=6, help="of each kind")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument("--worst", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found: list[Difference] = []
    n_compared = 0
    for kind in options.kinds:
        rng = np.random.default_rng(options.seed)
        for i, (setup, _) in enumerate(prior_problems(kind, options.tables, rng)):
            answer = compared(f"{kind} {i}", setup, options.seed + 100 * i)
            if isinstance(answer, str):
                print(f"{kind} {i}: {answer}", flush=True)
                continue
            own = sorted(answer, key=lambda one: -abs(one.value))
            word = "a miss" if any(one.is_miss for one in own) else "agrees"
            worst = f"{own[0].value:+.3f}, {own[0].what}"
            print(f"{kind} {i}: {word}; {worst}", flush=True)
            found += own
            n_compared += 1
    n_missed = len({one.table for one in found if one.is_miss})
    print(f"{n_compared} tables compared, {n_missed} differ by more than is allowed")
    print("\n| table | quantity | difference | Monte-Carlo error |\n|---|---|---|---|")
    found.sort(key=lambda one: -abs(one.value))
    for one in found[: options.worst]:
        print(f"| {one.table} | {one.what} | {one.value:+.3f} | {one.error:.3f} |")


if __name__ == "__main__":
    enable_compile_cache()
    main()
