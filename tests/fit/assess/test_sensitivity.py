"""What errors of the angles would move is what they do move."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.sensitivity import angle_error_shifts, angle_error_warnings
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import sweep
from pushfit.fit.identify.identify_table import identify_table
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import ROUTES

THETA_DEG = np.arange(10.0, 86.0, 15.0)
# What is asked for; what is tried, far below the bends and far above the noise.
COMMON_SD_DEG, OFF_DEG, NOISE = 1.0, 0.2, 1e-3
# Slopes at 0° against differences over 0.2°, and means of thousands of draws.
CURVATURE = 0.1
WORD = "elevations_taken_as_exact"
# Elevations at one azimuth, and azimuths at one elevation.
BOTH_DEG = np.array(
    [[20.0, 30.0, 55.0, *5 * [70.0]], [*3 * [90.0], 0.0, 36.0, 72.0, 108.0, 144.0]]
)


def table(off_deg=0.0) -> PeakTable:
    """Six pushes, elevations other than stated."""
    stated = np.stack([THETA_DEG, np.full(THETA_DEG.size, 90.0)])
    return pushed("firm", stated, stated + [[1.0], [0.0]] * np.asarray(off_deg))


def pushed(case: str, stated_deg, real_deg, *, noise: float = NOISE) -> PeakTable:
    """Pushes in other directions than stated, thrice."""
    real_theta_deg, real_alpha_deg = real_deg
    real = case_table(
        CASES[case], theta_deg=real_theta_deg, alpha_deg=real_alpha_deg, repeats=3
    )
    theta, alpha = np.radians(np.repeat(stated_deg, 3, axis=1))
    return PeakTable.from_arrays(
        theta=theta,
        alpha=alpha,
        heights={"height": real.heights("height")},
        sd={"height": np.full(theta.size, noise)},
        unit="n",
    )


def table_of_both(off_deg=0.0) -> PeakTable:
    """Both kinds of sweeps, azimuths other than stated."""
    real = BOTH_DEG + [[0.0], [1.0]] * np.asarray(off_deg)
    return pushed("ellipse", BOTH_DEG, real, noise=NOISE / 10)


def identified(of: PeakTable, text: str = ""):
    return identify_table(of, config(text), seed=0, engine="sweep", is_brief=True)


def means(of: PeakTable, *names: str) -> list[float]:
    """Posterior means by the sweep alone."""
    samples = sweep(fit_table(of, config()), 0).samples
    return [float(np.mean(samples[name])) for name in names]


def codes(of: PeakTable, text: str = "") -> set[str]:
    return {warning.code for warning in identified(of, text).warnings}


@pytest.fixture(scope="module")
def found():
    return identified(table())


def test_predicted_shift_is_that_of_elevations_that_are_off(found):
    """One direction after the other off by a little, and all identified again."""
    exact = np.mean(found.posterior.samples["theta_c"])
    off = [means(table(OFF_DEG * one), "theta_c") for one in np.eye(THETA_DEG.size)]
    expected = COMMON_SD_DEG / OFF_DEG * np.linalg.norm(np.array(off) - exact)
    fitted = fit_table(table(), config())
    shifts = angle_error_shifts(fitted.setup, found, fitted.slopes, names=("theta_c",))
    assert shifts[0, 0] == pytest.approx(expected, rel=CURVATURE)


def test_draws_that_never_roll_are_no_part_of_what_is_quoted_or_moved(found):
    """Twenty of 500 have no θ_c: what is said is that of the other 480."""
    posterior, fitted = found.posterior, fit_table(table(), config())
    rest = slice(20, 500)
    theta_c = posterior.samples["theta_c"].copy()
    theta_c[:20] = np.nan
    with_nan = posterior.samples | {"theta_c": theta_c}
    shifts, texts = [], []
    for samples, rows in ((with_nan, slice(500)), (posterior.samples, rest)):
        own = replace(
            posterior,
            samples={name: values[rows] for name, values in samples.items()},
            log_prob=posterior.log_prob[rows],
        )
        words = fitted.setup, replace(found, posterior=own), fitted.slopes
        shifts.append(angle_error_shifts(*words, names=("theta_c",)))
        texts.append([warning.text for warning in angle_error_warnings(*words)])
    np.testing.assert_allclose(shifts[0], shifts[1], rtol=ROUTES)
    assert texts[0] == texts[1] != []


def test_predicted_shift_is_that_of_azimuths_that_are_off():
    """The same of azimuths, where pushes are steep enough to feel the ellipse."""
    names = ("theta_c", "alpha_star")
    exact = table_of_both()
    found = identified(exact)
    errors = OFF_DEG * np.eye(BOTH_DEG.shape[1])
    off = [means(table_of_both(one), *names) for one in errors]
    moved = np.linalg.norm(np.array(off) - means(exact, *names), axis=0)
    fitted = fit_table(exact, config())
    shifts = angle_error_shifts(fitted.setup, found, fitted.slopes, names=names)
    expected = COMMON_SD_DEG / OFF_DEG * moved
    np.testing.assert_allclose(shifts[1], expected, rtol=CURVATURE)
    (told,) = [n.text for n in found.warnings if n.code == "azimuths_taken_as_exact"]
    assert "α* by about" in told
    assert "alpha_sd_deg" in told


def test_what_hangs_on_exact_elevations_is_said(found):
    warning = next(w for w in found.warnings if w.code == WORD)
    assert "θ_c by about" in warning.text
    assert "theta_sd_deg" in warning.text


def test_what_was_stated_is_not_asked_for():
    assert WORD not in codes(table(), "[noise]\ntheta_sd_deg = 0.0\n")


def test_scatter_about_the_fit_holds_what_joints_add_and_that_of_repeats_does_not():
    """20 repeats beyond the first are pooled unless sigma is to be sampled."""
    four_deg = THETA_DEG[:4]
    stated = case_table(CASES["firm"], theta_deg=four_deg, repeats=6, noise=NOISE)
    bare = stated.frame.drop(columns=[c for c in stated.frame if "_sd_" in c])
    assert WORD in codes(PeakTable.from_frame(bare))
    assert WORD not in codes(PeakTable.from_frame(bare), '[noise]\nsigma = "sampled"\n')


def test_hardly_more_heights_than_unknowns_are_said_to_test_nothing():
    few = case_table(CASES["firm"], theta_deg=THETA_DEG, repeats=1, noise=0.01)
    assert "model_untested" in codes(few)
    assert "model_untested" not in codes(table())
