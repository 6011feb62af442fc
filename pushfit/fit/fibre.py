"""Priors of the combinations A and B, and the six parameters given them.

A is K_sn and K_dn in series, B is K_st in series with C_d/L². The data know no more
than A and B, so given these the parameters are drawn from their prior: one number per
pair. Excluded: data.
"""

import abc
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.interpolate import CubicSpline

from pushfit.fit.priors import Prior
from pushfit.fit.quadrature import draw_from_nodes, gauss_legendre

# Distance from the centre at which a prior density ends here: 1e-31 of its mass lies
# beyond.
N_SD = 12.0
# Gauss nodes across a conditional density of up to 2 N_SD standard deviations.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
# Points of a table per standard deviation of the narrowest prior behind it; the cubic
# between them is then good to 1e-6.
POINTS_PER_SD, MAX_POINTS = 20, 16384
# Points on which a prior itself is read, about 85 per standard deviation.
N_PRIOR_POINTS = 2049
# How much finer a table is where one of a pair is fixed.
EDGE = 16.0
# A table ends where the log density is this far below its peak.
DEPTH = 80.0
# Smallest share of the scale of a prior that counts as positive.
TINY = 1e-9

Values = Float[np.ndarray, "..."]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogDensity:
    """Density of the log of a positive number.

    Args:
        lower: Where it begins.
        upper: Where it ends.
        scale: About the smallest distance over which it changes.
        log_prob: Log density between the two.
    """

    lower: float
    upper: float
    scale: float
    log_prob: Callable[[Values], Values]


class Table(eqx.Module):
    """Log density on a regular grid, for use inside compiled code.

    Args:
        start: First grid point.
        step: Distance between grid points.
        values: Log density on the grid.
        mean: Mean of the density.
        sd: Its standard deviation.
    """

    start: Float[Array, ""]
    step: Float[Array, ""]
    values: Float[Array, " g"]
    mean: Float[Array, ""]
    sd: Float[Array, ""]

    @property
    def end(self) -> Float[Array, ""]:
        """Last grid point."""
        return self.start + self.step * (self.values.size - 1)

    def log_prob(self, u: Float[Array, "*s"]) -> Float[Array, "*s"]:
        """Cubic through the four nearest grid points; -inf outside the grid."""
        place = (u - self.start) / self.step
        inside = (place >= 0) & (place <= self.values.size - 1)
        first = jnp.clip(jnp.floor(place) - 1, 0, self.values.size - 4)
        t = jnp.where(inside, place - first, 1.0)
        i = first.astype(int)
        a, b, c, d = (self.values[i + k] for k in range(4))
        cubic = (
            -a * (t - 1) * (t - 2) * (t - 3) / 6
            + b * t * (t - 2) * (t - 3) / 2
            - c * t * (t - 1) * (t - 3) / 2
            + d * t * (t - 1) * (t - 2) / 6
        )
        return jnp.where(inside, cubic, -jnp.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
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
    def solve(self, whole: Values, fixed: float, is_first: bool) -> tuple[Values, Values]:
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

    def split(
        self, whole: Float[np.ndarray, " n"], rng: np.random.Generator
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Draws of both logs, one pair for each value of the combination.

        Args:
            whole: Logs of the combination.
            rng: Source of randomness.

        Returns:
            Logs of the first and of the second.
        """
        n = whole.size
        a, b = self.first, self.second
        if not isinstance(a, LogDensity):
            is_fixed = not isinstance(b, LogDensity)
            second = b if is_fixed else self.solve(whole, a, is_first=True)[0]
            return np.full(n, a), np.broadcast_to(second, n)
        if not isinstance(b, LogDensity):
            return self.solve(whole, b, is_first=False)[0], np.full(n, b)
        t, log_joint, _ = self._joint(whole)
        drawn = draw_from_nodes(t, log_joint, rng.uniform(size=(n, 1)))[:, 0]
        return self.parts(whole, drawn)

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
        return gauss_legendre(log_joint, WEIGHTS, half)

    def _joint(self, whole: Values) -> tuple[np.ndarray, np.ndarray, Values]:
        """Nodes across the pair's own coordinate, log joint density, half width."""
        low, high = self.interval(whole)
        half = np.maximum((high - low) / 2, 1e-300)
        t = ((low + high) / 2)[..., None] + half[..., None] * NODES
        first, second = self.parts(whole[..., None], t)
        assert isinstance(self.first, LogDensity)
        assert isinstance(self.second, LogDensity)
        return t, self.first.log_prob(first) + self.second.log_prob(second), half


class Series(Pair):
    """Two springs in series, 1/X = 1/K_1 + 1/K_2; own coordinate ln(K_1/K_2)."""

    __slots__ = ()

    def whole(self, first: float, second: float) -> float:
        """-ln(1/K_1 + 1/K_2)."""
        return float(-np.logaddexp(-first, -second))

    def parts(self, whole: Values, t: Values) -> tuple[Values, Values]:
        """K_1 = X (1 + r), K_2 = X (1 + 1/r)."""
        return whole + np.logaddexp(0, t), whole + np.logaddexp(0, -t)

    def interval(self, whole: Values) -> tuple[Values, Values]:
        """From r = K_1/X - 1 and 1/r = K_2/X - 1 at the ends of both densities."""
        a, b = self.first, self.second
        assert isinstance(a, LogDensity)
        assert isinstance(b, LogDensity)
        low = np.maximum(_log_excess(a.lower - whole), -_log_excess(b.upper - whole))
        high = np.minimum(_log_excess(a.upper - whole), -_log_excess(b.lower - whole))
        return low, np.maximum(low, high)

    def solve(self, whole: Values, fixed: float, is_first: bool) -> tuple[Values, Values]:
        """1/K = 1/X - 1/K_fixed, the same for either spring."""
        log_share = np.log(-np.expm1(np.minimum(whole - fixed, -1e-15)))
        return whole - log_share, -log_share


class Quotient(Pair):
    """C_d/L², the spring that tilting adds; own coordinate ln L."""

    __slots__ = ()

    def whole(self, first: float, second: float) -> float:
        """Ln C_d - 2 ln L."""
        return first - 2 * second

    def parts(self, whole: Values, t: Values) -> tuple[Values, Values]:
        """C_d = q L²."""
        return whole + 2 * t, t + np.zeros_like(whole)

    def interval(self, whole: Values) -> tuple[Values, Values]:
        """Where L and q L² both have density."""
        a, b = self.first, self.second
        assert isinstance(a, LogDensity)
        assert isinstance(b, LogDensity)
        low = np.maximum(b.lower, (a.lower - whole) / 2)
        high = np.minimum(b.upper, (a.upper - whole) / 2)
        return low, np.maximum(low, high)

    def solve(self, whole: Values, fixed: float, is_first: bool) -> tuple[Values, Values]:
        """L = sqrt(C_d/q), or C_d = q L²."""
        if is_first:
            return (fixed - whole) / 2, np.full_like(whole, -np.log(2))
        return whole + 2 * fixed, np.zeros_like(whole)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fibre:
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

    def split(
        self,
        ln_A: Float[np.ndarray, " n"],
        ln_B: Float[np.ndarray, " n"],
        rng: np.random.Generator,
    ) -> dict[str, Float[np.ndarray, " n"]]:
        """Draws of the parameters from the prior given A and B.

        Args:
            ln_A: Log of A.
            ln_B: Log of B.
            rng: Source of randomness.

        Returns:
            Logs of K_sn, K_dn, K_st, C_d and L by name.
        """
        K_sn, K_dn = self.normal.split(ln_A, rng)
        K_st, rotation = self.tangential.split(ln_B, rng)
        C_d, L = self.rotation.split(rotation, rng)
        return {"K_sn": K_sn, "K_dn": K_dn, "K_st": K_st, "C_d": C_d, "L": L}


def make_fibre(
    priors: Mapping[str, Prior], fixed: Mapping[str, Float[Array, ""]]
) -> Fibre:
    """The fibre of a problem.

    Args:
        priors: Priors of the free parameters.
        fixed: Values of the fixed ones.

    Returns:
        Densities of all pairs.
    """

    def one(name: str) -> LogDensity | float:
        if name in priors:
            return prior_density(priors[name])
        return float(np.log(fixed[name]))

    rotation = Quotient(first=one("C_d"), second=one("L"))
    spring = rotation.density()
    if isinstance(spring, LogDensity):
        # A table first: the next integral over it would otherwise be a double one.
        spring = _tabulated(spring)
    return Fibre(
        normal=Series(first=one("K_sn"), second=one("K_dn")),
        tangential=Series(first=one("K_st"), second=spring),
        rotation=rotation,
        C_rr=one("C_rr"),
    )


def prior_density(prior: Prior) -> LogDensity:
    """Density of the log of a positive parameter.

    Args:
        prior: Its prior.

    Returns:
        Density with the ends beyond which nothing is left.
    """
    first, second = float(prior.first), float(prior.second)
    if prior.kind == "lognormal":
        centre, scale = np.log(first), second
        lower, upper = centre - N_SD * scale, centre + N_SD * scale
    elif prior.kind == "uniform":
        lower, upper = np.log(max(first, TINY * second)), np.log(second)
        scale = upper - lower
    else:
        top = first + N_SD * second
        lower, upper = np.log(max(first - N_SD * second, TINY * top)), np.log(top)
        scale = second / max(first + second, second)
    grid = np.linspace(lower, upper, N_PRIOR_POINTS)
    # Rounding at the bounds of a uniform prior must not leave its support.
    inside = jnp.asarray(np.clip(grid, lower + 1e-12, upper - 1e-12))
    return _interpolated(grid, np.asarray(prior.log_prob(inside)), float(scale))


def make_table(density: LogDensity) -> Table:
    """Table of a density over the part of its range that holds all but e^-80 of it.

    Args:
        density: Density of a log.

    Returns:
        Table; grid points beyond twice that depth are held there, to stay finite.
    """
    coarse = np.linspace(density.lower, density.upper, 513)
    level = np.nan_to_num(density.log_prob(coarse), nan=-np.inf)
    kept = np.flatnonzero(level > np.max(level) - DEPTH)
    low = coarse[max(kept[0] - 1, 0)]
    high = coarse[min(kept[-1] + 1, coarse.size - 1)]
    wanted = POINTS_PER_SD * (high - low) / density.scale
    # Powers of two: few shapes, few compilations.
    n = 1 << int(np.clip(np.ceil(np.log2(wanted)), 9, np.log2(MAX_POINTS)))
    grid = np.linspace(low, high, n)
    values = np.nan_to_num(density.log_prob(grid), nan=-np.inf)
    values = np.maximum(values, np.max(values) - 2 * DEPTH)
    mass = np.exp(values - np.max(values))
    mass[[0, -1]] /= 2
    mean = np.sum(mass * grid) / np.sum(mass)
    sd = np.sqrt(np.sum(mass * (grid - mean) ** 2) / np.sum(mass))
    return Table(
        start=jnp.asarray(low),
        step=jnp.asarray((high - low) / (n - 1)),
        values=jnp.asarray(values),
        mean=jnp.asarray(mean),
        sd=jnp.asarray(sd),
    )


def _tabulated(density: LogDensity) -> LogDensity:
    """The same density, read from a table."""
    table = make_table(density)
    values = np.asarray(table.values)
    grid = float(table.start) + float(table.step) * np.arange(values.size)
    return _interpolated(grid, values, density.scale)


def _interpolated(
    grid: Float[np.ndarray, " g"], values: Float[np.ndarray, " g"], scale: float
) -> LogDensity:
    """Density through given points: each shape of JAX arrays would be compiled anew."""
    spline = CubicSpline(grid, values, extrapolate=False)
    return LogDensity(
        lower=float(grid[0]),
        upper=float(grid[-1]),
        scale=scale,
        log_prob=lambda u: np.nan_to_num(spline(u), nan=-np.inf),
    )


def _log_excess(log_ratio: Values) -> Values:
    """Ln(exp(x) - 1), -inf where x is not positive."""
    safe = np.where(log_ratio > 0, log_ratio, 1.0)
    # ln(e^x - 1) = x + ln(1 - e^-x) does not overflow.
    return np.where(log_ratio > 0, safe + np.log(-np.expm1(-safe)), -np.inf)
