"""Which pushes reach the end of the sensor's range, so that their tops are cut.

Excluded: pushes held at a level (`pushfit.data.peaks.apex_or_plateau`). Half or twice
of a constant changes no test, and no flag of `benchmarks.recordings.real_recordings`.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Bool, Float

from pushfit.data.pushes.detection import Extent

# Two readings are alike at many a natural top.
_MIN_SAMPLES = 3
# A sensor at its limit may be noisy there: readings within this many sigma of the
# largest, which holds all but one in 16 000 of a level's, count as the largest, if that
# is a small share of the height.
_BAND_SIGMAS, _MAX_BAND = 4.0, 0.02
# Of the lower pushes.
_MOST = 0.5
# Its limit may also creep. Several pointed pushes that end within one of these shares
# of the height, each with so many readings there, end at a limit.
_BANDS, _MIN_NEAR, _MIN_PUSHES = (0.001, 0.002, 0.004, 0.008), 6, 2


def saturated_pushes(
    signal: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    *,
    signs: Sequence[int],
    limit: float | None,
    sigma: Float[np.ndarray, " p"],
) -> Bool[np.ndarray, " p"]:
    """Find the pushes that reach the end of the range.

    Args:
        signal: Samples [unit].
        signs: 1 for a push that goes up, -1 for one that goes down.
        limit: Largest reading of the sensor; None to recognise it. Where a push goes
            down, it is that of the reversed signal, and recognised as well [unit].
        sigma: Noise of a sample at rest beside each push; 0 where it is held, so that
            its readings pile up at their level by themselves [unit].
    """
    is_cut = np.zeros(len(extents), dtype=bool)
    for sign in set(signs):
        rows = [k for k, own in enumerate(signs) if own == sign]
        tops = [sign * signal[extents[k].start : extents[k].end] for k in rows]
        end = np.inf if limit is None else limit
        if limit is None or sign < 0:
            found = _ceiling(tops, [extents[k].height for k in rows], sigma[rows])
            end = min(end, found)
        if np.isfinite(end):
            is_cut[rows] = [bool(np.any(top >= end)) for top in tops]
    return is_cut


def _ceiling(
    tops: Sequence[Float[np.ndarray, " _"]],
    heights: Sequence[float],
    sigma: Float[np.ndarray, " q"],
) -> float:
    """Level at which readings pile up, infinite if they do nowhere.

    A natural top has about as many samples just below its highest value as at it; a cut
    one has them all at it. What one push shows holds for all.
    """
    highest = np.array([float(top.max(initial=-np.inf)) for top in tops])
    largest = float(highest.max())

    def near(band: float | Float[np.ndarray, " q"]) -> Bool[np.ndarray, " q"]:
        return highest > largest - band

    bands = _BAND_SIGMAS * sigma
    is_narrow = bands <= _MAX_BAND * np.array(heights)

    def is_flat(k: int, end: float) -> bool:
        return _piles_up(tops[k], end, float(bands[k]), _MIN_SAMPLES)

    ends = np.flatnonzero(highest == largest).tolist()
    # Where most lower pushes have flat tops, these are their shape and no limit.
    lower = np.flatnonzero((highest < largest) & ~near(bands)).tolist()
    if len(ends) > 1 or not _are_most(_is_at_one(tops[k]) for k in lower):
        if any(_is_at_one(tops[k]) for k in ends):
            return largest
    if not _are_most(sigma[k] == 0 or is_flat(k, float(highest[k])) for k in lower):
        for k in np.flatnonzero(is_narrow & near(bands)).tolist():
            if is_flat(k, largest):
                return largest - float(bands[k])
    for share in _BANDS:
        band = share * max(heights)
        pointed = np.flatnonzero((sigma > 0) & near(band)).tolist()
        at_end = [k for k in pointed if _piles_up(tops[k], largest, band, _MIN_NEAR)]
        if len(at_end) >= _MIN_PUSHES:
            return largest - band
    return np.inf


def _are_most(found: Iterable[bool]) -> bool:
    """Whether it is so of more than a share of the pushes."""
    return float(np.mean([*found] or [0.0])) > _MOST


def _is_at_one(top: Float[np.ndarray, " n"]) -> bool:
    """Whether far more readings are the largest than the three next to it."""
    n_at = np.count_nonzero(top >= top.max(initial=-np.inf))
    just_below = np.isin(top, np.unique(top)[-4:-1])
    return bool(n_at >= _MIN_SAMPLES and n_at > 2 * np.count_nonzero(just_below))


def _piles_up(
    top: Float[np.ndarray, " n"], largest: float, band: float, least: int
) -> bool:
    """Whether far more readings lie in a band below a level than in those beneath."""
    n_at = int(np.count_nonzero(top > largest - band))
    n_below = int(np.count_nonzero(top > largest - 4 * band)) - n_at
    return n_at >= least and n_at > 2 * n_below
