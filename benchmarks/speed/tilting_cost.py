"""What tilting mechanics cost against the paper's equations, as ratios.

    python -m benchmarks.speed.tilting_cost [--rounds 15]

Both run in turns in one process; medians of processor time over the rounds. Heights are
of 51 pushes at 512 draws from the default priors, and at as many points near one of
them.
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.tables import FIRM, HARD
from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.problem.slopes import with_slopes
from pushfit.model import Grasp, Vector, forward

# As in `benchmarks.coverage.one_sweep` [rad].
THETA = np.radians(np.arange(5.0, 90.0, 5.0))
# Draws from the priors, in one call.
N_DRAWS = 512
MECHANICS = ("linear", "tilting")
# Distance of two supports.
SPAN_MM = 60.0


def setup(mechanics: str, *, has_span: bool = False, seed: int = 0) -> Setup:
    """51 pushes simulated by tilting mechanics, all parameters but L free."""
    span = SPAN_MM / 1000 if has_span else None
    table = simulate_table(
        FIRM,
        Grasp(push_length=5e-3, mechanics="tilting", support_span=span),
        theta=THETA,
        alpha=0.0,
        repeats=3,
        noise=0.05,
        rng=np.random.default_rng(seed),
        state_sd=True,
    )
    text = f'[push]\nlength_mm = 5.0\n[grasp]\nmechanics = "{mechanics}"\n'
    if has_span:
        text += f"support_span_mm = {SPAN_MM}\n"
    text += "[parameters.L]\nfixed = 0.04\n" + HARD
    return build_problem(table, parse_config(text, path="grasp.toml"))


def problem(mechanics: str, *, has_span: bool = False) -> Problem:
    """The problem that such a table poses."""
    return setup(mechanics, has_span=has_span).problem


def heights(posed: Problem) -> Callable[[jax.Array], Vector]:
    """Heights at a point of the sampler."""

    def one(x: jax.Array) -> Vector:
        return forward(posed.state(x).params, posed.pushes, posed.grasp).height

    return one


def ratio(
    functions: dict[str, Callable[[jax.Array], jax.Array]], x: jax.Array, rounds: int
) -> str:
    """Median times of both and their ratio."""
    compiled = {name: jax.jit(jax.vmap(f)) for name, f in functions.items()}
    for function in compiled.values():
        jax.block_until_ready(function(x))
    times = {name: [] for name in compiled}
    for _ in range(rounds):
        for name, function in compiled.items():
            start = time.process_time()
            jax.block_until_ready(function(x))
            times[name].append(time.process_time() - start)
    linear, tilting = (np.median(times[name]) for name in MECHANICS)
    return f"{1e3 * linear:8.2f} ms {1e3 * tilting:8.2f} ms {tilting / linear:8.1f}"


def main() -> None:
    """Print one line for each function."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    posed = {name: problem(name) for name in MECHANICS}
    rng = np.random.default_rng(1)
    x = jnp.asarray(prior_x_samples(posed["tilting"], rng, N_DRAWS))
    near = jnp.asarray(np.median(x, axis=0) + 0.1 * rng.standard_normal(x.shape))
    model = {name: heights(p) for name, p in posed.items()}
    slopes = {name: partial(with_slopes, f) for name, f in model.items()}
    density = {name: p.log_prob for name, p in posed.items()}
    print(f"{'':32}{'linear':>11} {'tilting':>11} {'ratio':>8}")
    for name, functions in (
        ("heights", model),
        ("heights and slopes", slopes),
        ("log posterior", density),
    ):
        for where, points in (("over the prior", x), ("near one point", near)):
            print(f"{name + ' ' + where:32}{ratio(functions, points, rounds)}")


if __name__ == "__main__":
    main()
