"""Jerks of a force: readings far off for a shorter time than any push lasts.

A finger that snags, or a joint that knocks, may be felt as ten times the push. Heights
of components are read at the top of the whole force, which such a reading would be.
A contact that is lost for moments parts a push in two, or makes none of a hold.
Excluded: leaving them out of a recording (`pushfit.data.peaks.components`, and
`pushfit.data.peaks.chosen_humps` of a single channel).
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
# Steps of time, of which the median is the usual one.
_STEPS = 1 << 16


def are_jerks(
    time: Float[np.ndarray, " n"], samples: Float[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """Whether each sample of a component, at times [s], is one of a jerk."""
    middle, least, stride = _usual(time, samples)
    own = np.arange(len(samples)) // stride
    return _with_feet(time, np.abs(samples - middle[own]) > least[own])


def notches(
    time: Float[np.ndarray, " n"], samples: Float[np.ndarray, " n"]
) -> tuple[slice, ...]:
    """Samples far below all around them, on either side: as of a loose contact."""
    middle, least, stride = _usual(time, samples)
    # Most recordings have none, and may be long.
    starts = np.arange(0, len(samples), stride)
    if not np.any(np.minimum.reduceat(samples, starts) < middle - least):
        return ()
    own = np.arange(len(samples)) // stride
    is_low = _with_feet(time, samples < (middle - least)[own])
    edges = np.flatnonzero(np.diff(is_low, prepend=False, append=False)).tolist()
    found = []
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if 0 < first and last < len(time):
            lowest = first + int(np.argmin(samples[first:last]))
            sides = min(samples[first - 1], samples[last])
            if sides - samples[lowest] > least[own[lowest]]:
                found.append(slice(first, last))
    return tuple(found)


def _usual(
    time: Float[np.ndarray, " n"], samples: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], int]:
    """Medians around samples, how much off them is far, and of how many each is one."""
    from scipy.ndimage import percentile_filter  # noqa: PLC0415

    n = _n_around(time)
    stride = max(1, round(n / _ENOUGH))
    some, width = samples[::stride], 1 + round(n / stride)
    low, middle, high = (
        percentile_filter(some, share, width, mode="nearest") for share in (25, 50, 75)
    )
    least = np.maximum(
        _FAR * (high - low), _SIGMAS * SignalNoise.of(time, samples).sigma
    )
    return middle, least, stride


def _n_around(time: Float[np.ndarray, " n"]) -> float:
    """Usual number of samples that one is looked at among."""
    stride = max(1, len(time) // _STEPS)
    step = np.median(time[1::stride] - time[:-1:stride])
    return FIRST_SMOOTHING / _SHARE / float(step)


def _with_feet(
    time: Float[np.ndarray, " n"], is_far: Bool[np.ndarray, " n"]
) -> Bool[np.ndarray, " n"]:
    """What is far off, and what is beside it."""
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415

    return maximum_filter1d(is_far, 1 + round(_FEET * _n_around(time)))
