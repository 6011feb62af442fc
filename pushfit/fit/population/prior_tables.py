"""Marginal prior densities of ln A, ln B and ln C_rr, made once for each shape.

Heights in a sensor's own unit give each table default priors of its own scale but of
one shape. Excluded: priors of stiffness ellipses and of preloads.
"""

import functools
from collections.abc import Mapping

import numpy as np

from pushfit.fit.problem.priors.conditional_prior import make_conditional_prior
from pushfit.fit.problem.priors.distributions import Prior
from pushfit.fit.problem.priors.tabulated_density import (
    LogDensity,
    TabulatedDensity,
    tabulate,
)
from pushfit.fit.problem.problem import Problem
from pushfit.parameters import SIX, STIFF

# Shapes kept at a time: tables of one setting share theirs.
MAX_SHAPES = 256
# Kind, first and second number of every prior by name; fixed values by name.
Entries = tuple[tuple[str, str, float, float], ...]
Values = tuple[tuple[str, float], ...]


def prior_tables(problem: Problem) -> dict[str, TabulatedDensity]:
    """Densities of ln A, ln B and ln C_rr by name of the number, if it is free."""
    priors = {n: p for n, p in problem.priors.items() if n in SIX}
    stiff = [priors.get(name) for name in STIFF]
    can_scale = all(p is not None and p.kind == "lognormal" for p in stiff)
    scale = float(priors["K_sn"].first) if can_scale else 1.0
    entries = []
    for name, prior in sorted(priors.items()):
        first = float(prior.first)
        if can_scale and name in STIFF:
            # Nine digits, so that rounding cannot make two shapes of one.
            first = float(f"{first / scale:.9g}")
        entries.append((name, prior.kind, first, float(prior.second)))
    fixed = tuple(
        (name, float(value))
        for name, value in sorted(problem.fixed.items())
        if name in SIX
    )
    by = {"A": np.log(scale), "B": np.log(scale), "C_rr": 0.0}
    shape = _shape(tuple(entries), fixed)
    return {name: table.shifted(by[name]) for name, table in shape.items()}


@functools.lru_cache(maxsize=MAX_SHAPES)
def _shape(entries: Entries, fixed: Values) -> Mapping[str, TabulatedDensity]:
    priors = {name: Prior(kind, a, b) for name, kind, a, b in entries}
    prior = make_conditional_prior(priors, dict(fixed))
    densities = {
        "A": prior.normal.density(),
        "B": prior.tangential.density(),
        "C_rr": prior.C_rr,
    }
    return {n: tabulate(d) for n, d in densities.items() if isinstance(d, LogDensity)}
