"""Least squares against truth, against SciPy, and where there is no answer."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.optimize import least_squares, minimize

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import FitError
from pushfit.fit.problem.problem import bucket
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.guesses import guesses
from pushfit.fit.profiles.least_squares import (
    MAX_ROUNDS,
    STALLED_DELTA_CHI_SQUARE,
    costs_at,
    fit_least_squares,
    fit_result,
    polish,
    restarted,
)
from tests.fit.kinds import KINDS
from tests.fit.tables import (
    SEVEN_DEG,
    case_table,
    config,
    log_contact,
    setup_of,
    tables_of_the_prior,
    without_sd,
)
from tests.problems import CASES, PUSH
from tests.tolerances import EXACT

# The solver's relative tolerance is 1e-10; ten times that.
EXACT_DATA = 1e-9
# Both solvers stop at a gradient of rounding; SciPy at its ftol of 1e-12.
TWO_SOLVERS = 1e-6
# Far below what anybody would notice, and far above where solvers stop.
SAME_OPTIMUM = 0.01
# 337 degrees of freedom: sigma is known to 4 %; four of them.
SIGMA = 0.16
COMPONENTS = ("height_normal", "height_tangential")
# Two elevations at which every azimuth rolls, and two at which none does.
FOUR_DEG = np.array([15.0, 30.0, 60.0, 80.0])
ISOTROPIC = ("paper", "firm", "soft", "preload", "blind_magnitude")


def table_config(case) -> str:
    sharpness = float(case.grasp.sharpness)
    text = f"[grasp]\npreload_n = {float(case.grasp.preload)!r}\n"
    return text + (f"[transition]\nsharpness = {sharpness}\n" if sharpness < 99 else "")


def fit_of(table, text=""):
    return fit_least_squares(setup_of(table, text), reference_alpha=np.pi / 2)


@pytest.mark.parametrize("name", ISOTROPIC)
def test_noise_free_heights_give_the_truth(name):
    case = CASES[name]
    fit = fit_of(case_table(case), table_config(case))
    truth = log_contact(case.params)
    expected = [truth[n] for n in fit.names]
    np.testing.assert_allclose(fit.estimate, expected, rtol=0, atol=EXACT_DATA)
    best = fit.modes[0].theta_c_deg
    np.testing.assert_allclose(best, case.critical_angle_deg, rtol=EXACT_DATA)


def test_noise_free_heights_over_azimuths_give_the_ellipse():
    case = CASES["ellipse"]
    fit = fit_of(case_table(case, repeats=1, theta_deg=FOUR_DEG))
    stiff = {"ln_A": case.A, "ln_B": case.B, "ln_C_rr": float(case.params.C_rr)}
    found = dict(zip(fit.names, fit.estimate, strict=True))
    for name, value in stiff.items():
        np.testing.assert_allclose(found[name], np.log(value), atol=EXACT_DATA, rtol=0)
    axis = np.degrees(np.arctan2(found["f2"], found["f1"])) / 2 % 180
    np.testing.assert_allclose((axis + 90) % 180, case.soft_axis_deg, rtol=EXACT_DATA)


@pytest.mark.parametrize(
    ("name", "channels"),
    [
        ("paper", ("height",)),
        pytest.param("paper", COMPONENTS, marks=pytest.mark.slow),
        pytest.param("soft", ("height",), marks=pytest.mark.slow),
        pytest.param("soft", COMPONENTS, marks=pytest.mark.slow),
    ],
)
def test_scipy_finds_the_same_optimum(name, channels):
    case = CASES[name]
    # No push at 45°, θ_c of the case: on that kink of the hard switch both solvers
    # crawl, and stop a thousandth of a unit of chi-square apart.
    theta_deg = np.arange(7.0, 88.0, 5.0)
    table = case_table(case, noise=0.03, channels=channels, seed=3, theta_deg=theta_deg)
    setup = setup_of(table, table_config(case))
    fit = fit_least_squares(setup, reference_alpha=np.pi / 2)
    problem = setup.problem

    @eqx.filter_jit
    def residuals(y):
        return problem.data_residuals(y)

    # From guesses and from our optimum, where it must find nothing better.
    starts = [fit.estimate, *guesses(problem)[:5]]
    runs = [
        least_squares(residuals, start, xtol=1e-12, ftol=1e-12, gtol=1e-12)
        for start in starts
    ]
    other = min(runs, key=lambda run: run.cost)
    np.testing.assert_allclose(fit.chi_square, 2 * other.cost, rtol=TWO_SOLVERS)
    np.testing.assert_allclose(fit.estimate, other.x, atol=100 * TWO_SOLVERS, rtol=0)


# A grasp that rolls at every elevation of its first sweep, so that it has no θ_c there.
ROLLING = {
    **{"ln_A": 5.04, "ln_B": 4.8, "f1": 0.69, "f2": -0.14, "ln_C_rr": -0.31},
    **{"ln_r": -1.06, "ln_s": 0.37, "ln_L": -3.28},
}


@pytest.mark.parametrize("seed", [2, 3])
def test_the_best_fit_is_found_where_no_critical_angle_is(seed):
    """The valley of the truth is deeper than those of a search along θ_c."""
    setup = KINDS["paper"].setup(0)
    problem = setup.problem
    state = problem.state(jnp.asarray([ROLLING[name] for name in problem.names]))
    noise = np.random.default_rng(seed).standard_normal(problem.observed.shape)
    observed = problem.predict(state) + problem.reference_sigma * noise
    problem = eqx.tree_at(lambda p: p.observed, problem, observed)
    truth = np.array([[ROLLING[name] for name in problem.data_names]])
    _, costs, _ = polish(problem, truth)
    fit = fit_least_squares(replace(setup, problem=problem), reference_alpha=np.pi / 2)
    assert fit.chi_square <= costs[0] + SAME_OPTIMUM


@pytest.mark.slow
def test_no_random_start_finds_a_better_optimum():
    """The best of 100 random starts per table, on a smooth likelihood."""
    case = CASES["blind_magnitude"]
    for seed in range(6):
        table = case_table(case, noise=0.05, seed=seed)
        setup = setup_of(table, "[transition]\nsharpness = 12.0\n")
        fit = fit_least_squares(setup, reference_alpha=np.pi / 2)
        rng = np.random.default_rng(seed)
        starts = rng.uniform(fit.estimate - 3, fit.estimate + 3, (100, 3))
        _, costs, _ = polish(setup.problem, starts)
        assert fit.chi_square <= costs[0] * (1 + TWO_SOLVERS), f"seed {seed}"


def test_covariance_is_nan_where_the_data_do_not_determine_every_coordinate():
    """At one elevation A, B and C_rr cannot be told apart."""
    case = CASES["paper"]
    table = case_table(case, noise=0.02, theta_deg=np.array([30.0]), repeats=30)
    fit = fit_of(table)
    assert np.all(np.isnan(fit.covariance))
    assert np.all(np.isnan(fit.standard_error))


def is_on_kink(fit):
    """Whether θ_c is an elevation of the sweep; no solver gets as close by chance."""
    distance = np.abs(fit.modes[0].theta_c_deg - np.arange(5.0, 90.0, 5.0))
    return np.min(distance) < 1e-6


@pytest.mark.parametrize(("seed", "expected"), [(0, True), (3, True), (5, False)])
def test_an_optimum_on_a_pushed_elevation_has_no_standard_error(seed, expected):
    """There χ² has two slopes and no curvature; beside it the error is finite."""
    fit = fit_of(case_table(CASES["paper"], noise=0.03, seed=seed))
    assert is_on_kink(fit) == expected
    assert np.all(np.isnan(fit.standard_error) == expected)


@pytest.mark.slow
def test_standard_errors_are_missing_on_kinks_all_over_the_prior():
    fits = [fit_of(table) for table in tables_of_the_prior(100)]
    on_kink = np.array([is_on_kink(fit) for fit in fits])
    has_none = np.array([np.all(np.isnan(fit.standard_error)) for fit in fits])
    print(f"{on_kink.sum()} of {len(fits)} optima lie on a kink")
    assert np.all(has_none[on_kink])
    # Beyond the pushes C_rr or B may be out of sight as well.
    assert np.mean(has_none[~on_kink]) < 0.1


@pytest.mark.parametrize(("share", "is_done"), [(0.5, True), (2.0, False)])
def test_a_walk_that_gains_next_to_nothing_has_arrived(share, is_done):
    """A solver that never meets its tolerance, as where no finite ellipse fits best."""
    gain, n_calls = share * STALLED_DELTA_CHI_SQUARE, 0

    def minimiser(points):
        nonlocal n_calls
        n_calls += 1
        return points + 1, jnp.array([10.0 - n_calls * gain]), jnp.array([False])

    _, costs, found = restarted(minimiser, np.zeros((1, 2)))
    assert found[0] == is_done
    np.testing.assert_allclose(costs, 10.0 - MAX_ROUNDS * gain, rtol=TWO_SOLVERS)


@pytest.mark.parametrize(
    ("costs", "code"),
    [([7.0, 9.0], "max_steps"), ([np.inf, np.inf], "no_finite_start")],
)
def test_a_fit_that_did_not_arrive_says_how_far_it_came(costs, code):
    case = CASES["firm"]
    setup = setup_of(case_table(case))
    far = np.array([[log_contact(case.params)[n] for n in setup.problem.data_names]])
    points = np.concatenate([far + 0.1, far + 0.2])
    found = (points, np.array(costs), np.zeros(2, dtype=bool))
    with pytest.raises(FitError) as caught:
        fit_result(setup, found, reference_alpha=np.pi / 2)
    error = caught.value
    assert error.code == code
    assert error.names == setup.problem.data_names
    np.testing.assert_array_equal(error.points, points)
    np.testing.assert_array_equal(error.costs, costs)


@pytest.mark.slow
def test_standard_errors_scatter_as_they_say_where_the_likelihood_is_normal():
    """Components determine all three coordinates: pulls have unit variance."""
    case = CASES["firm"]
    n_tables = 60
    truth = log_contact(case.params)
    pulls = []
    for seed in range(n_tables):
        # No push at 30°, θ_c of the case: on that kink there is no standard error.
        table = case_table(
            case,
            noise=0.02,
            seed=seed,
            channels=COMPONENTS,
            theta_deg=np.arange(7.5, 88.0, 5.0),
        )
        fit = fit_of(table)
        expected = np.array([truth[n] for n in fit.names])
        pulls.append((fit.estimate - expected) / fit.standard_error)
    # n mean(pull²) is chi-square with n degrees of freedom; five of its sd.
    tolerance = 5 * np.sqrt(2 / n_tables)
    np.testing.assert_allclose(np.mean(np.square(pulls), axis=0), 1, atol=tolerance)


@pytest.mark.slow
def test_sampled_sigma_is_the_scatter_about_the_fit():
    case = CASES["paper"]
    table = case_table(case, noise=0.05, repeats=20, seed=1)
    setup = setup_of(table, '[noise]\nsigma = "sampled"\n')
    fit = fit_least_squares(setup, reference_alpha=np.pi / 2)
    # Given sds are in the table, so the total must be what was simulated.
    np.testing.assert_allclose(np.median(fit.sigma), 0.05, rtol=SIGMA)


def test_padding_changes_nothing():
    case = CASES["paper"]
    table = case_table(case, noise=0.03, repeats=1)
    setup = build_problem(table, config())
    n_padded = setup.problem.observed.shape[1]
    assert n_padded == bucket(table.n_pushes) > table.n_pushes
    fit = fit_least_squares(setup, reference_alpha=0.0)
    assert fit.n_data == table.n_pushes
    weights = 1 / table.sd("height")
    residuals = (fit.predicted - table.heights("height")) * weights
    np.testing.assert_allclose(np.sum(residuals**2), fit.chi_square, rtol=EXACT)


@pytest.mark.parametrize(
    ("channels", "text"),
    [
        (COMPONENTS, ""),
        (("height",), 'likelihood = "student_t"\n'),
        (("height",), '[transition]\nsharpness = "auto"\n'),
    ],
    ids=["channels", "tails", "transition"],
)
def test_a_search_has_the_weights_that_noise_settles_at(channels, text):
    """Its curve becomes a profile, so that other weights would narrow the set."""
    table = case_table(
        CASES["firm"], noise=0.02, channels=channels, theta_deg=SEVEN_DEG
    )
    setup = setup_of(without_sd(table), f'[noise]\nsigma = "sampled"\n{text}')
    curve = setup.search.curve
    is_possible = np.isfinite(curve.chi_square)
    costs = costs_at(setup.problem, curve.points[is_possible])
    np.testing.assert_allclose(costs, curve.chi_square[is_possible], rtol=EXACT)


@pytest.mark.parametrize("seed", [18, 49])
def test_no_other_start_finds_a_better_fit_beside_heavy_tails(seed):
    """SciPy's, at the same noise; which pushes are outliers is a question of it."""
    clean = case_table(CASES["firm"], repeats=1)
    noise = 0.05 * stats.t.rvs(2, size=clean.n_pushes, random_state=seed)
    heights = clean.heights("height") + noise
    table = PeakTable.from_arrays(
        theta=clean.theta, alpha=clean.alpha, heights={"height": heights}, unit="n"
    )
    text = '[noise]\nsigma = "sampled"\nlikelihood = "student_t"\n'
    fit, theta = fit_of(table, text), table.theta

    def deviance(z):
        A, B, C_rr = np.exp(z)
        normal = A * PUSH * np.sin(theta)
        tangential = np.minimum(C_rr * normal, B * PUSH * np.cos(theta))
        squares = ((np.hypot(normal, tangential) - heights) / fit.sigma) ** 2
        return 5 * np.sum(np.log1p(squares / 2))

    rng = np.random.default_rng(0)
    starts = fit.estimate + rng.normal(size=(48, 3))
    options = {"maxiter": 2000, "maxfev": 2000}
    runs = [
        minimize(deviance, s, method="Nelder-Mead", options=options) for s in starts
    ]
    np.testing.assert_allclose(deviance(fit.estimate), fit.chi_square, rtol=EXACT_DATA)
    assert fit.chi_square < min(run.fun for run in runs) + SAME_OPTIMUM
