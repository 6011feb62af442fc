"""What a verdict lets be quoted, as the tables of the documentation have it."""

from dataclasses import replace

import pytest

from pushfit.fit.assess.reporting_rules import pieces_for, reported, within_verdict
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.results import FitStatus, Quantity, Verdict
from pushfit.parameters import STIFFNESSES
from tests.fit.tables import SEVEN_DEG, case_table, config
from tests.problems import CASES

QUANTITY = Quantity(
    name="theta_c",
    unit="deg",
    estimate=40.0,
    interval=(35.0, 44.0),
    prob=0.9,
    sets=((36.0, 38.0), (39.0, 44.0)),
    likelihood_sets=((35.0, None),),
    verdict=Verdict.DETERMINED,
    contraction=0.9,
    note="",
)
WIDTH = 9.0


def told(verdict: Verdict, *, wanted: float = 1.1 * WIDTH, **changes) -> Quantity:
    quantity = replace(QUANTITY, verdict=verdict, **changes)
    return within_verdict(quantity, wanted_width_deg=wanted)


@pytest.mark.parametrize(
    ("verdict", "has_estimate", "has_interval", "has_sets"),
    [
        (Verdict.DETERMINED, True, True, True),
        (Verdict.LEARNED, True, True, True),
        (Verdict.PARTLY, True, True, True),
        (Verdict.ASSUMED, True, True, True),
        (Verdict.WIDE, False, True, True),
        (Verdict.SEVERAL_MODES, False, True, True),
        (Verdict.ONE_SIDED, False, False, True),
        (Verdict.NOT_DETERMINED, False, False, False),
    ],
)
def test_a_verdict_leaves_the_numbers_that_it_allows(
    verdict, has_estimate, has_interval, has_sets
):
    found = told(verdict)
    assert found.verdict is verdict
    assert found.estimate == (40.0 if has_estimate else None)
    assert found.interval == ((35.0, 44.0) if has_interval else None)
    assert found.sets == (QUANTITY.sets if has_sets else ())


@pytest.mark.parametrize(
    ("name", "wanted", "verdict"),
    [
        ("theta_c", 1.1 * WIDTH, Verdict.DETERMINED),
        ("theta_c", 0.9 * WIDTH, Verdict.WIDE),
        ("alpha_star", 0.9 * WIDTH, Verdict.WIDE),
        ("A", 0.9 * WIDTH, Verdict.DETERMINED),
    ],
)
def test_an_angle_wider_than_wanted_is_given_without_a_middle(name, wanted, verdict):
    found = told(Verdict.DETERMINED, wanted=wanted, name=name)
    assert found.verdict is verdict
    assert (found.estimate is None) is (verdict is Verdict.WIDE)
    assert found.interval == QUANTITY.interval


@pytest.mark.parametrize("interval", [(40.0, 40.0), (35.0, float("inf")), None])
def test_no_interval_without_a_finite_width(interval):
    assert told(Verdict.DETERMINED, interval=interval).interval is None


def test_several_modes_are_shown_by_the_set_that_has_them():
    found = told(Verdict.SEVERAL_MODES)
    assert pieces_for(found) == QUANTITY.sets
    one = replace(found, sets=QUANTITY.sets[:1])
    assert pieces_for(one) == QUANTITY.likelihood_sets


@pytest.fixture(scope="module")
def result():
    """One parameter is stated, and of one the heights are taken to tell nothing."""
    table = case_table(CASES["firm"], noise=0.02, theta_deg=SEVEN_DEG)
    text = "[parameters.L]\nfixed = 0.04\n"
    found = identify_table(table, config(text), seed=0, engine="sweep", is_brief=True)
    first, *others = found.parameters
    assumed = replace(first, verdict=Verdict.ASSUMED)
    return replace(found, parameters=(assumed, *others))


def by_name(found) -> dict[str, Quantity]:
    return {q.name: q for q in (found.theta_c, *found.parameters, *found.combinations)}


def test_a_model_that_does_not_fit_leaves_what_heights_say_provisional(result):
    """A middle and no interval; priors and what was stated are as they were."""
    before = by_name(result)
    rejected = replace(result.goodness_of_fit, is_adequate=False)
    after = by_name(reported(replace(result, goodness_of_fit=rejected)))
    untouched = {"K_sn": Verdict.ASSUMED, "L": Verdict.FIXED}
    assert {name: before[name].verdict for name in untouched} == untouched
    for name, quantity in after.items():
        if name in untouched:
            assert quantity == before[name]
        else:
            assert quantity.verdict is Verdict.PROVISIONAL
            assert quantity.estimate == before[name].estimate
            assert quantity.interval is None
            assert quantity.sets == quantity.likelihood_sets == ()


def test_a_fit_that_did_not_arrive_has_no_likelihood_sets(result):
    assert by_name(result)["theta_c"].likelihood_sets
    stopped = replace(result.fit, status=FitStatus.MAX_STEPS)
    found = by_name(reported(replace(result, fit=stopped)))
    assert not any(quantity.likelihood_sets for quantity in found.values())


def test_without_a_push_length_no_stiffness_leaves_the_house(result):
    """Nor among the coordinates of the modes."""
    assert by_name(result)["A"].interval
    unknown = result.config.with_keys("push", length_known=False)
    found = reported(replace(result, config=unknown))
    for name, quantity in by_name(found).items():
        is_quoted = quantity.estimate is not None or quantity.interval is not None
        assert is_quoted is (name not in STIFFNESSES)
    assert [mode.coordinates for mode in found.fit.modes] == [
        {} for _ in result.fit.modes
    ]
