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
from tests.tolerances import EXACT

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
        ({"force": 0.0}, "force = 0.0: .*; give another value, or leave it out$"),
        ({"theta_step_deg": 0.0}, "must be greater than 0; give another value, or "),
        ({"rest_s": -1.0}, "rest_s = -1.0: .* leave it out for 0.5$"),
        ({"workspace_mm": ((-1, 1), (1, 4), (0, 5))}, r"\[1, 4\] along y: give"),
        ({"forces": 3.0}, r"did you mean force\?$"),
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
    # What is stated by an option is stated later.
    assert Limits.of(config, rest_s=0.9, force=3.0).rest_s == 0.9


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


def directions(limits, settings=CONFIG):
    """Elevations and azimuths of the candidates [deg], the limits' own azimuths."""
    azimuths = limits.azimuths(settings)
    found = limits.candidates(azimuths=azimuths, reference_alpha=0.0)
    # Whatever rounding makes of them, they are within reach.
    assert np.all(limits.reach(found, azimuths=azimuths))
    theta, alpha = np.degrees(found).T
    return np.unique(theta.round(9)), np.unique(alpha.round(9))


@pytest.mark.parametrize(
    ("stated", "theta", "alpha"),
    [
        # Both ends, also where steps round down to one fewer.
        (
            {"theta_deg": (0.0, 0.3), "theta_step_deg": 0.1, "alpha_deg": (0.0, 0.0)},
            [0.0, 0.1, 0.2, 0.3],
            [0.0],
        ),
        (
            {"theta_deg": (7.0, 23.0), "alpha_deg": (-30.0, 60.0)},
            [7.0, 12.0, 17.0, 22.0],
            [-30.0, 0.0, 30.0, 60.0],
        ),
        ({"theta_deg": (7.0, 7.0), "alpha_deg": (80.0, 90.0)}, [7.0], [80.0, 90.0]),
        # 0° and 180° are one axis; a whole turn has each of them once.
        (
            {"theta_deg": (7.0, 7.0), "alpha_deg": (0.0, 180.0)},
            [7.0],
            [0.0, 30.0, 60.0, 90.0, 120.0, 150.0],
        ),
        (
            {"theta_deg": (7.0, 7.0), "alpha_deg": (-90.0, 270.0)},
            [7.0],
            [-90.0, -60.0, -30.0, 0.0, 30.0, 60.0],
        ),
    ],
)
def test_candidates_are_every_direction_once(stated, theta, alpha):
    steps = {"theta_step_deg": 5.0, "alpha_step_deg": 30.0}
    found = directions(Limits(**(steps | stated)))
    np.testing.assert_allclose(found[0], theta, rtol=EXACT)
    np.testing.assert_allclose(found[1], alpha, rtol=EXACT)


@pytest.mark.parametrize(
    ("alpha_deg", "stated", "expected"),
    [
        (None, None, 90.0),
        (None, 20.0, 20.0),
        ((0.0, 60.0), None, 30.0),
        ((80.0, 360.0), None, 90.0),
    ],
)
def test_before_a_push_theta_c_is_asked_across_the_supports(
    alpha_deg, stated, expected
):
    """Or as near to it as the middle of a reach that they are not in."""
    settings = CONFIG.with_keys("grasp", reference_alpha_deg=stated)
    found = Limits(alpha_deg=alpha_deg).first_azimuth(settings)
    np.testing.assert_allclose(np.degrees(found), expected, rtol=EXACT)
    from_file = CONFIG.with_keys("reach", alpha_deg=(0.0, 40.0))
    np.testing.assert_allclose(Limits().first_azimuth(from_file), np.pi / 9, rtol=EXACT)


def test_an_azimuth_is_reached_a_turn_further():
    turns = 2 * np.pi * np.array([-1, 0, 1])
    azimuths = float(np.radians(-30.0)), float(np.radians(40.0))
    for alpha_deg, is_reached in ((-30.0, True), (40.0, True), (41.0, False)):
        pushes = np.stack([np.full(3, 0.5), np.radians(alpha_deg) + turns], axis=1)
        assert np.all(Limits().reach(pushes, azimuths=azimuths) == is_reached)


def test_a_box_has_two_sides():
    limits = Limits(workspace_mm=((-2.0, 2.0), (-1.0, 3.0), (0.0, 4.5)))
    across = np.array([[0.5, np.pi / 2], [0.5, -np.pi / 2]])
    # 5 mm cos 0.5 = 4.4 mm, and half of that.
    assert list(limits.holds(across, length=0.0025)) == [True, False]
    assert not np.any(limits.holds(across, length=0.005))
