"""The three nodes for real, against a simulated robot, and killed in mid-push."""

import json
import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import DEBIAN, HOW

ROSMASTER = Path("/usr/bin/rosmaster")
ROOT = Path(__file__).parents[2]
TRUTH = """\
[push]
length_mm = 5.0
[parameters]
K_sn = { fixed = 800.0 }
K_dn = { fixed = 2000.0 }
K_st = { fixed = 400.0 }
C_rr = { fixed = 0.3 }
C_d = { fixed = 0.5 }
L = { fixed = 0.04 }
"""
# Where the finger rests after a push: a tenth of a millimetre, of five [m].
RETRACTED = 1e-4

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (ROSMASTER.exists() and (DEBIAN / "rospy").is_dir()),
        reason=f"ROS 1 is not installed; {HOW}",
    ),
]


def answers(port):
    """Whether somebody listens there."""
    with socket.socket() as caller:
        return caller.connect_ex(("127.0.0.1", port)) == 0


class Graph:
    """A master and the nodes around the algorithm, on a port of their own."""

    def __init__(self, folder: Path):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(folder),
            "PYTHONPATH": str(ROOT),
        }
        self.processes: dict[str, subprocess.Popen] = {}
        self.start(
            "master", ["/usr/bin/python3", str(ROSMASTER), "--core", "-p", str(port)]
        )
        while not answers(port):
            time.sleep(0.1)
        truth = folder / "truth.toml"
        truth.write_text(TRUTH)
        self.node("robot", f"_truth:={truth}")
        self.node("touch")
        # Half a second for five millimetres: time to kill something.
        self.node("position", "_speed:=0.005")

    def start(self, name, command, **options):
        process = subprocess.Popen(
            command, env=self.environment, cwd=ROOT, text=True, **options
        )
        self.processes[name] = process
        return process

    def node(self, name, *arguments):
        module = f"pushfit.explore.hands.ros.{name}"
        return self.start(name, [sys.executable, "-m", module, *arguments])

    def algorithm(self, journal):
        command = [sys.executable, "-m", "tests.explore.ros_explore", str(journal)]
        return self.start("algorithm", command, stdout=subprocess.PIPE)

    def kill(self, name):
        self.processes[name].kill()
        self.processes[name].wait()


@pytest.fixture
def graph(tmp_path):
    own = Graph(tmp_path)
    yield own
    for process in own.processes.values():
        process.kill()
        process.wait()
        if process.stdout:
            process.stdout.close()


def events(path):
    """Every line of a journal is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_nodes_explore(graph, tmp_path):
    journal = tmp_path / "run.jsonl"
    out, _ = graph.algorithm(journal).communicate(timeout=240)
    last = json.loads(out.splitlines()[-1])
    assert last["error"] is None
    assert last["answer"] == "out_of_budget"
    assert len(last["told"]) == 2
    assert max(map(abs, last["at"])) < RETRACTED
    told = [e for e in events(journal) if e["event"] == "told"]
    asked = [e for e in events(journal) if e["event"] == "asked"]
    for push, wanted in zip(told, asked, strict=True):
        # The robot goes where it is sent, but for the noise of its last step.
        assert abs(push["theta"] - wanted["theta"]) < 0.02


@pytest.mark.parametrize(
    ("victim", "error", "reason"),
    [("touch", None, "stale_stream"), ("master", "master_lost", None)],
)
def test_a_node_killed_in_mid_push_leaves_the_finger_retracted(
    graph, tmp_path, victim, error, reason
):
    journal = tmp_path / "run.jsonl"
    algorithm = graph.algorithm(journal)
    while not json.loads(algorithm.stdout.readline()).get("moving"):
        pass
    graph.kill(victim)
    last = json.loads(algorithm.stdout.read().splitlines()[-1])
    assert max(map(abs, last["at"])) < RETRACTED
    assert last["told"] == []
    assert last["error"] == error
    found = events(journal)
    assert [e["event"] for e in found][:2] == ["start", "asked"]
    failed = [e["reason"] for e in found if e["event"] == "failed"]
    assert failed == ([] if reason is None else [reason])


def test_ros_is_not_needed_before_a_node_starts():
    code = "import pushfit.explore.hands.ros.hand, sys; print('rospy' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT
    )
    assert found.stdout == "False\n"
    assert messages.DISPLACEMENT == "pushfit/displacement"
