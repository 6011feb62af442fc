"""Which pushes the ends of a recording cut."""

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.feet import FOOT, Feet

# A push begins a ninth of the way to half height before it passes the foot.
_BEGINS = 0.11
# Samples of rest that show that a push had not begun.
_SHOWN = 3


def are_cut(
    time: Float[np.ndarray, " n"], feet: Feet[np.ndarray]
) -> Bool[np.ndarray, " p"]:
    """Whether the samples begin or end before a rest is seen beside each push.

    Args:
        time: Sample times [s].
        feet: All pushes in order.
    """
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    shown = np.searchsorted(time, [early, late])
    lowest, highest = feet.room(time)
    # At an end a level over the rest of the push is one that it has on its way.
    high = FOOT * feet.height
    begins = (shown[0] < _SHOWN) | (feet.moved < -high)
    ends = (len(time) - shown[1] < _SHOWN) | (feet.moved > high)
    return ((lowest <= time[0]) & begins) | ((highest >= time[-1]) & ends)
