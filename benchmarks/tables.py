"""Tables that the benchmarks of speed share: truths from the default priors.

Each is one sweep of elevations from 5° to 85° at one azimuth, with known noise of 3 %
of its tallest height and the push length known.
"""

from collections.abc import Sequence

import equinox as eqx
import numpy as np

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.priors import default_priors
from pushfit.fit.setup import Setup, build_problem
from pushfit.model import Grasp, Parameters, Pushes, forward

PUSH_LENGTH = 5e-3
GRASP = Grasp(push_length=PUSH_LENGTH)
CONFIG = parse_config(f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n", path="grasp.toml")
NAMES = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L")
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
