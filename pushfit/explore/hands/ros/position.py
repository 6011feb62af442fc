"""Position node: moves the fingertip forth and back, and looks after what is touched.

    python -m pushfit.explore.hands.ros.position _max_force:=10 _speed:=0.01

Takes a displacement, sends set points to a robot, and ends early at a force, a stall, a
silent sensor, an algorithm that waits no more, a cancel, a lost master, or an end of
this node that is not sudden; whatever ends a push, the finger goes back. The algorithm
can tighten the force limit, never widen it. What it cannot do is outlive itself: a
robot that hears no set points has to take its finger back. Excluded: where to push, and
how far (`pushfit.explore.explorer`).
"""

import threading
import time
from functools import partial

import numpy as np
from jaxtyping import Float

from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.messages import put_xyz, ros, xyz

# How far the finger may lag behind its set point, and for how long [m, s].
LAG, LAG_TIME = 5e-4, 0.3
# A push may not begin, and must end, where the sensor was silent for so long [s].
SILENCE = 0.3
# A push must end where the algorithm did not say for so long that it waits for it [s].
UNAWAITED = 0.5
# How long the finger is given to come to rest where it is sent [s].
SETTLE = 1.0
# How often the master is looked for, and how often in a row it may be missing.
MASTER_EVERY, MISSING = 0.5, 2


class PositionNode:
    """The node; everything that moves is decided in its own thread."""

    def __init__(self) -> None:
        """Connect to the robot and to the other nodes."""
        r = ros()
        geometry, actions = r.geometry_msgs, r.actionlib_msgs
        rospy = r.rospy
        self.max_force = float(rospy.get_param("~max_force", 10.0))
        self.max_length = float(rospy.get_param("~max_length", 0.02))
        self.speed = float(rospy.get_param("~speed", 0.01))
        self.rate = float(rospy.get_param("~rate", 100.0))
        self._asked_force = np.inf
        self._at = np.zeros(3)
        self._force, self._heard = 0.0, 0.0
        self._is_cancelled = threading.Event()
        self._is_busy = threading.Lock()
        # Stamp of the push under way, and when the algorithm last waited for it.
        self._goal: object = None
        self._waited = self._said = 0.0
        publisher = partial(rospy.Publisher, queue_size=10)
        self._command = publisher(messages.COMMAND, geometry.PointStamped)
        self._status = publisher(messages.STATUS, actions.GoalStatus)
        self._reached = publisher(messages.REACHED, geometry.Vector3Stamped)
        # Before the rest: an algorithm that sees this node listen may call at once.
        rospy.Service(messages.RETRACT, r.std_srvs.Trigger, self._on_retract)
        for topic, kind, heard in (
            (messages.POSITION, geometry.PointStamped, self._on_position),
            (messages.TOUCH, geometry.WrenchStamped, self._on_touch),
            (messages.MAX_FORCE, r.std_msgs.Float64, self._on_limit),
            (messages.AWAITED, r.std_msgs.Time, self._on_awaited),
            (messages.CANCEL, actions.GoalID, self._on_cancel),
            (messages.DISPLACEMENT, geometry.Vector3Stamped, self._on_push),
        ):
            # Where the finger is, not where it was: what is late is left out.
            rospy.Subscriber(topic, kind, heard, queue_size=1, tcp_nodelay=True)
        rospy.on_shutdown(self._call_back)
        threading.Thread(target=self._watch_master, daemon=True).start()

    def _on_push(self, message: object) -> None:
        """One goal; a second one while the first is under way is refused."""
        stamp = message.header.stamp  # pyright: ignore
        goal = xyz(message.vector)  # pyright: ignore
        actions = ros().actionlib_msgs.GoalStatus
        length = float(np.linalg.norm(goal))
        if not 0 < length <= self.max_length:
            self._answer(stamp, actions.REJECTED, "out_of_reach")
        elif not self._is_busy.acquire(blocking=False):
            self._answer(stamp, actions.REJECTED, "cancelled")
        else:
            try:
                self._is_cancelled.clear()
                self._goal, self._waited = stamp, time.monotonic()
                self._answer_push(stamp, goal, length)
            finally:
                self._goal = None
                self._is_busy.release()

    def _answer_push(
        self, stamp: object, goal: Float[np.ndarray, "3"], length: float
    ) -> None:
        reason = self._forth(goal, length)
        reached = self._at.copy()
        self._back()
        r = ros()
        answer = r.geometry_msgs.Vector3Stamped()
        answer.header.stamp = stamp
        put_xyz(answer.vector, reached)
        self._reached.publish(answer)
        actions = r.actionlib_msgs.GoalStatus
        code = actions.SUCCEEDED if reason is None else actions.ABORTED
        self._answer(stamp, code, reason or "done")

    def _forth(self, goal: Float[np.ndarray, "3"], length: float) -> str | None:
        """Follow the ramp to its end; the reason for which it was left early."""
        begun = lagging_since = time.monotonic()
        duration = length / self.speed
        while True:
            now = time.monotonic()
            share = min((now - begun) / duration, 1.0)
            self._send(share * goal)
            is_lagging = np.linalg.norm(self._at - share * goal) > LAG
            lagging_since = lagging_since if is_lagging else now
            reason = self._trouble(now, lagging_since)
            if reason is not None:
                return reason
            if share == 1.0 and not is_lagging:
                return None
            time.sleep(1 / self.rate)

    def _trouble(self, now: float, lagging_since: float) -> str | None:
        """Why the push must end, if it must."""
        if self._is_cancelled.is_set():
            return "cancelled"
        if now - self._waited > UNAWAITED:
            return "algorithm_silent"
        if now - self._heard > SILENCE:
            return "stale_stream"
        if self._force > min(self.max_force, self._asked_force):
            return "force_abort"
        return "stalled" if now - lagging_since > LAG_TIME else None

    def _back(self) -> None:
        """To the contact, at the speed of the push, whatever the state of the rest."""
        start, begun = self._at.copy(), time.monotonic()
        duration = max(float(np.linalg.norm(start)) / self.speed, 1 / self.rate)
        while (share := (time.monotonic() - begun) / duration) < 1:
            self._send((1 - share) * start)
            time.sleep(1 / self.rate)
        self._send(np.zeros(3))
        end = time.monotonic() + SETTLE
        while not self._is_back() and time.monotonic() < end:
            time.sleep(1 / self.rate)
            self._send(np.zeros(3))  # a set point may get lost

    def _is_back(self) -> bool:
        return bool(np.linalg.norm(self._at) < LAG)

    def _call_back(self) -> bool:
        """End the push under way, if there is one; whether the finger is back."""
        self._is_cancelled.set()
        with self._is_busy:
            self._back()
        return self._is_back()

    def _send(self, point: Float[np.ndarray, "3"]) -> None:
        """Order a set point; during a push, whoever waits for it hears of that."""
        r = ros()
        message = r.geometry_msgs.PointStamped()
        message.header.stamp = r.rospy.Time.now()
        put_xyz(message.point, point)
        self._command.publish(message)
        now = time.monotonic()
        if self._goal is not None and now - self._said > messages.BEAT:
            self._said = now
            self._answer(self._goal, r.actionlib_msgs.GoalStatus.ACTIVE, "active")

    def _answer(self, stamp: object, code: int, text: str) -> None:
        message = ros().actionlib_msgs.GoalStatus()
        message.goal_id.stamp, message.status, message.text = stamp, code, text
        self._status.publish(message)

    def _on_retract(self, request: object) -> object:
        is_back = self._call_back()
        word = "retracted" if is_back else "the finger does not come back"
        return ros().std_srvs.TriggerResponse(success=is_back, message=word)

    def _watch_master(self) -> None:
        """Without a master nobody could tell the finger to stop."""
        missing = 0
        while not ros().rospy.is_shutdown():
            missing = 0 if messages.master_answers() else missing + 1
            if missing >= MISSING:
                self._call_back()
            time.sleep(MASTER_EVERY)

    def _on_position(self, message: object) -> None:
        self._at = xyz(message.point)  # pyright: ignore

    def _on_touch(self, message: object) -> None:
        force = xyz(message.wrench.force)  # pyright: ignore
        self._force = float(np.linalg.norm(force))
        self._heard = time.monotonic()

    def _on_limit(self, message: object) -> None:
        self._asked_force = float(message.data)  # pyright: ignore

    def _on_awaited(self, message: object) -> None:
        if message.data == self._goal:  # pyright: ignore
            self._waited = time.monotonic()

    def _on_cancel(self, message: object) -> None:
        self._is_cancelled.set()


main = partial(messages.run, "pushfit_position", PositionNode)

if __name__ == "__main__":
    main()
