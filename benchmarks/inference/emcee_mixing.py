"""How fast emcee mixes here: moves, numbers of walkers and coordinates.

Prints one table for a table of 51 pushes. Engines take turns within each round, so
that whatever else the machine does hits all of them; trust ratios, not milliseconds.

    python -m benchmarks.inference.emcee_mixing [--rounds 3] [--steps 1000]
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import emcee
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.tables import CONFIG, GRASP, NAMES
from pushfit.data.simulate import simulate_table
from pushfit.fit.problem.encoding import encode
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.programs.compile import in_chunks
from pushfit.fit.sampler.chains import Densities, advance
from pushfit.fit.sampler.diagnostics import autocorr_time
from pushfit.fit.sampler.mixture import fit_mixture
from pushfit.fit.sampler.moves import DifferenceMove, IndependenceMove
from pushfit.fit.sampler.starts import starting_points
from pushfit.model import Parameters

# Ensembles as `pushfit` has them, and the share of steps dropped at their begin.
N_ENSEMBLES = 4
BURN_IN = 0.2


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """One engine in one round: τ of θ_c, effective draws, seconds, evaluations."""

    tau: float
    ess: float
    seconds: float
    n_evaluations: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--steps", type=int, default=1000)
    options = parser.parse_args()
    problem, points = posterior_points()
    engines = emcee_engines(problem, points, options.steps)
    results = {name: [] for name in engines}
    for engine in engines.values():
        engine()  # compiles
    for _ in range(options.rounds):
        for name, engine in engines.items():
            results[name].append(engine())
    print_table(results)


def print_table(results: dict[str, list[Measurement]]) -> None:
    reference = np.median([m.ess / m.seconds for m in results["stretch, 64 walkers"]])
    print("tau of theta_c; nan: a walker never moved")
    print(f"{'engine':44s} {'tau':>6s} {'calls/ESS':>10s} {'ESS/s':>8s} {'ratio':>6s}")
    for name, rounds in results.items():
        tau = np.median([m.tau for m in rounds])
        calls = np.median([m.n_evaluations / m.ess for m in rounds])
        speed = np.median([m.ess / m.seconds for m in rounds])
        print(
            f"{name:44s} {tau:6.1f} {calls:10.1f} {speed:8.0f} {speed / reference:6.1f}"
        )


def posterior_points():
    """A table whose θ_c has two modes, and points from its posterior."""
    theta = np.repeat(np.radians(np.arange(5.0, 90.0, 5.0)), 3)
    table = simulate_table(
        Parameters(1300, 2600 / 3, 201, 0.3, 0.1608, 0.04),
        GRASP,
        theta=theta,
        alpha=np.zeros_like(theta),
        repeats=1,
        noise=0.03,
        rng=np.random.default_rng(0),
        state_sd=True,
    )
    setup = build_problem(table, CONFIG)
    fit = fit_least_squares(setup, reference_alpha=0.0)
    points = starting_points(
        setup.problem,
        fit,
        Densities(setup.problem),
        n_ensembles=N_ENSEMBLES,
        n_points=512,
        rng=np.random.default_rng(0),
    )
    return setup.problem, points


def emcee_engines(problem, points, n_steps: int) -> dict[str, Callable]:
    """Stretch, differences with jumps, and the mix, in both coordinate systems."""
    densities = Densities(problem)
    rng = np.random.default_rng(1)

    def engine(moves, n_walkers, density=densities.log_prob, cloud=points, raw=False):
        def run() -> Measurement:
            start = cloud.reshape(N_ENSEMBLES, -1, cloud.shape[1])[:, :n_walkers]
            started = time.perf_counter()
            chain, _ = advance(
                density,
                start.reshape(-1, cloud.shape[1]),
                n_steps,
                moves=moves(cloud),
                random=np.random.RandomState(0),
            )
            seconds = time.perf_counter() - started
            kept = chain[int(BURN_IN * n_steps) :]
            return measured(kept.reshape(-1, cloud.shape[1]), kept, seconds, raw)

        return run

    def measured(flat, kept, seconds: float, raw: bool) -> Measurement:
        x = encode_logs(problem, flat) if raw else flat
        trace = theta_c(problem, x).reshape(len(kept), N_ENSEMBLES, -1)
        tau = autocorr_time(trace)
        share = trace.size / (1 - BURN_IN)
        return Measurement(
            tau=tau, ess=share / tau, seconds=seconds, n_evaluations=int(share)
        )

    def stretch(cloud):
        return [(emcee.moves.StretchMove(), 1.0)]

    def difference(cloud):
        return [(DifferenceMove(N_ENSEMBLES), 1.0)]

    def mix(share):
        def moves(cloud):
            proposal = IndependenceMove(fit_mixture(cloud, rng))
            return [(DifferenceMove(N_ENSEMBLES), share), (proposal, 1 - share)]

        return moves

    logs = logs_of(problem, points)

    def raw_density(u):
        return densities.log_prob(encode_logs(problem, u))

    raw = {"density": raw_density, "cloud": logs, "raw": True}
    engines = {"stretch, 64 walkers": engine(stretch, 64)}
    engines["stretch, 64 walkers, six raw logs"] = engine(stretch, 64, **raw)
    engines["differences, 64 walkers"] = engine(difference, 64)
    engines["differences, 64 walkers, six raw logs"] = engine(difference, 64, **raw)
    for share in (0.75, 0.5, 0.25, 0.1):
        name = f"mix, {share:.0%} differences, 64 walkers"
        engines[name] = engine(mix(share), 64)
    engines["mix, 25% differences, 64 walkers, raw"] = engine(mix(0.25), 64, **raw)
    for n_walkers in (32, 128):
        name = f"mix, 25% differences, {n_walkers} walkers"
        engines[name] = engine(mix(0.25), n_walkers)
    return engines


def theta_c(problem, x):
    """θ_c without preload, arctan(B / (A C_rr)) [rad]."""
    ln_A, ln_B, ln_C_rr = (
        x[:, problem.names.index(name)] for name in ("ln_A", "ln_B", "ln_C_rr")
    )
    return np.arctan(np.exp(ln_B - ln_A - ln_C_rr))


@jax.jit
def _logs(problem, x):
    def one(x):
        params = problem.state(x).params
        return jnp.stack([jnp.log(getattr(params, name)) for name in NAMES])

    return jax.vmap(one)(x)


def logs_of(problem, x):
    """The six raw logs at points in sampling coordinates."""
    return in_chunks(lambda rows: _logs(problem, rows), x, 1024)


def encode_logs(problem, logs):
    """Sampling coordinates of six raw logs; |det| = 1, so densities stay the same."""
    values = {name: np.exp(logs[:, i]) for i, name in enumerate(NAMES)}
    return encode(problem, values)


if __name__ == "__main__":
    main()
