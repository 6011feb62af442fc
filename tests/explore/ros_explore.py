"""An algorithm node for tests: explores over ROS and says where the finger is.

python -m tests.explore.ros_explore JOURNAL
"""

import json
import sys
import time

import numpy as np

from pushfit.config.inputs import PeakSettings
from pushfit.errors import PushfitError
from pushfit.explore.explorer import Explorer
from pushfit.explore.hands.ros import messages
from pushfit.explore.hands.ros.hand import RosHand
from pushfit.explore.limits import Limits
from pushfit.explore.loop import explore
from tests.explore.worlds import COMPONENTS, CONFIG, SIGMA, importance

MOVING = 2e-3


def main(journal):
    hand = RosHand(has_forces=True, theta_deg=(5.0, 85.0))
    at = np.zeros(3)

    def follow(message):
        was = np.linalg.norm(at)
        at[:] = message.point.x, message.point.y, message.point.z
        if was < MOVING < np.linalg.norm(at):
            print(json.dumps({"moving": True}), flush=True)

    r = messages.ros()
    r.rospy.Subscriber(messages.POSITION, r.geometry_msgs.PointStamped, follow)
    explorer = Explorer(
        CONFIG,
        budget=2,
        sigma=SIGMA,
        channels=COMPONENTS,
        source=importance,
        journal=journal,
        limits=Limits(max_failures=1),
    )
    error = None
    try:
        explore(explorer, hand, settings=PeakSettings(normal="fz"))
    except PushfitError as caught:
        error = caught.code
    time.sleep(2.0)
    told = [row.theta for row in explorer.history.told]
    last = {"error": error, "at": at.tolist(), "told": told}
    print(json.dumps(last | {"answer": explorer.state.answer.value}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
