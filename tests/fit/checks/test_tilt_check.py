"""Which mechanics leads: cases whose answer the rule itself tells."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.config import GraspConfig, parse_config
from pushfit.fit.checks.tilt_check import (
    do_draws_tilt,
    does_tilt_matter,
    implied_tilt_deg,
    is_tilt_large,
    is_worse,
    tilt_warning,
)
from pushfit.fit.problem.setup import build_problem
from pushfit.mechanics.linear import implied_tilt
from pushfit.parameters import SIGNED, SIX
from tests.fit.posteriors import posterior_of
from tests.fit.tables import case_table
from tests.problems import CASES, PUSH
from tests.report.makers import make_answer, make_posterior
from tests.tolerances import EXACT

MEASURED = "[push]\nlength_mm = 5.0\n[parameters.L]\nfixed = 0.04\n"


def settings(text: str = "") -> GraspConfig:
    return parse_config(text, path="grasp.toml")


@pytest.mark.parametrize(
    ("shift", "stretch", "rolling", "matters"),
    [
        (2.6, 1.0, 1.0, True),
        (-2.4, 1.0, 1.0, False),
        (0.0, 1.6, 1.0, True),
        (0.0, 1.4, 1.0, False),
        (0.0, 1.0, 0.9, True),
        (0.0, 1.0, 0.99, False),
    ],
    ids=["far", "near", "wide", "as wide", "seldom rolls", "mostly rolls"],
)
def test_a_tilt_matters_where_it_moves_the_angle_by_a_quarter_of_its_interval(
    shift, stretch, rolling, matters
):
    """The linear interval of 90 % is 10° wide, as draws are even over 11.11°."""
    some = make_posterior(with_alpha=False)
    offsets = np.linspace(-10 / 1.8, 10 / 1.8, some.log_prob.size)
    tilted = 40.0 + shift + stretch * offsets
    tilted[: round((1 - rolling) * tilted.size)] = np.nan
    linear, tilting = (
        replace(some, samples={"theta_c": draws}) for draws in (40.0 + offsets, tilted)
    )
    assert does_tilt_matter(linear, tilting, prob=0.9) is matters


@pytest.mark.parametrize(("lowest_deg", "is_large"), [(79.0, False), (77.0, True)])
def test_a_tilt_is_large_where_its_largest_is_a_degree(lowest_deg, is_large):
    """Unrolled it bends the contact, C_d γ = L B S_p cos θ: 1° at 77.9°."""
    case = CASES["paper"]
    table = case_table(case, theta_deg=[lowest_deg, 82.0, 86.0], repeats=1)
    setup = build_problem(table, settings(MEASURED))
    values = {name: float(getattr(case.params, name)) for name in SIX}
    # Medians are the truth, and means are not.
    posterior = posterior_of({n: v * np.array([0.9, 1, 2]) for n, v in values.items()})
    bending = values["L"] * case.B * PUSH / values["C_d"]
    expected = np.degrees(bending * np.cos(np.radians(lowest_deg)))
    np.testing.assert_allclose(implied_tilt_deg(setup, posterior), expected, rtol=EXACT)
    assert is_tilt_large(setup, posterior) is is_large


def test_a_tilt_is_that_of_an_ellipse_where_there_is_one():
    case = CASES["ellipse"]
    setup = build_problem(case_table(case), settings(MEASURED))
    names = (*SIX, *SIGNED)
    draws = {n: np.full(3, float(getattr(case.params, n))) for n in names}
    tilt = implied_tilt(case.params, case.pushes(), case.grasp)
    expected = np.degrees(np.max(np.asarray(tilt)))
    found = implied_tilt_deg(setup, posterior_of(draws))
    np.testing.assert_allclose(found, expected, rtol=EXACT)


@pytest.mark.parametrize(
    ("log_evidence", "leads"), [(None, True), (-14.0, True), (-16.0, False)]
)
def test_draws_that_tilt_lead_unless_the_heights_speak_against_them(
    log_evidence, leads
):
    """By more than 5 in log evidence."""
    some = make_posterior(with_alpha=False)
    linear = replace(some, log_evidence=-10.0)
    moved = {"theta_c": some.samples["theta_c"] + 10.0}
    tilting = replace(some, samples=moved, log_evidence=log_evidence)
    assert do_draws_tilt(linear, tilting, prob=0.9) is leads


def test_a_contact_that_never_rolls_is_next_to_one_that_rolls_at_the_normal():
    some = make_posterior(with_alpha=False)
    late = np.linspace(82.0, 90.0, some.log_prob.size)
    linear, tilting = (
        replace(some, samples={"theta_c": draws})
        for draws in (late, np.where(late > 88.0, np.nan, late))
    )
    assert not does_tilt_matter(linear, tilting, prob=0.9)


@pytest.mark.parametrize(
    ("log_evidence", "rms_residual", "worse"),
    [
        (-16.0, 0.01, True),
        (-14.0, 0.04, False),
        (None, 0.023, True),
        (None, 0.022, False),
        (None, 0.0, False),
    ],
)
def test_evidence_decides_and_where_there_is_none_the_fit(
    log_evidence, rms_residual, worse
):
    """Of 40 heights ln 1.13 is worth 5 in log likelihood, by the likeliest noise."""
    linear = make_answer("linear", log_evidence=-10.0, rms_residual=0.02)
    tilting = make_answer(
        "tilting", log_evidence=log_evidence, rms_residual=rms_residual
    )
    assert is_worse(tilting, linear, n_heights=40) is worse


def test_a_large_tilt_is_warned_of_only_where_the_equations_of_the_paper_stand_alone():
    linear, tilting = (
        make_answer("linear", best=40.0),
        make_answer("tilting", best=30.0),
    )
    both = settings(MEASURED)
    assert tilt_warning(both, (tilting, linear), 9.0) is None
    assert tilt_warning(both, (linear, tilting), 9.0) is None
    unmeasured = settings("[push]\nlength_mm = 5.0\n")
    assert tilt_warning(unmeasured, (linear,), 0.9) is None
    assert "up to 1.1°" in tilt_warning(unmeasured, (linear,), 1.1).text
    alone = tilt_warning(unmeasured, (linear,), 9.0)
    assert "up to 9°" in alone.text
    assert "measure it and set parameters.L" in alone.text
    forced = settings(MEASURED + '[grasp]\nmechanics = "linear"\n')
    assert 'set grasp.mechanics = "auto"' in tilt_warning(forced, (linear,), 9.0).text
    both_lack = settings('[push]\nlength_mm = 5.0\n[grasp]\nmechanics = "linear"\n')
    cured = tilt_warning(both_lack, (linear,), 9.0).text
    assert "measure it and set parameters.L" in cured
    assert cured.endswith(', and set grasp.mechanics = "auto"')
    failed = tilt_warning(both, (linear,), 9.0)
    assert failed.text.endswith("no fit by them was found")


@pytest.mark.parametrize(("against", "odds"), [(3.5, "33 to 1"), (2.9, None)])
def test_tilting_mechanics_that_lead_against_the_heights_are_told_of(against, odds):
    """exp(3.5) is 33.1, and exp(2.9) less than 20."""
    tilting = make_answer("tilting", best=16.0, log_evidence=-against)
    linear = make_answer("linear", best=58.0, log_evidence=0.0)
    warning = tilt_warning(settings(MEASURED), (tilting, linear), 9.0)
    assert (warning is None) is (odds is None)
    if warning is not None:
        assert f"{odds} likelier by linear mechanics" in warning.text
    unknown = replace(linear, log_evidence=None)
    assert tilt_warning(settings(MEASURED), (tilting, unknown), 9.0) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", ["linear"]),
        ("[push]\nlength_mm = 5.0\n", ["linear"]),
        (MEASURED, ["linear", "tilting"]),
        (MEASURED + '[grasp]\nmechanics = "linear"\n', ["linear"]),
        (MEASURED + '[grasp]\nmechanics = "tilting"\n', ["tilting"]),
    ],
)
def test_both_mechanics_are_computed_where_the_lengths_are_stated(text, expected):
    found = settings(text).by_mechanics()
    assert [one.grasp.mechanics for one in found] == expected
