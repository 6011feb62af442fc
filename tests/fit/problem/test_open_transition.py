"""A transition whose sharpness is one of the unknowns: problem, fit and posterior.

Each is held against runs in which the sharpness is a number, which know nothing of a
prior of it.
"""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize, stats

from pushfit.config import GraspConfig
from pushfit.data.grasp import make_grasp
from pushfit.data.truth import stated_parameters
from pushfit.errors import ConfigError
from pushfit.explore.belief.from_fit import belief_from
from pushfit.explore.belief.predict import predict
from pushfit.fit.problem.constraint_terms import N_PRIOR_DRAWS
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import encode, prior_x_samples
from pushfit.fit.problem.predictions import predict_draws
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.sweep.posterior import sweep_posterior
from pushfit.model import as_float
from tests.fit.kinds import KINDS
from tests.fit.tables import SEVEN_DEG, case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

AUTO = '[transition]\nsharpness = "auto"\n'
# The default prior of p.
MEDIAN, SD_LOG = 8.0, 1.0
ALPHA, REACH = np.pi / 2, (0.0, np.pi)
# Nodes of Gauss and Hermite over ln p: twice as many change nothing beyond 0.002.
N_NODES = 12
# Standard errors; a false alarm once in 15 000.
N_SE = 4.0
N_COUNTED, KS_LEVEL = 1000, 1e-3
# Of the solver, against its own tolerance of 1e-10 in the coordinates.
SOLVED = 1e-6
# Of SciPy, as small as it takes.
SCIPY = 1e-14


def at_sharpness(problem: Problem, p: float) -> Problem:
    """The problem of a stated sharpness, traced so that one program serves all."""
    i, j = problem.names.index("ln_p"), problem.data_names.index("ln_p")
    return replace(
        problem,
        grasp=replace(problem.grasp, sharpness=as_float(p)),
        priors={n: prior for n, prior in problem.priors.items() if n != "p"},
        names=problem.names[:i] + problem.names[i + 1 :],
        data_names=problem.data_names[:j] + problem.data_names[j + 1 :],
        constraint=None,
        constraint_offset=None,
    )


@pytest.fixture(scope="module")
def setup() -> Setup:
    """Pushes of a soft contact, p = 6."""
    table = case_table(CASES["soft"], noise=0.02, seed=3, theta_deg=SEVEN_DEG)
    return settle_noise(build_problem(table, config(AUTO)))


@pytest.fixture(scope="module")
def swept(setup):
    return sweep_posterior(setup, seed=1, reference_alpha=ALPHA, reach=REACH)


@pytest.mark.parametrize(
    "name",
    [
        "open_transition",
        pytest.param("open_transition_tilting", marks=pytest.mark.slow),
    ],
)
def test_a_point_is_one_of_a_stated_sharpness_and_its_prior(name):
    kind = KINDS[name]
    problem = build_problem(kind.table(0), config(kind.text)).problem
    x = jnp.asarray(prior_x_samples(problem, np.random.default_rng(1), 1)[0])
    at = problem.names.index("ln_p")
    stated = at_sharpness(problem, float(jnp.exp(x[at])))
    rest = jnp.delete(x, at)
    np.testing.assert_allclose(
        problem.predict(problem.state(x)),
        stated.predict(stated.state(rest)),
        rtol=EXACT,
    )
    expected = stats.norm.logpdf(float(x[at]), np.log(MEDIAN), SD_LOG)
    found = float(problem.log_prior(x) - stated.log_prior(rest))
    np.testing.assert_allclose(found, expected, rtol=ROUTES)


def test_draws_come_back_from_their_values(setup):
    problem = setup.problem
    x = prior_x_samples(problem, np.random.default_rng(2), 8)
    values = samples_mapping(problem, x, ALPHA, reach=REACH)
    np.testing.assert_allclose(encode(problem, values), x, rtol=ROUTES)
    np.testing.assert_allclose(
        values["p"], np.exp(x[:, problem.names.index("ln_p")]), rtol=EXACT
    )


def test_the_critical_angle_does_not_depend_on_the_sharpness(setup):
    problem = setup.problem
    x = prior_x_samples(problem, np.random.default_rng(2), 8)
    other = x.copy()
    other[:, problem.names.index("ln_p")] = 0.3
    one, two = (
        samples_mapping(problem, v, ALPHA, reach=REACH)["theta_c"] for v in (x, other)
    )
    np.testing.assert_array_equal(one, two)


def test_bands_and_beliefs_predict_what_the_problem_does(setup):
    """Three ways from draws to heights take p from each draw."""
    problem = setup.problem
    x = prior_x_samples(problem, np.random.default_rng(4), 8)
    samples = samples_mapping(problem, x, ALPHA, reach=REACH)
    theta, alpha = (
        np.asarray(a)[:5] for a in (problem.pushes.theta, problem.pushes.alpha)
    )
    expected = np.stack(
        [
            np.asarray(problem.predict(problem.state(jnp.asarray(row))))[:, :5]
            for row in x
        ]
    )
    bands = predict_draws(problem, samples, np.stack([theta, alpha])).heights
    np.testing.assert_allclose(bands, expected, rtol=ROUTES)
    belief = belief_from(setup, samples, seed=0)
    # Draws of a belief are shuffled: K_sn tells which is which.
    order = [np.argmin(np.abs(samples["K_sn"] - k)) for k in belief.samples["K_sn"][:8]]
    heights = predict(belief, theta, alpha).heights[:, :, :8]
    # By push, channel and draw, where the others are by draw, channel and push.
    np.testing.assert_allclose(heights, expected[order].T, rtol=ROUTES)


def test_the_best_fit_weighs_the_sharpness_against_its_prior(setup):
    """χ² plus ((ln p - ln 8) / 1)², which a fit at any other p exceeds."""
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    best = float(fit.estimate[fit.names.index("ln_p")])

    @jax.jit
    def residuals(y, p):
        return at_sharpness(setup.problem, p).data_residuals(y)

    def total(ln_p: float) -> float:
        """By SciPy, from the best fit."""
        words = {"args": (np.exp(ln_p),), "xtol": SCIPY, "ftol": SCIPY, "gtol": SCIPY}
        start = np.delete(fit.estimate, fit.names.index("ln_p"))
        cost = optimize.least_squares(residuals, start, slopes, **words).cost
        return 2 * cost + ((ln_p - mean) / sd) ** 2

    slopes = jax.jit(jax.jacfwd(residuals))
    mean, sd = held_moments(setup.problem)
    assert abs(mean - np.log(MEDIAN)) < N_SE * SD_LOG / np.sqrt(N_PRIOR_DRAWS)
    assert abs(sd - SD_LOG) < N_SE * SD_LOG / np.sqrt(2 * N_PRIOR_DRAWS)
    np.testing.assert_allclose(total(best), fit.chi_square, rtol=SOLVED)
    assert total(best - 0.1) > fit.chi_square
    assert total(best + 0.1) > fit.chi_square
    assert fit.n_free == 3


def held_moments(problem: Problem) -> tuple[float, float]:
    """Mean and sd of ln p that the residual stands for."""
    assert problem.constraint is not None
    assert problem.constraint_offset is not None
    slope = float(problem.constraint[-1, problem.data_names.index("ln_p")])
    return float(problem.constraint_offset[-1]) / slope, 1 / slope


def test_heights_that_say_nothing_of_the_sharpness_leave_its_prior():
    """Where every push rolls the two forces are never near each other."""
    # As many pushes as in the fixture, so that its programs serve.
    theta_deg = np.linspace(5.0, 30.0, SEVEN_DEG.size)
    table = case_table(CASES["one_sided"], noise=0.02, theta_deg=theta_deg)
    setup = settle_noise(build_problem(table, config(AUTO)))
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    mean, sd = held_moments(setup.problem)
    assert abs(float(fit.estimate[fit.names.index("ln_p")]) - mean) < 0.5 * sd


@pytest.mark.slow
def test_evidence_and_angle_are_those_of_all_sharpnesses_together(setup, swept):
    """∫ evidence(p) prior(p) dp by Gauss and Hermite over runs of a stated p."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(N_NODES)
    logs, errors, angles = [], [], []
    for node in nodes:
        p = MEDIAN * np.exp(SD_LOG * node)
        stated = replace(setup, problem=at_sharpness(setup.problem, p), search=None)
        run = sweep_posterior(stated, seed=2, reference_alpha=ALPHA, reach=REACH)
        logs.append(run.log_evidence)
        errors.append(run.log_evidence_error)
        angles.append(run.samples["theta_c"])
    terms = np.log(weights / np.sum(weights)) + np.array(logs)
    total = np.logaddexp.reduce(terms)
    shares = np.exp(terms - total)
    error = np.hypot(swept.log_evidence_error, np.linalg.norm(shares * errors))
    assert abs(swept.log_evidence - total) < N_SE * error
    rng = np.random.default_rng(5)
    which = rng.choice(N_NODES, N_COUNTED, p=shares)
    mixed = np.array([rng.choice(angles[i]) for i in which])
    own = swept.samples["theta_c"][:N_COUNTED]
    assert stats.ks_2samp(own, mixed).pvalue > KS_LEVEL


@pytest.mark.slow
def test_what_is_not_known_of_the_sharpness_widens_the_angle(setup, swept):
    """Draws of θ_c at every p, as far as p is open, against those at its median."""
    stated = replace(setup, problem=at_sharpness(setup.problem, MEDIAN), search=None)
    run = sweep_posterior(stated, seed=2, reference_alpha=ALPHA, reach=REACH)
    assert np.std(swept.samples["theta_c"]) > np.std(run.samples["theta_c"])


def test_a_transition_is_open_unless_it_is_stated():
    assert GraspConfig().transition.sharpness == "auto"
    table = case_table(CASES["soft"], noise=0.02)
    assert "ln_p" in build_problem(table, GraspConfig()).problem.names


def test_a_simulation_is_hard_unless_stated_and_reads_no_prior_of_the_sharpness():
    names = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L")
    text = AUTO + "".join(f"[parameters.{n}]\nfixed = 1\n" for n in names)
    assert stated_parameters(config(text)).L == 1.0
    assert make_grasp(config(text), "n").sharpness == np.inf
    prior = "[parameters.p]\nlognormal = { median = 6.0, sd_log = 0.5 }\n"
    with pytest.raises(ConfigError, match=r"\[transition\] sharpness"):
        stated_parameters(config(text + prior))
