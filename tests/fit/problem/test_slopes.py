"""Jacobians by columns against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.problem.slopes import linearised, with_slopes
from pushfit.mechanics.roots import falling_root
from tests.tolerances import FEW_OPERATIONS

SLOPE = 1e-7  # as `falling_root` promises its derivatives
POINT = jnp.array([0.3, -1.2, 2.0])


def curved(y):
    return jnp.stack([y[0] * y[1], jnp.sin(y[2]), jnp.exp(y[0]), y @ y])


@pytest.mark.parametrize("in_turn", [False, True])
def test_the_jacobian_is_that_of_jax(in_turn):
    expected = jax.jacrev(curved)(POINT)
    values, slopes = with_slopes(curved, POINT, in_turn=in_turn)
    np.testing.assert_allclose(values, curved(POINT), rtol=FEW_OPERATIONS)
    np.testing.assert_allclose(slopes.T, expected, rtol=FEW_OPERATIONS)


@pytest.mark.parametrize(
    ("in_turn", "expected"), [(False, ["while"]), (True, ["while", "scan"])]
)
def test_what_is_searched_is_searched_once(in_turn, expected):
    """The search of a root is no part of what is done for every coordinate."""

    def cube_root(y):
        bracket = jnp.zeros_like(y), jnp.full_like(y, 10.0)
        return falling_root(lambda c, x: c - x**3, y, bracket, start=jnp.ones_like(y))

    y = jnp.array([2.0, 27.0, 64.0])
    values, slopes = with_slopes(cube_root, y, in_turn=in_turn)
    np.testing.assert_allclose(values, np.cbrt(y), rtol=FEW_OPERATIONS)
    np.testing.assert_allclose(slopes, np.diag(np.cbrt(y) / (3 * y)), rtol=SLOPE)
    program = jax.make_jaxpr(lambda y: with_slopes(cube_root, y, in_turn=in_turn))(y)
    loops = [e for e in program.eqns if e.primitive.name in ("scan", "while")]
    assert [e.primitive.name for e in loops] == expected
    assert "while" not in str([loop.params.get("jaxpr") for loop in loops[1:]])


def test_a_linearised_function_keeps_its_values_and_slopes():
    same = linearised(curved)
    np.testing.assert_allclose(same(POINT), curved(POINT), rtol=FEW_OPERATIONS)
    found = jax.jacfwd(same)(POINT)
    np.testing.assert_allclose(found, jax.jacrev(curved)(POINT), rtol=FEW_OPERATIONS)
