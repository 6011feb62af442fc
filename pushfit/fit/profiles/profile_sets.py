"""From a profile on a grid to the set at a probability, and to the word for its shape.

Excluded: how the profile was computed.
"""

import itertools
import math

import numpy as np
import scipy
from jaxtyping import Bool, Float

from pushfit.fit.results import LikelihoodProfile, Piece, Verdict

# Two modes are told apart by a barrier of at least this much Δχ² above the level; the
# hard switch puts lower ripples of no meaning on every profile.
LOWEST_BARRIER = 0.3
# And, of angles, of this width [deg]: what is narrower is one search that ended early,
# and means nothing to a hand.
NARROWEST = 0.25


def threshold(prob: float, degrees_of_freedom: float) -> float:
    """Largest Δχ² inside the set of one quantity.

    Args:
        degrees_of_freedom: Of the estimate of sigma that weighted the residuals;
            infinite where sigma is known.

    Returns:
        Quantile of chi-square with one degree of freedom, or of F(1, dof): infinite
        without any, where the residuals tell nothing of sigma.
    """
    if math.isinf(degrees_of_freedom):
        return float(scipy.special.chdtri(1, 1 - prob))
    if degrees_of_freedom < 1.0:
        return math.inf
    return float(scipy.special.fdtri(1, degrees_of_freedom, prob))


def pieces_below(
    values: Float[np.ndarray, " g"],
    delta: Float[np.ndarray, " g"],
    level: float,
    *,
    narrowest: float = 0.0,
) -> tuple[Piece, ...]:
    """Intervals in which a profile stays at or below a level.

    Args:
        values: Grid, ascending.
        delta: Δχ² on it; infinite where the value is impossible.
        level: Largest Δχ² inside.
        narrowest: Width that a barrier between two modes has at least.

    Returns:
        Pieces, ascending. The first or last end is None where the set runs to the end
        of the grid or to values that are impossible: nothing measured bounds it there.
    """
    smooth = _without_ripples(values, delta, level, narrowest)
    is_inside = np.concatenate([[False], smooth, [False]])
    starts = np.flatnonzero(~is_inside[:-1] & is_inside[1:])
    stops = np.flatnonzero(is_inside[:-1] & ~is_inside[1:]) - 1
    # sqrt(Δχ²) is a straight line where the profile is a parabola.
    root, target = np.sqrt(delta), math.sqrt(level)

    def end(inside: int, outside: int) -> float | None:
        if not 0 <= outside < values.size or not np.isfinite(root[outside]):
            # Between two pieces it is where the possible values end.
            is_outer = inside == (starts[0] if outside < inside else stops[-1])
            return None if is_outer else float(values[inside])
        share = (target - root[inside]) / (root[outside] - root[inside])
        return float(values[inside] + share * (values[outside] - values[inside]))

    runs = zip(starts.tolist(), stops.tolist(), strict=True)
    return tuple((end(a, a - 1), end(b, b + 1)) for a, b in runs)


def _without_ripples(
    values: Float[np.ndarray, " g"],
    delta: Float[np.ndarray, " g"],
    level: float,
    narrowest: float,
) -> Bool[np.ndarray, " g"]:
    """Which values are inside, barriers that part no two modes included."""
    is_inside = delta <= level
    edges = np.flatnonzero(np.diff(is_inside.astype(int)))
    for i, j in itertools.pairwise(edges):
        is_low = np.max(delta[i + 1 : j + 1]) < level + LOWEST_BARRIER
        # Impossible values are at the ends; one between is a search that failed.
        is_low |= j == i + 1 and np.isinf(delta[j])
        if is_low or values[j + 1] - values[i] < narrowest:
            is_inside[i + 1 : j + 1] = True
    return is_inside


def verdict_of(pieces: tuple[Piece, ...]) -> Verdict:
    """The word for the shape of a set.

    Returns:
        DETERMINED for one closed interval, ONE_SIDED for one half-open interval,
        SEVERAL_MODES for more than one piece, else NOT_DETERMINED.
    """
    if not pieces or pieces == ((None, None),):
        return Verdict.NOT_DETERMINED
    if len(pieces) > 1:
        return Verdict.SEVERAL_MODES
    is_open = any(None in piece for piece in pieces)
    return Verdict.ONE_SIDED if is_open else Verdict.DETERMINED


def profile_set(profile: LikelihoodProfile, prob: float) -> tuple[Piece, ...]:
    """Set of a profile at any probability.

    Args:
        profile: Profile; its grid is densest around the set at its own `prob`.

    Returns:
        Pieces, ascending and disjoint; None for an open end.
    """
    level = threshold(prob, profile.degrees_of_freedom)
    narrowest = NARROWEST if profile.unit == "deg" else 0.0
    values, delta = profile.values, profile.delta_chi_square
    return pieces_below(values, delta, level, narrowest=narrowest)
