"""What is known beforehand of coordinates that heights hardly see.

Where the object tilts, heights depend on s = K_st L²/C_d and on L, but so little that a
least-squares fit would walk off along them, and what it says of A, B, C_rr and θ_c with
it. Of an unknown sharpness p they say nothing where it is large. L is measured, s has a
prior given B, and p one of its own: each enters the fit as one residual, as if it had
been observed. Excluded: A, B and C_rr, on which no prior may act here.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import Problem
from pushfit.model import as_float

# Draws from the prior whose moments the residuals have: good to 2 % of each sd.
N_PRIOR_DRAWS = 4000


def with_constraints(problem: Problem) -> Problem:
    """The problem with a residual for every coordinate of `held_names`.

        (ln L - mean) / sd,   (ln s - mean(ln s | ln B, ln L)) / sd
        (ln p - mean) / sd

    The conditional mean is the linear regression over draws from the prior; for
    lognormal priors the first and the last are exact.
    """
    held = held_names(problem)
    if not held:
        return problem
    names = problem.data_names
    x = prior_x_samples(problem, np.random.default_rng(0), N_PRIOR_DRAWS)
    draws = {name: x[:, i] for i, name in enumerate(problem.names)}
    found = [_residual(names, draws, name) for name in held]
    rows, offsets = zip(*found, strict=True)
    return replace(
        problem,
        constraint=as_float(np.array(rows)),
        constraint_offset=as_float(np.array(offsets)),
    )


def held_names(problem: Problem) -> tuple[str, ...]:
    """Data coordinates that have a residual of their own, in the order of the rows."""
    names = problem.data_names
    # With two supports and small tilts L is what heights see it by.
    held = ["ln_L"] if "ln_L" in names and problem.grasp.law.sees_tilt else []
    # Without ln B it is ln s that the heights see in its place.
    held += ["ln_s"] if {"ln_s", "ln_B"} <= set(names) else []
    return (*held, "ln_p") if "ln_p" in names else tuple(held)


def held_values(
    problem: Problem, points: Float[np.ndarray, "k q"]
) -> Float[np.ndarray, "k q"]:
    """The points with every held coordinate where its residual vanishes."""
    if problem.constraint is None:
        return points
    rows, offsets = (
        np.asarray(problem.constraint),
        np.asarray(problem.constraint_offset),
    )
    names = problem.data_names
    points = points.copy()
    # In the order in which one depends on the other.
    for name, row, target in zip(held_names(problem), rows, offsets, strict=True):
        own = names.index(name)
        rest = points @ row - points[:, own] * row[own]
        points[:, own] = (target - rest) / row[own]
    return points


def _residual(
    names: tuple[str, ...],
    draws: dict[str, Float[np.ndarray, " n"]],
    name: str,
) -> tuple[Float[np.ndarray, " q"], float]:
    """Row and offset of the standardised residual of a coordinate."""
    given = [n for n in ("ln_B", "ln_L") if name == "ln_s" and n in names]
    design = np.stack(
        [np.ones(N_PRIOR_DRAWS), *(draws[other] for other in given)], axis=1
    )
    coefficients, *_ = np.linalg.lstsq(design, draws[name], rcond=None)
    sd = np.std(draws[name] - design @ coefficients)
    row = np.zeros(len(names))
    row[names.index(name)] = 1 / sd
    for other, slope in zip(given, coefficients[1:], strict=True):
        row[names.index(other)] = -slope / sd
    return row, float(coefficients[0] / sd)
