"""The signal that pushes were taken from, thinned to what a picture can show.

A table carries the traces of its recordings, so that a report can show every push where
it was measured without the recording itself. Excluded: drawing it
(`pushfit.report.figures.recording`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

# A page of six rows at 300 dpi, two points per pixel.
MAX_KEPT = 24_000


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedHeights:
    """Heights of pushes in one force component, and where they were measured.

    Args:
        start: Begin of the stretch that each height was measured over [s].
        end: Its end [s].
        baseline: Rest level under the top [unit].
        height: Top over baseline, negative where the push goes down [unit].
    """

    start: Float[np.ndarray, " p"]
    end: Float[np.ndarray, " p"]
    baseline: Float[np.ndarray, " p"]
    height: Float[np.ndarray, " p"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ComponentTrace:
    """One force component of a recording, whole.

    Args:
        name: Its channel.
        time: Sample times [s].
        signal: Samples, also those of jerks [unit].
        is_jerk: Whether each sample was left out as one of a jerk.
        heights: Of the rows of the peak table that were measured in the recording.
    """

    name: str
    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    is_jerk: Bool[np.ndarray, " n"]
    heights: SignedHeights


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One recording as its pushes were found in it.

    Args:
        path: Recording as the user named it.
        name: Words for the signal: its channel, or the change of force.
        unit: Unit of the signal, that of the heights.
        time: Sample times [s].
        signal: Samples, pushes going up [unit].
        first_row: First row of the peak table that was measured in it.
        n_rows: Rows that were measured in it, from there on.
        sign: -1 where the channel is turned, so that pushes go up; baselines of the
            table are those of the channel.
        components: What `signal` is the length of the change of; none where the pushes
            were measured in it.
    """

    path: str
    name: str
    unit: str
    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    first_row: int
    n_rows: int
    sign: int = 1
    components: tuple[ComponentTrace, ...] = ()


def envelope(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"], *, max_points: int
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Signal thinned for drawing with its extremes, unchanged if it is short."""
    if time.size <= max_points:
        return time, signal
    filled = np.where(np.isnan(signal), 0.0, signal)
    length = -(-time.size // (max_points // 2))
    n_whole = time.size // length * length
    kept = []
    for rows in (filled[:n_whole].reshape(-1, length), filled[None, n_whole:]):
        if rows.size:
            first = length * np.arange(len(rows)) + (n_whole if kept else 0)
            kept += [first + rows.argmin(axis=1), first + rows.argmax(axis=1)]
    keep = np.unique(np.concatenate(kept))
    return time[keep], signal[keep]
