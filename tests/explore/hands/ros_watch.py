"""Where the finger of a robot under ROS is: "out" and "back", a line each time.

After the word stands how far out it was last [mm].

python -m tests.explore.hands.ros_watch
"""

import numpy as np

from pushfit.explore.hands.ros import messages

# Far out, and where the finger rests after a push, of five millimetres [m].
OUT, RETRACTED = 2e-3, 1e-4


class Watch:
    """Says whenever the other of the two is reached."""

    def __init__(self):
        r = messages.ros()
        self.is_out, self.farthest = False, 0.0
        r.rospy.Subscriber(messages.POSITION, r.geometry_msgs.PointStamped, self.follow)

    def follow(self, message):
        length = np.linalg.norm(messages.xyz(message.point))
        self.farthest = max(self.farthest, length)
        if length < RETRACTED if self.is_out else length > OUT:
            self.is_out = not self.is_out
            word = "out" if self.is_out else "back"
            print(word, f"{1e3 * self.farthest:.2f}", flush=True)
            self.farthest = length


if __name__ == "__main__":
    messages.run("pushfit_watch", Watch)
