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
# So much calmer than lower holds the only one at its limit is. Eight normal samples are
# by chance once in 300 (chi-square, 7 degrees).
_CALMER = 3.0
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
    lower = np.flatnonzero((highest < largest) & ~near(bands)).tolist()

    def is_shape(at_end: Sequence[int], flat: Sequence[bool]) -> bool:
        """Whether flat tops are the shape of pushes and no limit.

        So it is where most lower ones have them, or any where one push is at the end,
        unless that is far calmer: a limit cuts noise as well.
        """
        if len(at_end) > 1 or not any(flat):
            return _are_most(flat)
        alike = [k for k, is_so in zip(lower, flat, strict=True) if is_so]
        own, *others = (_spread(tops[k], float(bands[k])) for k in (*at_end, *alike))
        return _CALMER * own >= min(others)

    if any(_is_at_one(tops[k]) for k in ends) and (
        len(ends) > 1 or not is_shape(ends, [_is_at_one(tops[k]) for k in lower])
    ):
        return largest
    at_end = np.flatnonzero(is_narrow & near(bands)).tolist()
    cut = [k for k in at_end if is_flat(k, largest)]
    flat = [bool(sigma[k] == 0) or is_flat(k, float(highest[k])) for k in lower]
    if cut and not is_shape(cut, flat):
        return largest - float(bands[cut[0]])
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


def _spread(top: Float[np.ndarray, " n"], band: float) -> float:
    """Between the quarters of the readings within a band below the largest."""
    near = top[top >= top.max(initial=-np.inf) - band]
    return float(np.ptp(np.quantile(near, [0.25, 0.75])))


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
