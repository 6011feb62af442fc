"""Names of topics, and ROS itself, which is no package of Python's index.

Nothing here is imported before a node starts: the rest of pushfit runs without ROS.
"""

import functools
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from jaxtyping import Float

from pushfit.errors import ConfigError

# To the position node, and what it answers; all in the frame of the push.
DISPLACEMENT, REACHED = "pushfit/displacement", "pushfit/reached"
STATUS, CANCEL, RETRACT = "pushfit/status", "pushfit/cancel", "pushfit/retract"
MAX_FORCE = "pushfit/max_force"
# From the touch node.
TOUCH = "pushfit/touch"
# Between the position node and a robot.
COMMAND, POSITION = "finger/command", "finger/position"
WRENCH, JOINTS = "finger/wrench", "finger/joint_states"
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


def master_answers() -> bool:
    """Whether the ROS master is there."""
    try:
        ros().rosgraph.Master("/pushfit").getPid()
    except Exception:  # whatever the network makes of a master that is gone
        return False
    return True


def run(name: str, node: Callable[[], object]) -> None:
    """Run a node until ROS ends."""
    rospy = ros().rospy
    rospy.init_node(name, argv=sys.argv)
    node()
    rospy.spin()


def xyz(point: Any) -> Float[np.ndarray, "3"]:
    """Components of a point or vector of a message."""
    return np.array([point.x, point.y, point.z])
