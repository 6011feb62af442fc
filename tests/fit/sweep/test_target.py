"""Expansions and first guesses where pushes cannot be predicted."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.sweep.outer import _first_starts
from pushfit.fit.sweep.prior import make_target
from pushfit.fit.sweep.target import IMPOSSIBLE, Target
from tests.fit.kinds import KINDS

ALPHA = np.pi / 2


@pytest.fixture
def target(monkeypatch) -> Target:
    """A posterior without predictions below its mean of u."""
    known = Target.differences

    def differences(self, y):
        return jnp.where(y[0] < self.mean[0], jnp.nan, known(self, y))

    monkeypatch.setattr(Target, "differences", differences)
    return make_target(KINDS["plain"].setup(1).problem, ALPHA)


def test_what_cannot_be_predicted_spoils_no_sum(target):
    """One NaN in a grid of conditional modes would make all of its masses NaN."""
    points = jnp.stack([target.mean.at[0].add(move) for move in (-1.0, 1.0)])
    found = eqx.filter_jit(lambda t, y: jax.vmap(t.expand)(y))(target, points)
    assert found.misfit[0] == IMPOSSIBLE
    assert found.misfit[1] < IMPOSSIBLE
    assert np.any(np.asarray(found.hessian[1]) != 0)
    for leaf in jax.tree.leaves(found):
        assert np.all(np.isfinite(leaf))


def test_first_guesses_are_numbers_everywhere(target):
    assert np.all(np.isfinite(eqx.filter_jit(_first_starts)(target)))
