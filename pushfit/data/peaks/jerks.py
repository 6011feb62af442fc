"""Jerks of a force: readings far off for a shorter time than any push lasts.

A finger that snags, or a joint that knocks, may be felt as ten times the push. Heights
of components are read at the top of the whole force, which such a reading would be.
Excluded: leaving them out of a recording (`pushfit.data.peaks.components`).
"""

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.detection import FIRST_SMOOTHING
from pushfit.data.pushes.noise import SignalNoise

# How far a reading is from the median around it: in differences of the quartiles, which
# are large on a flank (of normal noise 4 are 5.4 sigma), and in sigma, where most of
# them are equal.
_FAR, _SIGMAS = 4.0, 6.0
# What a jerk may take of its surroundings: more would be a quartile of them. With half
# or twice, jerks of 50 ms in holds and on contact are read. And its feet beside what is
# clear of it, 24 ms to either side.
_SHARE, _FEET = 0.25, 0.12
# Samples that show quartiles well enough: of a normal one these are good to 0.17 sigma.
_ENOUGH = 64


def are_jerks(
    time: Float[np.ndarray, " n"], samples: Float[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Whether each sample of a component, at times [s], is one of a jerk."""
    from scipy.ndimage import maximum_filter1d, percentile_filter  # noqa: PLC0415

    usual = float(np.median(np.diff(time)))
    n = FIRST_SMOOTHING / _SHARE / usual
    stride = max(1, round(n / _ENOUGH))
    some, width = samples[::stride], 1 + round(n / stride)
    low, middle, high = (
        percentile_filter(some, share, width, mode="nearest") for share in (25, 50, 75)
    )
    least = np.maximum(
        _FAR * (high - low), _SIGMAS * SignalNoise.of(time, samples).sigma
    )
    own = np.arange(len(samples)) // stride
    is_far = np.abs(samples - middle[own]) > least[own]
    return maximum_filter1d(is_far, 1 + round(_FEET * n))
