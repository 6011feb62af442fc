"""What a judge says of beliefs that are made up."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.explore.belief.belief import N_BELIEF_DRAWS
from pushfit.explore.belief.predict import predict
from pushfit.explore.decide.stopping import Judge
from pushfit.explore.limits import Limits
from pushfit.explore.records import Answer, Purpose, ToldPush
from tests.explore.beliefs import belief_of, prior_draws
from tests.explore.explorers import explorer
from tests.explore.worlds import feel

JUDGE = Judge(width=6.0, prob=0.9, budget=60, seed=0)
SIGMA, LIMITS = 0.05, Limits(reference_sigmas=4.0)
# Beside the limit of an alarm.
JUST = 0.01


def believed(n=64):
    return belief_of(prior_draws(n, np.random.default_rng(1)), sigma=SIGMA)


def push(height, *, theta=0.5, **changes):
    usual = {"alpha": 1.5, "heights": {"height": height}, "sd": None}
    return ToldPush(theta=theta, **(usual | changes))


def again(height, **changes):
    return push(height, purpose=Purpose.REFERENCE.value, **changes)


def change_of(height, *before):
    """What the last of some repetitions of a push is told to have changed by."""
    told = [push(before[0]), push(0.1), *map(again, before[1:]), again(height)]
    return JUDGE.moved(told, believed(), LIMITS)


@pytest.mark.parametrize("before", [(1.0,), (1.0, 1.1), (1.0, 1.1, 0.9)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_an_object_has_moved_where_a_repetition_is_off_by_its_noise(before, sign):
    """That of a height less the mean of n others: σ √(1 + 1/n)."""
    least = 4.0 * SIGMA * np.sqrt(1 + 1 / len(before))
    near, far = (
        change_of(np.mean(before) + sign * share * least, *before)
        for share in (1 - JUST, 1 + JUST)
    )
    assert near is None
    assert far is not None
    assert "4 standard deviations" in far.sentence
    # The push after the last that agreed: the second, or the one that just failed to.
    assert far.first == (1 if len(before) == 1 else len(before) + 1)


def test_joints_that_miss_a_little_are_no_slip():
    """The belief says how much more is felt where the finger went farther."""
    belief = believed()
    thetas = np.array([0.5, 0.9])
    expected = predict(belief, thetas, np.full(2, 1.5)).heights[:, 0] @ belief.weights
    assert abs(expected[1] - expected[0]) > 10 * SIGMA
    told = [push(expected[0] + 0.2), push(0.1), again(expected[1] + 0.2, theta=0.9)]
    assert JUDGE.moved(told, belief, LIMITS) is None
    still = [*told[:2], again(expected[0] + 0.2, theta=0.9)]
    assert JUDGE.moved(still, belief, LIMITS) is not None


def test_only_a_repetition_that_counts_tells_of_a_slip():
    told = [push(1.0), push(0.1), again(9.0)]
    assert JUDGE.moved(told, believed(), LIMITS) is not None
    for other in ([], told[:2], [*told[:2], again(9.0, flags="saturated")]):
        assert JUDGE.moved(other, believed(), LIMITS) is None


def test_an_axis_is_decided_across_its_end():
    question = explorer(ask="alpha_star").question
    rng = np.random.default_rng(1)
    draws = prior_draws(N_BELIEF_DRAWS, rng, ellipse=True)
    draws["alpha_star"] = np.mod(rng.normal(0.0, 1.0, N_BELIEF_DRAWS), 180.0)
    belief = belief_of(draws)
    for reach, is_decided in (((0.0, 180.0), True), ((0.0, 170.0), False)):
        config = question.config.with_keys("reach", alpha_deg=reach)
        intervals = JUDGE.intervals(belief, replace(question, config=config))
        assert (JUDGE.undecided(belief, intervals) == ()) is is_decided


@pytest.mark.parametrize(("share", "is_settled"), [(0.85, False), (0.95, True)])
def test_an_angle_is_absent_with_the_probability_of_an_interval(share, is_settled):
    draws = prior_draws(N_BELIEF_DRAWS, np.random.default_rng(1))
    is_there = np.arange(N_BELIEF_DRAWS) >= share * N_BELIEF_DRAWS
    draws["theta_c"] = np.where(is_there, 40.0, np.nan)
    belief = belief_of(draws)
    intervals = JUDGE.intervals(belief, explorer().question)
    assert intervals == {"theta_c": None}
    assert (JUDGE.undecided(belief, intervals) == ()) is is_settled


def test_failed_pushes_count_among_all_motions_and_not_in_the_budget():
    own = explorer(budget=5, limits=Limits(max_pushes=4), width_deg=0.1)
    left = [own.state.n_left]
    for reason in ("stalled", "", "", ""):
        (push_asked,) = own.ask()
        if reason:
            own.fail(push_asked, reason)
        else:
            heights = feel(push_asked, len(left))
            own.tell(push_asked.theta, push_asked.alpha, heights)
        left.append(own.state.n_left)
    assert left == [4, 3, 2, 1, 0]
    assert own.state.answer is Answer.OUT_OF_BUDGET
    assert explorer(budget=2, limits=Limits(max_pushes=4)).state.n_left == 2
