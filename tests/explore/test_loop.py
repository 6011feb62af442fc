"""Whole explorations by the simulated hand, with everything that can go wrong."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pushfit.config import parse_config
from pushfit.config.inputs import PeakSettings
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.simulate import Session, simulate_recording
from pushfit.explore.explorer import Explorer
from pushfit.explore.hands import simulated
from pushfit.explore.hands.protocol import PushStatus, Reach
from pushfit.explore.hands.simulated import SimulatedHand, World
from pushfit.explore.hands.touch import FINAL, NOTHING_FELT
from pushfit.explore.journal.events import INTERRUPTED
from pushfit.explore.limits import Limits
from pushfit.explore.loop import explore
from pushfit.explore.records import Answer
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp
from tests.explore.beliefs import PLAIN
from tests.explore.faulty import FaultyHand
from tests.explore.worlds import COMPONENTS, CONFIG, THETA_C, TRUTH, importance
from tests.tolerances import EXACT

pytestmark = pytest.mark.repeated

# Three standard errors of the sd of a thousand uniform numbers.
SPREAD = 0.045
# Four digits of the stiffness by which a reach becomes a force.
DIGITS = 1e-3

FORCES = PeakSettings(normal="fz")
SESSION = Session(
    rise=0.5,
    rest=0.6,
    drift=0.002,
    noise=0.01,
    level=2.0,
    quantum=0.005,
    forces=True,
    unit="n",
)
# Of the mean of 8192 draws from 32768 weighed ones, some hundreds of them effective;
# pushes of a softer object move it by more than 5° [deg].
MONTE_CARLO = 2.0
REACH = Reach(theta_deg=(0.0, 90.0), alpha_deg=(0.0, 180.0))


def hand(faults=None, *, session=SESSION, seed=1, scatter=0.02, grasp=PLAIN, delay=0.0):
    world = World(
        params=TRUTH, grasp=grasp, session=session, reach=REACH, scatter=scatter
    )
    return FaultyHand(world, seed=seed, faults=faults or {}, delay=delay)


def explorer(**changes):
    usual = {
        "width_deg": 9.0,
        "budget": 30,
        "sigma": 0.05,
        "channels": COMPONENTS,
        "source": importance,
        "limits": Limits(reference_every=0),
    }
    return Explorer(CONFIG, **(usual | changes))


def reasons(own):
    return [failure.reason for failure in own.history.failures]


def test_a_hand_explores_to_the_end():
    """Drift, counts, joints within half a degree, and the real peak extraction."""
    own, finger = explorer(), hand()
    state = explore(own, finger, settings=FORCES)
    assert state.answer is Answer.DECIDED
    low, high = state.intervals["theta_c"]
    assert low < THETA_C < high
    assert reasons(own) == []
    # Directions are those reached: whole degrees of the joints.
    np.testing.assert_allclose(np.degrees(own.table.theta) % 1.0, 0.0, atol=EXACT)


# Heights of two sensors: each is good to a few of its own samples [N].
SENSORS_DIFFER = 5 * SESSION.noise


@pytest.mark.parametrize("normal", ["-fz", "fx", "-fy"])
def test_a_hand_has_the_sensor_of_its_settings(normal):
    """The same pushes, felt by a sensor that is mounted another way."""
    tables = []
    for name in ("fz", normal):
        own, finger = explorer(budget=1), hand(session=replace(SESSION, normal=name))
        explore(own, finger, settings=PeakSettings(normal=name))
        assert reasons(own) == []
        tables.append(own.table)
    for channel in COMPONENTS:
        heights = [table.heights(channel) for table in tables]
        np.testing.assert_allclose(*heights, rtol=0, atol=SENSORS_DIFFER)


def test_settings_say_how_far_joints_miss():
    plan = PushSchedule.planned(np.full(1000, 0.5), np.pi / 2, repeats=1)
    made = simulate_recording(
        TRUTH, PLAIN, plan, session=simulated.SESSION, rng=np.random.default_rng(0)
    )
    missed = np.degrees([made.theta - plan.theta, made.alpha - plan.alpha])
    stated = simulated.joints_stated(CONFIG).noise
    assert stated.theta_sd_deg == pytest.approx(np.std(missed[0]), rel=SPREAD)
    assert stated.alpha_sd_deg == pytest.approx(np.std(missed[1]), rel=SPREAD)
    own = parse_config("[noise]\ntheta_sd_deg = 0.0\n", path="grasp.toml")
    assert simulated.joints_stated(own).noise.theta_sd_deg == 0.0


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("dropout", "dropout"),
        ("silent", "dropout"),
        ("frozen", "frozen"),
        ("stall", "stalled"),
        ("clock_jump", "clock_jump"),
        ("clock_back", "clock_jump"),
        ("object_lost", "object_lost"),
    ],
)
def test_a_fault_is_a_named_row_and_no_height(tmp_path, fault, reason):
    path = tmp_path / "run.jsonl"
    own, finger = explorer(journal=path, budget=2), hand({2: fault})
    explore(own, finger, settings=FORCES)
    events = [json.loads(line) for line in path.read_text().splitlines()]
    failed = [e for e in events if e["event"] == "failed"]
    assert failed[0]["reason"] == reason
    assert failed[0]["number"] == 2
    # What was told after the fault is told of other pushes: no height was invented.
    assert all(e["number"] != 2 for e in events if e["event"] == "told")
    assert not finger.is_extended


@pytest.mark.parametrize("fault", ["object_lost", "object_gone"])
@pytest.mark.parametrize("level", [0.0, 2.0])
def test_a_lost_object_ends_the_exploration(fault, level):
    """In the middle of the third push or before it, with a preload or none."""
    own = explorer()
    finger = hand({3: fault}, session=replace(SESSION, level=level))
    state = explore(own, finger, settings=FORCES)
    assert state.answer is Answer.STOPPED
    assert state.sentence.startswith("object_lost: the finger lost the object at push")
    assert "begin another exploration" in state.sentence
    # Once nothing is felt where something should be; the second time it is gone.
    once = ["nothing_felt"] if fault == "object_gone" else []
    assert reasons(own) == [*once, "object_lost"]
    assert own.table.n_pushes == 2
    assert not finger.is_extended


def test_every_word_of_a_hand_is_explained():
    page = (Path(__file__).parents[2] / "docs" / "exploration.md").read_text()
    faults = {status.value for status in PushStatus} - {"done"}
    for word in faults | {NOTHING_FELT, INTERRUPTED, "not_at_rest"} | FINAL:
        assert f"`{word}`" in page


@pytest.mark.parametrize("fault", ["duplicate", "late"])
def test_messages_twice_or_late_change_no_height(fault):
    """Sorted by their stamps and each taken once, they are the same samples."""
    plain, odd = explorer(budget=1), explorer(budget=1)
    explore(plain, hand(), settings=FORCES)
    explore(odd, hand({1: fault}), settings=FORCES)
    for channel in COMPONENTS:
        np.testing.assert_allclose(
            odd.table.heights(channel), plain.table.heights(channel), rtol=EXACT
        )


def test_a_sensor_that_lags_behind_the_motion_feels_the_same():
    """A tenth of a second late; other samples of the rests are its baseline."""
    plain, late = explorer(budget=2), explorer(budget=2)
    explore(plain, hand(), settings=FORCES)
    explore(late, hand(delay=0.1), settings=FORCES)
    assert reasons(late) == []
    for channel in COMPONENTS:
        np.testing.assert_allclose(
            late.table.heights(channel),
            plain.table.heights(channel),
            atol=SESSION.noise,
        )


def test_what_settings_leave_open_follows_from_the_exploration():
    """The normal force from the channels, and signs from a reach below the surface."""
    limits = Limits(reference_every=0, theta_deg=(-40.0, 60.0))
    stated, left_open = explorer(budget=1), explorer(budget=1, limits=limits)
    explore(stated, hand(), settings=FORCES)
    explore(left_open, hand(), settings=PeakSettings())
    for own in (stated, left_open):
        assert own.table is not None
        assert own.table.n_pushes == 1


@pytest.mark.slow
def test_a_hand_that_tilts_explores_to_its_own_angle():
    """Pushed and believed by tilting mechanics, of a lever that is stated.

    The angles by both mechanics are 3° apart, so that 4° tell them from each other.
    """
    text = "[push]\nlength_mm = 5.0\n[parameters.L]\nfixed = 0.04\n"
    config = parse_config(text, path="grasp.toml")
    grasp = Grasp(push_length=0.005, mechanics="tilting")
    theta_c = float(np.degrees(critical_angle(TRUTH, grasp, np.pi / 2)))
    own = Explorer(config, width_deg=4.0, budget=40, sigma=0.05, channels=COMPONENTS)
    state = explore(own, hand(grasp=grasp), settings=FORCES)
    assert own.belief.grasp.mechanics == "tilting"
    assert state.answer is Answer.DECIDED
    low, high = state.intervals["theta_c"]
    assert low < theta_c < high
    assert not low < THETA_C < high


@pytest.mark.parametrize(
    ("slips_at", "last_good"),
    [
        # The strongest of the first four was the second: the first reference differs.
        (3, 2),
        # The first reference is push 5 and agrees; that after ten more does not.
        (7, 5),
    ],
)
def test_after_a_slip_nothing_is_mixed(tmp_path, slips_at, last_good):
    """Left out is what another object may have felt, and no more."""
    path = tmp_path / "run.jsonl"
    usual = {"width_deg": 1.0, "limits": Limits(reference_every=5), "journal": path}
    own = explorer(**usual)
    state = explore(own, hand({slips_at: "slip"}), settings=FORCES)
    assert state.answer is Answer.STOPPED
    assert "the object has moved" in state.sentence
    assert f"pushes from {last_good + 1} on are left out" in state.sentence
    is_used = np.arange(own.table.n_pushes) < last_good
    np.testing.assert_array_equal(own.table.is_used, is_used)
    assert all("moved" in words for words in own.table.flags[last_good:])
    # What is believed rests on the pushes that are used, and is read again so.
    again = explorer(**usual)
    assert again.table.flags == own.table.flags
    assert again.state == state
    good = explorer(width_deg=1.0)
    for row in own.history.told[:last_good]:
        good.tell(row.theta, row.alpha, row.heights, sd=row.sd)
    np.testing.assert_allclose(
        np.average(own.belief.samples["theta_c"], weights=own.belief.weights),
        np.average(good.belief.samples["theta_c"], weights=good.belief.weights),
        atol=MONTE_CARLO,
    )


def test_the_position_node_aborts_at_the_force_limit():
    """A limit that belief thinks safe and the world does not."""
    own = explorer(limits=Limits(reference_every=0))
    finger = hand()
    outcome = finger.push(np.array([0.0, 0.0, 0.005]), max_force=1.0)
    assert outcome.status.value == "force_abort"
    np.testing.assert_allclose(
        np.linalg.norm(outcome.reached) * 571.4, 1.0, rtol=DIGITS
    )
    assert own.state.answer is Answer.DECIDING


def test_a_saturated_push_is_never_made_again():
    own, finger = explorer(budget=4), hand(session=SESSION_SHORT)
    explore(own, finger, settings=FORCES)
    assert "saturated" in reasons(own)
    assert all(f.is_final for f in own.history.failures if f.reason == "saturated")


SESSION_SHORT = Session(
    rise=0.5, rest=0.6, noise=0.01, level=2.0, limit=3.2, forces=True, unit="n"
)


def test_a_hand_that_passes_by_pushes_is_where_it_would_be():
    """Its clock and its noise, to the last bit."""
    own = explorer(budget=4)
    whole, later = hand({2: "stall"}), hand({2: "stall"})
    explore(own, whole, settings=FORCES)
    assert own.history.n_made == whole.n_pushes == 5
    later.pass_by(own.history.n_made, rest=own.limits.rest_s)
    assert later.clock == whole.clock
    after = [(finger, finger.clock) for finger in (whole, later)]
    for finger, _ in after:
        finger.rest(0.5)
        finger.push(np.array([0.0, 3e-3, 4e-3]), max_force=None)
    felt = [finger.samples(since) for finger, since in after]
    np.testing.assert_array_equal(felt[0].time, felt[1].time)
    np.testing.assert_array_equal(felt[0].channels["fz"], felt[1].channels["fz"])


def test_a_stopped_exploration_goes_on_by_the_same_call():
    own = explorer(budget=3, limits=Limits(max_failures=2))
    finger = hand({1: "stall", 2: "stall"})
    assert explore(own, finger, settings=FORCES).answer is Answer.STOPPED
    state = explore(own, finger, settings=FORCES)
    assert state.answer is Answer.OUT_OF_BUDGET
    assert own.table.n_pushes == 3


class Broken(SimulatedHand):
    """A driver that dies in the middle of a push."""

    def push(self, displacement, *, max_force):
        self.is_extended = True
        raise ConnectionError("the controller does not answer")


class Stuck(SimulatedHand):
    """A driver that misses the first order to retract after a push."""

    is_missed = False

    def retract(self):
        if self.is_extended and not self.is_missed:
            self.is_missed = True
            raise ConnectionError("the controller does not answer")
        super().retract()


def test_a_finger_left_on_the_object_is_taken_back_at_the_end():
    finger = Stuck(hand().world, seed=1)
    with pytest.raises(ConnectionError):
        explore(explorer(), finger, settings=FORCES)
    assert finger.is_missed
    assert not finger.is_extended


def test_the_finger_is_taken_back_when_the_driver_dies(tmp_path, monkeypatch):
    path, calls = tmp_path / "run.jsonl", []
    own = explorer(journal=path)
    finger = Broken(hand().world, seed=1)
    retract = finger.retract
    monkeypatch.setattr(finger, "stop", lambda: calls.append("stop"))
    monkeypatch.setattr(finger, "retract", lambda: calls.append("back") or retract())
    with pytest.raises(ConnectionError):
        explore(own, finger, settings=FORCES)
    # Before the first push, after it, and once it has been stopped.
    assert calls == ["back", "back", "stop", "back"]
    assert not finger.is_extended
    again = explorer(journal=path)
    assert again.is_dangling
    explore(again, hand(), settings=FORCES)
    assert reasons(again)[0] == "interrupted"
    assert again.state.answer is Answer.DECIDED
