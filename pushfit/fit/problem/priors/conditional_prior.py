"""Priors of the combinations A and B, and the six parameters given them.

A is K_sn and K_dn in series, B is K_st in series with C_d/L². The data know no more
than A and B, so given these the parameters are drawn from their prior: one number per
pair. Excluded: data.
"""

import abc
import functools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Array, Float

from pushfit.fit.problem.priors.distributions import Prior
from pushfit.fit.problem.priors.quadrature import draw_from_nodes
from pushfit.fit.problem.priors.tabulated_density import (
    LogDensity,
    Values,
    prior_density,
    tabulate,
    tabulated,
)
from pushfit.parameters import TINY

# Gauss nodes across a conditional density of up to 2 N_SD standard deviations.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
# Table of quantiles: values of the combination and normal scores, where straight lines
# between them err by less than a thousandth of a standard deviation.
N_ROWS, SCORES = 513, np.linspace(-5.0, 5.0, 201)
# How much finer a table is where one of a pair is fixed.
EDGE = 16.0
# Stands for the log of a density of 0: where it is 0 at all nodes, differences of it
# are no NaN, and the quantiles those of a flat one.
LOG_OF_NONE = -1e300
# Log ratio by which springs in series are softer than either at least, about what
# rounding leaves of it: the other spring stays finite. Not tuned.
SOFTER = 1e-15


@dataclass(frozen=True, kw_only=True)  # no slots: quantiles are cached
class Pair(abc.ABC):
    """A combination of two independent positive numbers, and its parts given it.

    Args:
        first: Density of the log of the first, or its log where it is fixed.
        second: The same of the second.
    """

    first: LogDensity | float
    second: LogDensity | float

    @abc.abstractmethod
    def whole(self, first: float, second: float) -> float:
        """Log of the combination, from the logs of both."""

    @abc.abstractmethod
    def parts(self, whole: Values, t: Values) -> tuple[Values, Values]:
        """Logs of both, from the combination and the pair's own coordinate."""

    @abc.abstractmethod
    def interval(self, whole: Values) -> tuple[Values, Values]:
        """Range of the pair's own coordinate in which both densities are positive."""

    @abc.abstractmethod
    def solve(
        self, whole: Values, fixed: float, is_first: bool
    ) -> tuple[Values, Values]:
        """Log of the free one of the pair, and of its slope against the combination."""

    def density(self) -> LogDensity | float:
        """Density of the log of the combination, or its log where both are fixed."""
        a, b = self.first, self.second
        if not isinstance(a, LogDensity) and not isinstance(b, LogDensity):
            return self.whole(a, b)
        ends = [
            self.whole(x, y)
            for x in ((a.lower, a.upper) if isinstance(a, LogDensity) else (a,))
            for y in ((b.lower, b.upper) if isinstance(b, LogDensity) else (b,))
        ]
        scales = [d.scale for d in (a, b) if isinstance(d, LogDensity)]
        # With one spring fixed the density has a steep edge at that spring.
        scale = min(scales) if len(scales) == 2 else scales[0] / EDGE
        return LogDensity(
            lower=min(ends), upper=max(ends), scale=scale, log_prob=self._log_prob
        )

    @functools.cached_property
    def quantiles(self) -> tuple[Float[np.ndarray, " r"], Float[np.ndarray, "r s"]]:
        """Values of the combination, and the quantile at each of `SCORES`."""
        density = self.density()
        if not isinstance(density, LogDensity):
            raise TypeError("both of the pair are fixed, and have no quantiles")
        grid = tabulate(density).grid
        rows = np.linspace(grid[0], grid[-1], N_ROWS)
        t, log_joint, _ = self._joint(rows)
        probs = np.broadcast_to(scipy.special.ndtr(SCORES), (N_ROWS, SCORES.size))
        # The outermost rows may lie outside the range of both.
        return rows, draw_from_nodes(t, np.maximum(log_joint, LOG_OF_NONE), probs)

    def _log_prob(self, whole: Values) -> Values:
        """Log density of the combination."""
        for fixed, free, is_first in (
            (self.first, self.second, True),
            (self.second, self.first, False),
        ):
            if not isinstance(fixed, LogDensity) and isinstance(free, LogDensity):
                value, log_slope = self.solve(whole, fixed, is_first)
                return free.log_prob(value) + log_slope
        _, log_joint, half = self._joint(whole)
        return scipy.special.logsumexp(log_joint, b=WEIGHTS, axis=-1) + np.log(half)

    def _joint(
        self, whole: Values
    ) -> tuple[Float[np.ndarray, "*n t"], Float[np.ndarray, "*n t"], Values]:
        """Nodes across the pair's own coordinate, log joint density, half width."""
        low, high = self.interval(whole)
        half = np.maximum((high - low) / 2, TINY)
        t = ((low + high) / 2)[..., None] + half[..., None] * NODES
        first, second = self.parts(whole[..., None], t)
        a, b = self._densities()
        return t, a.log_prob(first) + b.log_prob(second), half

    def _densities(self) -> tuple[LogDensity, LogDensity]:
        """Densities of both, of which neither is fixed."""
        if isinstance(self.first, LogDensity) and isinstance(self.second, LogDensity):
            return self.first, self.second
        raise TypeError("one of the pair is fixed, and has no density")


class Series(Pair):
    """Two springs in series, 1/X = 1/K_1 + 1/K_2; own coordinate ln(K_1/K_2)."""

    def whole(self, first: float, second: float) -> float:
        """Ln X = -ln(1/K_1 + 1/K_2), of ln K_1 and ln K_2."""
        return float(-np.logaddexp(-first, -second))

    def parts(self, whole: Values, t: Values) -> tuple[Values, Values]:
        """K_1 = X (1 + r), K_2 = X (1 + 1/r)."""
        return whole + np.logaddexp(0, t), whole + np.logaddexp(0, -t)

    def interval(self, whole: Values) -> tuple[Values, Values]:
        """From r = K_1/X - 1 and 1/r = K_2/X - 1 at the ends of both densities."""
        a, b = self._densities()
        low = np.maximum(_log_excess(a.lower - whole), -_log_excess(b.upper - whole))
        high = np.minimum(_log_excess(a.upper - whole), -_log_excess(b.lower - whole))
        return low, np.maximum(low, high)

    def solve(
        self, whole: Values, fixed: float, is_first: bool
    ) -> tuple[Values, Values]:
        """1/K = 1/X - 1/K_fixed, the same for either spring."""
        log_share = np.log(-np.expm1(np.minimum(whole - fixed, -SOFTER)))
        return whole - log_share, -log_share


class Quotient(Pair):
    """C_d/L², the spring that tilting adds; own coordinate ln L."""

    def whole(self, first: float, second: float) -> float:
        """Ln q = ln C_d - 2 ln L, of ln C_d and ln L."""
        return first - 2 * second

    def parts(self, whole: Values, t: Values) -> tuple[Values, Values]:
        """Ln C_d = ln q + 2 ln L, and ln L."""
        return whole + 2 * t, t + np.zeros_like(whole)

    def interval(self, whole: Values) -> tuple[Values, Values]:
        """Where L and q L² both have density."""
        a, b = self._densities()
        low = np.maximum(b.lower, (a.lower - whole) / 2)
        high = np.minimum(b.upper, (a.upper - whole) / 2)
        return low, np.maximum(low, high)

    def solve(
        self, whole: Values, fixed: float, is_first: bool
    ) -> tuple[Values, Values]:
        """L = sqrt(C_d/q), or C_d = q L²."""
        if is_first:
            return (fixed - whole) / 2, np.full_like(whole, -np.log(2))
        return whole + 2 * fixed, np.zeros_like(whole)


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionalPrior:
    """How the six parameters hang on A, B and C_rr.

    Args:
        normal: K_sn and K_dn.
        tangential: K_st and the spring C_d/L².
        rotation: C_d and L.
        C_rr: Its density, or its log where it is fixed.
    """

    normal: Series
    tangential: Series
    rotation: Quotient
    C_rr: LogDensity | float


def make_conditional_prior(
    priors: Mapping[str, Prior], fixed: Mapping[str, float | Float[Array, ""]]
) -> ConditionalPrior:
    """The conditional prior of a problem."""

    def one(name: str) -> LogDensity | float:
        if name in priors:
            return prior_density(priors[name])
        return float(np.log(fixed[name]))

    rotation = Quotient(first=one("C_d"), second=one("L"))
    spring = rotation.density()
    if isinstance(spring, LogDensity):
        # A table first: the next integral over it would otherwise be a double one.
        spring = tabulated(spring)
    return ConditionalPrior(
        normal=Series(first=one("K_sn"), second=one("K_dn")),
        tangential=Series(first=one("K_st"), second=spring),
        rotation=rotation,
        C_rr=one("C_rr"),
    )


def _log_excess(log_ratio: Values) -> Values:
    """Ln(exp(x) - 1), -inf where x is not positive."""
    safe = np.where(log_ratio > 0, log_ratio, 1.0)
    # ln(e^x - 1) = x + ln(1 - e^-x) does not overflow.
    return np.where(log_ratio > 0, safe + np.log(-np.expm1(-safe)), -np.inf)
