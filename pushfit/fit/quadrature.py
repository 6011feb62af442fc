"""One-dimensional rules with an error of their own, and draws from their nodes.

Everything works on logs of densities: posteriors span hundreds of e-folds. Excluded:
what is integrated.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from scipy.special import logsumexp

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


@dataclass(frozen=True, slots=True, kw_only=True)
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

        def merged(name: str) -> np.ndarray:
            kept = np.delete(getattr(self, name), which, axis=0)
            return np.concatenate([kept, getattr(parts, name)])

        return Cells(
            lower=merged("lower"),
            upper=merged("upper"),
            log_values=merged("log_values"),
            inner_error=merged("inner_error"),
        )


def cell_nodes(
    lower: Float[np.ndarray, " k"], upper: Float[np.ndarray, " k"]
) -> Float[np.ndarray, "k 15"]:
    """Nodes of the 15-point rule in every interval."""
    return ((lower + upper) / 2)[:, None] + ((upper - lower) / 2)[:, None] * NODES


def gauss_legendre(
    log_f: Float[np.ndarray, "... m"],
    weights: Float[np.ndarray, " m"],
    half_width: Float[np.ndarray, "..."],
) -> Float[np.ndarray, "..."]:
    """Log integral of exp(log_f) given at Gauss nodes of intervals."""
    return logsumexp(log_f, b=weights, axis=-1) + np.log(half_width)


def draw_from_nodes(
    nodes: Float[np.ndarray, "n m"],
    log_density: Float[np.ndarray, "n m"],
    uniform: Float[np.ndarray, "n d"],
) -> Float[np.ndarray, "n d"]:
    """Draws from densities that are exponential between neighbouring nodes.

    A chord of a concave log density lies below it by nearly the same share
    everywhere, so the draws are right to fourth order in the distance of the nodes.

    Args:
        nodes: Ascending nodes of each density.
        log_density: Log of the density there, unnormalised; -inf allowed.
        uniform: Numbers in (0, 1) that become the draws.

    Returns:
        Draws, as many per density as there are numbers.
    """
    top = np.max(log_density, axis=1, keepdims=True)
    level = np.maximum(log_density - top, -700.0)
    step, rise = np.diff(nodes, axis=1), np.diff(level, axis=1)
    # ∫ exp over a segment: exp(left) (e^rise - 1) / rise, and its limit 1 at rise 0.
    is_flat = np.abs(rise) < 1e-9
    safe = np.where(is_flat, 1.0, rise)
    mass = np.exp(level[:, :-1]) * step * np.where(is_flat, 1.0, np.expm1(rise) / safe)
    total = np.cumsum(mass, axis=1)
    wanted = uniform * total[:, -1:]
    rows = np.arange(nodes.shape[0])[:, None]
    segment = np.sum(total[:, None, :] < wanted[:, :, None], axis=2)
    segment = np.minimum(segment, step.shape[1] - 1)
    before = np.where(segment > 0, total[rows, segment - 1], 0.0)
    share = (wanted - before) / np.maximum(mass[rows, segment], 1e-300)
    share = np.clip(share, 0.0, 1.0)
    slope, flat = safe[rows, segment], is_flat[rows, segment]
    part = np.where(flat, share, np.log1p(share * np.expm1(slope)) / slope)
    return nodes[rows, segment] + part * step[rows, segment]
