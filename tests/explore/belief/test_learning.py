"""Which push is repeated, and when, and what of the pushes goes into a belief.

Pushes and heights are made up: no mechanics gives them.
"""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.explore.belief.belief import Question
from pushfit.explore.belief.learning import (
    learnt,
    reference_due,
    reference_rows,
    weighed,
)
from pushfit.explore.belief.tables import noise_is_known, sd_of, table_of, told_rows
from pushfit.explore.limits import Limits
from pushfit.explore.records import Purpose, ToldPush
from tests.explore.beliefs import belief_of, prior_draws
from tests.explore.worlds import COMPONENTS, CONFIG
from tests.tolerances import EXACT

REFERENCE = Purpose.REFERENCE.value


def push(height, **changes):
    usual = {"theta": 0.5, "alpha": 1.5, "heights": {"height": height}, "sd": None}
    return ToldPush(**(usual | changes))


def question(**changes):
    usual = {"config": CONFIG, "ask": ("theta_c",), "channels": ("height",)}
    usual |= {"unit": "n", "sigma": None, "reference_alpha": np.pi / 2}
    return Question(**(usual | changes))


# None of them is a push of full length, of this exploration, whose height counts.
NONE_OF_ITS = (
    push(9.0, is_attached=True),
    push(9.0, length_share=0.5),
    push(9.0, flags="saturated"),
)


@pytest.mark.parametrize(
    ("first", "every", "expected"),
    [(4, 5, [5, 11, 17]), (4, 2, [3, 6, 9, 12, 15, 18]), (1, 9, [2, 12]), (4, 0, [])],
)
def test_a_push_is_repeated_early_and_then_every_so_many(first, every, expected):
    limits = Limits(reference_first=first, reference_every=every)
    told, repeated = list(NONE_OF_ITS), []
    for number in range(1, 19):
        due = reference_due(told, limits)
        if due is not None:
            repeated.append(number)
        told.append(push(1.0, purpose=None if due is None else REFERENCE))
        told += NONE_OF_ITS if number % 3 == 0 else ()
    assert repeated == expected


def test_repeated_is_the_strongest_push_but_not_the_last_before():
    """Of a pull the height is negative."""
    own = [push(1.0), push(-3.0), push(2.0), push(5.0)]
    assert reference_rows([*NONE_OF_ITS, *own]) == [own[1]]
    again = push(-2.9, purpose=REFERENCE)
    later = [push(8.0), push(7.0)]
    assert reference_rows([*own, again, *later]) == [own[1], again]
    twice = push(-2.8, purpose=REFERENCE)
    assert reference_rows([*own, again, *later, twice]) == [own[1], again, twice]
    assert reference_rows([own[0]]) == [own[0]]


def believed(n=64, **changes):
    draws = prior_draws(n, np.random.default_rng(1))
    return replace(belief_of(draws, sigma=0.3), **changes)


def test_a_height_that_is_no_evidence_weighs_no_draw():
    belief = believed()
    assert weighed(belief, push(9.0, flags="saturated"), question()) is belief
    changed = weighed(belief, push(9.0), question())
    assert np.ptp(changed.log_weights) > 0


def test_a_push_of_a_smaller_sd_tells_more():
    belief = believed()
    spread = [
        np.ptp(weighed(belief, push(1.0, sd={"height": sd}), question()).log_weights)
        for sd in (0.1, 0.2)
    ]
    # Squares of residuals, over those of the noise.
    np.testing.assert_allclose(spread[0], 4 * spread[1], rtol=EXACT)


@pytest.mark.parametrize("is_guess", [False, True])
def test_every_push_is_in_the_draws_or_in_their_weights(is_guess):
    """Short ones always by weights; all of them where draws are those of the priors."""
    told = [push(h) for h in (1.0, 1.1, 1.2, 1.3)]
    told[1] = replace(told[1], length_share=0.5)
    asked = []

    def source(table, question, seed):
        asked.append((None if table is None else table.n_pushes, seed))
        return believed(is_guess=is_guess)

    found = learnt(told, question(), n_drawn=3, source=source, seed=7)
    expected = believed()
    for row in told if is_guess else (told[1], told[3]):
        expected = weighed(expected, row, question())
    np.testing.assert_allclose(found.log_weights, expected.log_weights, rtol=EXACT)
    assert asked[0][0] == 2


def test_no_two_explorations_or_pushes_share_a_seed():
    seeds = []

    def source(table, question, seed):
        seeds.append(seed)
        return believed()

    told = [push(1.0)] * 4
    for seed in range(4):
        for n in range(5):
            learnt(told, question(), n_drawn=n, source=source, seed=seed)
    assert len(set(seeds)) == 20


def test_a_table_is_told_and_made_again():
    table = PeakTable.from_arrays(
        theta=np.array([0.2, 0.5]),
        alpha=np.array([1.0, 2.0]),
        heights={
            COMPONENTS[0]: np.array([1.0, 2.0]),
            COMPONENTS[1]: np.array([3.0, 4]),
        },
        sd={COMPONENTS[0]: np.array([0.1, 0.2]), COMPONENTS[1]: np.array([0.3, 0.4])},
        unit="n",
        flags=("saturated", ""),
    )
    rows = told_rows(table)
    assert [row.is_left_out for row in rows] == [True, False]
    again = table_of(rows, question(channels=COMPONENTS))
    assert again is not None
    assert again.frame.equals(table.frame)
    # With sds of one channel alone the noise of none is known.
    frame = table.frame.drop(columns="height_tangential_sd_n")
    assert all(row.sd is None for row in told_rows(PeakTable.from_frame(frame)))


def test_noise_is_known_where_every_whole_push_states_it():
    stated, bare = push(1.0, sd={"height": 0.1}), push(1.0)
    short = push(1.0, length_share=0.5)
    for told, is_known in (
        ([], False),
        ([stated, short], True),
        ([stated, bare], False),
        ([short], False),
    ):
        assert noise_is_known(told, question()) is is_known
        assert noise_is_known(told, question(sigma=0.1))
        table = table_of(told, question())
        assert (table is not None and table.sd("height") is not None) is is_known


@pytest.mark.parametrize(
    ("stated", "sigma", "expected"),
    [(0.1, None, 0.1), (0.1, 0.3, 0.3), (0.5, 0.3, 0.5), (None, 0.3, 0.3)],
)
def test_a_height_scatters_at_least_as_repeats_do(stated, sigma, expected):
    row = push(1.0, sd=None if stated is None else {"height": stated})
    found = sd_of(row, question(sigma=sigma))
    np.testing.assert_allclose(found, [expected], rtol=EXACT)
    assert sd_of(push(1.0), question()) is None
