"""What sensors would report at many points and for any pushes.

Pictures, checks, weights and simulated tables all ask here: points and pushes are
padded to one shape, so that a mechanics needs one program for them all. Excluded:
residuals and densities (`pushfit.fit.problem.problem`).
"""

from collections.abc import Callable, Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

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


def predict_points(
    problem: Problem, points: Float[np.ndarray, "k q"], pushes: Pushes
) -> Channels:
    """What sensors report at data coordinates, by point and push."""

    def states(rows: Int[np.ndarray, " m"]) -> ModelPoint[Contact]:
        return _of_points(problem.of_data, points[rows])

    return _predict(problem.grasp, states, len(points), pushes)


def predict_draws(
    problem: Problem, samples: Mapping[str, Float[np.ndarray, " n"]], pushes: Pushes
) -> Channels:
    """What sensors report at draws, or any values, by draw and push.

    Args:
        samples: Values of all that is unknown by name.
    """
    names = (*Parameters.__dataclass_fields__, *OF_GRASP)
    known = {name: samples[name] for name in names if name in samples}

    def states(rows: Int[np.ndarray, " m"]) -> ModelPoint[Contact]:
        return _of_draws(problem, {n: v[rows] for n, v in known.items()})

    return _predict(problem.grasp, states, next(iter(known.values())).size, pushes)


def heights_of(problem: Problem, channels: Channels) -> Float[np.ndarray, "k c n"]:
    """Heights of the channels of a problem, of what was predicted [table unit]."""
    return np.stack([getattr(channels, name) for name in problem.channels], axis=1)


def _predict(
    grasp: Grasp,
    states: Callable[[Int[np.ndarray, " m"]], ModelPoint[Contact]],
    n_points: int,
    pushes: Pushes,
) -> Channels:
    """Channels of all points and pushes, given the states of some points."""
    angles = np.stack([pushes.theta, pushes.alpha])
    # Repeats are the same direction over and over.
    unique, inverse = np.unique(angles, axis=1, return_inverse=True)
    blocks = _padded_rows(unique.shape[1], N_PUSHES)
    parts = [unique[:, rows] for rows in blocks]
    # All calls are sent off before the first is waited for.
    calls = []
    for i, rows in enumerate(_padded_rows(n_points, N_POINTS)):
        at = states(rows)
        n_left = jnp.asarray(n_points - i * N_POINTS)
        calls.append([_channels(at, part, grasp, n_left) for part in parts])
    found = [jax.tree.map(lambda *a: np.concatenate(a, axis=1), *row) for row in calls]
    return jax.tree.map(
        lambda *a: np.concatenate(a)[:n_points, inverse.ravel()], *found
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
