"""The algorithm node's view of a robot: a `Hand` that talks to the other two nodes."""

import threading
import time
from collections import deque

import numpy as np
from jaxtyping import Float

from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError
from pushfit.explore.hands.protocol import PushOutcome, PushStatus, Reach
from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import ros, xyz

# Samples kept: some minutes of a fast sensor.
KEPT = 200_000
# Longest that a push may take, and that the sensor may be silent meanwhile [s].
PATIENCE, SILENCE = 60.0, 0.5
# How often the master is looked for during a push [s].
MASTER_EVERY = 1.0


class RosHand:
    """A hand behind the position node and the touch node.

    Args:
        has_forces: Whether components are recorded rather than the magnitude.
    """

    def __init__(
        self,
        *,
        has_forces: bool,
        theta_deg: tuple[float, float],
        alpha_deg: tuple[float, float] = (-180.0, 180.0),
    ) -> None:
        """Start the algorithm node and wait for the other two."""
        self._has_forces = has_forces
        self._reach = Reach(theta_deg=theta_deg, alpha_deg=alpha_deg)
        self._samples: deque[tuple[float, float, float, float]] = deque(maxlen=KEPT)
        self._heard = 0.0
        self._status: dict[float, tuple[int, str]] = {}
        self._reached: dict[float, Float[np.ndarray, 3]] = {}
        self._changed = threading.Condition()
        r = ros()
        geometry, actions = r.geometry_msgs, r.actionlib_msgs
        r.rospy.init_node("pushfit_algorithm", disable_signals=True)
        self._push = r.rospy.Publisher(
            messages.DISPLACEMENT, geometry.Vector3Stamped, queue_size=1
        )
        self._cancel = r.rospy.Publisher(messages.CANCEL, actions.GoalID, queue_size=1)
        self._limit = r.rospy.Publisher(
            messages.MAX_FORCE, r.std_msgs.Float64, queue_size=1, latch=True
        )
        for topic, kind, heard in (
            (messages.TOUCH, geometry.WrenchStamped, self._on_touch),
            (messages.REACHED, geometry.Vector3Stamped, self._on_reached),
            (messages.STATUS, actions.GoalStatus, self._on_status),
        ):
            r.rospy.Subscriber(topic, kind, heard, queue_size=1000)
        self._wait_for_nodes()
        # Kept open: it must work also when the master is gone.
        self._retract = r.rospy.ServiceProxy(
            messages.RETRACT, r.std_srvs.Trigger, persistent=True
        )

    def push(
        self, displacement: Float[np.ndarray, "3"], *, max_force: float | None
    ) -> PushOutcome:
        """Have the position node push; see `Hand`."""
        r = ros()
        stamp = r.rospy.Time.now()
        if max_force is not None:
            self._limit.publish(float(max_force))
        goal = r.geometry_msgs.Vector3Stamped()
        goal.header.stamp, goal.header.frame_id = stamp, "push"
        goal.vector.x, goal.vector.y, goal.vector.z = map(float, displacement)
        self._push.publish(goal)
        status, text = self._awaited(stamp)
        key = stamp.to_sec()
        return PushOutcome(
            status=status,
            reached=self._reached.get(key, np.zeros(3)),
            t_start=key,
            t_end=r.rospy.Time.now().to_sec(),
            text=text,
        )

    def retract(self) -> None:
        """Ask the position node to take the finger back."""
        try:
            self._retract()
        except ros().rospy.ServiceException:
            # It retracts by itself when the master, or the sensor, is gone.
            self.stop()

    def stop(self) -> None:
        """Cancel whatever the position node does; it then takes the finger back."""
        self._cancel.publish(ros().actionlib_msgs.GoalID())

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        time.sleep(seconds)

    def samples(self, since: float) -> Recording:
        """Samples as they came since a moment; the directions are those reached."""
        rows = np.array(list(self._samples), dtype=float).reshape(-1, 4)
        recent = rows[:, 0] >= since
        rows = rows[int(np.argmax(recent)) if np.any(recent) else len(rows) :]
        forces = {"force": np.linalg.norm(rows[:, 1:], axis=1)}
        if self._has_forces:
            forces = {"fx": rows[:, 1], "fy": rows[:, 2], "fz": rows[:, 3]}
        return Recording(
            time=rows[:, 0],
            channels=forces,
            units=dict.fromkeys(forces, "n"),
            notes=("recorded over ROS",),
        )

    def reach(self) -> Reach:
        """Where the finger can push."""
        return self._reach

    def _awaited(self, stamp: object) -> tuple[PushStatus, str]:
        """Wait for the end of a push, and for no longer than is safe."""
        key = stamp.to_sec()  # pyright: ignore
        begun = looked = time.monotonic()
        with self._changed:
            while key not in self._status:
                self._changed.wait(0.05)
                now = time.monotonic()
                if now - looked > MASTER_EVERY:
                    looked = now
                    if not messages.master_answers():
                        self.stop()
                        raise DataError(
                            "the ROS master does not answer any more; the finger was "
                            "called back: start it, and the same command goes on",
                            code="master_lost",
                        )
                if now - max(self._heard, begun) > SILENCE:
                    self.stop()
                    return PushStatus.STALE_STREAM, "the touch node is silent"
                if now - begun > PATIENCE:
                    self.stop()
                    return PushStatus.NO_ANSWER, "the position node does not answer"
            code, text = self._status[key]
        done = ros().actionlib_msgs.GoalStatus.SUCCEEDED
        if code == done:
            return PushStatus.DONE, text
        words = {status.value for status in PushStatus}
        return PushStatus(text if text in words else "cancelled"), text

    def _wait_for_nodes(self) -> None:
        """Both other nodes must be there before anything moves."""
        rospy = ros().rospy
        rospy.wait_for_service(messages.RETRACT, timeout=PATIENCE)
        end = time.monotonic() + PATIENCE
        while not self._push.get_num_connections() or not self._samples:
            if time.monotonic() > end:
                raise DataError(
                    "no touch node, or no position node: start them first, as in "
                    "explore.launch",
                    code="no_nodes",
                )
            time.sleep(0.05)

    def _on_touch(self, message: object) -> None:
        force = message.wrench.force  # pyright: ignore
        stamp = message.header.stamp.to_sec()  # pyright: ignore
        self._samples.append((stamp, force.x, force.y, force.z))
        self._heard = time.monotonic()

    def _on_reached(self, message: object) -> None:
        key = message.header.stamp.to_sec()  # pyright: ignore
        self._reached[key] = xyz(message.vector)  # pyright: ignore

    def _on_status(self, message: object) -> None:
        goal = message.goal_id.stamp.to_sec()  # pyright: ignore
        with self._changed:
            self._status[goal] = (message.status, message.text)  # pyright: ignore
            self._changed.notify_all()
