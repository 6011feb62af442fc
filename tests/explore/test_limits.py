"""No command ever leaves reach, workspace, rest or force limits."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pushfit.config import parse_config
from pushfit.config.explore import ExploreSection
from pushfit.config.inputs import PeakSettings
from pushfit.errors import ConfigError
from pushfit.explore.belief.predict import predict
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits, tip_displacement
from pushfit.explore.loop import explore
from tests.explore.test_loop import hand
from tests.explore.worlds import COMPONENTS, CONFIG, SIGMA, feel, importance

# What sums and products of floats may add to a limit [deg], [mm], [s]; relative, to a
# length.
ROUNDED, LONGER = 1e-6, 1e-9
# One percent of the draws may exceed a force; the one at that quantile has its weight.
BEYOND = 0.011
angles = st.integers(0, 8).map(lambda k: 10.0 * k)


@pytest.mark.parametrize("alpha_deg", [(180.0, 0.0), (0.0, 400.0)])
def test_azimuths_are_a_range_as_elevations_are(alpha_deg):
    with pytest.raises(ConfigError, match="no range of azimuths"):
        Limits(alpha_deg=alpha_deg)


@st.composite
def limits(draw):
    low, high = sorted((draw(angles), draw(angles)))
    box = None
    if draw(st.booleans()):
        side, depth = draw(st.floats(0.5, 6.0)), draw(st.floats(0.5, 6.0))
        box = ((-side, side), (-side, side), (0.0, depth))
    return Limits(
        theta_deg=(low + 5.0, high + 5.0),
        force=draw(st.none() | st.floats(0.2, 5.0)),
        workspace_mm=box,
        reference_every=draw(st.integers(0, 3)),
    )


@pytest.mark.slow
@settings(max_examples=15, suppress_health_check=[HealthCheck.too_slow])
@given(limits=limits())
def test_no_suggestion_leaves_the_limits(limits):
    own = Explorer(
        CONFIG,
        budget=4,
        sigma=SIGMA,
        channels=COMPONENTS,
        source=importance,
        limits=limits,
    )
    while pushes := own.ask(20):
        belief = own.belief
        for push in pushes:
            assert limits.theta_deg[0] - ROUNDED <= push.theta_deg
            assert push.theta_deg <= limits.theta_deg[1] + ROUNDED
            tip = 1e3 * tip_displacement(
                push.theta, push.alpha, 0.005 * push.length_share
            )
            for x, (low, high) in zip(tip, limits.workspace_mm or (), strict=False):
                assert low - ROUNDED <= x <= high + ROUNDED
            if limits.force is not None:
                found = predict(
                    belief,
                    np.array([push.theta]),
                    np.array([push.alpha]),
                    length_share=push.length_share,
                )
                beyond = (found.force[0] > limits.force) @ belief.weights
                assert beyond <= BEYOND
        first = pushes[0]
        own.tell(first.theta, first.alpha, feel(first, len(own.history.told)))


class Watched:
    """A hand that writes down what it is told to do, and when."""

    def __init__(self, inner):
        self.inner, self.commands = inner, []

    def push(self, displacement, *, max_force):
        self.commands.append(("push", self.inner.clock, displacement, max_force))
        return self.inner.push(displacement, max_force=max_force)

    def retract(self):
        self.commands.append(("retract", self.inner.clock, None, None))
        self.inner.retract()

    def stop(self):
        self.inner.stop()

    def rest(self, seconds):
        self.inner.rest(seconds)

    def samples(self, since):
        return self.inner.samples(since)

    def reach(self):
        return self.inner.reach()


def test_every_push_is_preceded_by_a_rest_and_followed_by_a_retraction():
    own = Explorer(
        CONFIG,
        budget=4,
        sigma=SIGMA,
        channels=COMPONENTS,
        source=importance,
        limits=Limits(rest_s=0.7, force=4.0),
    )
    watched = Watched(hand({2: "stall"}))
    explore(own, watched, settings=PeakSettings(normal="fz"))
    names = [name for name, *_ in watched.commands]
    pushes = [i for i, name in enumerate(names) if name == "push"]
    assert len(pushes) == 5
    for i in pushes:
        assert names[i + 1] == "retract"
        before = watched.commands[i - 1]
        assert watched.commands[i][1] - before[1] >= 0.7 - ROUNDED
        assert watched.commands[i][3] == 4.0
        assert np.linalg.norm(watched.commands[i][2]) <= 0.005 * (1 + LONGER)


@pytest.mark.parametrize(
    ("wrong", "advice"),
    [
        ({"theta_deg": (50.0, 10.0)}, r"give \[low, high\] with -90 <= low"),
        ({"force": 0.0}, "leave it out"),
        ({"theta_step_deg": 0.0}, "theta_step_deg = 0.0: must be greater than 0; mend"),
        ({"rest_s": -1.0}, "rest_s = -1.0: must be greater than 0; mend it"),
        ({"workspace_mm": ((-1, 1), (1, 4), (0, 5))}, r"\[1, 4\] along y: give"),
        ({"forces": 3.0}, "did you mean force"),
    ],
)
def test_limits_that_mean_nothing_are_refused(wrong, advice):
    with pytest.raises(ConfigError, match=f"limits.*{advice}"):
        Limits(**wrong)


def test_every_limit_can_be_stated_in_the_file_or_asked_for():
    asked = {"force"}  # --max-force
    elsewhere = {"theta_deg", "alpha_deg"}  # [reach]
    assert set(Limits.model_fields) == asked | elsewhere | set(
        ExploreSection.model_fields
    )


def test_limits_of_the_file_hold_where_no_others_are_given():
    text = "[push]\nlength_mm = 5.0\n[explore]\nrest_s = 0.7\nmax_pushes = 7\n"
    text += "workspace_mm = [[-1, 1], [-4, 4], [0, 5]]\n[reach]\ntheta_deg = [-9, 60]\n"
    config = parse_config(text, path="grasp.toml")
    found = Explorer(config, source=importance).limits
    box = ((-1.0, 1.0), (-4.0, 4.0), (0.0, 5.0))
    assert found == Limits(
        rest_s=0.7, max_pushes=7, workspace_mm=box, theta_deg=(-9.0, 60.0)
    )
    assert Explorer(config, source=importance, limits=Limits()).limits == Limits()


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("rest_s = 0", "explore.rest_s = 0"),
        ("max_failures = 0", "explore.max_failures = 0"),
        ("reference_every = -1", "explore.reference_every = -1"),
        ("stall_share = 1.5", "explore.stall_share = 1.5"),
        ("workspace_mm = [[-1, 1], [1, 4], [0, 5]]", r"\[1, 4\] along y: give"),
        ("workspace_mm = [[-1, 1], [0, 0], [0, 5]]", r"\[0, 0\] along y: give"),
    ],
)
def test_limits_in_the_file_that_mean_nothing_are_refused(line, says):
    with pytest.raises(ConfigError, match=says):
        parse_config(f"[explore]\n{line}\n", path="grasp.toml")


@pytest.mark.parametrize(
    ("theta_deg", "alpha_deg", "is_allowed"),
    [
        (60.0, 90.0, True),
        (60.0, 0.0, False),  # x = 2.5 mm
        (60.0, 270.0, False),  # not across the supports from below
        (90.0, 90.0, False),  # z = 5 mm
        (4.0, 90.0, False),  # below the lowest elevation
    ],
)
def test_pushes_stay_in_the_box_and_within_reach(theta_deg, alpha_deg, is_allowed):
    limits = Limits(workspace_mm=((-2.0, 2.0), (-3.0, 3.0), (0.0, 4.5)))
    theta, alpha = np.radians([theta_deg, alpha_deg])
    found = limits.allow(theta, alpha, length=0.005, azimuths=(0.0, np.pi))
    assert found is is_allowed
