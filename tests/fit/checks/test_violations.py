"""Residuals name the assumption that they speak against, and none that holds."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.violations import (
    NAMING_LEVEL,
    Violation,
    _constant,
    _heavy_tailed,
    _is_rounding,
    _soft,
    _steep,
    _tall,
    violation_warnings,
    violations,
)
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import Fitted
from pushfit.fit.problem.priors.distributions import default_prior
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

NOISE = 0.01
N_TABLES = 12
# Of a tenth of the tallest height, what 102 with noise of a thousandth leave open, and
# its two digits.
OF_CONSTANT = 0.1
CONSTANT = (
    '[noise]\nlikelihood = "normal"\nheight_share = 0.0\ntheta_sd_deg = 0.0\n'
    'repeats = "alike"\n'
)


def pushes(kind: str, seed: int) -> PeakTable:
    """Seventeen elevations, six times, in a world that breaks one assumption."""
    case, rng = CASES["firm"], np.random.default_rng(seed)
    theta = np.radians(np.repeat(np.arange(5.0, 86.0, 5.0), 6))
    real = theta + (rng.normal(0.0, 0.02, theta.size) if kind == "angles" else 0.0)
    soft = replace(case.grasp, sharpness=4.0)
    clean = simulate_table(
        case.params,
        soft if kind == "soft" else case.grasp,
        theta=real,
        alpha=np.full(theta.size, np.pi / 2),
        repeats=1,
        noise=0.0,
        rng=rng,
        channels=("height",),
    ).heights("height")
    noise = NOISE * rng.standard_normal(theta.size)
    if kind == "heavy":
        noise = NOISE * rng.standard_t(2.5, theta.size)
    if kind == "proportional":
        noise *= 4 * clean / np.max(clean)
    repeat = np.tile(np.arange(6), 17)
    if kind == "constant":
        noise += 5 * NOISE
    if kind == "offsets":
        noise += NOISE * np.linspace(-1.0, 1.0, 6)[repeat]
    if kind == "gains":
        noise += clean * np.linspace(-0.01, 0.01, 6)[repeat]
    return PeakTable.from_arrays(
        theta=theta,
        alpha=np.full(theta.size, np.pi / 2),
        heights={"height": clean + noise},
        unit="n",
    )


def found(kind: str) -> list[tuple[Violation, ...]]:
    """Alternatives of tables of one world."""
    normal = config(CONSTANT)
    fitted = [fit_table(pushes(kind, seed), normal) for seed in range(N_TABLES)]
    return [
        violations(one.table, one.setup, one.fit, slopes=one.slopes) for one in fitted
    ]


@pytest.mark.parametrize(
    ("kind", "code"),
    [
        ("soft", "looks_soft"),
        ("constant", "looks_like_a_constant"),
        ("gains", "looks_like_gains"),
        *(
            pytest.param(kind, code, marks=pytest.mark.slow)
            for kind, code in (
                ("angles", "looks_like_angle_errors"),
                ("heavy", "looks_heavy_tailed"),
                ("proportional", "looks_proportional"),
                ("offsets", "looks_like_offsets"),
            )
        ),
    ],
)
def test_what_is_violated_is_mostly_what_is_named(kind, code):
    """Of twelve tables more than half name it, and no more than one another."""
    first = [alternatives[0] for alternatives in found(kind)]
    named = [v.code for v in first if v.p_value < NAMING_LEVEL]
    assert named.count(code) > N_TABLES / 2
    assert len(named) - named.count(code) <= 1


def test_nothing_is_named_where_nothing_is_violated():
    """Six tests of twelve tables at 1e-3: two false alarms once in 10³ seeds."""
    alternatives = [v for table in found("nothing") for v in table]
    assert sum(v.p_value < NAMING_LEVEL for v in alternatives) <= 1


@pytest.fixture(scope="module")
def shifted() -> Fitted:
    """Residuals of a constant, repeats in it."""
    return fit_table(pushes("constant", 0), config(CONSTANT))


def told(one: Fitted, **changed) -> set[str]:
    """Codes of what is tested, with other parts of the problem, noise or fit."""
    parts = {"problem": one.setup.problem, "noise": one.setup.noise, "fit": one.fit}
    parts = {n: replace(part, **changed.get(n, {})) for n, part in parts.items()}
    fit = parts.pop("fit")
    found = violations(one.table, replace(one.setup, **parts), fit, slopes=one.slopes)
    return {violation.code for violation in found}


@pytest.mark.parametrize("what", ["tails", "a twentieth of the noise", "two to spare"])
def test_residuals_of_no_normal_noise_or_of_hardly_any_are_not_asked(shifted, what):
    fit = shifted.fit
    changed = {
        "tails": {"problem": {"likelihood": "student_t"}},
        "a twentieth of the noise": {
            "fit": {"sigma": 20 * fit.sigma, "chi_square": fit.chi_square / 400}
        },
        "two to spare": {"fit": {"n_free": fit.n_data - 2}},
    }
    assert "looks_like_a_constant" in told(shifted)
    assert told(shifted, **changed[what]) == set()


def test_what_is_part_of_the_model_is_no_violation_of_it(shifted):
    """A soft transition, known or unknown, and what heights of a repeat share."""
    problem = shifted.setup.problem
    everything = told(shifted)
    assert {"looks_soft", "looks_like_offsets"} < everything
    soft = {"grasp": replace(problem.grasp, sharpness=4.0)}
    is_open = {"priors": {**problem.priors, "p": default_prior("p")}}
    for change in (soft, is_open):
        assert everything - told(shifted, problem=change) == {"looks_soft"}
    shared = {"shared": {"height": np.zeros((1, shifted.table.n_pushes))}}
    left = told(shifted, noise=shared)
    assert everything - left == {"looks_like_offsets", "looks_like_a_constant"}
    # A coordinate that is a constant of the heights.
    jacobian = shifted.fit.jacobian.copy()
    jacobian[:, 0] = 1 / shifted.fit.sigma
    seen = {"jacobian": jacobian}
    assert everything - told(shifted, fit=seen) == {"looks_like_a_constant"}


def test_noise_of_several_sizes_is_not_called_heavy_tailed_too():
    one = fit_table(pushes("proportional", 0), config(CONSTANT))
    first, *others = violations(one.table, one.setup, one.fit, slopes=one.slopes)
    assert first.code == "looks_proportional"
    assert first.p_value < NAMING_LEVEL
    assert "looks_heavy_tailed" not in {violation.code for violation in others}


def test_a_transition_is_soft_by_residuals_of_one_sign_alone():
    """And nothing shows what the model does by itself, or one residual beside it."""
    rng = np.random.default_rng(0)
    basis, _ = np.linalg.qr(rng.standard_normal((30, 3)))
    change, noise = rng.standard_normal((2, 30))
    free = noise - basis @ (basis.T @ noise)
    chances = [_soft(sign * free, basis, change).p_value for sign in (1.0, -1.0)]
    np.testing.assert_allclose(sum(chances), 1.0, rtol=EXACT)
    assert np.isnan(_soft(free, basis, basis @ np.ones(3)).p_value)
    few = slice(4)
    assert np.isnan(_soft(free[few], basis[few], change[few]).p_value)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_constant_of_either_sign_has_the_chance_of_a_t_test(sign):
    free = sign * np.random.default_rng(0).normal(0.3, 1.0, 30)
    constant = _constant(free, np.zeros((30, 0)), np.ones(30), "height_n")
    expected = scipy.stats.ttest_1samp(free, 0.0)
    np.testing.assert_allclose(constant.p_value, expected.pvalue, rtol=EXACT)
    assert f"those of {np.mean(free):+.2g} in all of height_n" in constant.text


def test_residuals_without_tails_are_not_heavy_tailed():
    light = _heavy_tailed(np.linspace(-1.0, 1.0, 200))
    assert light is not None
    assert light.p_value > 1 - NAMING_LEVEL


def test_scatter_that_falls_where_heights_are_steep_is_no_error_of_angles():
    """And where they are tall no noise in proportion."""
    free = np.random.default_rng(0).standard_normal(200) * np.linspace(1.0, 0.1, 200)
    size = np.linspace(0.0, 100.0, 200)
    steep = _steep(free, size)
    assert steep is not None
    assert steep.p_value > 1 - NAMING_LEVEL
    assert _tall(free, size, False).p_value > 1 - NAMING_LEVEL


@pytest.mark.parametrize(("noise", "is_rounding"), [(0.0, True), (0.3, False)])
def test_noise_of_the_size_of_rounding_is_more_than_rounding(noise, is_rounding):
    """Errors of rounding alone have an rms of 1 / √12 of a step; both have 0.42."""
    rng, step = np.random.default_rng(0), 0.01
    true = rng.uniform(1.0, 2.0, 400)
    heights = (true + noise * step * rng.standard_normal(400)).round(2)
    assert _is_rounding(heights, heights - true) is is_rounding


def test_fewer_than_twenty_residuals_show_no_tails():
    free = np.random.default_rng(0).standard_t(2.0, 20)
    assert _heavy_tailed(free) is not None
    assert _heavy_tailed(free[:19]) is None


@pytest.mark.parametrize(("error_deg", "is_named"), [(5.0, True), (15.0, False)])
def test_no_joint_errs_by_as_much_as_a_wrong_model_may_ask_for(error_deg, is_named):
    """Scatter in proportion to slopes, beside one of unit variance."""
    rng = np.random.default_rng(0)
    slope = np.linspace(0.0, 100.0, 200)
    free = np.radians(error_deg) * slope * rng.standard_normal(200)
    steep = _steep(free + rng.standard_normal(200), slope)
    assert (steep is not None and steep.p_value < NAMING_LEVEL) == is_named


def test_errors_of_ten_degrees_are_said_without_an_exponent():
    rng = np.random.default_rng(0)
    slope = np.linspace(0.0, 100.0, 200)
    steep = _steep(np.radians(10.0) * slope * rng.standard_normal(200), slope)
    assert steep is not None
    assert "by about 10°" in steep.text


def test_rounding_speaks_against_nothing():
    """Heights that are all the same fit with A = B, but for the solver's rounding."""
    theta = np.radians(np.repeat(np.arange(5.0, 86.0, 5.0), 3))
    table = PeakTable.from_arrays(
        theta=theta,
        alpha=np.full(theta.size, np.pi / 2),
        heights={"height": np.ones(theta.size)},
        unit="n",
    )
    fitted = fit_table(table, config())
    assert violations(table, fitted.setup, fitted.fit, slopes=fitted.slopes) == ()


def test_a_rejected_model_asks_less_of_an_explanation():
    weak = (Violation(code="looks_soft", p_value=0.01, text="set something"),)
    assert violation_warnings(weak, is_adequate=True) == ()
    (warning,) = violation_warnings(weak, is_adequate=False)
    assert warning.code == "looks_soft"


@pytest.mark.parametrize("is_counted", [False, True])
def test_nobody_is_told_to_set_what_is_set(is_counted):
    tall = _tall(np.linspace(0.0, 4.0, 40), np.linspace(0.0, 4.0, 40), is_counted)
    assert ("set [noise] height_share" in tall.text) is not is_counted
    slope = np.linspace(0.0, 100.0, 200)
    rng = np.random.default_rng(0)
    free = np.radians(5.0) * slope * rng.standard_normal(200)
    steep = _steep(free, slope, is_counted)
    assert steep is not None
    assert ("set [noise] theta_sd_deg" in steep.text) is not is_counted


COMPONENTS = ("height_normal", "height_tangential")


def components(share: float, seed: int) -> PeakTable:
    """Both components at the same elevations, with noise in proportion beside a hum."""
    case, rng = CASES["firm"], np.random.default_rng(seed)
    theta = np.radians(np.repeat(np.arange(5.0, 86.0, 5.0), 6))
    clean = simulate_table(
        case.params,
        case.grasp,
        theta=theta,
        alpha=np.full(theta.size, np.pi / 2),
        repeats=1,
        noise=0.0,
        rng=rng,
        channels=COMPONENTS,
    )
    heights = {}
    for name in COMPONENTS:
        height = clean.heights(name)
        sd = np.hypot(NOISE * np.max(height) / 10, share * height)
        heights[name] = height + sd * rng.standard_normal(theta.size)
    return PeakTable.from_arrays(
        theta=theta, alpha=np.full(theta.size, np.pi / 2), heights=heights, unit="n"
    )


@pytest.fixture(scope="module")
def of_components() -> Fitted:
    """Noise of two sizes, and a constant in one of both."""
    table = components(0.0, 0)
    column = "height_tangential_n"
    constant = OF_CONSTANT * float(table.frame[column].max())
    frame = table.frame.assign(**{column: table.frame[column] + constant})
    return fit_table(PeakTable.from_frame(frame), config(CONSTANT))


def test_a_constant_is_that_of_the_component_that_has_it(of_components):
    one, column = of_components, "height_tangential_n"
    found = violations(one.table, one.setup, one.fit, slopes=one.slopes)
    first = next(v for v in found if v.code == "looks_like_a_constant")
    size, of = re.search(r"those of (\S+) in all of (\S+),", first.text).groups()
    assert of == column
    constant = OF_CONSTANT / (1 + OF_CONSTANT) * one.table.heights(column[:-2]).max()
    assert float(size) == pytest.approx(constant, rel=OF_CONSTANT)


def test_alternatives_have_the_chances_of_textbook_tests(of_components):
    """One-sided n R² of squares (Koenker), and Student's t of one more column."""
    one, fit = of_components, of_components.fit
    mask = np.asarray(one.setup.problem.mask)
    residuals = (
        np.asarray(one.setup.problem.observed)[mask] - fit.predicted
    ) / fit.sigma
    free = residuals - fit.jacobian @ np.linalg.lstsq(fit.jacobian, residuals)[0]
    steep = np.sqrt(np.mean(one.slopes[0] ** 2, axis=0))[mask]
    expected = []
    for size in (steep, fit.predicted):
        correlation = scipy.stats.linregress((size / fit.sigma) ** 2, free**2).rvalue
        expected.append(scipy.stats.norm.sf(np.sqrt(free.size) * correlation))
    for name in COMPONENTS:
        column = (np.array(fit.channel) == name) / fit.sigma
        design = np.column_stack([column, fit.jacobian])
        (size, *_), (squares,), rank, _ = np.linalg.lstsq(design, residuals)
        dof = free.size - rank
        error = np.sqrt(np.linalg.inv(design.T @ design)[0, 0] * squares / dof)
        expected.append(2 * scipy.stats.t.sf(abs(size) / error, dof))
    found = violations(one.table, one.setup, one.fit, slopes=one.slopes)
    codes = ("looks_like_angle_errors", "looks_proportional", "looks_like_a_constant")
    chances = [v.p_value for v in found if v.code in codes]
    np.testing.assert_allclose(chances, sorted(expected), rtol=ROUTES)


def test_one_component_that_is_rounded_does_not_hide_the_other(of_components):
    """Both are those of rounding before nothing is said."""
    one, n_silent = of_components, []
    for rows in (slice(1), slice(2)):
        observed = np.array(one.setup.problem.observed)
        predicted = np.zeros_like(observed)
        predicted[np.asarray(one.setup.problem.mask)] = one.fit.predicted
        observed[rows] = predicted[rows].round(2)
        n_silent.append(not told(one, problem={"observed": observed}))
    assert n_silent == [False, True]


@pytest.mark.slow
@pytest.mark.parametrize(("share", "is_named"), [(0.05, True), (0.0, False)])
def test_heights_are_tall_in_units_of_the_noise_of_their_component(share, is_named):
    """One component scatters by a fraction of what the other does."""
    normal = config(CONSTANT)
    fitted = [fit_table(components(share, seed), normal) for seed in range(N_TABLES)]
    each = [
        violations(one.table, one.setup, one.fit, slopes=one.slopes) for one in fitted
    ]
    named = [found[0].code for found in each if found[0].p_value < NAMING_LEVEL]
    assert (named.count("looks_proportional") > N_TABLES / 2) is is_named


@pytest.mark.parametrize(("noise", "is_said"), [(1e-4, False), (NOISE, True)])
def test_residuals_of_rounding_show_nothing(noise, is_said):
    """Repeats that round apart do so anywhere; those of this seed where θ is steep."""
    table = case_table(CASES["firm"], noise=noise, seed=4)
    rounded = table.heights("height").round(3)
    frame = table.frame.drop(columns="height_sd_n").assign(height_n=rounded)
    table = PeakTable.from_frame(frame)
    fitted = fit_table(table, config())
    assert bool(fitted.shown) is is_said
    assert "angle_errors" not in {warning.code for warning in fitted.warnings}
