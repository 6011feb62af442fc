"""Errors of the angles scatter heights by the model's own slopes."""

from itertools import product

import jax.numpy as jnp
import numpy as np
import pytest
from scipy import linalg, optimize, stats

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError
from pushfit.fit.identify.fit_table import MIN_ANGLE_GAIN, fit_table
from pushfit.fit.profiles.angle_errors import angle_slopes, steepness
from pushfit.fit.profiles.weights import repeat_gain
from tests.fit.tables import SEVEN_DEG, case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT

ANGLES = "[noise]\ntheta_sd_deg = 1.0\nalpha_sd_deg = 2.0\n"
ANGLE_SDS = np.radians([1.0, 2.0])
# Weights are settled with the fit.
TOLERANCE = 1e-6
PRINTED = 0.05  # errors are printed to two digits
SEARCHED = 1e-6  # Nelder-Mead stops where a log likelihood changes by 1e-8


def heights(theta, alpha, values, S_p=0.005):
    """Eqs. (6) to (12) in NumPy: ln A, ln B, ln C_rr, and the ellipse of B."""
    A, B, C_rr = np.exp([values["ln_A"], values["ln_B"], values["ln_C_rr"]])
    f1, f2 = values["f1"], values["f2"]
    size = np.hypot(f1, f2)
    shape = np.sinh(size / 2) / size * np.array([[f1, f2], [f2, -f1]])
    tensor = B * (np.cosh(size / 2) * np.eye(2) + shape)
    x, y = tensor @ np.array([np.cos(alpha), np.sin(alpha)])
    elastic = S_p * np.hypot(x, y) * np.cos(theta)
    normal = S_p * A * np.sin(theta)
    return np.hypot(np.minimum(elastic, C_rr * normal), normal)


def sweep(**changes) -> PeakTable:
    """Both angles swept, on an ellipse, the sd of heights stated."""
    theta = np.r_[np.arange(9.0, 86.0, 8.0), np.full(8, 70.0)]
    alpha = np.r_[np.full(10, 90.0), np.arange(5.0, 180.0, 22.0)]
    words = {"noise": 0.02, "seed": 3, "repeats": 1} | changes
    return case_table(CASES["ellipse"], theta_deg=theta, alpha_deg=alpha, **words)


def test_the_likelihood_is_that_of_a_dense_covariance():
    """Cov = diag(sd²) + J Jᵀ / 2, a column of J for each angle of each push, off by one
    standard deviation to either side; some reach beyond θ_c."""
    table = sweep(noise=0.0005)
    fitted = fit_table(table, config(ANGLES))
    problem, fit = fitted.setup.problem, fitted.fit
    values = dict(zip(fit.names, fit.estimate, strict=True))
    theta, alpha = table.theta, table.alpha
    beside = np.abs(theta - np.radians(fit.modes[0].theta_c_deg))
    assert np.min(beside) < ANGLE_SDS[0]
    exact, columns = heights(theta, alpha, values), []
    for angle, side in product((0, 1), (-1.0, 1.0)):
        for push in range(table.n_pushes):
            off = np.zeros((2, table.n_pushes))
            off[angle, push] = side * ANGLE_SDS[angle]
            columns.append(heights(theta + off[0], alpha + off[1], values) - exact)
    moved = np.array(columns).T
    covariance = np.diag(table.sd("height") ** 2) + moved @ moved.T / 2
    expected = stats.multivariate_normal.logpdf(
        table.heights("height"), exact, covariance
    )
    state = problem.data_state(jnp.asarray(fit.estimate))
    found = float(problem.log_likelihood(state))
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE)
    # Without the errors of the angles it is another one.
    assert abs(found - _without(table, values)) > 1.0


def _without(table: PeakTable, values) -> float:
    predicted = heights(table.theta, table.alpha, values)
    sd = table.sd("height")
    return float(np.sum(stats.norm.logpdf(table.heights("height"), predicted, sd)))


def test_angles_without_errors_change_nothing():
    plain = fit_table(sweep(), config())
    stated = fit_table(sweep(), config("[noise]\ntheta_sd_deg = 0.0\n"))
    np.testing.assert_array_equal(plain.fit.estimate, stated.fit.estimate)
    np.testing.assert_array_equal(plain.fit.sigma, stated.fit.sigma)


def test_repeats_are_no_measure_of_noise_that_differs_by_direction():
    """Noise that is pooled from repeats holds the errors of their angles."""
    table = case_table(CASES["firm"], noise=0.02, theta_deg=SEVEN_DEG)
    bare = PeakTable.from_frame(table.frame.drop(columns="height_sd_n"))
    fitted = fit_table(bare, config("[noise]\ntheta_sd_deg = 1.0\n"))
    assert fitted.config.noise.sigma == "sampled"
    forced = config('[noise]\ntheta_sd_deg = 1.0\nsigma = "pooled"\n')
    with pytest.raises(ConfigError, match="pooled"):
        fit_table(bare, forced)


def test_errors_of_the_angles_explain_scatter_beyond_the_sd():
    """Elevations off by 1°: heights scatter beyond their sd, and as much as known."""
    case, rng = CASES["firm"], np.random.default_rng(5)
    theta_deg = np.repeat(np.arange(5.0, 86.0, 5.0), 3)
    off = theta_deg + rng.normal(0.0, 1.0, theta_deg.size)
    real = case_table(
        case, theta_deg=off, alpha_deg=np.full(off.size, 90.0), repeats=1
    ).heights("height")
    sd = np.full(off.size, 0.005)
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(off.size, np.pi / 2),
        heights={"height": real + sd * rng.standard_normal(off.size)},
        sd={"height": sd},
        unit="n",
    )
    stated = fit_table(table, config("[noise]\ntheta_sd_deg = 1.0\n"))
    assert "scatter_exceeds_sd" not in {n.code for n in stated.warnings}
    plain = fit_table(table, config('[noise]\nsigma = "given"\ntheta_sd_deg = 0.0\n'))
    dof = stated.fit.degrees_of_freedom
    low, high = stats.chi2.interval(0.999, dof)
    assert plain.fit.chi_square > 2 * high
    assert low < stated.fit.chi_square < high


# The paper's own pushes, both components; 51 pushes know an error to about a tenth.
COMPONENTS = ("height_normal", "height_tangential")
JOINTS_DEG, N_SE = 1.0, 3.5


def missing(kind: str, seed: int) -> PeakTable:
    """Pushes whose joints are exact, or miss anew, or alike in all three repeats."""
    rng = np.random.default_rng(seed)
    theta_deg = np.repeat(np.arange(5.0, 86.0, 5.0), 3)
    off = {
        "exact": lambda: np.zeros(theta_deg.size),
        "anew": lambda: rng.normal(0.0, JOINTS_DEG, theta_deg.size),
        "alike": lambda: np.repeat(rng.normal(0.0, JOINTS_DEG, 17), 3),
    }[kind]()
    real = case_table(
        CASES["firm"],
        theta_deg=theta_deg + off,
        alpha_deg=np.full(off.size, 90.0),
        repeats=1,
        channels=COMPONENTS,
    )
    noise = 0.002 * rng.standard_normal((2, off.size))
    heights = {
        name: real.heights(name) + row
        for name, row in zip(COMPONENTS, noise, strict=True)
    }
    return PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.full(off.size, np.pi / 2),
        heights=heights,
        unit="n",
    )


def errors_of(fitted) -> float:
    """Errors of the angles that a fit speaks of [deg]."""
    (told,) = [n.text for n in fitted.warnings if n.code == "angle_errors"]
    return float(told.split("erred by ")[1].split("°")[0])


def test_errors_of_the_angles_are_found():
    """Of 204 pushes: each channel alone would know them to 1 / √(2 · 204).

    In four tables as long as the others of this file, which have their programs.
    """
    errors = []
    for seed in range(4):
        table = missing("anew", seed)
        fitted = fit_table(table, config('[noise]\ntheta_sd_deg = "estimate"\n'))
        errors.append(errors_of(fitted))
        stated = fit_table(table, config(f"[noise]\ntheta_sd_deg = {errors[-1]}\n"))
        np.testing.assert_allclose(fitted.fit.sigma, stated.fit.sigma, rtol=PRINTED)
    found = np.mean(errors) / JOINTS_DEG
    assert abs(found - 1) < N_SE / np.sqrt(2 * 204) + 0.005


@pytest.mark.parametrize(
    ("kind", "chosen"), [("exact", None), ("anew", "estimate"), ("alike", None)]
)
def test_angles_err_where_repeats_say_so(kind, chosen):
    """What all repeats of a direction share looks like a wrong model as well.

    Of six seeds in a row; repeats of seed 1 do by chance, as one table in 20.
    """
    fitted = [fit_table(missing(kind, seed), config()) for seed in range(2, 8)]
    assert [one.config.noise.theta_sd_deg for one in fitted] == 6 * [chosen]


@pytest.mark.parametrize(
    "text",
    [
        "theta_sd_deg = 0.0\n",
        "alpha_sd_deg = 2.0\n",
        'sigma = "pooled"\n',
        "height_share = 0.01\n",
    ],
)
def test_angles_are_left_alone_where_something_is_stated(text):
    fitted = fit_table(missing("anew", 0), config(f"[noise]\n{text}"))
    assert fitted.config.noise.theta_sd_deg in (0.0, None)


@pytest.mark.parametrize("kind", ["exact", "anew"])
def test_repeats_gain_the_ratio_of_the_likelihoods(kind):
    """By normal densities of contrasts, of two or three repeats of a direction."""
    whole = missing(kind, 1)
    table = PeakTable.from_frame(whole.frame.drop(index=range(2, 51, 6)))
    fitted = fit_table(table, config("[noise]\ntheta_sd_deg = 0.0\n"))
    problem, fit = fitted.setup.problem, fitted.fit
    slopes = np.hypot(*steepness(angle_slopes(problem, fit.estimate)))
    _, direction = np.unique(table.groups, return_inverse=True)
    errors, size = [], []
    for name, slope in zip(COMPONENTS, slopes, strict=True):
        rows = [np.flatnonzero(direction == g) for g in range(17)]
        own = [linalg.helmert(r.size) @ table.heights(name)[r] for r in rows]
        errors.append(np.concatenate(own))
        size.append(np.concatenate([slope[r[1:]] for r in rows]))
    assert len(errors[0]) == 25

    def level(x) -> float:
        variance = np.exp(x[1:])[:, None] + np.exp(x[0]) * np.square(size)
        return float(np.sum(stats.norm.logpdf(errors, scale=np.sqrt(variance))))

    ways = [
        optimize.minimize(
            lambda x, low=low: -level(np.r_[low if low else x[0], x[1:]]),
            np.log([1e-4, 1e-5, 1e-5]),
            method="Nelder-Mead",
            options={"xatol": 1e-6, "fatol": 1e-8, "maxiter": 4000},
        ).fun
        for low in (-60.0, None)
    ]
    found = repeat_gain(problem, slopes, direction)
    np.testing.assert_allclose(found, ways[0] - ways[1], rtol=0, atol=SEARCHED)
    assert (found > MIN_ANGLE_GAIN) == (kind == "anew")


SHARED = ANGLES + 'angle_errors = "shared"\n'


def gain_of_a_step(table, fitted, log_density) -> tuple[float, float]:
    """How much likelier the best fit is than a point nearby, and by a density of ours.

    Args:
        log_density: Of the data coordinates by name.
    """
    near = fitted.fit.estimate, fitted.fit.estimate + 0.01
    problem = fitted.setup.problem
    found = [problem.log_likelihood(problem.data_state(jnp.asarray(y))) for y in near]
    names = fitted.fit.names
    expected = [log_density(dict(zip(names, y, strict=True))) for y in near]
    return float(found[0] - found[1]), expected[0] - expected[1]


def test_shared_errors_are_those_of_a_dense_covariance():
    """Cov = diag(sd²) + J Jᵀ / 2, a column of J for each side of each direction."""
    table = sweep(repeats=3)
    fitted = fit_table(table, config(SHARED))
    fit = fitted.fit
    assert fitted.table.is_used.sum() == 18
    values = dict(zip(fit.names, fit.estimate, strict=True))
    covariance = np.diag(table.sd("height") ** 2)
    exact = heights(table.theta, table.alpha, values)
    for angle, side in product((0, 1), (-1.0, 1.0)):
        for direction in range(18):
            off = np.zeros((2, table.n_pushes))
            off[angle, table.groups == direction] = side * ANGLE_SDS[angle]
            real = heights(table.theta + off[0], table.alpha + off[1], values)
            covariance += np.outer(real - exact, real - exact) / 2

    def log_density(values) -> float:
        mean = heights(table.theta, table.alpha, values)
        observed = table.heights("height")
        return float(stats.multivariate_normal.logpdf(observed, mean, covariance))

    found, expected = gain_of_a_step(table, fitted, log_density)
    np.testing.assert_allclose(found, expected, rtol=TOLERANCE)
    assert [w.code for w in fitted.warnings].count("repeats_averaged") == 1


def test_shared_errors_need_noise_that_is_known():
    """Of 36 repeats beyond the first the scatter is pooled, of 18 only if asked for."""
    text = SHARED + '[transition]\nsharpness = "hard"\n'
    thrice, twice = (
        PeakTable.from_frame(sweep(repeats=n).frame.drop(columns="height_sd_n"))
        for n in (3, 2)
    )
    pooled = fit_table(thrice, config(text))
    scatter, dof = thrice.pooled_sd("height")
    assert dof == 36
    sd = pooled.table.sd("height")[pooled.table.is_used]
    np.testing.assert_allclose(sd, scatter / np.sqrt(3), rtol=EXACT)
    # What was settled can be fitted again.
    again = fit_table(thrice, pooled.config)
    np.testing.assert_array_equal(again.fit.estimate, pooled.fit.estimate)
    with pytest.raises(ConfigError, match="add the column height_sd_n,"):
        fit_table(twice, config(text))
    asked = fit_table(
        twice, config(text.replace("[noise]", '[noise]\nsigma = "pooled"'))
    )
    assert asked.config.noise.sigma == "pooled"


def test_pushes_left_out_are_kept_and_take_no_part_in_means():
    table = sweep(repeats=2).with_flag([0], "saturated")
    found = fit_table(table, config(SHARED)).table
    assert found.is_used.sum() == 18
    assert found.flags[0] == {"saturated"}
    other = np.flatnonzero(table.groups == table.groups[0])[1]
    for values in ("heights", "sd"):
        assert (
            getattr(found, values)("height")[other]
            == getattr(table, values)("height")[other]
        )


def test_each_direction_pushed_once_shares_nothing():
    each, shared = (fit_table(sweep(), config(text)) for text in (ANGLES, SHARED))
    np.testing.assert_array_equal(each.fit.estimate, shared.fit.estimate)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('angle_errors = "shared"', "no error is stated"),
        ('angle_errors = "shared"\ntheta_sd_deg = 1.0\nheight_share = 0.1', "averages"),
    ],
)
def test_shared_errors_that_contradict_are_refused(text, said):
    with pytest.raises(ConfigError, match=said):
        config(f"[noise]\n{text}\n")
