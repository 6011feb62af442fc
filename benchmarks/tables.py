"""Tables and problems that the benchmarks share: truths from the priors.

Tables are one sweep of elevations from 5° to 85° at one azimuth, with a noise of 3 %
of its tallest height and the push length known.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.model import Grasp, Parameters, Pushes, forward
from tests.fit.kinds import KINDS

# The paper's [m].
PUSH_LENGTH = 5e-3
GRASP = Grasp(push_length=PUSH_LENGTH)
# The switch of the paper, which what they are compared with has, too.
HARD = '[transition]\nsharpness = "hard"\n'
CONFIG = parse_config(
    f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n{HARD}", path="grasp.toml"
)
# A = 520 and B = 150 N/m: tan θ_c = 150 / (0.5 · 520), θ_c = 30.0°.
FIRM = Parameters(K_sn=1300, K_dn=2600 / 3, K_st=450, C_rr=0.5, C_d=0.36, L=0.04)
NAMES = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L")
# As a share of the tallest height.
NOISE = 0.03


def prior_tables(
    n: int, *, n_angles: int = 17, repeats: int = 3, seed: int = 0
) -> list[PeakTable]:
    """Tables of as many grasps."""
    rng = np.random.default_rng(seed)
    priors = default_priors(None)
    logs = {name: priors[name].sample(rng, n) for name in NAMES}
    theta = np.radians(np.linspace(5.0, 85.0, n_angles))
    pushes = Pushes(theta, np.zeros_like(theta))
    heights = eqx.filter_jit(lambda truth: forward(truth, pushes, GRASP).height)
    tables = []
    for index in range(n):
        truth = Parameters(**{k: float(np.exp(v[index])) for k, v in logs.items()})
        table = simulate_table(
            truth,
            GRASP,
            theta=theta,
            alpha=0.0,
            repeats=repeats,
            noise=NOISE * float(np.max(heights(truth))),
            rng=rng,
            state_sd=True,
        )
        tables.append(table)
    return tables


def setups(tables: Sequence[PeakTable]) -> list[Setup]:
    """Problems that tables pose."""
    return [build_problem(table, CONFIG) for table in tables]


def prior_problems(
    kind: str, n: int, rng: np.random.Generator
) -> Iterator[tuple[Setup, Float[np.ndarray, " p"]]]:
    """Problems of a kind of the tests' registry, and the truth of each.

    Pushes and noise are those of the kind, truths are drawn from its priors, the noise
    of each table when it is asked for.
    """
    setup = KINDS[kind].setup(0)
    problem = setup.problem
    x = prior_x_samples(problem, rng, n)
    states = jax.vmap(problem.state)(jnp.asarray(x))
    clean = np.asarray(jax.vmap(problem.predict)(states))
    noise = np.asarray(jax.vmap(problem.noise)(states))
    for truth, heights, sigma in zip(x, clean, noise, strict=True):
        observed = jnp.asarray(heights + sigma * rng.standard_normal(sigma.shape))
        yield replace(setup, problem=replace(problem, observed=observed)), truth
