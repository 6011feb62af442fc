"""Which pushes are allowed, against the forces and places of each draw."""

from dataclasses import replace

import numpy as np

from pushfit.explore.decide.next_push import Surveyor
from pushfit.explore.limits import Limits
from pushfit.model import Grasp
from tests.explore.beliefs import belief_of, prior_draws
from tests.explore.explorers import explorer

N = 4096
PRELOAD, LENGTH = 2.0, 0.005  # [N], [m]


def surveyed(limits, *, grasp):
    draws = prior_draws(N, np.random.default_rng(1))
    belief = replace(belief_of(draws), grasp=grasp)
    question = explorer(ask="theta_c", channels=("height",)).question
    own = Surveyor(question, limits).survey(belief, undecided=("theta_c",))
    return draws, own


def test_no_pull_is_asked_for_that_may_lift_the_finger_off():
    """K_sn and K_dn in series hold it on, as long as they pull by less than preload."""
    limits = Limits(theta_deg=(-60.0, 30.0))
    grasp = Grasp(push_length=LENGTH, preload=PRELOAD)
    draws, own = surveyed(limits, grasp=grasp)
    stiffness = 1 / (1 / draws["K_sn"] + 1 / draws["K_dn"])
    pull = -LENGTH * np.sin(own.theta)[:, None] * stiffness
    share = np.mean(pull > PRELOAD, axis=1)
    np.testing.assert_array_equal(own.is_allowed, share <= 0.01)
    assert 0 < np.sum(own.is_allowed[own.theta < 0]) < np.sum(own.theta < 0)
    assert own.refusals == {"might lift the finger off": np.sum(share > 0.01)}
    assert np.all(own.gains[~own.is_allowed] == 0)


def test_in_a_low_box_the_longest_push_that_stays_inside_is_asked_for():
    """At 60° and above a tenth of 5 mm ends below 1 mm, and a quarter above."""
    box = ((-9.0, 9.0), (-9.0, 9.0), (0.0, 1.0))
    limits = Limits(theta_deg=(60.0, 85.0), workspace_mm=box)
    _, own = surveyed(limits, grasp=Grasp(push_length=LENGTH))
    assert own.length_share == 0.1
    assert np.all(own.is_allowed)
