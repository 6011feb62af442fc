"""Which mechanics leads: cases whose answer the rule itself tells."""

import pytest

from pushfit.config import GraspConfig, parse_config
from pushfit.fit.checks.tilt_check import does_tilt_matter, is_worse, tilt_warning
from tests.report.makers import make_answer

MEASURED = "[push]\nlength_mm = 5.0\n[parameters.L]\nfixed = 0.04\n"


def settings(text: str = "") -> GraspConfig:
    return parse_config(text, path="grasp.toml")


@pytest.mark.parametrize(
    ("best", "other", "width", "matters"),
    [
        (40.0, 38.9, 4.0, True),
        (40.0, 40.9, 4.0, False),
        (40.0, 37.9, None, True),
        (40.0, 41.9, None, False),
        (40.0, None, 4.0, True),
        (None, 40.0, None, True),
        (None, None, None, False),
    ],
    ids=["far", "near", "far, open", "near, open", "gone", "there", "never rolls"],
)
def test_a_tilt_matters_where_it_moves_the_angle_by_a_quarter_of_the_width(
    best, other, width, matters
):
    linear = make_answer("linear", best=best, width=width)
    tilting = make_answer("tilting", best=other)
    assert does_tilt_matter(linear, tilting) is matters


@pytest.mark.parametrize(
    ("log_evidence", "chi_square", "worse"),
    [
        (-16.0, 50.0, True),
        (-14.0, 90.0, False),
        (None, 61.0, True),
        (None, 59.0, False),
    ],
)
def test_evidence_decides_and_where_there_is_none_the_fit(
    log_evidence, chi_square, worse
):
    linear = make_answer("linear", log_evidence=-10.0, chi_square=50.0)
    tilting = make_answer("tilting", log_evidence=log_evidence, chi_square=chi_square)
    assert is_worse(tilting, linear) is worse


def test_a_large_tilt_is_warned_of_only_where_the_equations_of_the_paper_lead():
    linear, tilting = (
        make_answer("linear", best=40.0),
        make_answer("tilting", best=30.0),
    )
    both = settings(MEASURED)
    assert tilt_warning(both, (tilting, linear), 9.0) is None
    assert "check L, the push length" in tilt_warning(both, (linear, tilting), 9.0).text
    near = make_answer("tilting", best=39.5)
    assert tilt_warning(both, (linear, near), 9.0) is None
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
