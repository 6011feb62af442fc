"""A one-dimensional rule with an error of its own.

Everything works on logs of densities: posteriors span hundreds of e-folds. Excluded:
what is integrated.
"""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float, Int

# Gauss-Kronrod pair of 7 and 15 points on [-1, 1], as in QUADPACK's qk15: nodes from
# the outside to the middle, weights of both rules (0 where Gauss has no node).
_HALF = np.array(
    [
        [0.9914553711208126, 0.0229353220105292, 0.0],
        [0.9491079123427585, 0.0630920926299786, 0.1294849661688697],
        [0.8648644233597691, 0.1047900103222502, 0.0],
        [0.7415311855993944, 0.1406532597155259, 0.2797053914892767],
        [0.5860872354676911, 0.1690047266392679, 0.0],
        [0.4058451513773972, 0.1903505780647854, 0.3818300505051189],
        [0.2077849550078985, 0.2044329400752989, 0.0],
    ]
)
_MIDDLE = np.array([[0.0, 0.2094821410847278, 0.4179591836734694]])
_RULE = np.concatenate([_HALF * [-1, 1, 1], _MIDDLE, _HALF[::-1]])
NODES, KRONROD, GAUSS = _RULE.T


@dataclass(frozen=True, slots=True)
class Cells:
    """Integral of a positive function over adjoining intervals.

    Args:
        lower: Lower end of each interval.
        upper: Upper end.
        log_values: Log of the function at the nodes of each interval.
        inner_error: Relative error of the function at each node.
    """

    lower: Float[np.ndarray, " k"]
    upper: Float[np.ndarray, " k"]
    log_values: Float[np.ndarray, "k 15"]
    inner_error: Float[np.ndarray, "k 15"]

    @property
    def nodes(self) -> Float[np.ndarray, "k 15"]:
        """Nodes of every interval."""
        return cell_nodes(self.lower, self.upper)

    @property
    def scale(self) -> float:
        """Log of the largest value, taken out of every sum."""
        return float(np.max(self.log_values))

    @property
    def log_integral(self) -> float:
        """Log of the integral over all intervals."""
        return float(np.log(np.sum(self.integrals))) + self.scale

    @property
    def integrals(self) -> Float[np.ndarray, " k"]:
        """Integral over each interval, divided by exp(`scale`)."""
        values = np.exp(self.log_values - self.scale)
        return (self.upper - self.lower) / 2 * (values @ KRONROD)

    @property
    def errors(self) -> Float[np.ndarray, " k"]:
        """Error of each integral by QUADPACK's rule, that of the values aside."""
        half = (self.upper - self.lower) / 2
        values = np.exp(self.log_values - self.scale)
        total = values @ KRONROD
        difference = np.abs(total - values @ GAUSS)
        # How far from constant the function is: the rule cannot err by much more.
        spread = np.abs(values - total[:, None] / 2) @ KRONROD
        safe = np.where(spread > 0, spread, 1.0)
        error = np.minimum(safe, safe * (200 * difference / safe) ** 1.5)
        return half * np.where(spread > 0, error, difference)

    @property
    def relative_error(self) -> float:
        """Bound on the relative error of the whole integral."""
        values = np.exp(self.log_values - self.scale)
        inner = (values * self.inner_error) @ KRONROD
        inner = np.sum((self.upper - self.lower) / 2 * inner)
        return float((np.sum(self.errors) + inner) / np.sum(self.integrals))

    def replaced(self, which: Int[np.ndarray, " r"], parts: "Cells") -> "Cells":
        """The intervals with some of them replaced by their parts."""
        values, others = (
            [getattr(c, f.name) for f in fields(Cells)] for c in (self, parts)
        )
        kept = (np.delete(value, which, axis=0) for value in values)
        return Cells(*map(np.concatenate, zip(kept, others, strict=True)))


def cell_nodes(
    lower: Float[np.ndarray, " k"], upper: Float[np.ndarray, " k"]
) -> Float[np.ndarray, "k 15"]:
    """Nodes of the 15-point rule in every interval."""
    return ((lower + upper) / 2)[:, None] + ((upper - lower) / 2)[:, None] * NODES
