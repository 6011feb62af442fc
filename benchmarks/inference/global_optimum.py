"""How often least squares misses the best fit that many random starts find.

    python -m benchmarks.inference.global_optimum
        [--kind plain] [--tables 200] [--starts 32]

Tables have the pushes and noise of a kind of the tests' registry, and truths from the
priors. Starts are drawn from the priors too and polished by the same solver. A miss is
a fit that is worse by more than 0.5 in half its chi-square; where the random starts are
the worse ones is counted beside it, because they may miss too.
"""

import argparse
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from benchmarks.tables import prior_problems
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import Problem
from pushfit.fit.profiles.least_squares import fit_least_squares, polish, settle_noise
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.model import contact
from tests.fit.kinds import KINDS

# A likelihood ratio of exp(0.5): less than this nobody would notice.
MISS = 0.5


def data_points(problem: Problem, x: Float[Array, "n p"]) -> Float[Array, "n q"]:
    """Data coordinates of points in sampling coordinates."""

    def one(x: Float[Array, " p"]) -> Float[Array, " q"]:
        state = problem.state(x)
        group = contact(state.params)
        values = {
            "ln_A": jnp.log(group.A),
            "ln_B": jnp.log(group.B),
            "ln_C_rr": jnp.log(group.C_rr),
            "f1": group.f1,
            "f2": group.f2,
            "ln_F_0": jnp.log(state.preload),
            "ln_s": jnp.log(group.s),
            "ln_L": jnp.log(group.L),
        }
        if state.sharpness is not None:
            values["ln_p"] = jnp.log(state.sharpness)
        return jnp.stack([values[name] for name in problem.data_names])

    return jax.vmap(one)(x)


def differences(kind: str, n_tables: int, n_starts: int, seed: int) -> Iterator[float]:
    """Half the chi-square of the fit less that of the best random start."""
    rng = np.random.default_rng(seed)
    for setup, _ in prior_problems(kind, n_tables, rng):
        setup = settle_noise(setup)
        data = setup.problem
        fit = fit_least_squares(setup, reference_alpha=np.pi / 2)
        starts = data_points(data, jnp.asarray(prior_x_samples(data, rng, n_starts)))
        _, costs, _ = polish(data, np.asarray(starts))
        yield (fit.chi_square - costs[0]) / 2


def main() -> None:
    """Print the share of misses."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--kind", default="plain", choices=KINDS)
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--starts", type=int, default=32)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = np.array(
        list(differences(options.kind, options.tables, options.starts, options.seed))
    )
    print(f"{options.tables} tables of kind {options.kind}, {options.starts} starts")
    print(
        f"{np.sum(found > MISS)} miss the best random start, "
        f"{np.sum(found < -MISS)} beat it; worst {np.max(found):.2g}"
    )


if __name__ == "__main__":
    enable_compile_cache()
    main()
