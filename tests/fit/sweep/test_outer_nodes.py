"""Nodes along one coordinate: on an objective whose profile is known."""

import jax
import jax.numpy as jnp
import numpy as np

from pushfit.fit.sweep.outer_nodes import ascending, begun, next_round
from pushfit.fit.sweep.search import in_rounds
from pushfit.fit.sweep.target import Expansion
from tests.tolerances import EXACT

N_NODES, FAR, SLOPE = 32, 100.0, 0.05
# Cost of the valley at v = 3 over that at v = 0, about.
ABOVE = 100.0


def even(nodes):
    """Nodes as far from each other as they can be."""
    return jnp.linspace(0.0, 1.0, N_NODES)


class TwoValleys:
    """Residuals with a deep valley at v = 0 and another that stays far above it."""

    mean, precision = jnp.zeros(2), 1e-12 * jnp.eye(2)

    def residuals(self, y):
        u, v = y
        return jnp.stack([SLOPE * (u - FAR), 10.0 * v * (v - 3.0), 5.0 * v])

    def cost(self, y):
        return jnp.sum(self.residuals(y) ** 2) / 2

    def expand(self, y):
        residuals, jacobian = self.residuals(y), jax.jacfwd(self.residuals)(y)
        cost = self.cost(y)
        return Expansion(
            y=y,
            misfit=cost,
            cost=cost,
            gradient=residuals @ jacobian,
            hessian=jacobian.T @ jacobian,
        )


def test_no_node_stays_above_its_neighbours_valley():
    """The first node begins in the valley above, and slides, but never to its end."""
    starts = np.zeros((N_NODES, 2))
    starts[:, 0] = np.linspace(0.0, FAR, N_NODES)
    starts[0, 1] = 3.0
    target = TwoValleys()
    assert target.cost(starts[0]) > target.cost(np.array([0.0, 0.0])) + ABOVE

    is_free = jnp.array([False, True])

    def onward(number, ends, _):
        nodes = ascending(ends)
        following = next_round(
            target, nodes, is_free, placing=even, is_final=number == 0
        )
        return nodes, following, None

    first = begun(jnp.asarray(starts), is_free)
    _, found = in_rounds(
        lambda _: target, jnp.arange(2), first, state=None, onward=onward
    )
    nodes = jax.tree.map(lambda a: a[-1], found)
    profile = (SLOPE * (nodes.y[:, 0] - FAR)) ** 2 / 2
    np.testing.assert_allclose(nodes.cost, profile, rtol=0, atol=EXACT)
