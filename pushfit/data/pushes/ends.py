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
    is_first, is_last = lowest <= time[0], highest >= time[-1]
    # A level over that of the other rest is one on the way, unless drift leads there
    # or it is held for as long as the push.
    length = np.maximum(feet.end - feet.start, feet.step)
    drift = length * _usual_rate(feet.rows(np.flatnonzero(~(is_first | is_last))))
    high = FOOT * feet.height
    is_high = np.stack([drift - feet.moved > high, feet.moved - drift > high])
    is_high &= np.stack([feet.start - time[0], time[-1] - feet.end]) < feet.width
    begins = (shown[0] < _SHOWN) | is_high[0]
    ends = (len(time) - shown[1] < _SHOWN) | is_high[1]
    return (is_first & begins) | (is_last & ends)


def _usual_rate(feet: Feet[np.ndarray]) -> float:
    """Drift of the rests beside pushes: a median, a long push for more [unit/s]."""
    length = np.maximum(feet.end - feet.start, feet.step)
    if length.size == 0:
        return 0.0
    rates = feet.moved / length
    order = np.argsort(rates)
    up_to = np.cumsum(length[order])
    return float(rates[order][np.searchsorted(up_to, up_to[-1] / 2)])
