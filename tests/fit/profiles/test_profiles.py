"""Likelihood sets: against closed forms, brute force, and what no push can tell."""

import dataclasses
from functools import partial

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize, stats

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.profiles.profile_sets import (
    NARROWEST,
    pieces_below,
    profile_set,
    threshold,
    verdict_of,
)
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.fit.results import Verdict
from pushfit.model import Grasp
from tests.fit.tables import case_table, setup_of, without_sd
from tests.problems import CASES, PUSH, ellipse, paper_parameters
from tests.tolerances import EXACT, ROUTES

ALPHA = np.pi / 2
FIXED = {"K_sn": 1200, "K_dn": 600, "K_st": 300, "C_d": 0.24, "L": 0.04}
FRICTION_ONLY = "".join(f"[parameters.{n}]\nfixed = {v}\n" for n, v in FIXED.items())
CHANNEL = {
    "channels": ("height_tangential",),
    "theta_deg": np.array([10.0, 20.0, 30.0]),
}
FIVE = np.array([10.0, 30.0, 45.0, 60.0, 80.0])
ELEVATIONS = np.arange(5.0, 86.0, 5.0)
AUTO = '[transition]\nsharpness = "auto"\n'
# About where the prior has the sharpness.
LN_P = 2.1
# Ends are placed where Δχ² meets its threshold to 0.2 %, so to 0.1 % of the half width.
END = 3e-3
# Ten times the tolerance of the solver.
SOLVED = 1e-9
# A profile found by another solver, from many starts.
SAME_PROFILE = 1e-3
# Twice the step beside an end that stands for the jump of a profile there [deg].
JUMP = 2e-6
# Noise of 1e-6 N leaves a set of 0.0014°; twice that [deg].
NARROW = 3e-3


def profiles_of(setup, *, prob=0.9, alpha=ALPHA, reach=(0.0, np.pi)):
    fit = fit_least_squares(setup, reference_alpha=alpha)
    return likelihood_profiles(
        setup, fit, reference_alpha=alpha, prob=prob, reach=reach
    )


def small_setup(name="firm", *, noise, seed=0, text=""):
    return setup_of(
        case_table(CASES[name], noise=noise, seed=seed, theta_deg=FIVE), text
    )


# Three pushes at 15° in each azimuth, in a grasp that squeezes with 12 kPa.
AZIMUTHS = np.repeat([0.0, 30.0, 60.0, 90.0, 120.0, 150.0], 3)
HEIGHTS = np.array(
    [
        [5.96, 5.94, 5.90, 5.76, 5.80, 5.79, 4.33, 4.32, 4.41],
        [5.09, 5.09, 4.97, 5.95, 5.89, 5.87, 5.78, 5.89, 5.99],
    ]
).ravel()
FOAM = """
[push]
length_mm = 5.0
[grasp]
preload_kpa = 12.0
[transition]
sharpness = "hard"
[parameters.L]
normal = { mean = 0.04, sd = 0.001 }
"""


@pytest.fixture(scope="module")
def firm():
    setup = small_setup(noise=0.05)
    return setup, profiles_of(setup)


def friction_estimate(table):
    """C_rr and Σ slope² of the tangential heights A C_rr S_p sin θ."""
    slope = 400 * PUSH * np.sin(table.theta)
    heights = table.heights("height_tangential")
    return np.sum(slope * heights) / np.sum(slope**2), slope, heights


def test_linear_model_has_the_normal_interval():
    sigma = 0.01
    table = case_table(CASES["paper"], noise=sigma, **CHANNEL)
    estimate, slope, _ = friction_estimate(table)
    half = stats.norm.ppf(0.95) * sigma / np.sqrt(np.sum(slope**2))
    setup = setup_of(table, FRICTION_ONLY)
    ((low, high),) = profiles_of(setup)["C_rr"].pieces
    expected = [estimate - half, estimate + half]
    np.testing.assert_allclose([low, high], expected, rtol=0, atol=END * half)
    # And the error of ln C_rr, at the best fit.
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    error = sigma / np.sqrt(np.sum(slope**2)) / estimate
    np.testing.assert_allclose(fit.estimate, [np.log(estimate)], rtol=SOLVED)
    np.testing.assert_allclose(fit.standard_error, [error], rtol=SOLVED)


def test_noise_estimated_from_residuals_gives_the_t_interval():
    table = case_table(CASES["paper"], noise=0.01, **CHANNEL)
    setup = setup_of(table, FRICTION_ONLY)
    noise = dataclasses.replace(setup.noise, kind="sampled")
    estimate, slope, heights = friction_estimate(table)
    dof = table.n_pushes - 1
    sigma = np.sqrt(np.sum((heights - estimate * slope) ** 2) / dof)
    known = jnp.full_like(setup.problem.reference_sigma, sigma)
    problem = eqx.tree_at(lambda p: p.reference_sigma, setup.problem, known)
    setup = dataclasses.replace(setup, noise=noise, problem=problem)
    half = stats.t.ppf(0.95, dof) * sigma / np.sqrt(np.sum(slope**2))
    ((low, high),) = profiles_of(setup)["C_rr"].pieces
    expected = [estimate - half, estimate + half]
    np.testing.assert_allclose([low, high], expected, rtol=0, atol=END * half)


@pytest.fixture(scope="module")
def single():
    """One push in each direction, nothing said of the noise nor of the transition."""
    table = case_table(CASES["firm"], noise=0.03, repeats=1, theta_deg=ELEVATIONS)
    setup = setup_of(without_sd(table), AUTO)
    assert setup.noise.kind == "sampled"
    return setup, profiles_of(setup)


@pytest.mark.parametrize("name", ["firm", "single"])
def test_profile_of_the_critical_angle_is_that_of_another_solver(name, request):
    """SciPy's Nelder-Mead from many starts, heights by the printed equations.

    With an open sharpness they are smooth, and ln p costs what its prior has it cost.
    """
    setup, profiles = request.getfixturevalue(name)
    problem = setup.problem
    used = np.asarray(problem.mask)[0]
    theta = np.asarray(problem.pushes.theta)[used]
    heights = np.asarray(problem.observed)[0, used]
    sigma = np.asarray(problem.reference_sigma)[0, used]
    is_open = "ln_p" in problem.data_names
    stated, offset = problem.constraint, problem.constraint_offset

    def chi_square(z, angle):
        A, C_rr = np.exp(z[:2])
        normal = A * PUSH * np.sin(theta)
        unrolled = A * C_rr * np.tan(angle) * PUSH * np.cos(theta)
        tangential = np.minimum(C_rr * normal, unrolled)
        prior = 0.0
        if is_open:
            ratio = tangential / np.maximum(C_rr * normal, unrolled)
            p = np.exp(np.clip(z[2], -5.0, 8.0))
            tangential = tangential * (1 + ratio**p) ** (-1 / p)
            prior = (stated[0, 3] * z[2] - offset[0]) ** 2
        height = np.hypot(normal, tangential)
        return np.sum(((height - heights) / sigma) ** 2) + prior

    def best(angle):
        starts = [np.log([520, c]) for c in (0.05, 0.2, 0.5, 1.2, 3.0)]
        if is_open:
            starts = [np.r_[s, LN_P] for s in starts]
        options = {"xatol": 1e-9, "fatol": 1e-9, "maxiter": 2000}
        runs = [
            optimize.minimize(chi_square, s, (angle,), "Nelder-Mead", options=options)
            for s in starts
        ]
        return min(run.fun for run in runs)

    profile = profiles["theta_c"]
    chosen = np.linspace(5, profile.values.size - 5, 6).astype(int)
    expected = np.array([best(np.radians(profile.values[i])) for i in chosen])
    least = best(np.radians(profile.values[np.argmin(profile.delta_chi_square)]))
    np.testing.assert_allclose(
        profile.delta_chi_square[chosen], expected - least, rtol=0, atol=SAME_PROFILE
    )


def test_noise_free_heights_determine_the_critical_angle():
    profile = profiles_of(small_setup("paper", noise=1e-6))["theta_c"]
    ((low, high),) = profile.pieces
    assert profile.verdict is Verdict.DETERMINED
    assert low < 45.0 < high
    assert high - low < NARROW


BELOW = np.arange(10.0, 61.0, 12.5)


@pytest.mark.slow
def test_pushes_on_one_side_leave_the_other_end_open():
    """θ_c = 72° and no push above 60°: components tell that all have rolled."""
    channels = ("height_normal", "height_tangential")
    table = case_table(
        CASES["one_sided"], noise=0.01, theta_deg=BELOW, channels=channels
    )
    profile = profiles_of(setup_of(table))["theta_c"]
    assert profile.verdict is Verdict.ONE_SIDED
    ((low, high),) = profile.pieces
    assert high is None
    assert low is not None
    assert 45 < low < 72


def test_magnitudes_of_rolled_pushes_alone_bound_nothing():
    """Heights ∝ sin θ are also those of an object that never resists sideways."""
    table = case_table(CASES["one_sided"], noise=1e-3, theta_deg=BELOW, seed=1)
    profile = profiles_of(setup_of(table))["theta_c"]
    assert profile.verdict is Verdict.NOT_DETERMINED


def test_one_elevation_determines_no_angle():
    table = case_table(CASES["paper"], noise=0.05, theta_deg=np.full(5, 40.0))
    profile = profiles_of(setup_of(table))["theta_c"]
    assert profile.verdict is Verdict.NOT_DETERMINED
    assert profile.pieces == ((None, None),)


def test_stiffnesses_in_series_are_bounded_by_the_whole(firm):
    """Any K_sn > A goes with some K_dn; C_d without L has no bound at all."""
    _, profiles = firm
    assert profiles["K_sn"].pieces == ((profiles["A"].pieces[0][0], None),)
    assert profiles["K_sn"].verdict is Verdict.ONE_SIDED
    assert profiles["C_d"].verdict is Verdict.NOT_DETERMINED


@pytest.mark.slow
def test_a_fixed_partner_makes_the_parameter_a_function():
    """1/K_sn = 1/A - 1/K_dn."""
    text = "[parameters.K_dn]\nfixed = 866.6666666666666\n"
    profiles = profiles_of(small_setup(noise=0.02, text=text))
    (A,) = profiles["A"].pieces
    (K_sn,) = profiles["K_sn"].pieces
    expected = [1 / (1 / a - 3 / 2600) for a in A]
    np.testing.assert_allclose(K_sn, expected, rtol=END)


@pytest.mark.slow
def test_soft_axis_of_noise_free_heights_is_found():
    table = case_table(CASES["ellipse"], noise=1e-3)
    profile = profiles_of(setup_of(table), alpha=np.radians(30))["alpha_star"]
    ((low, high),) = profile.pieces
    assert low < 120 < high
    assert high - low < 2


@pytest.mark.parametrize("turn", [0.0, -180.0])
def test_unreachable_soft_axis_counts_at_the_end_of_the_reach(turn):
    """The soft axis is at 120°; a finger that ends at 90° does best there.

    So does one that pushes the other way, where it ends.
    """
    words = {"theta_deg": np.array([15.0, 30.0, 60.0, 80.0]), "repeats": 1}
    table = case_table(CASES["ellipse"], noise=1e-3, **words)
    reach = tuple(np.radians([40.0 + turn, 90.0 + turn]))
    profiles = profiles_of(setup_of(table), alpha=np.radians(30), reach=reach)
    end = 90.0 + turn
    np.testing.assert_allclose(
        profiles["alpha_star"].pieces, ((end, end),), rtol=0, atol=JUMP
    )


@pytest.mark.parametrize(("width", "n"), [(0.04, 1), (0.4, 2)])
def test_a_barrier_that_no_hand_can_tell_parts_no_modes(width, n):
    """One value of a parabola about 64° is a search that ended early."""
    values = np.sort([*np.linspace(60.0, 68.0, 81), 62.97, 62.97 + width])
    delta = (values - 64.0) ** 2
    delta[(values > 62.97) & (values < 62.97 + width)] += 5.0
    assert len(pieces_below(values, delta, 2.7, narrowest=NARROWEST)) == n
    assert len(pieces_below(values, delta, 2.7)) == 2


@pytest.mark.parametrize(
    ("delta", "pieces", "verdict"),
    [
        ([9, 0, 9], ((2 / 3, 4 / 3),), Verdict.DETERMINED),
        ([0, 0, 9], ((None, 4 / 3),), Verdict.ONE_SIDED),
        ([np.inf, 0, 9], ((None, 4 / 3),), Verdict.ONE_SIDED),
        ([0, 0, 0], ((None, None),), Verdict.NOT_DETERMINED),
        ([0, 9, 0], ((None, 1 / 3), (5 / 3, None)), Verdict.SEVERAL_MODES),
        # Barriers of less than 0.3 above the level, and of more.
        ([0, 1.25, 0, 9], ((None, 7 / 3),), Verdict.ONE_SIDED),
        ([0, 1.44, 0, 9], ((None, 5 / 6), (7 / 6, 7 / 3)), Verdict.SEVERAL_MODES),
        ([0, np.inf, 0, 9], ((None, 7 / 3),), Verdict.ONE_SIDED),
        ([0, np.inf, np.inf, 0], ((None, 0), (3, None)), Verdict.SEVERAL_MODES),
    ],
)
def test_sets_have_the_shape_of_the_profile(delta, pieces, verdict):
    """sqrt(Δχ²) is 3 at 9, so the level 1 is met a third of the way up."""
    values = np.arange(float(len(delta)))
    found = pieces_below(values, np.array(delta, dtype=float), 1.0)
    assert verdict_of(found) is verdict
    for one, other in zip(found, pieces, strict=True):
        for a, b in zip(one, other, strict=True):
            assert (a is None) == (b is None)
            assert a is None or abs(a - b) < EXACT


def test_sets_of_higher_levels_contain_those_of_lower(firm):
    _, profiles = firm
    profile = profiles["theta_c"]
    (inner,), (outer,) = profile_set(profile, 0.5), profile_set(profile, 0.9)
    assert outer[0] < inner[0] < inner[1] < outer[1]
    assert profile_set(profile, 0.9) == profile.pieces


def test_threshold_is_that_of_one_parameter():
    assert threshold(0.95, np.inf) == pytest.approx(1.959963984540054**2, rel=ROUTES)
    assert threshold(0.95, 5.0) == pytest.approx(2.570581835636197**2, rel=ROUTES)


def test_as_many_unknowns_as_heights_bound_nothing():
    """Residuals of an exact fit would show any noise as none, and sets as points."""
    heights, theta = np.array([1.2, 2.1, 2.7]), np.radians([20.0, 45.0, 70.0])
    table = PeakTable.from_arrays(
        theta=theta, alpha=np.full(3, np.pi / 2), heights={"height": heights}, unit="n"
    )
    profiles = profiles_of(setup_of(table))
    for name in ("theta_c", "A", "B"):
        assert profiles[name].verdict is Verdict.NOT_DETERMINED
        assert profiles[name].pieces == ((None, None),)


N_TABLES = 120
# Binomial bounds of 99.9 % around the nominal one; θ_c may be over-covered where
# the set is open, so only the lower bound is that tight.
PROBS = (0.5, 0.9, 0.95)


@pytest.mark.slow
@pytest.mark.parametrize("is_known", [True, False])
def test_sets_of_the_critical_angle_cover_as_often_as_they_say(is_known):
    """With noise and transition known, and from single pushes with both open."""
    rng = np.random.default_rng(3)
    hits = {prob: 0 for prob in PROBS}
    for seed in range(N_TABLES):
        values = {
            "K_sn": 800 * np.exp(0.8 * rng.normal()),
            "K_dn": 2000 * np.exp(0.8 * rng.normal()),
            "K_st": 400 * np.exp(0.8 * rng.normal()),
            "C_rr": 0.3 * np.exp(0.8 * rng.normal()),
            "C_d": 0.5 * np.exp(0.8 * rng.normal()),
            "L": 0.04 * np.exp(0.3 * rng.normal()),
        }
        A = 1 / (1 / values["K_sn"] + 1 / values["K_dn"])
        B = 1 / (1 / values["K_st"] + values["L"] ** 2 / values["C_d"])
        truth = np.degrees(np.arctan2(B, A * values["C_rr"]))
        case = dataclasses.replace(CASES["paper"], params=paper_parameters(**values))
        noise, table_of = 0.03 * A * PUSH, partial(case_table, case, seed=seed)
        if is_known:
            setup = setup_of(table_of(noise=noise))
        else:
            table = table_of(noise=noise, repeats=1, theta_deg=ELEVATIONS)
            setup = setup_of(without_sd(table), AUTO)
        profile = profiles_of(setup, prob=0.95)["theta_c"]
        for prob in PROBS:
            hits[prob] += any(
                (a is None or a <= truth) and (b is None or truth <= b)
                for a, b in profile_set(profile, prob)
            )
    for prob in PROBS:
        low, high = stats.binom.interval(0.999, N_TABLES, prob)
        assert low <= hits[prob] <= high, (prob, hits)


@pytest.mark.slow
def test_a_set_covers_the_whole_valley_of_a_sweep_at_one_elevation():
    """Softened, the transition has another valley, from which none leads back."""
    table = PeakTable.from_arrays(
        theta=np.full(AZIMUTHS.size, np.radians(15.0)),
        alpha=np.radians(AZIMUTHS),
        heights={"height": HEIGHTS},
        sd={"height": np.full(AZIMUTHS.size, 0.097)},
        unit="kpa",
    )
    setup = build_problem(table, parse_config(FOAM, path="grasp.toml"))
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    profile = likelihood_profiles(
        setup,
        fit,
        reference_alpha=ALPHA,
        prob=0.9,
        reach=(0.0, np.pi),
        wanted=("ln_A",),
    )["A"]
    least = fit.chi_square
    assert setup.problem.data_names == ("ln_A", "ln_B", "ln_C_rr", "f1", "f2")
    residuals = eqx.filter_jit(setup.problem.data_residuals)
    # The valley as SciPy finds it from sixty random starts.
    start = [7.9, 0.0, 0.3, -0.3]
    for A in (100.0, 300.0, 1000.0, 2000.0):

        def imposed(rest, A=A):
            return np.asarray(residuals(jnp.r_[np.log(A), rest]))

        elsewhere = 2 * optimize.least_squares(imposed, start).cost - least
        here = np.interp(A, profile.values, profile.delta_chi_square)
        # A tenth of what moves the end of a 90 % set.
        assert here < elsewhere + 0.3
    assert profile.verdict is Verdict.ONE_SIDED


def test_modes_above_a_profile_do_not_cut_it(firm):
    """Other minima of χ² lie above the profile, at values that better fits share."""
    setup, profiles = firm
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    (low, high), best = profiles["A"].pieces[0], fit.modes[0]
    above = dataclasses.replace(
        best,
        coordinates=best.coordinates | {"ln_A": np.log((low + high) / 2)},
        chi_square=best.chi_square + 30,
    )
    found = likelihood_profiles(
        setup,
        dataclasses.replace(fit, modes=(best, above)),
        reference_alpha=ALPHA,
        prob=0.9,
        reach=(0.0, np.pi),
        wanted=("ln_A",),
    )
    assert found["A"].pieces == (pytest.approx((low, high), rel=END),)


@pytest.mark.slow
def test_pushes_along_two_supports_have_the_set_of_one_with_more_friction():
    """C_rr + |AB|/2L instead of C_rr, and nothing rolls about the other axis."""
    case = CASES["paper"]
    rng = np.random.default_rng(1)
    table = simulate_table(
        case.params,
        Grasp(push_length=PUSH, support_span=0.04),
        theta=np.radians(np.arange(5.0, 86.0, 8.0)),
        alpha=0.0,
        repeats=3,
        noise=0.02,
        rng=rng,
    )
    sets = [
        profiles_of(setup_of(table, text), alpha=0.0)["theta_c"].pieces
        for text in ("", "[grasp]\nsupport_span_mm = 40\n")
    ]
    assert len(sets[0]) == 1
    np.testing.assert_allclose(sets[1], sets[0], rtol=SAME_PROFILE)


def test_no_push_bounds_a_critical_angle_above_all_pushes():
    """Of an ellipse, whose last value the search of the curve may leave halfway.

    Above 75° no height tells one θ_c from another, so that an end there is open.
    """
    theta, alpha = np.meshgrid([15, 35, 55, 75], np.arange(0.0, 136.0, 45.0) + 1e-3)
    table = simulate_table(
        paper_parameters(**ellipse(2.0, 160.0)),
        Grasp(push_length=PUSH),
        theta=np.radians(theta.ravel()),
        alpha=np.radians(alpha.ravel()),
        repeats=3,
        noise=0.03,
        rng=np.random.default_rng(1),
    )
    profiles = profiles_of(setup_of(without_sd(table)), alpha=np.radians(1e-3))
    assert profiles["theta_c"].verdict is Verdict.ONE_SIDED
    ((_, high),) = profiles["theta_c"].pieces
    assert high is None
