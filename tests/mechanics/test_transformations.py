"""Every public function of the model is the same under jit and under vmap."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit import model
from pushfit.mechanics import coordinates, directions, linear
from tests.problems import CASES, SMOOTH_THETA_DEG
from tests.tolerances import ROUNDING

REORDERED = 1e-11  # the compiler reorders what is equal on paper
# The vertex of a parabola divides differences of nearly equal resistances.
VERTEX = 1e-6

REGISTRY = {
    "forward": model.forward,
    "forces": model.forces,
    "push_resistance": model.push_resistance,
    "implied_tilt": linear.implied_tilt,
    "support_stiffness": lambda p, pushes, grasp: model.support_stiffness(p),
    "contact": lambda p, pushes, grasp: model.contact(p),
    "tangential_stiffness": lambda p, pushes, grasp: model.tangential_stiffness(
        model.contact(p), pushes.azimuth
    ),
    "critical_angle": lambda p, pushes, grasp: directions.critical_angle(
        p, grasp, pushes.alpha
    ),
    "soft_axis": lambda p, pushes, grasp: directions.soft_axis(p),
    "best_direction": lambda p, pushes, grasp: directions.best_direction(
        p, grasp, pushes.theta[3], reach=(0.3, math.pi)
    ),
    "coordinates": lambda p, pushes, grasp: coordinates.coordinates(p),
    "parameters": lambda p, pushes, grasp: coordinates.parameters(
        coordinates.coordinates(p)
    ),
    "log_volume": lambda p, pushes, grasp: coordinates.log_volume(
        coordinates.coordinates(p)
    ),
}
FACTORS = [0.8, 1.3]


# These take another branch with a single rolling limit.
SINGLE_LIMIT = ("forward", "critical_angle", "best_direction")
CHECKS = [(function, "everything") for function in REGISTRY]
CHECKS += [(function, "ellipse") for function in SINGLE_LIMIT]


@pytest.mark.parametrize(("function", "name"), CHECKS)
def test_jit_is_eager_and_vmap_is_a_loop(function, name):
    case = CASES[name]
    pushes = case.pushes(SMOOTH_THETA_DEG)
    tolerance = VERTEX if function == "best_direction" else REORDERED

    def evaluate(params):
        return REGISTRY[function](params, pushes, case.grasp)

    scaled = [jax.tree.map(lambda x, c=c: c * x, case.params) for c in FACTORS]
    eager = [evaluate(params) for params in scaled]
    compiled = eqx.filter_jit(evaluate)
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *scaled)
    mapped = jax.jit(jax.vmap(evaluate))(stacked)
    for i, (params, expected) in enumerate(zip(scaled, eager, strict=True)):
        one = jax.tree.map(lambda x, i=i: x[i], mapped)
        for result in (compiled(params), one):
            assert jax.tree.structure(result) == jax.tree.structure(expected)
            for got, want in zip(
                *map(jax.tree.leaves, (result, expected)), strict=True
            ):
                np.testing.assert_allclose(got, want, rtol=tolerance, atol=ROUNDING)
