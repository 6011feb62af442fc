"""What an exploration needs of a robot: a finger that pushes and a sensor that feels.

Whoever implements `Hand` runs everything here; nothing in this package knows a robot.
The paper calls the two halves position node and touch node. Excluded: what is made of
the samples (`pushfit.explore.hands.touch`).
"""

import enum
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from pushfit.data.recordings.records import Recording


class PushStatus(enum.Enum):
    """How a push ended; the value is the word in journals."""

    DONE = "done"
    STALLED = "stalled"
    FORCE_ABORT = "force_abort"
    OBJECT_LOST = "object_lost"
    OUT_OF_REACH = "out_of_reach"
    STALE_STREAM = "stale_stream"
    CANCELLED = "cancelled"
    NO_ANSWER = "no_answer"
    ALGORITHM_SILENT = "algorithm_silent"


@dataclass(frozen=True, slots=True, kw_only=True)
class PushOutcome:
    """What became of a push.

    Args:
        status: How it ended.
        reached: Displacement at its end, from the contact [m].
        t_start: When the finger began to move, on the clock of the samples [s].
        t_end: When it was back, or had stopped [s].
    """

    status: PushStatus
    reached: Float[np.ndarray, "3"]
    t_start: float
    t_end: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Where the finger can push.

    Args:
        theta_deg: Lowest and highest elevation [deg].
        alpha_deg: Lowest and highest azimuth [deg].
    """

    theta_deg: tuple[float, float]
    alpha_deg: tuple[float, float]


@runtime_checkable
class Hand(Protocol):
    """A finger on an object, with a tactile sensor.

    `push` moves forth and back and returns when the finger has stopped. Forces are
    watched by whoever moves the finger, not by the exploration: `max_force` is obeyed
    without asking back.
    """

    def push(
        self, displacement: Float[np.ndarray, "3"], *, max_force: float | None
    ) -> PushOutcome:
        """Move the fingertip by a displacement [m] and back; stop at a force [N]."""
        ...

    def retract(self) -> None:
        """Return to the contact without pushing; also from the middle of a push."""
        ...

    def stop(self) -> None:
        """Stop moving at once."""
        ...

    def rest(self, seconds: float) -> None:
        """Rest while the sensor goes on.

        Counted from the last return of this or of `retract`: a time for which somebody
        thought meanwhile is rest as well.
        """
        ...

    def samples(self, since: float) -> Recording:
        """Samples as they came since a moment [s], whatever is wrong with them."""
        ...

    def reach(self) -> Reach:
        """Where the finger can push."""
        ...
