"""Heights that are of no grasp, though no draws are there to say so."""

import numpy as np
import pytest

from pushfit.config import parse_config
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.explorer import Explorer
from pushfit.explore.records import Answer
from tests.fit.tables import HARD, TOML


def guess(table, question, seed, **_):
    """What an engine leaves that has no draws of these heights."""
    return believe(None, question, seed)


@pytest.mark.parametrize(("sign", "is_stopped"), [(-1.0, True), (1.0, False)])
def test_heights_without_a_grasp_end_an_exploration_without_draws(sign, is_stopped):
    """Else an inverted sensor has all pushes made, without a word."""
    own = Explorer(
        parse_config(TOML + HARD, path="grasp.toml"), sigma=0.05, source=guess
    )
    for theta, height in ((60.0, 1.3), (40.0, 1.0)):
        own.tell(np.radians(theta), np.radians(90.0), sign * height)
    assert (own.state.answer is Answer.STOPPED) is is_stopped
    assert ("no grasp gives all of these heights" in own.state.sentence) is is_stopped
