"""The algorithm node's view of a robot: a `Hand` that talks to the other two nodes.

Excluded: these two (`pushfit.explore.hands.ros.position`,
`pushfit.explore.hands.ros.touch`).
"""

import queue
import threading
import time
from collections import deque
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError
from pushfit.explore.hands.protocol import PushOutcome, PushStatus, Reach
from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import put_xyz, ros, xyz

# Samples kept: some minutes of a fast sensor.
KEPT = 200_000
# Longest that a push may take, and that a node may be silent meanwhile [s].
PATIENCE, SILENCE = 60.0, 0.5
# Longest that taking the finger back may take [s].
PATIENCE_BACK = 10.0
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
        # When the touch node and the position node last spoke, and when the finger was
        # last back or had rested.
        self._heard = self._answered = self._still_since = 0.0
        self._status: dict[float, tuple[int, str]] = {}
        self._reached: dict[float, Float[np.ndarray, 3]] = {}
        self._changed = threading.Condition()
        r = ros()
        geometry, actions = r.geometry_msgs, r.actionlib_msgs
        messages.begin("pushfit_algorithm", disable_signals=True)
        to_robot = partial(r.rospy.Publisher, queue_size=1)
        self._push = to_robot(messages.DISPLACEMENT, geometry.Vector3Stamped)
        self._cancel = to_robot(messages.CANCEL, actions.GoalID)
        self._awaited = to_robot(messages.AWAITED, r.std_msgs.Time)
        self._limit = to_robot(messages.MAX_FORCE, r.std_msgs.Float64, latch=True)
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
        put_xyz(goal.vector, displacement)
        self._push.publish(goal)
        status = self._wait_for_end(stamp)
        key = stamp.to_sec()
        return PushOutcome(
            status=status,
            reached=self._reached.get(key, np.zeros(3)),
            t_start=key,
            t_end=r.rospy.Time.now().to_sec(),
        )

    def retract(self) -> None:
        """Have the position node take the finger back.

        Raises:
            DataError: It does not answer, or the finger does not come back.
        """
        answers: queue.SimpleQueue[Any] = queue.SimpleQueue()
        # A thread of its own: a call to a node that hangs never returns.
        threading.Thread(target=self._call, args=(answers,), daemon=True).start()
        try:
            answer = answers.get(timeout=PATIENCE_BACK)
        except queue.Empty:
            answer = None
        if answer is None:
            raise self._lost()
        if not answer.success:
            raise DataError(
                f"after a call to retract: {answer.message}; see to the finger and its "
                "controller, and the same command goes on",
                code="not_retracted",
            )
        self._still_since = time.monotonic()

    def _call(self, answers: "queue.SimpleQueue[Any]") -> None:
        """Call to retract; None is the answer of a node that is gone."""
        rospy = ros().rospy
        try:
            answers.put(self._retract())
        except (rospy.ServiceException, rospy.ROSException):
            answers.put(None)

    def _lost(self) -> DataError:
        self.stop()
        return DataError(
            "the position node does not answer any more, and nothing but the driver of "
            "the robot can take the finger back now: see that it is off the object, "
            "start the node, and the same command goes on; a driver should go back by "
            "itself where set points stay away (docs/real_robot.md)",
            code="position_lost",
        )

    def stop(self) -> None:
        """Cancel whatever the position node does; it then takes the finger back."""
        self._cancel.publish(ros().actionlib_msgs.GoalID())

    def rest(self, seconds: float) -> None:
        """Sleep for what is left of the rest."""
        time.sleep(max(0.0, self._still_since + seconds - time.monotonic()))
        self._still_since = time.monotonic()

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

    def _wait_for_end(self, stamp: object) -> PushStatus:
        """Wait for the end of a push, and for no longer than is safe."""
        key = stamp.to_sec()  # pyright: ignore
        begun = looked = time.monotonic()
        with self._changed:
            while not self._has_ended(key):
                self._changed.wait(messages.BEAT)
                self._awaited.publish(stamp)
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
                    return PushStatus.STALE_STREAM
                if now - max(self._answered, begun) > SILENCE:
                    raise self._lost()
                if now - begun > PATIENCE:
                    self.stop()
                    return PushStatus.NO_ANSWER
            code, text = self._status[key]
        done = ros().actionlib_msgs.GoalStatus.SUCCEEDED
        if code == done:
            return PushStatus.DONE
        words = {status.value for status in PushStatus}
        return PushStatus(text if text in words else "cancelled")

    def _has_ended(self, key: float) -> bool:
        """Whether a push was answered, and how far it went: these are two messages."""
        if key not in self._status:
            return False
        code, _ = self._status[key]
        return code == ros().actionlib_msgs.GoalStatus.REJECTED or key in self._reached

    def _wait_for_nodes(self) -> None:
        """Both other nodes must be there before anything moves."""
        end = time.monotonic() + PATIENCE
        while missing := self._missing():
            if time.monotonic() > end:
                raise DataError(
                    f"{' and '.join(missing)} did not speak for {PATIENCE:g} s: start "
                    "it first, as in explore.launch",
                    code="no_nodes",
                )
            time.sleep(0.05)

    def _missing(self) -> list[str]:
        """Nodes that are not there yet."""
        reach = (self._push, self._awaited, self._cancel)
        is_deaf = not all(topic.get_num_connections() for topic in reach)
        return [
            *(["the position node"] if is_deaf else []),
            *([] if self._samples else ["the touch node"]),
        ]

    def _on_touch(self, message: object) -> None:
        force = message.wrench.force  # pyright: ignore
        stamp = message.header.stamp.to_sec()  # pyright: ignore
        self._samples.append((stamp, force.x, force.y, force.z))
        self._heard = time.monotonic()

    def _on_reached(self, message: object) -> None:
        key = message.header.stamp.to_sec()  # pyright: ignore
        with self._changed:
            self._reached[key] = xyz(message.vector)  # pyright: ignore
            self._changed.notify_all()

    def _on_status(self, message: object) -> None:
        goal = message.goal_id.stamp.to_sec()  # pyright: ignore
        self._answered = time.monotonic()
        if message.status == ros().actionlib_msgs.GoalStatus.ACTIVE:  # pyright: ignore
            return
        with self._changed:
            self._status[goal] = (message.status, message.text)  # pyright: ignore
            self._changed.notify_all()
