"""Priors against SciPy's densities and their own samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate, stats

from pushfit.fit.problem.priors.distributions import (
    Prior,
    default_priors,
    priors_from_config,
)
from pushfit.parameters import OF_GRASP, POSITIVE
from tests.fit.tables import config
from tests.tolerances import EXACT, ROUTES

TAIL = 1e-6  # of the normal prior 4e-7 lies below the range of the integral
MIN_P = 1e-3  # a false alarm once in 1000 seeds, per prior
PRIORS = {
    "lognormal": Prior("lognormal", 800.0, 0.5),
    "normal": Prior("normal", 3.0, 2.0),
    "uniform": Prior("uniform", 0.5, 4.0),
    "signed normal": Prior("normal", -0.5, 1.5, is_positive=False),
    "signed uniform": Prior("uniform", -2.0, 1.0, is_positive=False),
}


@pytest.mark.parametrize("name", PRIORS)
def test_density_integrates_to_one(name):
    prior = PRIORS[name]
    low, high = (-12.0, 12.0) if prior.is_positive else (-9.0, 9.0)
    edges = [np.log(0.5), np.log(4.0)] if name == "uniform" else [-2.0, 1.0]
    total, _ = integrate.quad(
        lambda u: float(jnp.exp(prior.log_prob(jnp.asarray(u)))),
        low,
        high,
        points=edges,
        limit=200,
    )
    np.testing.assert_allclose(total, 1.0, rtol=TAIL)


@pytest.mark.parametrize("name", PRIORS)
def test_samples_follow_the_density(name):
    """Kolmogorov-Smirnov against the numerically integrated density."""
    prior = PRIORS[name]
    draws = prior.sample(np.random.default_rng(5), 4000)
    grid = np.linspace(draws.min() - 2, draws.max() + 2, 20001)
    density = np.exp(np.asarray(prior.log_prob(jnp.asarray(grid))))
    cdf = integrate.cumulative_trapezoid(density, grid, initial=0)
    p_value = stats.kstest(draws, lambda u: np.interp(u, grid, cdf)).pvalue
    assert p_value > MIN_P


def test_normal_prior_of_a_positive_parameter_is_truncated_at_zero():
    u = np.linspace(-2, 2, 9)
    value = np.exp(u)
    expected = stats.truncnorm.logpdf(value, -1.5, np.inf, loc=3.0, scale=2.0) + u
    found = np.asarray(PRIORS["normal"].log_prob(jnp.asarray(u)))
    np.testing.assert_allclose(found, expected, rtol=ROUTES)


@pytest.mark.parametrize("name", PRIORS)
def test_gradient_is_finite_inside(name):
    prior = PRIORS[name]
    slope = jax.grad(lambda u: prior.log_prob(u))(jnp.asarray(0.3))
    assert np.isfinite(slope)


def test_config_overrides_and_fixes():
    text = """
    [parameters.L]
    fixed = 0.05
    [parameters.K_sn]
    normal = { mean = 900.0, sd = 90.0 }
    [parameters.e1]
    uniform = { low = -1.0, high = 1.0 }
    """
    priors, fixed = priors_from_config(config(text), default_priors(None))
    assert fixed == {"L": 0.05}
    assert "L" not in priors
    assert (priors["K_sn"].kind, float(priors["K_sn"].second)) == ("normal", 90.0)
    assert not priors["e1"].is_positive


def test_default_priors_scale_with_uncalibrated_heights():
    """Stiffness in counts/m is as much wider as the scale is larger."""
    plain, scaled = default_priors(None), default_priors(1e5)
    ratio = float(scaled["K_sn"].first / plain["K_sn"].first)
    for name in ("K_dn", "K_st", "C_d"):
        found = float(scaled[name].first / plain[name].first)
        np.testing.assert_allclose(found, ratio, rtol=EXACT)
    for name in ("C_rr", "L"):
        assert float(scaled[name].first) == float(plain[name].first)
    assert set(POSITIVE) - set(OF_GRASP) <= set(plain)
