"""Expansions and first guesses where pushes cannot be predicted."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from pushfit.fit.sweep.likelihood import log_likelihood, noise_terms
from pushfit.fit.sweep.outer_nodes import _first_starts
from pushfit.fit.sweep.prior import make_target
from pushfit.fit.sweep.target import IMPOSSIBLE, Target
from tests.fit.kinds import KINDS

ALPHA = np.pi / 2
# Sums over nodes of ln σ only say where draws are proposed.
SUMMED = 0.03


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


@pytest.mark.parametrize("size", [0.01, 0.3])
def test_sampled_noise_is_summed_out_as_quadrature_does(size):
    pooled = make_target(KINDS["plain"].setup(1).problem, ALPHA).pooled
    difference = size * np.cos(np.arange(pooled.problem.mask.size))[None]
    difference = jnp.where(pooled.problem.mask, difference, 0.0)
    prior = pooled.problem.priors["sigma_height"]
    ln_sigma = jnp.linspace(-9.0, 2.0, 2001)
    level = np.array(
        jax.vmap(
            lambda x: (
                log_likelihood(pooled, difference, {"ln_sigma_height": x})
                + prior.log_prob(x)
            )
        )(ln_sigma)
    )
    density, highest = np.exp(level - np.max(level)), np.max(level)
    mass = integrate.simpson(density, ln_sigma)
    precision = integrate.simpson(density * np.exp(-2 * ln_sigma), ln_sigma) / mass
    terms = noise_terms(pooled, difference)
    assert float(terms.log_likelihood) == pytest.approx(
        highest + np.log(mass), abs=SUMMED
    )
    expected = np.asarray(pooled.count * pooled.problem.mask) * precision
    np.testing.assert_allclose(terms.weights, expected, rtol=SUMMED)
