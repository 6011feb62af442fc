"""Jacobians by columns against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np

from pushfit.fit.problem.slopes import linearised, with_slopes

EXACT = 1e-13  # equal on paper
POINT = jnp.array([0.3, -1.2, 2.0])


def curved(y):
    return jnp.stack([y[0] * y[1], jnp.sin(y[2]), jnp.exp(y[0]), y @ y])


def test_the_jacobian_is_that_of_jax():
    expected = jax.jacrev(curved)(POINT)
    values, slopes = with_slopes(curved, POINT)
    np.testing.assert_allclose(values, curved(POINT), rtol=EXACT)
    np.testing.assert_allclose(slopes, expected, rtol=EXACT)


def test_a_linearised_function_keeps_its_values_and_slopes():
    same = linearised(curved)
    np.testing.assert_allclose(same(POINT), curved(POINT), rtol=EXACT)
    found = jax.jacfwd(same)(POINT)
    np.testing.assert_allclose(found, jax.jacrev(curved)(POINT), rtol=EXACT)
