"""What sensors would report at many points and for any pushes.

Pictures, checks, weights and simulated tables all ask here: points and pushes are
padded to one shape, so that a mechanics needs one program for them all. Excluded:
residuals and densities (`pushfit.fit.problem.problem`).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int, Shaped

from pushfit.fit.problem.problem import ModelPoint, Problem, grasp_with
from pushfit.fit.programs.compile import compiled
from pushfit.model import (
    Channels,
    Contact,
    Grasp,
    Parameters,
    Pushes,
    contact,
    forward,
)
from pushfit.parameters import OF_GRASP

# Programs take numbers of NumPy as they are.
AnyArray = Array | np.ndarray
# Points and directions of one call, and points that are computed together: a call is
# sent off once for many, and computes no more than are asked for.
N_POINTS, N_PUSHES = 1024, 32
N_TOGETHER = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Reports:
    """What sensors report of pushes at points.

    Args:
        heights: By channel of the problem [table unit].
        in_contact: False where the push has lifted the finger off.
    """

    heights: Float[np.ndarray, "k c n"]
    in_contact: Bool[np.ndarray, "k n"]


def predict_points(
    problem: Problem, points: Float[np.ndarray, "k q"], angles: Float[np.ndarray, "2 n"]
) -> Reports:
    """What sensors report at data coordinates, by point and push.

    Args:
        angles: θ and α of the pushes [rad].
    """
    of_data = problem.of_data

    def states(rows: Int[np.ndarray, " m"]) -> ModelPoint[Contact]:
        return _of_points(of_data, points[rows])

    return _predict(problem, states, len(points), angles)


def predict_draws(
    problem: Problem,
    samples: Mapping[str, Float[np.ndarray, " m"]],
    angles: Float[np.ndarray, "2 n"],
) -> Reports:
    """What sensors report at draws, or any values, by draw and push.

    Args:
        samples: Values of all that is unknown by name.
        angles: θ and α of the pushes [rad].
    """
    names = (*Parameters.__dataclass_fields__, *OF_GRASP)
    known = {name: samples[name] for name in names if name in samples}
    of_data = problem.of_data

    def states(rows: Int[np.ndarray, " k"]) -> ModelPoint[Contact]:
        return _of_draws(of_data, {n: v[rows] for n, v in known.items()})

    return _predict(problem, states, next(iter(known.values())).size, angles)


def _predict(
    problem: Problem,
    states: Callable[[Int[np.ndarray, " m"]], ModelPoint[Contact]],
    n_points: int,
    angles: Float[np.ndarray, "2 n"],
) -> Reports:
    """What is reported at all points and pushes, given the states of some points."""
    # Repeats are the same direction over and over.
    unique, inverse = np.unique(angles, axis=1, return_inverse=True)
    blocks = _padded_rows(unique.shape[1], N_PUSHES)
    parts = [unique[:, rows] for rows in blocks]
    # All calls are sent off before the first is waited for.
    calls = []
    for i, rows in enumerate(_padded_rows(n_points, N_POINTS)):
        at = states(rows)
        n_left = jnp.asarray(n_points - i * N_POINTS)
        calls.append([_channels(at, part, problem.grasp, n_left) for part in parts])

    def all_of(name: str) -> Shaped[np.ndarray, "k n"]:
        found = np.block([[getattr(part, name) for part in row] for row in calls])
        return found[:n_points, inverse.ravel()]

    return Reports(
        heights=np.stack([all_of(name) for name in problem.channels], axis=1),
        in_contact=all_of("in_contact"),
    )


def _padded_rows(n: int, size: int) -> list[Int[np.ndarray, " m"]]:
    """Indices in calls of one size, the last index repeated."""
    return [np.minimum(np.arange(i, i + size), n - 1) for i in range(0, n, size)]


@compiled
def _of_points(problem: Problem, points: Float[AnyArray, "k q"]) -> ModelPoint[Contact]:
    return jax.vmap(problem.data_state)(jnp.asarray(points))


@compiled
def _of_draws(
    problem: Problem, draws: Mapping[str, Float[AnyArray, " k"]]
) -> ModelPoint[Contact]:
    def one(draw: Mapping[str, Float[Array, ""]]) -> ModelPoint[Contact]:
        own = {name: value for name, value in draw.items() if name not in OF_GRASP}
        for name in Parameters.__dataclass_fields__:
            own.setdefault(name, problem.fixed.get(name, jnp.zeros(())))
        preload = grasp_with(problem.grasp, draw).preload
        no_sigma = jnp.zeros(len(problem.channels))
        group = contact(Parameters(**own))
        return ModelPoint(group, preload, no_sigma, jnp.zeros(()), draw.get("p"))

    return jax.vmap(one)({name: jnp.asarray(v) for name, v in draws.items()})


@compiled
def _channels(
    states: ModelPoint[Contact],
    angles: Float[AnyArray, "2 n"],
    grasp: Grasp,
    n_points: Int[Array, ""],
) -> Channels:
    """Channels of the first points; beyond them anything."""
    pushes = Pushes(*angles)

    def one(state: ModelPoint[Contact]) -> Channels:
        return forward(state.params, pushes, state.grasp(grasp))

    def part(i: Int[Array, ""], found: Channels) -> Channels:
        start = i * N_TOGETHER
        some = jax.tree.map(
            lambda a: jax.lax.dynamic_slice_in_dim(a, start, N_TOGETHER), states
        )
        return jax.tree.map(
            lambda all_, own: jax.lax.dynamic_update_slice_in_dim(
                all_, own, start, axis=0
            ),
            found,
            jax.vmap(one)(some),
        )

    shapes = jax.eval_shape(jax.vmap(one), states)
    nothing = jax.tree.map(lambda a: jnp.zeros(a.shape, a.dtype), shapes)
    n_parts = jnp.minimum(-(-n_points // N_TOGETHER), N_POINTS // N_TOGETHER)
    return jax.lax.fori_loop(0, n_parts, part, nothing)
