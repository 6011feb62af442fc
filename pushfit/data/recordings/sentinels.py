"""Numbers that stand for samples which a sensor did not give.

Excluded: texts that do (`pushfit.data.text.explain`), and gaps of either
(`pushfit.data.recordings.samples`).
"""

import numpy as np
from jaxtyping import Float

# What is larger is no reading of any unit, but what stands for one.
NO_READING = 1e20
# From 999 on, nines and the ends of whole numbers are codes where all other samples are
# further off than they lie apart; a number of no form, given twice or more, where they
# are so many times as far off: a push is up to some hundred times as high as its noise.
_ENDS = frozenset({2.0**15, 2.0**16 - 1, 2.0**15 - 1, 2.0**31, 2.0**31 - 1})
_NINES, _FAR = frozenset(10.0**k - 1 for k in range(3, 11)), 1000.0
# Fewer samples do not show how far apart they lie; so many are looked at before all.
_FEWEST, _SOME = 8, 1 << 14


def sentinel_of(values: Float[np.ndarray, " n"]) -> float | None:
    """Find the number that stands for missing samples of one channel.

    Args:
        values: Samples in the unit of the file, NaN where missing.

    Returns:
        The number farthest from 0 if it is beyond any unit, or the least or largest if
        it is far from all others and has the form of a code, or comes twice; None where
        neither is so.
    """
    ends = float(np.fmin.reduce(values)), float(np.fmax.reduce(values))
    # Few first: a copy of every channel would cost more than reading it.
    some = values[:: 1 + len(values) // _SOME]
    for end in sorted(ends, key=abs, reverse=True):
        if abs(end) > NO_READING:
            return end
        has_form = abs(end) in _NINES | _ENDS
        far = 1.0 if has_form else _FAR
        if _keeps_off(end, some, ends, far) and _keeps_off(end, values, ends, far):
            if has_form or np.count_nonzero(values == end) > 1:
                return end
    return None


def _keeps_off(
    end: float, values: Float[np.ndarray, " n"], ends: tuple[float, float], far: float
) -> bool:
    """Whether an end of samples is so many times as far off as those between reach."""
    others = values[(values > ends[0]) & (values < ends[1])]
    if others.size < _FEWEST or abs(end) < min(_NINES):
        return False
    span = float(np.ptp(others))
    return 0 < far * span < float(np.abs(others - end).min())
