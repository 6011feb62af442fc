"""What errors of the angles would move is what they do move."""

import numpy as np
import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.sensitivity import COMMON_SD_DEG, angle_error_shifts
from pushfit.fit.fitted import fit_table
from pushfit.fit.identify import identify_table
from tests.fit.tables import case_table, config
from tests.problems import CASES

THETA_DEG = np.arange(10.0, 86.0, 15.0)
# Far below the slopes that bend, far above the noise.
OFF_DEG, NOISE = 0.2, 1e-3
# Slopes at 0° against differences over 0.2°, and means of thousands of draws.
CURVATURE = 0.1
WORD = "elevations_taken_as_exact"


def table(off_deg=0.0) -> PeakTable:
    """Six pushes, elevations other than stated."""
    azimuths = np.full(THETA_DEG.size, 90.0)
    pushed = {"alpha_deg": azimuths, "repeats": 3}
    real = case_table(CASES["firm"], theta_deg=THETA_DEG + off_deg, **pushed)
    return PeakTable.from_arrays(
        theta=np.radians(np.repeat(THETA_DEG, 3)),
        alpha=np.full(3 * THETA_DEG.size, np.pi / 2),
        heights={"height": real.heights("height")},
        sd={"height": np.full(3 * THETA_DEG.size, NOISE)},
        unit="n",
    )


def identified(of: PeakTable, text: str = ""):
    return identify_table(of, config(text), seed=0, engine="sweep", is_brief=True)


def codes(of: PeakTable, text: str = "") -> set[str]:
    return {warning.code for warning in identified(of, text).warnings}


@pytest.fixture(scope="module")
def found():
    return identified(table())


def test_predicted_shift_is_that_of_elevations_that_are_off(found):
    """One direction after the other off by a little, and all identified again."""
    exact = np.mean(found.posterior.samples["theta_c"])
    moved = []
    for one in np.eye(THETA_DEG.size):
        other = identified(table(OFF_DEG * one))
        moved.append(np.mean(other.posterior.samples["theta_c"]) - exact)
    expected = COMMON_SD_DEG / OFF_DEG * np.linalg.norm(moved)
    setup = fit_table(table(), config()).setup
    shifts = angle_error_shifts(setup, found, ("theta_c",))
    assert shifts[0, 0] == pytest.approx(expected, rel=CURVATURE)


def test_what_hangs_on_exact_elevations_is_said(found):
    warning = next(w for w in found.warnings if w.code == WORD)
    assert "θ_c by about" in warning.text
    assert "theta_sd_deg" in warning.text


def test_what_was_stated_is_not_asked_for():
    assert WORD not in codes(table(), "[noise]\ntheta_sd_deg = 0.0\n")


def test_scatter_about_the_fit_holds_what_joints_add_and_that_of_repeats_does_not():
    """24 repeats beyond the first are pooled unless sigma is to be sampled."""
    stated = case_table(CASES["firm"], theta_deg=THETA_DEG, repeats=5, noise=NOISE)
    bare = stated.frame.drop(columns=[c for c in stated.frame if "_sd_" in c])
    assert WORD in codes(PeakTable.from_frame(bare))
    assert WORD not in codes(PeakTable.from_frame(bare), '[noise]\nsigma = "sampled"\n')


def test_hardly_more_heights_than_unknowns_are_said_to_test_nothing():
    few = case_table(CASES["firm"], theta_deg=THETA_DEG, repeats=1, noise=0.01)
    assert "model_untested" in codes(few)
    assert "model_untested" not in codes(table())
