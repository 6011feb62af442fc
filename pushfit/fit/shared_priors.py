"""Priors that many tables share, up to the unit of their stiffnesses.

Heights in a sensor's own unit give each table default priors of its own scale but of
one shape. What takes time is made once for each shape and kept: the fibre, tables of
the densities, and draws. Excluded: priors of stiffness ellipses and of preloads.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass

import jax
import numpy as np
from jaxtyping import Float

from pushfit.containers import contact
from pushfit.fit.derived import PARAMETERS
from pushfit.fit.fibre import Fibre, make_fibre
from pushfit.fit.log_density import LogDensity, Table, make_table
from pushfit.fit.priors import Prior
from pushfit.fit.problem import Problem
from pushfit.model import Parameters

# Stiffnesses whose priors scale with the unit of the heights.
SCALED = ("K_sn", "K_dn", "K_st", "C_d")
SEED = 0
N_PRIOR_DRAWS = 4000
MAX_SHAPES = 256
# Kind, first and second number of every prior by name; fixed values by name.
Key = tuple[tuple[tuple[str, str, float, float], ...], tuple[tuple[str, float], ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Everything about a prior whose stiffnesses are in its own unit.

    Args:
        fibre: Prior of the parameters given A and B.
        tables: Densities of ln A, ln B and ln C_rr by name of the number, if it is
            free.
        samples: Draws of the parameters, of A and B, and of θ_c [deg].
    """

    fibre: Fibre
    tables: Mapping[str, Table]
    samples: Mapping[str, Float[np.ndarray, " n"]]


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedPrior:
    """Prior of a problem.

    Args:
        shape: What it shares with others.
        scale: Unit of the stiffnesses in `shape`.
        tables: Densities of ln A, ln B and ln C_rr by name of the number, if it is
            free.
    """

    shape: Shape
    scale: float
    tables: Mapping[str, Table]

    def samples(self) -> dict[str, Float[np.ndarray, " n"]]:
        """Draws in the units of the problem, the same for every problem of a shape."""
        return {
            name: values * self.scale if name in (*SCALED, "A", "B") else values
            for name, values in self.shape.samples.items()
        }


def shared_prior(problem: Problem) -> SharedPrior:
    """The prior of a problem, noise aside.

    Args:
        problem: Problem.

    Returns:
        Its shape, made now or before, and its scale.
    """
    priors = {n: p for n, p in problem.priors.items() if n in PARAMETERS}
    stiff = [priors.get(name) for name in SCALED]
    can_scale = all(p is not None and p.kind == "lognormal" for p in stiff)
    scale = float(priors["K_sn"].first) if can_scale else 1.0
    entries = []
    for name, prior in sorted(priors.items()):
        first = float(prior.first)
        if can_scale and name in SCALED:
            # Nine digits, so that rounding cannot make two shapes of one.
            first = float(f"{first / scale:.9g}")
        entries.append((name, prior.kind, first, float(prior.second)))
    fixed = tuple(
        (name, float(value))
        for name, value in sorted(problem.fixed.items())
        if name in PARAMETERS
    )
    shape = _shape((tuple(entries), fixed))
    by = {"A": np.log(scale), "B": np.log(scale), "C_rr": 0.0}
    tables = {name: table.shifted(by[name]) for name, table in shape.tables.items()}
    return SharedPrior(shape=shape, scale=scale, tables=tables)


def prior_tables(fibre: Fibre) -> dict[str, Table]:
    """Densities of ln A, ln B and ln C_rr by name of the number, if it is free."""
    densities = {
        "A": fibre.normal.density(),
        "B": fibre.tangential.density(),
        "C_rr": fibre.C_rr,
    }
    return {n: make_table(d) for n, d in densities.items() if isinstance(d, LogDensity)}


@functools.lru_cache(maxsize=MAX_SHAPES)
def _shape(key: Key) -> Shape:
    entries, fixed = key
    priors = {name: Prior(kind, a, b) for name, kind, a, b in entries}
    fibre = make_fibre(priors, dict(fixed))
    return Shape(
        fibre=fibre, tables=prior_tables(fibre), samples=_samples(priors, dict(fixed))
    )


def _samples(
    priors: Mapping[str, Prior], fixed: Mapping[str, float]
) -> dict[str, Float[np.ndarray, " n"]]:
    """Draws of all numbers that are reported."""
    rng = np.random.default_rng(SEED)
    draws = {
        name: np.exp(prior.sample(rng, N_PRIOR_DRAWS)) for name, prior in priors.items()
    }
    draws |= {name: np.full(N_PRIOR_DRAWS, value) for name, value in fixed.items()}
    params = {name: draws[name] for name in PARAMETERS}
    none = np.zeros(N_PRIOR_DRAWS)
    group = jax.vmap(contact)(Parameters(**params, e1=none, e2=none))
    A, B = np.asarray(group.A), np.asarray(group.B)
    theta_c = np.degrees(np.arctan2(B, A * draws["C_rr"]))
    return params | {"A": A, "B": B, "theta_c": theta_c}
