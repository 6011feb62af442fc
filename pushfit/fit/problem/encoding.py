"""Physical values as points in sampling coordinates, and draws from the prior there.

Excluded: the coordinates of the data (`pushfit.fit.problem.data_coordinates`).
"""

import dataclasses
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.mechanics.coordinates import Coordinates, coordinates
from pushfit.model import Parameters

PARAMETERS = tuple(field.name for field in dataclasses.fields(Parameters))
# Rows per call of the change of coordinates.
CHUNK = 1024


def encode(
    problem: Problem, values: Mapping[str, Float[np.ndarray, " n"]]
) -> Float[np.ndarray, "n p"]:
    """Sampling coordinates, by `problem.names`; inverse of `Problem.state`.

    Args:
        values: Value of every free parameter, of F_0 and of sigma_<channel> where they
            are sampled [as in `priors.UNITS`, sigma in table units].
    """
    n = len(next(iter(values.values())))
    fixed = {name: float(value) for name, value in problem.fixed.items()}
    params = [values.get(name, np.full(n, fixed.get(name, 0.0))) for name in PARAMETERS]
    coords = in_chunks(_coordinates, np.stack(params, axis=1), CHUNK)
    order = [field.name for field in dataclasses.fields(Coordinates)]
    points = []
    for name in problem.names:
        if name in order:
            points.append(coords[:, order.index(name)])
        elif name.startswith("ln_"):
            points.append(np.log(values[name.removeprefix("ln_")]))
        else:
            points.append(np.asarray(values[name]))
    return np.stack(points, axis=1)


def prior_x_samples(
    problem: Problem, rng: np.random.Generator, n: int
) -> Float[np.ndarray, "n p"]:
    """Independent draws from the prior, in the order of `problem.names`."""
    draws = {}
    for name, prior in problem.priors.items():
        u = prior.sample(rng, n)
        draws[name] = np.exp(u) if prior.is_positive else u
    return encode(problem, draws)


@compiled
def _coordinates(params: Float[Array, "n 8"]) -> Float[Array, "n 8"]:
    """Rows of `PARAMETERS` as rows of the fields of `Coordinates`."""
    coords = jax.vmap(lambda row: coordinates(Parameters(*row)))(params)
    return jnp.stack(jax.tree.leaves(coords), axis=1)
