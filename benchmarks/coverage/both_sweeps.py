"""How often intervals for θ_c and α* hold the truth, over tables drawn from the prior.

    python -m benchmarks.coverage.both_sweeps --tables 200

Each table has both of the paper's protocols (θ from 5° to 85° at α = 90°, α from 0° to
150° at θ = 15°), three repeats, and noise of 3 % of its tallest height. Truth and fit
share the default priors, so a correct sampler covers at its nominal rate.
"""

import argparse
import multiprocessing
from concurrent.futures import ProcessPoolExecutor

import numpy as np
import pandas as pd
from scipy import stats

from benchmarks.tables import CONFIG, GRASP
from pushfit.data.simulate import simulate_table
from pushfit.fit.problem.derived import equal_tailed_interval
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.results import FitStatus
from pushfit.fit.sampler.emcee_posterior import Budget, sample_posterior
from pushfit.mechanics.directions import best_direction, critical_angle
from pushfit.model import Parameters, Pushes, forward

# Probabilities that people quote.
PROBS = (0.5, 0.9, 0.95)
# Azimuths [rad]: all axes, and that of the sweep of θ, across the supports.
REACH = (0.0, np.pi)
REFERENCE_ALPHA = np.pi / 2
# A quarter of the walkers of a normal run: enough for an interval, and 200 times one.
BUDGET = Budget(n_ensembles=2, n_walkers=32)


def covered(seed: int) -> dict[str, list[bool]] | None:
    """Which intervals of one table hold its truth; None if the sampler gave up."""

    table, params = prior_table(np.random.default_rng(seed))
    setup = build_problem(table, CONFIG)
    words = {"reference_alpha": REFERENCE_ALPHA}
    fit = fit_least_squares(setup, throw=False, **words)
    posterior = sample_posterior(
        setup, fit, seed=seed, reach=REACH, budget=BUDGET, **words
    )
    if posterior.status is not FitStatus.OK:
        return None
    angles = {
        "theta_c": float(critical_angle(params, GRASP, REFERENCE_ALPHA)),
        "alpha_star": float(best_direction(params, GRASP, 0.26, reach=REACH)),
    }
    found = {}
    for name, truth in angles.items():
        is_axis = name == "alpha_star"
        found[name] = []
        for prob in PROBS:
            draws = posterior.samples[name]
            low, high = equal_tailed_interval(draws, prob, is_axis=is_axis)
            offset = np.degrees(truth) - low
            offset = offset % 180.0 if is_axis else offset
            found[name].append(bool(0 <= offset <= high - low))
    return found


def prior_table(rng: np.random.Generator):
    """A table of both protocols from one draw of the default priors."""

    values = {
        name: float(prior.sample(rng, 1)[0])
        for name, prior in default_priors(None).items()
    }
    params = Parameters(
        **{n: v if n in ("e1", "e2") else np.exp(v) for n, v in values.items()}
    )
    sweep = np.radians(np.arange(5.0, 86.0, 10.0))
    turn = np.radians(np.arange(0.0, 151.0, 30.0))
    theta = np.concatenate([sweep, np.full(turn.size, np.radians(15.0))])
    alpha = np.concatenate([np.full(sweep.size, np.pi / 2), turn])
    heights = np.asarray(forward(params, Pushes(theta, alpha), GRASP).height)
    table = simulate_table(
        params,
        GRASP,
        theta=theta,
        alpha=alpha,
        repeats=3,
        noise=0.03 * float(heights.max()),
        rng=rng,
        state_sd=True,
    )
    return table, params


def main() -> None:
    """Print measured coverage beside the 99.9 % binomial range of the nominal one."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    seeds = range(options.seed, options.seed + options.tables)
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(options.workers, mp_context=context) as pool:
        found = list(pool.map(covered, seeds))
    kept = [one for one in found if one is not None]
    rows = []
    for name in ("theta_c", "alpha_star"):
        for i, prob in enumerate(PROBS):
            share = np.mean([one[name][i] for one in kept])
            low, high = stats.binom.interval(0.999, len(kept), prob)
            limits = f"{low / len(kept):.3f}-{high / len(kept):.3f}"
            rows.append([name, f"{prob:.0%}", f"{share:.3f}", limits])
    columns = ["interval", "nominal", "measured", "99.9 % binomial"]
    print(pd.DataFrame(rows, columns=columns).to_string(index=False))
    print(f"{len(kept)} tables; {len(found) - len(kept)} not converged")


if __name__ == "__main__":
    main()
