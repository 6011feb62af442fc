"""Fill short gaps of a series by interpolation."""

import numpy as np
from jaxtyping import Float

# Between neighbours further apart than this many usual steps a push may hide.
MAX_FILLED_STEPS = 5.0


def fill_short_gaps(
    time: Float[np.ndarray, " n"],
    values: Float[np.ndarray, " n"],
    *,
    is_azimuth: bool = False,
) -> Float[np.ndarray, " n"]:
    """Interpolate missing samples between neighbours that are close in time.

    Args:
        time: Sample times [s].
        values: Samples, NaN where missing.
        is_azimuth: Whether the samples are angles through 360°, of which the shorter
            way round is meant [rad].

    Returns:
        The samples, still NaN in gaps longer than `MAX_FILLED_STEPS` usual steps of
        this series, and before its first and after its last sample.
    """
    known = np.flatnonzero(~np.isnan(values))
    if known.size < 2:
        return values
    rows = np.flatnonzero(np.isnan(values))
    after = np.searchsorted(known, rows)
    inside = (after > 0) & (after < known.size)
    rows, after = rows[inside], after[inside]
    step = np.diff(time[known])
    is_short = step[after - 1] <= MAX_FILLED_STEPS * np.median(step)
    rows = rows[is_short]
    samples = values[known]
    if is_azimuth:
        samples = np.unwrap(samples)
    filled = values.copy()
    filled[rows] = np.interp(time[rows], time[known], samples)
    if is_azimuth:
        filled[rows] = np.angle(np.exp(1j * filled[rows]))
    return filled
