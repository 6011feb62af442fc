"""Starts: the change of coordinates inverted, the prior drawn, every mode populated."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from pushfit.errors import FitError
from pushfit.fit.problem.encoding import encode, prior_x_samples
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.results import Mode
from pushfit.fit.sampler.chains import Densities
from pushfit.fit.sampler.starts import starting_points
from tests.fit.tables import case_table, config, setup_of
from tests.problems import CASES
from tests.tolerances import EXACT

# A chain of logs and exponentials.
ROUND_TRIP = 1e-10
MIN_P = 1e-4  # a false alarm once in 10 000 seeds, per parameter
FIXED = {
    "nothing": "",
    "K_sn": "[parameters.K_sn]\nfixed = 1200.0",
    "K_dn": "[parameters.K_dn]\nfixed = 600.0",
    "L": "[parameters.L]\nfixed = 0.04",
    "K_st": "[parameters.K_st]\nfixed = 300.0",
    "C_d": "[parameters.C_d]\nfixed = 0.24",
    "C_rr": "[parameters.C_rr]\nfixed = 0.25",
    "F_0 estimated": '[grasp]\npreload_n = "estimate"',
    "sigma sampled": '[noise]\nsigma = "sampled"',
}
QUANTITIES = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L", "e1", "e2")


def physical(problem, x):
    """What `Problem.state` makes of points, by the names of the priors."""
    states = jax.vmap(problem.state)(jnp.asarray(x))
    values = {n: np.asarray(getattr(states.params, n)) for n in QUANTITIES}
    values["F_0"] = np.asarray(states.preload)
    for i, channel in enumerate(problem.channels):
        values[f"sigma_{channel}"] = np.asarray(states.sigma)[:, i]
    return {name: values[name] for name in problem.priors}


@pytest.mark.parametrize(
    ("case", "name"),
    [
        *(("paper", name) for name in FIXED),
        ("ellipse", "nothing"),
        *(
            pytest.param("ellipse", name, marks=pytest.mark.slow)
            for name in FIXED
            if name != "nothing"
        ),
    ],
)
def test_encoding_is_the_inverse_of_the_state(case, name):
    table = case_table(CASES[case], noise=0.03)
    problem = build_problem(table, config(FIXED[name])).problem
    x = prior_x_samples(problem, np.random.default_rng(0), 20)
    assert x.shape == (20, len(problem.names))
    values = physical(problem, x)
    np.testing.assert_allclose(
        encode(problem, values), x, rtol=ROUND_TRIP, atol=ROUND_TRIP
    )


def test_prior_draws_follow_the_prior_of_every_parameter():
    """Kolmogorov-Smirnov against SciPy's lognormal, through the coordinates."""
    problem = build_problem(case_table(CASES["paper"], noise=0.03), config()).problem
    values = physical(problem, prior_x_samples(problem, np.random.default_rng(1), 4000))
    for name, prior in problem.priors.items():
        cdf = stats.lognorm(float(prior.second), scale=float(prior.first)).cdf
        assert stats.kstest(values[name], cdf).pvalue > MIN_P, name


def cloud(setup, fit=None, seed=0):
    problem = setup.problem
    fit = fit or fit_least_squares(setup, reference_alpha=0.0)
    densities = Densities(problem)
    points = starting_points(
        problem,
        fit,
        densities,
        n_ensembles=4,
        n_points=256,
        rng=np.random.default_rng(seed),
    )
    return points, densities


@pytest.fixture(scope="module")
def setup():
    return setup_of(case_table(CASES["firm"], noise=0.03))


def test_every_start_is_finite_and_distinct(setup):
    points, densities = cloud(setup)
    assert np.all(np.isfinite(densities.log_prob(points)))
    assert len(np.unique(points, axis=0)) > 0.95 * len(points)


def test_densities_are_those_of_the_problem(setup):
    points, densities = cloud(setup)
    log_probs = eqx.filter_jit(lambda p, x: jax.vmap(p.log_prob)(x))
    expected = log_probs(setup.problem, jnp.asarray(points[:7]))
    # The same operations, fused in another way.
    np.testing.assert_allclose(densities.log_prob(points[:7]), expected, rtol=EXACT)


def test_a_mode_that_cooling_missed_starts_a_walker_in_every_ensemble(setup):
    """A mode is put in by hand where the density is at its best."""
    fit = fit_least_squares(setup, reference_alpha=0.0)
    marked = dict(fit.modes[0].coordinates)
    mode = Mode(coordinates=marked, theta_c_deg=None, chi_square=fit.chi_square)
    points, _ = cloud(setup, dataclasses.replace(fit, modes=(mode,)))
    first = points.reshape(4, 256, -1)[:, 0]
    for name, value in marked.items():
        assert np.all(first[:, setup.problem.names.index(name)] == value)


def test_a_hopeless_mode_starts_no_walker(setup):
    fit = fit_least_squares(setup, reference_alpha=0.0)
    far = {name: value + 20.0 for name, value in fit.modes[0].coordinates.items()}
    mode = Mode(coordinates=far, theta_c_deg=None, chi_square=fit.chi_square)
    points, _ = cloud(setup, dataclasses.replace(fit, modes=(mode,)))
    assert not np.any(points[:, setup.problem.names.index("ln_A")] == far["ln_A"])


def test_heights_without_finite_likelihood_name_a_parameter_with_its_prior():
    setup = setup_of(case_table(CASES["firm"], noise=0.03))
    fit = fit_least_squares(setup, reference_alpha=0.0)
    problem = dataclasses.replace(
        setup.problem, observed=setup.problem.observed * np.nan
    )
    with pytest.raises(FitError, match=r"K_sn = .* N/m \(prior: lognormal") as error:
        cloud(dataclasses.replace(setup, problem=problem), fit)
    assert error.value.code == "no_finite_start"


@pytest.mark.slow
def test_bounds_of_uniform_priors_hold_for_every_start():
    text = "[parameters.C_rr]\nuniform = { low = 0.3, high = 0.6 }"
    setup = setup_of(case_table(CASES["firm"], noise=0.03), text)
    points, _ = cloud(setup)
    C_rr = physical(setup.problem, points)["C_rr"]
    assert np.all((C_rr >= 0.3) & (C_rr <= 0.6))
