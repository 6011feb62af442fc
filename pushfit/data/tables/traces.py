"""The signal that pushes were taken from, thinned to what a picture can show.

A table carries the traces of its recordings, so that a report can show every push where
it was measured without the recording itself.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# A page of six rows at 300 dpi, two points per pixel.
MAX_KEPT = 24_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One recording as its pushes were found in it.

    Args:
        path: Recording as the user named it.
        name: Channel.
        unit: Unit of the signal, that of the heights.
        time: Sample times [s].
        signal: Samples, pushes going up [unit].
        first_row: First row of the peak table that was measured in it.
        n_rows: Number of its rows.
        sign: -1 where the channel is turned, so that pushes go up; baselines of the
            table are those of the channel.
    """

    path: str
    name: str
    unit: str
    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    first_row: int
    n_rows: int
    sign: int = 1


def envelope(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"], *, max_points: int
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Signal thinned for drawing, with the extremes of every stretch kept.

    Args:
        time: Sample times [s].
        signal: Samples.
        max_points: How many samples may stay.

    Returns:
        Times and samples, unchanged if there are few.
    """
    if time.size <= max_points:
        return time, signal
    filled = np.where(np.isnan(signal), 0.0, signal)
    length = -(-time.size // (max_points // 2))
    # The last sample again: of equal extremes the first is taken.
    rows = np.pad(filled, (0, -time.size % length), mode="edge").reshape(-1, length)
    first = length * np.arange(len(rows))
    keep = np.unique([first + np.argmin(rows, axis=1), first + np.argmax(rows, axis=1)])
    return time[keep], signal[keep]
