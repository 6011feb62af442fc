"""An algorithm node for tests: explores over ROS and says how that ended.

python -m tests.explore.hands.ros_explore JOURNAL
"""

import json
import sys

from pushfit.config.inputs import PeakSettings
from pushfit.errors import PushfitError
from pushfit.explore.explorer import Explorer
from pushfit.explore.hands.ros.hand import RosHand
from pushfit.explore.limits import Limits
from pushfit.explore.loop import explore
from tests.explore.worlds import COMPONENTS, CONFIG, SIGMA, importance


def main(journal):
    hand = RosHand(has_forces=True, theta_deg=(5.0, 85.0))
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
        error = {"code": caught.code, "sentence": str(caught)}
    told = [row.theta for row in explorer.history.told]
    answer = explorer.state.answer.value
    print(json.dumps({"error": error, "told": told, "answer": answer}), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
