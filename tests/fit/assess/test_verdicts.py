"""The verdict on an angle: draws and profiles whose answer the rule itself tells."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.fit.assess.reporting_rules import pieces_for
from pushfit.fit.assess.verdicts import angle_quantity, quantities
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.profile_sets import verdict_of
from pushfit.fit.results import (
    LikelihoodProfile,
    Piece,
    Quantity,
    Verdict,
)
from tests.fit.posteriors import posterior_of
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT

SHARES = (np.arange(2000) + 0.5) / 2000
# A posterior of 40° ± 2°, and a prior that has every angle.
NARROW, WIDE = 40.0 + 2.0 * scipy.stats.norm.ppf(SHARES), 90.0 * SHARES
CLOSED, OPEN = ((36.0, 44.0),), ((36.0, None),)


def judged(
    draws: np.ndarray,
    pieces: tuple[Piece, ...] | None = CLOSED,
    *,
    before: np.ndarray = WIDE,
    by_draws: bool = False,
    name: str = "theta_c",
) -> Quantity:
    """An angle by draws and, unless there are none, by a likelihood set."""
    posterior = posterior_of({name: draws}, {name: before})
    profile = None
    if pieces is not None:
        profile = LikelihoodProfile(
            name=name,
            unit="deg",
            values=np.zeros(0),
            delta_chi_square=np.zeros(0),
            pieces=pieces,
            prob=0.9,
            verdict=verdict_of(pieces),
            degrees_of_freedom=np.inf,
        )
    return angle_quantity(name, posterior, profile, prob=0.9, by_draws=by_draws)


@pytest.mark.parametrize(
    ("never", "verdict", "is_quoted"),
    [
        (0.04, Verdict.DETERMINED, True),
        (0.06, Verdict.DETERMINED, False),
        (0.89, Verdict.DETERMINED, False),
        (0.91, Verdict.ABSENT, False),
        (1.0, Verdict.ABSENT, False),
    ],
)
def test_draws_that_never_roll_leave_an_interval_its_tails_alone(
    never, verdict, is_quoted
):
    found = judged(np.where(SHARES[::-1] < never, np.nan, NARROW))
    assert found.verdict is verdict
    assert (found.interval is not None) is is_quoted
    assert (found.estimate is not None) is is_quoted
    assert ("of the posterior never rolls" in found.note) is not is_quoted
    assert found.likelihood_sets == (() if verdict is Verdict.ABSENT else CLOSED)
    assert (found.contraction is None) is (never == 1.0)


@pytest.mark.parametrize(
    ("share", "verdict"), [(0.75, Verdict.DETERMINED), (0.85, Verdict.NOT_DETERMINED)]
)
def test_what_hardly_narrows_the_prior_determines_nothing(share, verdict):
    """However sharp its profile; four fifths of its width is hardly."""
    assert judged(45.0 + share * (WIDE - 45.0)).verdict is verdict


@pytest.mark.parametrize(
    ("by_draws", "before", "verdict"),
    [
        (True, WIDE, Verdict.DETERMINED),
        (False, WIDE, Verdict.NOT_DETERMINED),
        # What is fixed is not determined by heights.
        (True, np.full(2000, 40.0), Verdict.NOT_DETERMINED),
    ],
)
def test_draws_alone_tell_where_there_is_no_profile_to_be_had(
    by_draws, before, verdict
):
    assert judged(NARROW, None, before=before, by_draws=by_draws).verdict is verdict


@pytest.mark.parametrize("by_draws", [True, False])
@pytest.mark.parametrize(
    ("at_lower", "verdict"),
    [(0.0, Verdict.DETERMINED), (0.4, Verdict.NOT_DETERMINED)],
)
def test_one_end_of_a_short_reach_is_determined_where_draws_are_at_it(
    at_lower, verdict, by_draws
):
    """One in twenty directions of the prior is within, and one in 200 afterwards."""
    before = np.clip(25.0 + 200.0 * (SHARES - 0.5), 20.0, 30.0)
    within = np.clip(20.0 + 10.0 * (SHARES - at_lower) / 0.005, 20.0, 30.0)
    draws = np.where(SHARES < at_lower, 20.0, within)
    found = judged(
        draws,
        None if by_draws else ((30.0, 30.0),),
        before=before,
        by_draws=by_draws,
        name="alpha_star",
    )
    assert found.verdict is verdict


@pytest.mark.parametrize("is_lower", [True, False])
def test_an_end_that_the_likelihood_leaves_open_is_open(is_lower):
    ((low, high),) = judged(NARROW).sets
    found = judged(NARROW, ((None, 44.0),) if is_lower else OPEN)
    assert found.verdict is Verdict.ONE_SIDED
    assert found.sets == (((None, high),) if is_lower else ((low, None),))


@pytest.mark.parametrize(
    ("share", "of_parameter", "of_combination"),
    [
        (0.85, Verdict.LEARNED, Verdict.DETERMINED),
        (0.75, Verdict.PARTLY, Verdict.WIDE),
        (0.25, Verdict.PARTLY, Verdict.WIDE),
        (0.15, Verdict.ASSUMED, Verdict.NOT_DETERMINED),
    ],
)
def test_parameters_are_learned_by_the_variance_of_their_logs(
    share, of_parameter, of_combination
):
    """Less by four fifths is learned, by less than one fifth assumed."""
    setup = build_problem(case_table(CASES["paper"]), config())
    log_draws = scipy.stats.norm.ppf(SHARES)
    names = ("K_sn", "C_rr", "A", "sigma_height")
    before = dict.fromkeys(names, np.exp(log_draws))
    draws = dict.fromkeys(names, np.exp(np.sqrt(1 - share) * log_draws))
    parameters, combinations = quantities(
        setup, posterior_of(draws, before), {}, prob=0.9, unit="n", with_sets=False
    )
    for found in (*parameters, *combinations):
        np.testing.assert_allclose(found.contraction, share, rtol=EXACT)
    assert {one.verdict for one in parameters} == {of_parameter}
    assert {one.verdict for one in combinations} == {of_combination}


def test_what_fixed_springs_come_to_is_assumed():
    setup = build_problem(case_table(CASES["paper"]), config())
    stated = posterior_of({"A": np.full(2000, 400.0)}, {"A": np.full(2000, 400.0)})
    _, (found,) = quantities(setup, stated, {}, prob=0.9, unit="n", with_sets=False)
    assert found.verdict is Verdict.ASSUMED


@pytest.mark.parametrize(
    ("piece", "narrowed", "verdict"),
    [
        ((0.9, 1.1), 0.1, Verdict.LEARNED),
        ((0.9, None), 0.1, Verdict.PARTLY),
        ((0.9, None), 0.95, Verdict.ASSUMED),
    ],
)
def test_a_parameter_with_an_end_that_no_height_bounds_is_learned_in_part(
    piece, narrowed, verdict
):
    setup = build_problem(case_table(CASES["paper"]), config())
    log_draws = scipy.stats.norm.ppf(SHARES)
    posterior = posterior_of(
        {"K_sn": np.exp(narrowed * log_draws)}, {"K_sn": np.exp(log_draws)}
    )
    profile = LikelihoodProfile(
        name="K_sn",
        unit="N/m",
        values=np.zeros(0),
        delta_chi_square=np.zeros(0),
        pieces=(piece,),
        prob=0.9,
        verdict=verdict_of((piece,)),
        degrees_of_freedom=np.inf,
    )
    ((found,), _) = quantities(
        setup, posterior, {"K_sn": profile}, prob=0.9, unit="n", with_sets=False
    )
    assert found.verdict is verdict


def test_a_set_that_is_open_at_both_ends_shows_no_bound():
    """Of an angle bounded on one side the likelihood has the end then."""
    quantity = replace(
        judged(NARROW, OPEN), verdict=Verdict.ONE_SIDED, sets=((None, None),)
    )
    assert pieces_for(quantity) == quantity.likelihood_sets == OPEN
    assert pieces_for(replace(quantity, likelihood_sets=((None, None),))) == ()
