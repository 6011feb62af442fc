"""Tables of a result: whose correlations are shown, and in which order."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.fit.results import Verdict
from pushfit.report.frames import correlations, result_frame
from tests.tolerances import EXACT

# A thousandth is what a correlation so strong scatters by, of two thousand draws.
OF_2000 = 2e-3


@pytest.fixture
def correlated(determined):
    """e1 goes against the log of C_rr, and that of K_st goes with it a little."""
    x, noise = np.random.default_rng(1).standard_normal((2, 2000))
    draws = {"C_rr": np.exp(x), "e1": 0.1 * noise - x, "K_st": np.exp(x + noise)}
    samples = dict(determined.posterior.samples) | draws
    return replace(determined, posterior=replace(determined.posterior, samples=samples))


def pairs(result):
    return [{c.first, c.second} for c in correlations(result)]


def test_the_strongest_correlation_comes_first(correlated):
    found = correlations(correlated)
    assert [abs(c.value) for c in found] == sorted(
        (abs(c.value) for c in found), reverse=True
    )
    assert {found[0].first, found[0].second} == {"C_rr", "e1"}
    np.testing.assert_allclose(found[0].value, -1 / np.sqrt(1.01), rtol=OF_2000)


def test_what_is_fixed_correlates_with_nothing(correlated):
    fixed = tuple(
        replace(one, verdict=Verdict.FIXED) if one.name == "e1" else one
        for one in correlated.parameters
    )
    assert {"C_rr", "e1"} in pairs(correlated)
    assert not any(
        "e1" in pair for pair in pairs(replace(correlated, parameters=fixed))
    )


def test_stiffnesses_of_an_unknown_push_length_correlate_with_nothing(correlated):
    config = correlated.config.with_keys("push", length_known=False)
    assert {"C_rr", "K_st"} in pairs(correlated)
    shown = pairs(replace(correlated, config=config))
    assert {"C_rr", "e1"} in shown
    assert not any("K_st" in pair for pair in shown)


def test_a_row_is_all_of_its_quantity(determined):
    wider = tuple(replace(one, prob=0.8) for one in determined.parameters)
    result = replace(determined, parameters=wider)
    frame = result_frame(result)
    for one in (*result.parameters, *result.combinations):
        row = frame.loc[one.name]
        interval = one.interval or (np.nan, np.nan)
        told = one.estimate, *interval, one.prob, one.contraction
        numbers = row[["estimate", "lower", "upper", "prob", "contraction"]]
        np.testing.assert_allclose(
            numbers.astype(float), np.array(told, dtype=float), rtol=EXACT
        )
        assert (row["unit"], row["verdict"]) == (one.unit, one.verdict.value)
