"""How far an analysis is: by the usual times of its stages, never back."""

import pytest

from pushfit.config import config_of
from pushfit.fit.identify.progress import SECONDS, Stages, stages_of, usual_seconds
from tests.tolerances import EXACT

BOTH = {"push": {"length_mm": 5.0}, "parameters": {"L": {"fixed": 0.04}}}
LINEAR = {"grasp": {"mechanics": "linear"}}


@pytest.mark.parametrize("engine", ["auto", "sweep", "emcee"])
@pytest.mark.parametrize("config", [BOTH, LINEAR, {}])
def test_every_stage_has_a_time_and_comes_once(config, engine):
    names = stages_of(config_of(config), engine)
    assert set(names) <= set(SECONDS)
    assert len(set(names)) == len(names)
    assert names[-1] == "checks"


def test_a_stage_begins_when_those_before_it_are_over():
    """Shares are of seconds: 2 of 2 + 0.5, and half of the last half second more."""
    said = []
    names = ["least squares by linear mechanics", "checks"]
    first, last = (SECONDS[name][0] for name in names)
    stages = Stages(names, lambda stage, share: said.append((stage, share)))
    for name in names:
        stages.begin(name)
    stages.within("sampling", 0.5)
    whole = first + last
    assert said == [
        (names[0], 0.0),
        (names[1], pytest.approx(first / whole, rel=EXACT)),
        ("sampling", pytest.approx((first + last / 2) / whole, rel=EXACT)),
    ]


def test_other_mechanics_than_foreseen_shorten_what_is_left():
    names = [f"{n} by tilting mechanics" for n in ("least squares", "likelihood sets")]
    said = []
    stages = Stages(names, lambda stage, share: said.append(share))
    stages.begin(names[0])
    stages.begin("likelihood sets by linear mechanics")
    run = [names[0], "likelihood sets by linear mechanics"]
    share = SECONDS[names[0]][0] / usual_seconds(run)
    assert said == [0.0, pytest.approx(share, rel=EXACT)]


def test_what_was_not_foreseen_moves_no_bar_back():
    said = []
    names = ["least squares by linear mechanics", "checks", "next push"]
    stages = Stages(names, lambda stage, share: said.append(share))
    for name in ("next push", "emcee", "checks"):
        stages.begin(name)
    stages.within("checks", 1.0)
    assert said == sorted(said)
    assert said[-1] == 1.0


def test_compiling_takes_its_share():
    said = []
    names = ["posterior by linear mechanics", "report and figures"]
    for is_compiled in (True, False):
        told = Stages(
            names, lambda _, share: said.append(share), is_compiled=is_compiled
        )
        told.begin(names[1])
    assert said[0] < 0.5 < said[1]
