"""From pushes told to a belief, and when the first push is due again.

Excluded: where draws come from (`pushfit.explore.belief.from_fit`).
"""

from collections.abc import Sequence

import numpy as np

from pushfit.explore.belief.belief import Belief, BeliefSource, Question
from pushfit.explore.belief.predict import predict
from pushfit.explore.belief.tables import sd_of, table_of
from pushfit.explore.limits import Limits
from pushfit.explore.records import Purpose, ToldPush

# Draws after n pushes have a seed of their own, whatever the seed of the exploration.
SEEDS = 1_000_003


def learnt(
    told: Sequence[ToldPush],
    question: Question,
    *,
    n_drawn: int,
    source: BeliefSource,
    seed: int,
) -> Belief:
    """Fresh draws from the first pushes, weighed by the others.

    Short pushes are in no table: they always come by weights, and all of them where
    draws are those of the priors.
    """
    first, rest = told[:n_drawn], told[n_drawn:]
    belief = source(table_of(first, question), question, SEEDS * seed + n_drawn)
    by_weights = [row for row in first if row.is_short or belief.is_guess]
    for row in [*by_weights, *rest]:
        belief = weighed(belief, row, question)
    return belief


def weighed(belief: Belief, row: ToldPush, question: Question) -> Belief:
    """The belief after one more push; flagged heights are no evidence."""
    if row.is_left_out:
        return belief
    found = predict(
        belief,
        np.array([row.theta]),
        np.array([row.alpha]),
        length_share=row.length_share,
    )
    heights = np.array([row.heights[channel] for channel in question.channels])
    return belief.updated(heights, found.heights[0], sd_of(row, question))


def reference_due(told: Sequence[ToldPush], limits: Limits) -> ToldPush | None:
    """The push to repeat, if it is time to see whether the object has moved."""
    own = _own(told)
    since = 0
    for row in reversed(own):
        if row.purpose == Purpose.REFERENCE.value:
            break
        since += 1
    every = limits.reference_every
    # An object that slips most often does so when it is pushed for the first times.
    due = every if since < len(own) else min(every, limits.reference_first)
    return reference_rows(told)[0] if every and since >= due else None


def reference_rows(told: Sequence[ToldPush]) -> list[ToldPush]:
    """The push that others are held against, and its repetitions so far.

    It is the strongest of those before the first repetition, as that shows most of a
    change, but not the one just before, since which nothing can have happened.

    Args:
        told: Pushes in order, at least one of them of full length, its own, and
            without a flag that leaves it out.
    """
    own = _own(told)
    again = [row for row in own if row.purpose == Purpose.REFERENCE.value]
    before = own[: own.index(again[0])] if again else own
    strongest = max(
        before[:-1] or before, key=lambda row: max(map(abs, row.heights.values()))
    )
    return [strongest, *again]


def _own(told: Sequence[ToldPush]) -> list[ToldPush]:
    """Pushes of this exploration of full length whose heights count."""
    return [row for row in told if row.counts and not row.is_attached]
