"""Names of topics, and ROS itself, which is no package of Python's index.

Nothing here is imported before a node starts: the rest of pushfit runs without ROS.
Excluded: what nodes say on the topics (`pushfit.explore.hands.ros.hand`,
`pushfit.explore.hands.ros.position`, `pushfit.explore.hands.ros.touch`).
"""

import functools
import sys
from collections.abc import Callable, Iterable
from http.client import HTTPConnection
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any
from xmlrpc.client import ServerProxy, Transport

import numpy as np
from jaxtyping import Float

from pushfit.errors import ConfigError, DataError

# To the position node, and what it answers; all in the frame of the push.
DISPLACEMENT, REACHED = "pushfit/displacement", "pushfit/reached"
STATUS, CANCEL, RETRACT = "pushfit/status", "pushfit/cancel", "pushfit/retract"
MAX_FORCE = "pushfit/max_force"
# Stamp of the push that the algorithm waits for, for as long as it waits.
AWAITED = "pushfit/awaited"
# From the touch node.
TOUCH = "pushfit/touch"
# Between the position node and a robot.
COMMAND, POSITION = "finger/command", "finger/position"
WRENCH, JOINTS = "finger/wrench", "finger/joint_states"
# How often two nodes that wait for each other say that they are there [s].
BEAT = 0.05
# Longest wait for the master [s].
PATIENCE = 1.0
# Where Debian and Ubuntu put Python packages of ROS 1.
DEBIAN = Path("/usr/lib/python3/dist-packages")
HOW = (
    "apt-get install python3-rospy python3-rosmaster python3-roslaunch "
    "python3-geometry-msgs python3-sensor-msgs python3-std-msgs python3-std-srvs "
    "python3-actionlib-msgs python3-catkin"
)
WANTED = (
    "rospy",
    "rosgraph",
    "geometry_msgs.msg",
    "actionlib_msgs.msg",
    "sensor_msgs.msg",
    "std_msgs.msg",
    "std_srvs.srv",
)


@functools.cache
def ros() -> SimpleNamespace:
    """Modules of ROS by the last word before a dot.

    Returns:
        `rospy`, `rosgraph`, and messages as `geometry_msgs`, `actionlib_msgs`,
        `sensor_msgs`, `std_msgs` and `std_srvs`.

    Raises:
        ConfigError: ROS is not installed, with what installs it.
    """
    modules = {name.split(".")[0]: _imported(name) for name in WANTED}
    return SimpleNamespace(**modules)


def _imported(name: str) -> ModuleType:
    """A module of ROS, of this Python or of the system's."""
    try:
        return import_module(name)
    except ImportError as first:
        folder = str(DEBIAN)
        if DEBIAN.is_dir() and folder not in sys.path:
            # At the end, so that nothing of this environment is replaced.
            sys.path.append(folder)
            return _imported(name)
        raise ConfigError(
            f"ROS 1 is not installed ({first}); on Debian: {HOW}", code="no_ros"
        ) from first


class _Impatient(Transport):
    """A way to a master that may be gone: ROS itself would wait for minutes."""

    def make_connection(self, host: Any) -> HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = PATIENCE
        return connection


def master_answers() -> bool:
    """Whether the ROS master is there; known within a second or two."""
    try:
        ServerProxy(ros().rosgraph.get_master_uri(), _Impatient()).getPid("/pushfit")
    except Exception:  # whatever the network makes of a master that is gone
        return False
    return True


def begin(name: str, **options: Any) -> None:
    """Make this process a node.

    Raises:
        DataError: No master answers; ROS itself would wait for one without a word.
    """
    if not master_answers():
        raise DataError(
            f"no ROS master answers at {ros().rosgraph.get_master_uri()}, which is "
            "ROS_MASTER_URI or its default; start one with its nodes, as roslaunch "
            "pushfit explore.launch does, and give the same command again",
            code="no_master",
        )
    ros().rospy.init_node(name, **options)


def run(name: str, node: Callable[[], object]) -> None:
    """Run a node until ROS ends."""
    begin(name, argv=sys.argv)
    node()
    ros().rospy.spin()


def xyz(point: Any) -> Float[np.ndarray, "3"]:
    """Components of a point or vector of a message."""
    return np.array([point.x, point.y, point.z])


def put_xyz(point: Any, values: Iterable[float]) -> None:
    """Set the components of a point or vector of a message."""
    point.x, point.y, point.z = map(float, values)
