"""Pushes that keep the contact and pushes that lose it, by their readings alone."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.simulate import Session, simulate_recording
from pushfit.explore.hands.protocol import PushOutcome, PushStatus
from pushfit.explore.hands.touch import is_lost, is_unfelt
from tests.explore.beliefs import PLAIN
from tests.explore.worlds import TRUTH
from tests.problems import BIOTAC

SESSIONS = {
    "there and back": Session(noise=0.01),
    "half a sine": Session(shape="sine", noise=0.01),
    "held": Session(shape="plateau", noise=0.01),
    "with a preload and counts": Session(level=2.0, noise=0.01, quantum=0.02),
    "components": Session(forces=True, level=1.0, noise=0.01),
    "few samples": Session(rate=25.0, noise=0.01),
    "noise of a tenth": Session(noise=0.1),
    "losing counts on release": replace(BIOTAC, limit=None, level=10.0, noise=0.01),
}
# Where the contact is lost, as a share of the push: forth, far out, on the way back.
LOST_AT = (0.4, 0.5, 0.65)


def pushed(session, *, theta_deg=60.0, seed=0):
    """One push and how it ended."""
    plan = PushSchedule.planned(np.radians([theta_deg]), np.pi / 2, repeats=1)
    rng = np.random.default_rng(seed)
    found = simulate_recording(TRUTH, PLAIN, plan, session=session, rng=rng)
    start = float(found.t_start[0])
    return found.recording, PushOutcome(
        status=PushStatus.DONE,
        reached=np.zeros(3),
        t_start=start,
        t_end=start + session.duration,
    )


def cut(recording, outcome, *, at, until=np.inf):
    """Nothing to be felt from a share of the push on: not even the preload."""
    time, length = recording.time, outcome.t_end - outcome.t_start
    gone = time > outcome.t_start + at * length
    gone &= time < outcome.t_start + until * length
    channels = {k: np.where(gone, 0.0, v) for k, v in recording.channels.items()}
    return replace(recording, channels=channels)


@pytest.mark.parametrize("name", SESSIONS)
def test_a_contact_that_is_kept_is_not_called_lost(name):
    for seed, theta in enumerate([5.0, 30.0, 60.0, 85.0] * 2):
        recording, outcome = pushed(SESSIONS[name], theta_deg=theta, seed=seed)
        assert not is_lost(recording, outcome)


@pytest.mark.parametrize("name", SESSIONS)
@pytest.mark.parametrize("at", LOST_AT)
def test_a_contact_that_is_lost_is_called_so(name, at):
    recording, outcome = pushed(SESSIONS[name])
    assert is_lost(cut(recording, outcome, at=at), outcome)


def test_a_loose_cable_is_no_lost_contact():
    recording, outcome = pushed(SESSIONS["there and back"])
    assert not is_lost(cut(recording, outcome, at=0.4, until=0.5), outcome)


def test_a_push_is_unfelt_where_a_quarter_of_the_least_is_missing():
    """The height is K_n S_p for a push along the normal; A = 571 N/m, S_p = 5 mm."""
    recording, outcome = pushed(Session(noise=0.01), theta_deg=90.0)
    height = 571.4 * 5e-3
    # The tenth of a push around its end has 0.95 of its height, going and coming.
    assert is_unfelt(recording, outcome, least=4.2 * height)
    assert not is_unfelt(recording, outcome, least=3.6 * height)
