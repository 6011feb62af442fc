"""An exploration that kills its own process after a line of its journal.

python -m tests.explore.journal.killed JOURNAL [LINES]
"""

import os
import signal
import sys

from pushfit.config.inputs import PeakSettings
from pushfit.explore.explorer import Explorer
from pushfit.explore.hands.simulated import SimulatedHand
from pushfit.explore.journal.file import Journal
from pushfit.explore.limits import Limits
from pushfit.explore.loop import explore
from tests.explore.test_loop import hand
from tests.explore.worlds import COMPONENTS, CONFIG, SIGMA, importance


class Steady(SimulatedHand):
    """A robot whose world does not begin anew when the algorithm dies."""

    def push(self, displacement, *, max_force):
        self.clock = 100.0 * (self.n_pushes + 1)
        return super().push(displacement, max_force=max_force)


def main(path, last=None):
    write = Journal.write

    def write_and_die(self, event):
        write(self, event)
        with open(path) as file:
            n_lines = len(file.readlines())
        if n_lines == last:
            os.kill(os.getpid(), signal.SIGKILL)

    Journal.write = write_and_die
    explorer = Explorer(
        CONFIG,
        width_deg=12.0,
        budget=2,
        sigma=SIGMA,
        channels=COMPONENTS,
        source=importance,
        journal=path,
        limits=Limits(reference_every=1),
    )
    finger = Steady(hand().world, seed=1)
    finger.n_pushes = len(explorer.history.told)
    explore(explorer, finger, settings=PeakSettings(normal="fz"))
    print(repr(explorer.state))


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
