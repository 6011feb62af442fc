"""A robot that is not there: follows set points and feels what the push model says.

    python -m pushfit.explore.hands.ros.robot _truth:=truth.toml _noise:=0.01

For rehearsals and tests, in place of the driver of a real finger. Like that of a real
one it has a watchdog: without set points for a time it goes back to the contact.
Excluded: a hand without ROS (`pushfit.explore.hands.simulated`).
"""

import threading
import time
from functools import partial

import equinox as eqx
import numpy as np

from pushfit.config import read_config
from pushfit.data.grasp import make_grasp
from pushfit.data.truth import stated_parameters
from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import put_xyz, ros, xyz
from pushfit.model import Pushes, forward


class RobotNode:
    """The node: position follows the set point, force follows the position."""

    def __init__(self) -> None:
        """Hold the grasp of a file."""
        r = ros()
        rospy = r.rospy
        config = read_config(rospy.get_param("~truth"))
        self.params, self.grasp = stated_parameters(config), make_grasp(config, "n")
        self.noise = float(rospy.get_param("~noise", 0.01))
        self.rate = float(rospy.get_param("~rate", 200.0))
        self._rng = np.random.default_rng(int(rospy.get_param("~seed", 0)))
        # Longest time without a set point [s], and the speed of going back then [m/s].
        self.watchdog = float(rospy.get_param("~watchdog", 0.5))
        self.speed = float(rospy.get_param("~speed", 0.01))
        self._at, self._ordered = np.zeros(3), 0.0
        self._forces = eqx.filter_jit(forward)
        geometry = r.geometry_msgs
        publisher = partial(rospy.Publisher, queue_size=10)
        self._position = publisher(messages.POSITION, geometry.PointStamped)
        self._joints = publisher(messages.JOINTS, r.sensor_msgs.JointState)
        self._wrench = rospy.Publisher(
            messages.WRENCH, geometry.WrenchStamped, queue_size=100
        )
        self._publish()  # compiles before anybody pushes
        rospy.Subscriber(
            messages.COMMAND,
            geometry.PointStamped,
            self._on_command,
            queue_size=1,
            tcp_nodelay=True,
        )
        threading.Thread(target=self._run, daemon=True).start()

    def _on_command(self, message: object) -> None:
        self._at = xyz(message.point)  # pyright: ignore
        self._ordered = time.monotonic()

    def _go_back(self) -> None:
        """One step to the contact where nobody says any more where to go."""
        length = float(np.linalg.norm(self._at))
        if length > 0 and time.monotonic() - self._ordered > self.watchdog:
            self._at = self._at * max(1 - self.speed / self.rate / length, 0.0)

    def _run(self) -> None:
        while not ros().rospy.is_shutdown():
            self._go_back()
            self._publish()
            time.sleep(1 / self.rate)

    def _publish(self) -> None:
        r = ros()
        now, (x, y, z) = r.rospy.Time.now(), self._at.tolist()
        length = float(np.linalg.norm(self._at))
        alpha, theta = np.arctan2(y, x), np.arcsin(z / max(length, 1e-12))
        grasp = eqx.tree_at(
            lambda g: g.push_length, self.grasp, np.asarray(max(length, 1e-12))
        )
        pushes = Pushes(np.array([theta]), np.array([alpha]))
        found = self._forces(self.params, pushes, grasp)
        normal, tangential = float(found.height_normal[0]), found.height_tangential[0]
        along = float(tangential) * np.array([np.cos(alpha), np.sin(alpha)])
        force = np.append(along, normal) + self.noise * self._rng.standard_normal(3)
        position = r.geometry_msgs.PointStamped()
        position.header.stamp = now
        put_xyz(position.point, (x, y, z))
        self._position.publish(position)
        joints = r.sensor_msgs.JointState()
        joints.header.stamp, joints.name = now, ["x", "y", "z"]
        joints.position = [x, y, z]
        self._joints.publish(joints)
        wrench = r.geometry_msgs.WrenchStamped()
        wrench.header.stamp = now
        put_xyz(wrench.wrench.force, force)
        self._wrench.publish(wrench)


main = partial(messages.run, "pushfit_robot", RobotNode)

if __name__ == "__main__":
    main()
