"""Many tables at once: against single tables, and against each other."""

import numpy as np
import pytest

from pushfit.fit.identify.identify_many import identify_many
from pushfit.fit.identify.identify_table import identify_table
from tests.fit.tables import case_table, config
from tests.problems import CASES

# Elevations of all tables here: one compiled program.
NINE = np.array([8.0, 16.0, 24.0, 32.0, 42.0, 52.0, 62.0, 72.0, 82.0])
# Another unit rounds otherwise, and searches end within their own tolerance of that.
UNIT_TOL = 1e-6
SCENES = (("firm", 0.1), ("firm", 0.005), ("paper", 0.05), ("paper", 0.3))


@pytest.fixture(scope="module")
def tables():
    """Sharp, wide, and one with two modes."""
    return [
        case_table(CASES[name], noise=noise, seed=seed, theta_deg=NINE)
        for seed, (name, noise) in enumerate(SCENES)
    ]


@pytest.mark.parametrize("n", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_a_result_does_not_depend_on_its_neighbours_or_their_order(tables, n):
    tables, seeds = tables[:n], range(n)
    forward = identify_many(tables, config(), seeds=seeds, engine="auto")
    backward = identify_many(tables[::-1], config(), seeds=seeds[::-1], engine="auto")
    (alone,) = identify_many(tables[-1:], config(), seeds=seeds[-1:], engine="auto")
    backward = backward[::-1]
    for one, other in zip([*forward, forward[-1]], [*backward, alone], strict=True):
        assert one.values == other.values
        for name, draws in one.draws.items():
            assert np.array_equal(draws, other.draws[name], equal_nan=True)


@pytest.mark.slow
def test_rows_say_what_a_single_table_says(tables):
    (row,) = identify_many(tables[:1], config(), seeds=[0], engine="auto")
    single = identify_table(tables[0], config(), seed=0, engine="sweep")
    theta_c = single.theta_c
    assert row.values["theta_c_verdict"] == theta_c.verdict.value
    assert row.values["theta_c_deg"] == theta_c.estimate
    assert row.values["theta_c_low_deg"] == theta_c.interval[0]
    assert row.values["theta_c_high_deg"] == theta_c.interval[1]
    assert row.values["chi_square"] == single.fit.chi_square
    p_value = single.goodness_of_fit.p_value
    assert row.values["chi_square_p_value"] == p_value
    assert row.values["warnings"] == ";".join(w.code for w in single.warnings)
    assert row.values["engine"] == "sweep"


@pytest.mark.parametrize(
    ("name", "noise", "word"),
    [("firm", 0.005, "determined"), ("paper", 0.3, "not_determined")],
)
def test_rows_have_one_vocabulary_for_series_stiffnesses(tables, name, noise, word):
    """That of profiles, which rows do without."""
    table = tables[SCENES.index((name, noise))]
    (row,) = identify_many([table], config(), seeds=[0], engine="sweep")
    words = {row.values[f"{letter}_verdict"] for letter in "AB"}
    assert word in words
    assert words <= {"determined", "wide", "not_determined"}
    for letter in "AB":
        is_quoted = row.values[f"{letter}_verdict"] == "determined"
        assert (row.values[letter] is not None) == is_quoted


def test_an_unusable_table_leaves_its_neighbours_alone(tables):
    n_pushes = tables[1].n_pushes
    broken = tables[1].with_flag(range(n_pushes), "saturated")
    found = identify_many([tables[0], broken], config(), seeds=[0, 1], engine="auto")
    assert found[0].values["status"] == "ok"
    assert found[1].code == "no_usable_push"


@pytest.mark.slow
def test_units_of_the_heights_change_stiffness_alone():
    newtons = case_table(CASES["firm"], noise=0.05, seed=3, theta_deg=NINE)
    frame = newtons.frame.rename(columns=lambda n: n.replace("_n", "_kpa"))
    heights = [n for n in frame if n.endswith("_kpa")]
    frame[heights] *= 7.3
    other = type(newtons).from_frame(frame)
    results = [
        identify_table(table, config(), seed=0, is_brief=True)
        for table in (other, type(other).from_frame(frame.assign(**frame[heights] * 2)))
    ]
    one, two = (r.posterior.samples for r in results)
    assert np.allclose(one["theta_c"], two["theta_c"], rtol=UNIT_TOL)
    assert np.allclose(2 * one["A"], two["A"], rtol=UNIT_TOL)
