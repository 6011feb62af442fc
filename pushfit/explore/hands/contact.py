"""Whether the finger still feels the object during a push.

Judged by the reading alone. Excluded: a reading that does not come back to rest
(`pushfit.explore.hands.touch`).
"""

import numpy as np
from jaxtyping import Float
from numpy.lib.stride_tricks import sliding_window_view

from pushfit.data.recordings.records import Recording
from pushfit.explore.hands.protocol import PushOutcome

# A contact that is lost is lost within this share of a push; a finger that goes back
# takes longer. Fewer samples than this in a push tell the two apart by chance.
SUDDEN, LEAST_SAMPLES = 0.02, 40
# What falls is above this share of the strongest reading, and leaves this one: neither
# the end of the way back nor a slip.
FALLS_FROM, LEAVES = 0.5, 0.1
# Above so much noise of a sample it is a push [standard deviations].
CLEAR = 6.0
# Share of the push after a loss that has to stay so; a loose cable comes and goes.
STAYS = 0.95
# Share of what a push makes felt at least, below which it felt nothing.
UNFELT = 0.25


def is_lost(recording: Recording, outcome: PushOutcome) -> bool:
    """Whether the contact was lost in the middle of a push.

    The change from the reading at rest then falls at once to nothing or, with a
    preload, beyond, and stays there, while the finger is still out.
    """
    excess, noise = _excess(recording, outcome)
    n = len(excess)
    if n < LEAST_SAMPLES:
        return False
    width = max(round(n * SUDDEN), 1)
    smooth = _medians(excess, width)
    before, after = smooth[: -2 * width], smooth[2 * width :]
    size = np.linalg.norm(before, axis=1)
    least = np.maximum(FALLS_FROM * np.maximum.accumulate(size), CLEAR * noise)
    has_fallen = np.sum(after * before, axis=1) <= LEAVES * size**2
    for i in np.flatnonzero((size > least) & has_fallen):
        if np.mean(after[i:] @ before[i] <= LEAVES * size[i] ** 2) > STAYS:
            return True
    return False


def is_unfelt(recording: Recording, outcome: PushOutcome, *, least: float) -> bool:
    """Whether a push changed the reading by much less than it does at least.

    Args:
        least: Height that a push exceeds by what is believed [unit].
    """
    excess, _ = _excess(recording, outcome)
    smooth = _medians(excess, max(len(excess) // 10, 1))
    return bool(np.max(np.linalg.norm(smooth, axis=1)) < UNFELT * least)


def _excess(
    recording: Recording, outcome: PushOutcome
) -> tuple[Float[np.ndarray, "n c"], float]:
    """Samples of the push less those of the rest before it, and noise of a sample."""
    time = recording.time
    values = np.stack(list(recording.channels.values()), axis=1)
    rest = values[time < outcome.t_start]
    if not len(rest):
        rest = values[:1]
    near = (time >= outcome.t_start) & (time <= outcome.t_end)
    noise = float(np.linalg.norm(np.std(rest, axis=0)))
    return values[near] - np.median(rest, axis=0), noise


def _medians(values: Float[np.ndarray, "n c"], width: int) -> Float[np.ndarray, "m c"]:
    return np.median(sliding_window_view(values, width, axis=0), axis=-1)
