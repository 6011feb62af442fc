"""Valleys between pushes that are no rests, as between the halves of a double push.

Excluded: parting a push in two (`pushfit.data.pushes.doubles`) and the levels of rests
(`pushfit.data.peaks.baselines`).
"""

import numpy as np
from jaxtyping import Bool, Int

from pushfit.data.pushes.feet import LEAST, SHIFT, Feet


def are_valleys(feet: Feet[np.ndarray]) -> Bool[np.ndarray, " q"]:
    """Whether between each push and the next there is a valley, but no rest.

    Next to nothing of a level is held there, or it is more than half way up to both,
    and held for less than either; and the first or the last of all pushes that follow
    each other so leads from a rest to another level than drift does. Where neither
    does, valleys are the rests of pushes that go on without any other.

    Args:
        feet: All pushes, in order.
    """
    least = LEAST * feet.span
    (first, last), (first_after, last_after) = feet.before, feet.after()
    is_short = (last_after - first_after < least)[:-1] & (last - first < least)[1:]
    is_high = (feet.moved > feet.height)[:-1] & (-feet.moved > feet.height)[1:]
    gap, width = feet.start[1:] - feet.end[:-1], feet.width
    is_short |= is_high & (gap < np.minimum(width[:-1], width[1:]))
    is_off = np.abs(feet.moved) > SHIFT * feet.height
    ends = ends_of_chains(is_short)
    return is_short & (is_off[ends[0]] | is_off[ends[1]])[:-1]


def ends_of_chains(
    is_joint: Bool[np.ndarray, " q"],
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """The first and the last of all pushes that each is joint with.

    Args:
        is_joint: Whether each push is so with the next.
    """
    chain = np.append(0, np.cumsum(~is_joint))
    first, after = (np.searchsorted(chain, chain, side=s) for s in ("left", "right"))
    return first, after - 1
