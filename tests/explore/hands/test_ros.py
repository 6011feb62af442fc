"""The three nodes for real, against a simulated robot, and killed in mid-push."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from pushfit.data.tables.peak_table import read_table
from pushfit.errors import DataError
from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import DEBIAN, HOW
from pushfit.model import Grasp, Pushes, forward
from pushfit.report.store.read import read_result
from tests.explore.worlds import COMPONENTS, SIGMA, TRUTH_FILE
from tests.explore.worlds import TRUTH as PARAMETERS

ROSMASTER = Path("/usr/bin/rosmaster")
ROOT = Path(__file__).parents[3]
# After so long without set points the robot goes back by itself, or never [s].
WATCHDOG, NONE = 0.5, 1e6
# Longest until the finger is back: half a second until somebody misses somebody, or two
# looks for the master; two seconds of the way; and a busy machine [s].
BACK = 8.0
# Longest until the algorithm has given up: two calls to retract that nobody answers, of
# ten seconds each, and a busy machine [s].
SOON = 40.0
# Where a finger turns that is given up at two millimetres of five [mm].
TURNED = 4.5
# The robot goes where it is sent, but for the noise of its last step [rad].
SENT = 0.02

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (ROSMASTER.exists() and (DEBIAN / "rospy").is_dir()),
        reason=f"ROS 1 is not installed; {HOW}",
    ),
]


def free_port():
    """A port that nobody listens at."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


def answers(port):
    """Whether somebody listens there."""
    with socket.socket() as caller:
        return caller.connect_ex(("127.0.0.1", port)) == 0


class Graph:
    """A master and the nodes around the algorithm, on a port of their own."""

    def __init__(self, folder: Path):
        self.port = free_port()
        self.environment = {
            **os.environ,
            "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}",
            "ROS_IP": "127.0.0.1",
            "ROS_LOG_DIR": str(folder),
            "PYTHONPATH": str(ROOT),
        }
        self.truth = folder / "truth.toml"
        self.truth.write_text(TRUTH_FILE)
        self.processes: dict[str, subprocess.Popen] = {}

    def begin(self, *, watchdog):
        command = ["/usr/bin/python3", str(ROSMASTER), "--core", "-p", str(self.port)]
        self.start("master", command)
        while not answers(self.port):
            time.sleep(0.1)
        self.node(
            "robot", f"_truth:={self.truth}", f"_watchdog:={watchdog}", "_rate:=100"
        )
        self.node("touch")
        # Two seconds for five millimetres: time to kill something, and a busy machine
        # that is late by a fifth of a second is no stall.
        self.node("position", "_speed:=0.0025")
        self.module("watch", "tests.explore.hands.ros_watch", stdout=subprocess.PIPE)

    def start(self, name, command, **options):
        process = subprocess.Popen(
            command, env=self.environment, cwd=ROOT, text=True, **options
        )
        self.processes[name] = process
        return process

    def module(self, name, module, *arguments, **options):
        return self.start(name, [sys.executable, "-m", module, *arguments], **options)

    def node(self, name, *arguments):
        return self.module(name, f"pushfit.explore.hands.ros.{name}", *arguments)

    def algorithm(self, journal):
        return self.module(
            "algorithm",
            "tests.explore.hands.ros_explore",
            journal,
            stdout=subprocess.PIPE,
        )

    def sees(self, word, *, within):
        """How far out the finger was when it is seen out, or back; 0 if not in time."""
        watch = self.processes["watch"]
        timer = threading.Timer(within, watch.kill)
        timer.start()
        lines = (line.split() for line in watch.stdout)
        found = next((float(far) for which, far in lines if which == word), 0.0)
        timer.cancel()
        return found

    def end(self):
        for process in self.processes.values():
            process.kill()
            process.wait()
            if process.stdout:
                process.stdout.close()


@pytest.fixture
def graph(tmp_path):
    own = Graph(tmp_path)
    yield own
    own.end()


def ended(algorithm, *, within=240):
    """How an exploration says that it ended."""
    out, _ = algorithm.communicate(timeout=within)
    return json.loads(out.splitlines()[-1])


def events(path):
    """Every line of a journal is whole."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_nodes_explore(graph, tmp_path):
    journal = tmp_path / "run.jsonl"
    graph.begin(watchdog=NONE)
    last = ended(graph.algorithm(journal))
    assert last["error"] is None
    assert last["answer"] == "out_of_budget"
    assert len(last["told"]) == 2
    for word in ("out", "back") * 2:
        assert graph.sees(word, within=1.0)
    told = [e for e in events(journal) if e["event"] == "told"]
    asked = [e for e in events(journal) if e["event"] == "asked"]
    for push, wanted in zip(told, asked, strict=True):
        assert abs(push["theta"] - wanted["theta"]) < SENT


@pytest.mark.parametrize(
    ("victim", "blow", "error", "reasons"),
    [
        ("touch", signal.SIGKILL, None, [["stale_stream"]]),
        ("master", signal.SIGKILL, "master_lost", [[]]),
        # Ended, not killed: the position node takes the finger back before it goes, and
        # its last words may be heard.
        ("position", signal.SIGINT, "position_lost", [[], ["cancelled"]]),
        # Killed or hanging: only the robot itself is left.
        ("position", signal.SIGKILL, "position_lost", [[]]),
        ("position", signal.SIGSTOP, "position_lost", [[]]),
    ],
)
def test_whatever_dies_in_mid_push_the_finger_is_retracted(
    graph, tmp_path, victim, blow, error, reasons
):
    journal = tmp_path / "run.jsonl"
    is_alone = victim == "position" and blow != signal.SIGINT
    graph.begin(watchdog=WATCHDOG if is_alone else NONE)
    algorithm = graph.algorithm(journal)
    assert graph.sees("out", within=120)
    graph.processes[victim].send_signal(blow)
    assert graph.sees("back", within=BACK)
    last = ended(algorithm, within=SOON)
    assert last["told"] == []
    assert (last["error"] and last["error"]["code"]) == error
    if error == "position_lost":
        assert "nothing but the driver of the robot" in last["error"]["sentence"]
    found = events(journal)
    assert [e["event"] for e in found][:2] == ["start", "asked"]
    failed = [e["reason"] for e in found if e["event"] == "failed"]
    assert failed in reasons


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_without_an_algorithm_the_position_node_takes_the_finger_back(
    graph, tmp_path, blow
):
    journal = tmp_path / "run.jsonl"
    graph.begin(watchdog=NONE)
    algorithm = graph.algorithm(journal)
    assert graph.sees("out", within=120)
    algorithm.send_signal(blow)
    # Not after going on to the end.
    assert 0 < graph.sees("back", within=BACK) < TURNED
    assert [e["event"] for e in events(journal)] == ["start", "asked"]
    algorithm.send_signal(signal.SIGCONT)
    if blow == signal.SIGSTOP:
        answer, reason = "stopped", "algorithm_silent"
    else:
        algorithm.wait()
        algorithm.stdout.close()
        algorithm = graph.algorithm(journal)
        answer, reason = "out_of_budget", "interrupted"
    assert ended(algorithm)["answer"] == answer
    failed = [e["reason"] for e in events(journal) if e["event"] == "failed"]
    assert failed == [reason]


def test_the_command_says_at_once_that_there_is_no_master(graph, tmp_path):
    command = [sys.executable, "-m", "pushfit", "explore", "--hand", "ros"]
    found = subprocess.run(
        [*command, "--out", str(tmp_path / "run")],
        env=graph.environment,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert found.returncode == DataError.exit_code
    assert f"no ROS master answers at http://127.0.0.1:{graph.port}" in found.stderr
    assert "Traceback" not in found.stderr


def test_the_launch_file_explores_to_a_result(graph, tmp_path):
    """As docs/real_robot.md has it: master, nodes and robot by roslaunch."""
    (tmp_path / "grasp.toml").write_text("[push]\nlength_mm = 5.0\n")
    out = tmp_path / "run"
    command = ["/usr/bin/roslaunch", "--port", str(graph.port), "pushfit"]
    command += ["explore.launch", "simulate:=true", f"truth:={graph.truth}"]
    command += [f"config:={tmp_path / 'grasp.toml'}", f"out:={out}"]
    command += ["options:=--forces --sigma 0.05 --budget 2"]
    # The scripts of the package call the python3 of the path.
    folders = [str(Path(sys.executable).parent), os.environ["PATH"]]
    graph.environment |= {
        "PATH": os.pathsep.join(folders),
        "ROS_PACKAGE_PATH": str(ROOT / "examples" / "ros"),
    }
    launch = graph.start("launch", command, stdout=subprocess.PIPE)
    printed, _ = launch.communicate(timeout=400)
    assert "Identified from all pushes: The critical angle θ_c" in printed
    told = [e for e in events(out / "journal.jsonl") if e["event"] == "told"]
    assert len(told) == 2
    table = read_table(out / "peaks.csv")
    grasp = Grasp(push_length=0.005)
    felt = forward(PARAMETERS, Pushes(table.theta, table.alpha), grasp)
    for channel in COMPONENTS:
        np.testing.assert_allclose(
            table.heights(channel), getattr(felt, channel), atol=SIGMA
        )
    assert read_result(out).theta_c.sets
    assert (out / "report.html").exists()


def test_ros_is_not_needed_before_a_node_starts():
    code = "import pushfit.explore.hands.ros.hand, sys; print('rospy' in sys.modules)"
    found = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT
    )
    assert found.stdout == "False\n"
    assert messages.DISPLACEMENT == "pushfit/displacement"
