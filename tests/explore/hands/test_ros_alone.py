"""What nodes do without a master, and a hand between pushes: without ROS, too."""

import socket
import time
from types import SimpleNamespace

import pytest

from pushfit.errors import DataError
from pushfit.explore.hands.ros import hand, messages
from tests.tolerances import EXACT

# Connecting and hearing nothing, each for a second; and a busy machine [s].
AT_ONCE = 5 * messages.PATIENCE


def never(*arguments, **options):
    """As ROS does: it would wait here for ever."""
    pytest.fail("the node was begun without a master")


@pytest.mark.parametrize("is_mute", [False, True])
def test_a_node_does_not_wait_for_a_master(monkeypatch, is_mute):
    """One that is not there, and a program that listens but says nothing."""
    with socket.socket() as port:
        port.bind(("127.0.0.1", 0))
        if is_mute:
            port.listen()
        uri = f"http://127.0.0.1:{port.getsockname()[1]}/"
        fake = SimpleNamespace(
            rosgraph=SimpleNamespace(get_master_uri=lambda: uri),
            rospy=SimpleNamespace(init_node=never),
        )
        monkeypatch.setattr(messages, "ros", lambda: fake)
        begun = time.monotonic()
        with pytest.raises(DataError, match="no ROS master answers at") as caught:
            messages.begin("pushfit_algorithm")
    assert caught.value.code == "no_master"
    assert uri in str(caught.value)
    assert time.monotonic() - begun < AT_ONCE


class Clock:
    """A clock that goes on while somebody sleeps."""

    def __init__(self):
        self.now, self.sleeps = 100.0, []

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.sleeps.append(seconds)
        self.now += seconds


@pytest.mark.parametrize(("thought", "slept"), [(0.0, 0.5), (0.3, 0.2), (2.0, 0.0)])
def test_time_to_think_is_rest(monkeypatch, thought, slept):
    """The finger stays for what is left, and never goes before it has rested."""
    clock = Clock()
    monkeypatch.setattr(hand, "time", clock)
    finger = object.__new__(hand.RosHand)
    finger._call = lambda answers: answers.put(SimpleNamespace(success=True))
    finger.retract()
    for _ in range(2):
        clock.now += thought
        finger.rest(0.5)
    assert clock.sleeps == pytest.approx([slept, slept], rel=EXACT)
