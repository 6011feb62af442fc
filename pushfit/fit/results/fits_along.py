"""Best fits along one quantity, which whatever comes later begins with.

Excluded: the search itself (`pushfit.fit.profiles.curve_search`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """Profile of one quantity.

    Args:
        values: Values, ascending [ln unit, or rad].
        points: Data coordinates of the best fit at each value.
        chi_square: Its sum of squared residuals; infinite where it is impossible.
    """

    values: Float[np.ndarray, " g"]
    points: Float[np.ndarray, "g q"]
    chi_square: Float[np.ndarray, " g"]

    def joined(self, other: "Curve") -> "Curve":
        """Both curves as one; of equal values the better fit stays."""
        values = np.concatenate([self.values, other.values])
        chi_square = np.concatenate([self.chi_square, other.chi_square])
        points = np.concatenate([self.points, other.points])
        order = np.lexsort((chi_square, values))
        is_first = np.diff(values[order], prepend=-np.inf) > 0
        kept = order[is_first]
        return Curve(
            values=values[kept], points=points[kept], chi_square=chi_square[kept]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class FitsAlong:
    """Best fits along one quantity, from end to end.

    Args:
        observed: Heights that were fitted.
        quantity: Name of the quantity: θ_c, or what else is free.
        reference_alpha: Azimuth of θ_c [rad].
        is_thorough: Whether the fits began with those of a search, or guesses are many
            beside the shapes of a problem without an ellipse.
        curve: The fits.
        valleys: Points at the bottom of the lowest valleys, or near it, lowest first.
    """

    observed: Float[np.ndarray, "c n"]
    quantity: str
    reference_alpha: float
    is_thorough: bool
    curve: Curve
    valleys: Float[np.ndarray, "k q"]
