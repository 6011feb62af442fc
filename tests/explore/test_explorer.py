"""The course of an exploration: what is asked, what told, and when it ends."""

import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError, DataError
from pushfit.explore.belief.belief import N_BELIEF_DRAWS
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.decide.stopping import MIN_UNKNOWN_NOISE
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.explore.records import Answer, Purpose
from pushfit.fit.results import ResultWarning
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp, Parameters
from tests.explore.beliefs import PLAIN
from tests.explore.explorers import (
    WIDTH,
    explorer,
    hopeless_table,
    run,
    without_a_noise,
)
from tests.explore.worlds import (
    COMPONENTS,
    SIGMA,
    THETA_C,
    TRUTH,
    feel,
    importance,
)
from tests.tolerances import EXACT

FORCE = 2.5  # what no push may exceed [N]
BESIDE_DEG = 10.0  # two steps of the candidates


def test_an_exploration_decides_and_then_asks_nothing():
    own = explorer()
    asked = run(own)
    assert own.state.answer is Answer.DECIDED
    low, high = own.state.intervals["theta_c"]
    assert high - low <= WIDTH
    assert low < THETA_C < high
    assert own.ask() == ()
    assert len(asked) == own.state.n_pushes < 15
    assert "decided to ± 4.5°" in own.state.sentence


def few_draws(found):
    """Those of ten draws, as weights leave them where heights are exact."""
    few = np.where(np.arange(N_BELIEF_DRAWS) < 10, 0.0, -np.inf)
    return replace(found, log_weights=few)


def unsure(found):
    warning = ResultWarning(code="not_converged", text="")
    return replace(found, warnings=(warning,))


@pytest.mark.parametrize(
    ("spoilt", "why"),
    [
        (few_draws, "only 10 draws of it are left"),
        (unsure, "its draws are not to be trusted"),
    ],
)
def test_of_draws_that_give_no_interval_there_is_no_forecast(spoilt, why):
    """Pushes are asked for all the same; ten draws lie within a degree or two."""

    def source(table, question, seed):
        return spoilt(importance(table, question, seed))

    own = explorer(source=source, width_deg=60.0)
    own.attach(hopeless_table())
    (push,) = own.ask()
    state = own.state
    assert state.answer is Answer.DECIDING
    assert state.intervals == {"theta_c": None}
    assert (state.p_budget, push.p_decided) == (None, 0.0)
    assert not np.isfinite(push.expected_width)
    assert state.sentence == f"after 12 pushes θ_c is open, as {why}."


def test_no_interval_is_quoted_of_heights_that_the_model_does_not_describe():
    """While more of them may still be made; a finding ends it."""
    warning = ResultWarning(code="model_inadequate", text="it does not")

    def source(table, question, seed):
        return replace(importance(table, question, seed), warnings=(warning,))

    found = []
    for own in (explorer(), explorer(source=source)):
        own.tell(np.pi / 4, np.pi / 2, dict.fromkeys(COMPONENTS, 1.0))
        (push,) = own.ask()
        state = own.state
        quoted = state.intervals["theta_c"], state.p_budget
        found.append((*(one is None for one in quoted), np.isfinite(push.gain)))
        assert state.answer is Answer.DECIDING
        assert np.isfinite(push.expected_width) == (state.p_budget is not None)
    assert found == [(False, False, True), (True, True, True)]
    assert "is open, as the model does not describe the heights." in state.sentence


def test_suggestions_are_ranked_by_gain():
    gains = [s.gain for s in explorer().ask(5)]
    assert gains == sorted(gains, reverse=True)
    assert gains[0] > 0


def test_only_the_first_in_rank_has_a_number():
    assert [s.number for s in explorer().ask(3)] == [1, None, None]


@pytest.mark.parametrize(
    "changes",
    [
        {"theta": 40.0},
        {"theta": np.nan},
        {"alpha": np.inf},
        {"sd": -0.1},
        {"sd": 0.0},
        {"flags": "fine"},
    ],
)
def test_a_push_that_is_refused_is_not_taken_in(tmp_path, changes):
    """Neither by this process nor by the next one on its journal."""
    path = tmp_path / "journal.jsonl"
    own = explorer(journal=path, channels=("height",))
    (first, *_) = own.ask()
    before = path.read_bytes()
    push = {"theta": first.theta, "alpha": first.alpha, "heights": 1.0}
    with pytest.raises(DataError):
        own.tell(**(push | changes))
    assert path.read_bytes() == before
    own.tell(**push)
    assert len(explorer(journal=path, channels=("height",)).history.told) == 1


# As a user's script does, without the checks of types that tests have.
NO_NUMBERS = """\
from pushfit.errors import DataError
from pushfit.explore.explorer import Explorer
from tests.explore.worlds import importance

own = Explorer(None, sigma=0.05, source=importance)
push = {"theta": 0.5, "alpha": 1.5, "heights": 1.0}
for changes in (
    {"heights": None},
    {"heights": float("nan")},
    {"heights": "no height"},
    {"heights": [1.0, 2.0]},
    {"heights": {"height": None}},
    {"theta": None},
    {"alpha": "across"},
    {"sd": {"height": "small"}},
    {"theta": "0.5"},
    {"heights": {"height": "1.0"}},
):
    try:
        own.tell(**(push | changes))
    except DataError as error:
        print(error)
print(len(own.history.told))
"""


def test_what_is_no_number_is_refused_where_it_is_told():
    found = subprocess.run(
        [sys.executable, "-c", NO_NUMBERS],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert found.returncode == 0, found.stderr
    *said, n_told = found.stdout.splitlines()
    assert n_told == "0"
    assert [line.partition(" is ")[0] for line in said] == [
        "height = None",
        "height = nan",
        "height = 'no height'",
        "height = [1.0, 2.0]",
        "height = None",
        "theta = None",
        "alpha = 'across'",
        "height = 'small'",
        "theta = '0.5'",
        "height = '1.0'",
    ]
    assert all(line.endswith("a push without a height by `fail()`") for line in said)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"sigma": -1.0}, "sigma = -1.0"),
        ({"sigma": np.nan}, "sigma = nan"),
        ({"channels": ("foo",)}, "foo"),
        ({"channels": ()}, "no channel"),
        ({"unit": "lbf"}, "lbf"),
        ({"seed": -1}, "seed = -1"),
        ({"budget": -1}, "budget -1"),
        ({"width_deg": 0.0}, "the width must be within 0 and 180°"),
        ({"width_deg": 180.0}, "the width must be within 0 and 180°"),
        ({"prob": 0.0}, "the probability within 0 and 1"),
        ({"prob": 1.0}, "the probability within 0 and 1"),
        ({"budget": 0}, "the budget 1 push or more"),
        ({"journal": "."}, "a journal is a file"),
        ({"journal": "missing/one.jsonl"}, "folder that exists"),
    ],
)
def test_a_question_that_makes_no_sense_is_refused_at_once(changes, named):
    with pytest.raises(ConfigError, match=named):
        explorer(**changes)


@pytest.mark.parametrize("n", [0, -1])
def test_no_push_is_no_answer_to_a_question_for_one(n):
    with pytest.raises(ConfigError, match="ask for one push or more"):
        explorer().ask(n)


def test_settings_of_an_exploration_may_be_given_in_any_form(tmp_path):
    file = tmp_path / "grasp.toml"
    file.write_text("[push]\nlength_mm = 4.0\n", "utf-8")
    for given in (file, str(file), {"push": {"length_mm": 4.0}}):
        assert Explorer(given).question.config.push.length_mm == 4.0
    assert not Explorer(None).question.config.push.length_known


def test_earlier_pushes_are_attached_and_cost_no_budget():
    rng = np.random.default_rng(1)
    table = simulate_table(
        TRUTH,
        Grasp(push_length=0.005),
        theta=np.radians([20.0, 50.0, 80.0]),
        alpha=np.pi / 2,
        repeats=1,
        noise=SIGMA,
        rng=rng,
        channels=COMPONENTS,
        state_sd=True,
    )
    own = explorer()
    own.attach(table)
    assert (own.state.n_pushes, own.state.n_left) == (3, 30)
    with pytest.raises(DataError, match="attach a table first"):
        own.attach(hopeless_table())


def test_a_push_that_nobody_asked_for_counts_as_well():
    own = explorer()
    before = own.judge.intervals(own.belief, own.question)["theta_c"]
    own.ask()
    # Not as asked, and where it got to.
    own.tell(np.radians(33.3), np.pi / 2, dict.fromkeys(COMPONENTS, 1.0))
    after = own.state.intervals["theta_c"]
    assert after[1] - after[0] < before[1] - before[0]
    np.testing.assert_allclose(own.table.theta, np.radians([33.3]), rtol=EXACT)


def test_a_failed_push_is_asked_again_last_an_abandoned_one_never():
    own = explorer()
    (first,) = own.ask()
    own.fail(first, "stalled")
    *others, last = own.ask(100)
    assert last.theta == first.theta
    assert first.theta not in {s.theta for s in others}
    own.abandon(others[0])
    assert others[0].theta not in {s.theta for s in own.ask(100)}
    # What gives a height ends the row of failures.
    (second,) = own.ask()
    own.tell(second.theta, second.alpha, feel(second, 0))
    thetas = [s.theta for s in own.ask(100)]
    assert first.theta in thetas[:-1]


def test_a_table_beyond_the_azimuths_is_told_from_a_workspace():
    table = hopeless_table()
    own = explorer(limits=Limits(theta_deg=(5.0, 85.0)), width_deg=0.1)
    own.attach(PeakTable.from_frame(table.frame.assign(alpha_deg=270.0)))
    assert not own.ask()
    words = "17 candidates beyond the azimuths 0° to 180° of the reach"
    assert words in own.state.sentence


@pytest.mark.parametrize("reason", ["stalled", ""])
def test_a_push_fails_once_and_for_a_reason(reason):
    own = explorer()
    (first,) = own.ask()
    if reason:
        own.fail(first, reason)
    with pytest.raises(DataError, match="answered before" if reason else "a reason"):
        own.fail(first, reason)
    assert len(own.history.failures) == (1 if reason else 0)


@pytest.mark.parametrize(("factor", "is_wrong"), [(1.0, False), (3.0, True)])
def test_one_wrong_height_decides_nothing(factor, is_wrong):
    """Tens of sigmas off, which leave hardly a draw and so a narrow interval."""
    own = explorer(limits=Limits(reference_every=0))
    for number in range(30):
        suggestions = own.ask()
        if not suggestions:
            break
        (push,) = suggestions
        heights = feel(push, number)
        if number == 2:
            heights = {c: factor * h for c, h in heights.items()}
        own.tell(push.theta, push.alpha, heights)
    assert own.state.answer is (Answer.STOPPED if is_wrong else Answer.DECIDED)
    is_named = "push 3 " in own.state.sentence
    assert is_named is is_wrong
    own.go_on()
    assert (own.state.answer is Answer.DECIDED) is not is_wrong


@pytest.mark.parametrize("channels", [("height",), COMPONENTS])
@pytest.mark.parametrize(("factor", "word"), [(1e3, "large"), (1e-3, "small")])
def test_a_height_in_another_unit_is_named(channels, factor, word):
    """Told, or in a table made before; no draws are made from it."""
    own = explorer(channels=channels)
    for number in range(4):
        (push,) = own.ask()
        heights = feel(push, number, channels=channels)
        if number == 3:
            heights = {c: factor * h for c, h in heights.items()}
        own.tell(push.theta, push.alpha, heights)
    wrong = heights[channels[0]]
    for told in (own, explorer(channels=channels)):
        if not told.history.told:
            told.attach(own.table)
        said = told.state.sentence
        assert told.state.answer is Answer.STOPPED
        assert said.startswith(f"push 4 ({push.describe()}): {channels[0]}_n = ")
        assert f"{wrong:g} is about 1000 times too {word} beside the others" in said
        assert said.endswith("correct it, or leave the push out, and begin again")
        assert told.history.n_drawn < 4


def test_what_cannot_be_decided_for_a_wrong_height_is_said():
    """The draws that such a height leaves forecast nothing."""
    table = hopeless_table()
    normal = table.heights("height_normal").copy()
    normal[3] *= 10
    wrong = type(table).from_frame(table.frame.assign(height_normal_n=normal))
    own = explorer(limits=Limits(theta_deg=(5.0, 10.0)))
    own.attach(wrong)
    assert own.state.answer is Answer.STOPPED
    assert "no grasp gives all of these heights: push 4 " in own.state.sentence


def test_a_push_beyond_the_limits_is_not_asked_for_again():
    """The strongest push is the reference; the finger went too far with it."""
    limits = Limits(theta_deg=(5.0, 60.0), reference_every=3, reference_first=3)
    own = explorer(limits=limits, width_deg=0.1)
    for theta_deg in (63.5, 30.0, 20.0):
        (push,) = own.ask()
        there = replace(push, theta=np.radians(theta_deg))
        own.tell(there.theta, there.alpha, feel(there, int(theta_deg)))
    (push,) = own.ask()
    assert push.purpose is Purpose.REFERENCE
    np.testing.assert_allclose(push.theta_deg, limits.theta_deg[1], rtol=EXACT)


def test_three_failures_in_a_row_end_it():
    own = explorer(limits=Limits(max_failures=3))
    for _ in range(3):
        own.fail(own.ask()[0], "stalled")
    assert own.state.answer is Answer.STOPPED
    thetas = [f"θ = {np.degrees(f.theta):.1f}°" for f in own.history.failures]
    assert all(f"stalled at {theta}" in own.state.sentence for theta in thetas)
    assert len(set(thetas)) == 3


def test_what_is_over_does_not_go_on(tmp_path):
    own = explorer()
    own.stop("the object is gone", is_over=True)
    own.go_on()
    assert own.state.answer is Answer.STOPPED


def test_without_a_word_on_the_noise_eight_pushes_are_the_least():
    own = without_a_noise()
    assert len(run(own, channels=("height",))) == MIN_UNKNOWN_NOISE


def test_pushes_that_do_not_count_are_none_of_the_eight():
    own = without_a_noise(channels=COMPONENTS)
    while suggestions := own.ask():
        push, number = suggestions[0], len(own.history.told)
        flags = "saturated" if number % 2 else ""
        own.tell(push.theta, push.alpha, feel(push, number), flags=flags)
    assert own.state.answer is Answer.DECIDED
    assert sum(row.counts for row in own.history.told) == 8


def test_a_budget_ends_it():
    own = explorer(width_deg=0.5, budget=3)
    assert len(run(own)) == 3
    assert own.state.answer is Answer.OUT_OF_BUDGET
    assert "by a larger budget with the same journal" in own.state.sentence


@pytest.mark.parametrize(
    ("budget", "words"),
    [(1, "the one push that is left"), (2, "the 2 pushes that are")],
)
def test_one_push_is_no_pushes(budget, words):
    assert words in explorer(budget=budget).state.sentence


@pytest.mark.parametrize("is_guess", [True, False])
def test_priors_alone_do_not_say_that_an_angle_is_absent(is_guess):
    """Draws that never roll: a finding after pushes, a possibility before the first."""

    def never_rolling(table, question, seed):
        found = importance(table, question, seed)
        nowhere = {"theta_c": np.full(N_BELIEF_DRAWS, np.nan)}
        return replace(found, samples={**found.samples, **nowhere}, is_guess=is_guess)

    own = explorer(source=never_rolling)
    is_told = "does not exist" in own.state.sentence
    assert is_told is not is_guess
    assert ("by the priors alone" in own.state.sentence) is is_guess
    assert own.state.p_budget is None
    assert own.state.answer is Answer.DECIDING


def test_a_decision_is_what_a_table_of_the_same_pushes_says():
    """Draw for draw: the same seed, pushes and mechanics, as `next` takes them."""
    own = explorer()
    run(own)
    assert own.state.answer is Answer.DECIDED
    assert own.history.n_drawn == len(own.history.told)
    after = explorer()
    after.attach(own.table)
    assert after.state.intervals == own.state.intervals
    assert after.state.answer is Answer.DECIDED


@pytest.mark.parametrize(
    ("channels", "advice"),
    [
        (("height",), " Force components, a wider reach or less noise would help."),
        # Components are felt already.
        (COMPONENTS, " A wider reach or less noise would help."),
    ],
)
def test_what_lies_out_of_reach_cannot_be_decided(channels, advice):
    """θ_c = 45.6°, pushes to 10° only: a bound from one side, however many."""
    own = explorer(limits=Limits(theta_deg=(5.0, 10.0)), channels=channels)
    run(own, channels=channels)
    assert own.state.answer is Answer.CANNOT
    assert "cannot be decided to ± 4.5°" in own.state.sentence
    assert own.state.sentence.endswith(advice)
    # One hopeless forecast is no answer yet.
    *_, before, second, last = own.history.course
    assert last.answer is Answer.CANNOT
    assert {before.answer, second.answer} == {Answer.DECIDING}
    assert before.p_unlimited is not None


# Two grasps of which three pushes feel the same, but for noise.
ALIKE = (
    Parameters(K_sn=769, K_dn=536, K_st=253, C_rr=0.948, C_d=0.252, L=0.062),
    Parameters(K_sn=413, K_dn=1400, K_st=626, C_rr=0.124, C_d=0.264, L=0.0338),
)


@pytest.mark.parametrize("truth", [0, 1])
def test_of_two_hills_the_own_one_is_left(truth):
    sigma, channels = 0.0463, ("height",)
    table = PeakTable.from_arrays(
        theta=np.radians([10.0, 45.0, 80.0]),
        alpha=np.full(3, np.pi / 2),
        heights={"height": np.array([0.370, 1.114, 1.577])},
        unit="n",
    )
    own = explorer(width_deg=30.0, budget=40, sigma=sigma, channels=channels)
    own.attach(table)
    values = own.belief.samples["theta_c"]
    below, between, above = np.histogram(values, bins=[0, 30, 60, 90])[0]
    assert min(below, above) > 1.4 * between
    angles = [np.degrees(critical_angle(one, PLAIN, np.pi / 2)) for one in ALIKE]
    low, high = own.state.intervals["theta_c"]
    assert low < min(angles) < max(angles) < high
    run(own, params=ALIKE[truth], sigma=sigma, channels=channels)
    low, high = own.state.intervals["theta_c"]
    assert low < angles[truth] < high
    assert not low < angles[1 - truth] < high


def test_a_table_that_is_hopeless_needs_no_further_push():
    """Twelve pushes to 10° made before: nothing was looked at in between."""
    own = explorer(limits=Limits(theta_deg=(5.0, 10.0)))
    own.attach(hopeless_table())
    assert own.state.answer is Answer.CANNOT


def test_the_first_push_is_repeated_and_says_when_the_object_has_moved():
    own = explorer(width_deg=1.0, budget=60, limits=Limits(reference_every=4))
    asked = run(own, n=5)
    assert asked[4].purpose is Purpose.REFERENCE
    # The strongest push so far shows most of a change; the last one shows none.
    assert asked[4].theta == max(s.theta for s in asked[:3])
    assert own.state.answer is Answer.DECIDING
    run(own, n=4)
    softer = Parameters(K_sn=500, K_dn=1200, K_st=400, C_rr=0.3, C_d=0.5, L=0.04)
    run(own, n=1, params=softer)
    assert own.state.answer is Answer.STOPPED
    assert "the object has moved" in own.state.sentence


def test_a_slip_before_the_last_push_is_seen():
    """That push is the strongest, and to repeat it would say that nothing moved."""
    own = explorer(width_deg=0.1, limits=Limits(reference_every=4))
    softer = Parameters(K_sn=500, K_dn=1200, K_st=400, C_rr=0.3, C_d=0.5, L=0.04)
    for theta_deg in (30.0, 20.0, 25.0, 85.0):
        (push,) = own.ask()
        push = replace(push, theta=np.radians(theta_deg))
        params = softer if theta_deg == 85.0 else TRUTH
        own.tell(push.theta, push.alpha, feel(push, int(theta_deg), params=params))
    (push,) = own.ask()
    assert push.purpose is Purpose.REFERENCE
    np.testing.assert_allclose(push.theta_deg, 30.0, rtol=EXACT)
    own.tell(push.theta, push.alpha, feel(push, 5, params=softer))
    assert "the object has moved" in own.state.sentence


def test_a_height_that_does_not_count_shows_no_slip():
    """A push that was saturated is the tallest, and no measure of the others."""
    own = explorer(width_deg=0.1, limits=Limits(reference_every=4))
    for number in range(5):
        (push,) = own.ask()
        flags, more = ("saturated", 3.0) if number == 1 else ("", 0.0)
        heights = {name: h + more for name, h in feel(push, number).items()}
        own.tell(push.theta, push.alpha, heights, flags=flags)
    run(own, n=1)
    assert own.history.told[-1].purpose == Purpose.REFERENCE.value
    assert own.state.answer is Answer.DECIDING


def test_a_reference_that_is_abandoned_is_made_beside_it():
    own = explorer(width_deg=0.1, limits=Limits(reference_every=4))
    run(own, n=4)
    (due,) = own.ask()
    assert due.purpose is Purpose.REFERENCE
    own.abandon(due, "saturated")
    run(own, n=1)
    (other,) = own.ask()
    assert other.purpose is Purpose.REFERENCE
    assert 0 < abs(other.theta_deg - due.theta_deg) < BESIDE_DEG


def test_whether_the_object_moved_is_asked_early_and_then_now_and_then():
    limits = Limits(reference_every=5)
    own = explorer(width_deg=0.1, budget=11, limits=limits)
    purposes = [push.purpose for push in run(own)]
    # After the first four pushes, then after five.
    repeated = [n for n, p in enumerate(purposes, 1) if p is Purpose.REFERENCE]
    assert repeated == [5, 11]


def test_short_pushes_alone_decide_nothing():
    """Draws of the priors that agree with all of them are soon but a few."""
    limits = Limits(force=0.5, theta_deg=(20.0, 85.0))
    own = explorer(width_deg=6.0, sigma=0.01, limits=limits, source=believe)
    asked = run(own, n=30, sigma=0.01)
    assert {s.purpose for s in asked} == {Purpose.PROBE}
    assert own.state.answer is Answer.STOPPED
    assert "give a higher force limit" in own.state.sentence
    assert own.state.intervals == {"theta_c": None}


def test_first_pushes_are_short_while_the_stiffness_is_unknown():
    own = explorer(limits=Limits(force=FORCE, theta_deg=(30.0, 85.0)))
    asked = run(own)
    assert asked[0].purpose is Purpose.PROBE
    assert asked[0].length_share < 1
    assert asked[-1].length_share == 1
    assert all(s.force_q99 <= FORCE for s in asked)
    assert own.state.answer is Answer.DECIDED
    # Probes weigh the draws but are no rows of the table.
    assert own.table.n_pushes == sum(s.length_share == 1 for s in asked)


def test_a_push_that_went_farther_than_asked_is_told_with_its_length():
    own = explorer(limits=Limits(force=FORCE, theta_deg=(30.0, 85.0)))
    (asked,) = own.ask()
    heights = feel(replace(asked, length_share=1.0), 0)
    own.tell(asked.theta, asked.alpha, heights, length_share=1.0)
    assert own.table.n_pushes == 1
    for share in (0.0, 1.1):
        with pytest.raises(DataError, match=f"length_share = {share:g}"):
            own.tell(asked.theta, asked.alpha, heights, length_share=share)
    assert len(own.history.told) == 1


def test_a_refusal_is_explained_and_its_remedy_is_one():
    own = explorer(limits=Limits(force=1e-4))
    assert own.ask() == ()
    assert "might exceed the force limit of 0.0001" in own.state.sentence
    (least,) = re.findall(r"give a force limit of (\S+) or more", own.state.sentence)
    assert explorer(limits=Limits(force=float(least))).ask()
    assert not explorer(limits=Limits(force=0.9 * float(least))).ask()
    # The journal keeps to its limits, so nothing is there to go on with.
    own.go_on()
    assert own.state.answer is Answer.STOPPED


def test_a_box_without_a_push_is_explained():
    thousandth = (-1e-3, 1e-3)
    limits = Limits(workspace_mm=(thousandth,) * 3, force=1e-4)
    n = len(limits.candidates(azimuths=None, reference_alpha=0.0))
    own = explorer(limits=limits)
    assert own.ask() == ()
    assert f"{n} candidates out of the workspace" in own.state.sentence
    assert own.state.sentence.endswith("; widen them")
