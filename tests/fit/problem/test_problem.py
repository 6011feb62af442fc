"""The one place of densities, against SciPy and against its own identities."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from pushfit.errors import ConfigError
from pushfit.fit.problem.problem import STUDENT_DOF
from pushfit.fit.problem.setup import build_problem, n_azimuths
from tests.fit.tables import FIXED as KNOWN
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import DIFFERENCE, EXACT, ROUTES

SAMPLED = '[noise]\nsigma = "sampled"\n'
FIXED = {
    "nothing": {},
    "K_sn": {"K_sn": 1200.0},
    "K_dn": {"K_dn": 600.0},
    "L": {"L": 0.04},
    "K_st": {"K_st": 300.0},
    "C_d": {"C_d": 0.24},
    "K_st and C_d": {"K_st": 300.0, "C_d": 0.24},
    "C_d and L": {"C_d": 0.24, "L": 0.04},
    "K_st and L": {"K_st": 300.0, "L": 0.04},
    "C_rr": {"C_rr": 0.25},
    "both normal": {"K_sn": 1200.0, "K_dn": 600.0},
}


def fixing(name: str):
    """Configuration that fixes these parameters."""
    lines = [f"[parameters.{n}]\nfixed = {v}\n" for n, v in FIXED[name].items()]
    return config("".join(lines))


def log_parameters(problem, x):
    """Logs of the free parameters and e, as the prior sees them."""
    params = problem.state(x).params
    free = [
        n for n in ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L") if n in problem.priors
    ]
    values = [jnp.log(getattr(params, n)) for n in free]
    values += [getattr(params, n) for n in ("e1", "e2") if n in problem.priors]
    return jnp.stack(values)


def some_x(problem, seed=0):
    rng = np.random.default_rng(seed)
    centre = {"ln_A": 6.0, "ln_B": 4.6, "ln_C_rr": -1.4, "ln_L": -3.2, "ln_F_0": 0.5}
    return jnp.asarray([centre.get(n, 0.0) + rng.normal(0, 0.3) for n in problem.names])


@pytest.mark.parametrize(
    ("shape", "name"),
    [
        *(("paper", name) for name in FIXED),
        ("ellipse", "K_st and C_d"),
        *(
            pytest.param("ellipse", name, marks=pytest.mark.slow)
            for name in FIXED
            if name != "K_st and C_d"
        ),
    ],
)
def test_prior_keeps_its_volume_whatever_is_fixed(shape, name):
    """log_prior(x) is the prior of the parameters times |det| by autodiff."""
    problem = build_problem(case_table(CASES[shape]), fixing(name)).problem
    assert len(problem.names) == len(problem.priors)
    keep = [i for i, n in enumerate(problem.names) if not n.startswith("ln_sigma")]
    x = some_x(problem)

    def of_kept(values):
        return log_parameters(problem, x.at[jnp.asarray(keep)].set(values))

    jacobian = jax.jit(jax.jacfwd(of_kept))(x[jnp.asarray(keep)])
    volume = np.linalg.slogdet(np.asarray(jacobian))[1]
    state = problem.state(x)
    expected = volume
    for parameter, prior in problem.priors.items():
        if parameter.startswith("sigma_"):
            value = jnp.log(state.sigma[0])
        else:
            value = getattr(state.params, parameter)
            value = jnp.log(value) if prior.is_positive else value
        expected = expected + float(prior.log_prob(value))
    np.testing.assert_allclose(float(problem.log_prior(x)), expected, rtol=ROUTES)


@pytest.mark.parametrize("name", [n for n in FIXED if n != "nothing"])
def test_fixed_parameters_stay_fixed(name):
    problem = build_problem(case_table(CASES["paper"]), fixing(name)).problem
    params = problem.state(some_x(problem)).params
    for parameter, value in problem.fixed.items():
        np.testing.assert_allclose(getattr(params, parameter), value, rtol=EXACT)


@pytest.mark.parametrize("likelihood", ["normal", "student_t"])
def test_log_likelihood_is_the_sum_of_scipy_densities(likelihood):
    table = case_table(CASES["paper"], noise=0.04, seed=2)
    text = f'[noise]\nlikelihood = "{likelihood}"\n'
    problem = build_problem(table, config(text)).problem
    state = problem.state(some_x(problem))
    n = table.n_pushes
    predicted = np.asarray(problem.predict(state))[0, :n]
    observed, sd = table.heights("height"), table.sd("height")
    if likelihood == "normal":
        expected = stats.norm.logpdf(observed, predicted, sd).sum()
    else:
        # A stated sd is a standard deviation, which SciPy's scale is not.
        scale = sd / stats.t.std(STUDENT_DOF)
        expected = stats.t.logpdf(observed, STUDENT_DOF, predicted, scale).sum()
    np.testing.assert_allclose(
        float(problem.log_likelihood(state)), expected, rtol=EXACT
    )


@pytest.mark.parametrize("likelihood", ["normal", "student_t"])
def test_half_the_squared_residuals_are_the_negative_log_likelihood(likelihood):
    table = case_table(CASES["paper"], noise=0.04, seed=2)
    text = f'[noise]\nlikelihood = "{likelihood}"\n'
    problem = build_problem(table, config(text)).problem
    states = [problem.state(some_x(problem, seed)) for seed in (1, 2)]
    half = [0.5 * float(jnp.sum(problem.residuals(s) ** 2)) for s in states]
    logs = [float(problem.log_likelihood(s)) for s in states]
    np.testing.assert_allclose(half[1] - half[0], logs[0] - logs[1], rtol=ROUTES)


def test_sampled_sigma_adds_to_the_given_one_in_quadrature():
    table = case_table(CASES["paper"], noise=0.04, seed=2)
    problem = build_problem(table, config('[noise]\nsigma = "sampled"\n')).problem
    x = some_x(problem).at[problem.names.index("ln_sigma_height")].set(np.log(0.03))
    state = problem.state(x)
    predicted = np.asarray(problem.predict(state))[0, : table.n_pushes]
    expected = stats.norm.logpdf(table.heights("height"), predicted, 0.05).sum()
    np.testing.assert_allclose(
        float(problem.log_likelihood(state)), expected, rtol=EXACT
    )


@pytest.mark.parametrize(
    ("shape", "text"),
    [
        ("soft", SAMPLED),
        ("ellipse", ""),
        ("preload", ""),
        pytest.param("soft", "", marks=pytest.mark.slow),
        pytest.param("ellipse", SAMPLED, marks=pytest.mark.slow),
        pytest.param("preload", SAMPLED, marks=pytest.mark.slow),
    ],
)
def test_gradient_of_log_prob_equals_finite_differences(shape, text):
    table = case_table(CASES[shape], noise=0.05, repeats=1)
    problem = build_problem(table, config(text)).problem
    x = some_x(problem, 4)
    log_prob = eqx.filter_jit(problem.log_prob)
    gradient = np.asarray(eqx.filter_jit(eqx.filter_grad(problem.log_prob))(x))
    step = 1e-6
    for i in range(x.size):
        up, down = log_prob(x.at[i].add(step)), log_prob(x.at[i].add(-step))
        slope = float(up - down) / (2 * step)
        scale = max(abs(slope), np.max(np.abs(gradient)))
        np.testing.assert_allclose(gradient[i], slope, atol=DIFFERENCE * scale, rtol=0)


@pytest.mark.parametrize("likelihood", ["normal", "student_t"])
def test_padding_cannot_poison_a_gradient(likelihood):
    """NaN in a padded height leaves value and gradient as they were."""
    text = f'[noise]\nlikelihood = "{likelihood}"\n'
    table = case_table(CASES["paper"], noise=0.05)
    problem = build_problem(table, config(text)).problem
    padded = ~np.asarray(problem.mask)
    assert padded.any()
    poisoned = jnp.where(padded, jnp.nan, problem.observed)
    other = eqx.tree_at(lambda p: p.observed, problem, poisoned)
    x = some_x(problem)
    # One program for both, whose sums are in one order.
    both = eqx.filter_jit(lambda x, p: eqx.filter_value_and_grad(p.log_prob)(x))
    for found, expected in zip(both(x, other), both(x, problem), strict=True):
        assert np.isfinite(expected).all()
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    ("alpha_deg", "n"),
    [([90, 90.1], 1), ([0, 180, 360], 1), ([0, 179.9], 1), ([0, 60, 120], 3)],
)
def test_azimuths_are_counted_as_axes(alpha_deg, n):
    assert n_azimuths(np.radians(np.asarray(alpha_deg, dtype=float))) == n


@pytest.mark.parametrize("noise", ["", 'sigma = "sampled"'])
def test_a_question_of_which_all_is_known_is_refused(noise):
    """Noise alone is nothing to infer; an unknown preload is."""
    known = "".join(f"[parameters.{n}]\nfixed = {v}\n" for n, v in KNOWN.items())
    known = f"[noise]\n{noise}\n{known}[parameters.C_rr]\nfixed = 0.24\n"
    table = case_table(CASES["paper"], noise=0.02)
    with pytest.raises(ConfigError, match="nothing to infer") as error:
        build_problem(table, config(known))
    assert error.value.code == "nothing_free"
    setup = build_problem(table, config(f'[grasp]\npreload_n = "estimate"\n{known}'))
    assert setup.problem.data_names == ("ln_F_0",)
