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
        unit: Unit of the signal, that of the heights.
        time: Sample times [s].
        signal: Samples, pushes going up [unit].
        first_row: First row of the peak table that was measured in it.
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
    """Signal thinned for drawing with its extremes, unchanged if it is short.

    Args:
        time: Sample times [s].
    """
    if time.size <= max_points:
        return time, signal
    filled = (
        np.where(np.isnan(signal), 0.0, signal) if np.isnan(signal).any() else signal
    )
    length = -(-time.size // (max_points // 2))
    n_whole = time.size // length * length
    kept = []
    for rows in (filled[:n_whole].reshape(-1, length), filled[None, n_whole:]):
        if rows.size:
            first = length * np.arange(len(rows)) + (n_whole if kept else 0)
            kept += [first + rows.argmin(axis=1), first + rows.argmax(axis=1)]
    keep = np.unique(np.concatenate(kept))
    return time[keep], signal[keep]
