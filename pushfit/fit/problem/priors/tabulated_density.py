"""Densities of logs of positive numbers: as functions, and as tables.

Excluded: where they come from.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.fit.problem.priors.distributions import Prior, log_prior_at
from pushfit.model import as_float

# Distance from the centre at which a prior density ends here: 1e-31 of its mass lies
# beyond.
N_SD = 12.0
# Points of a table per standard deviation of the narrowest prior behind it; the cubic
# between them is then good to 1e-6.
POINTS_PER_SD, MAX_POINTS = 20, 16384
# Points on which a prior itself is read, about 85 per standard deviation.
N_PRIOR_POINTS = 2049
# A table ends where the log density is this far below its peak.
DEPTH = 80.0
# Smallest share of the scale of a prior that counts as positive.
SMALLEST_SHARE = 1e-9

Values = Float[np.ndarray, "..."]


@dataclass(frozen=True, slots=True, kw_only=True)
class LogDensity:
    """Density of the log of a positive number.

    Args:
        lower: Where it begins [ln unit].
        upper: Where it ends [ln unit].
        scale: About the smallest distance over which it changes [ln unit].
        log_prob: Log density at the log of the number; -inf outside.
    """

    lower: float
    upper: float
    scale: float
    log_prob: Callable[[Values], Values]


@dataclass(frozen=True, slots=True, kw_only=True)
class TabulatedDensity:
    """Log density on a regular grid.

    Args:
        start: First grid point [ln unit].
        step: Distance of grid points [ln unit].
        values: Log density at them, up to a constant.
    """

    start: float
    step: float
    values: Float[np.ndarray, " g"]

    @property
    def grid(self) -> Float[np.ndarray, " g"]:
        """All grid points [ln unit]."""
        return self.start + self.step * np.arange(self.values.size)

    def shifted(self, by: float) -> "TabulatedDensity":
        """Density of the log of a number that is exp(by) times as large."""
        return replace(self, start=self.start + by)


def prior_density(prior: Prior) -> LogDensity:
    """Density of the log of a positive parameter."""
    first, second = float(prior.first), float(prior.second)
    if prior.kind == "lognormal":
        centre, scale = np.log(first), second
        lower, upper = centre - N_SD * scale, centre + N_SD * scale
    elif prior.kind == "uniform":
        lower, upper = np.log(max(first, SMALLEST_SHARE * second)), np.log(second)
        scale = upper - lower
    else:
        top = first + N_SD * second
        lower, upper = (
            np.log(max(first - N_SD * second, SMALLEST_SHARE * top)),
            np.log(top),
        )
        scale = second / max(first + second, second)
    grid = np.linspace(lower, upper, N_PRIOR_POINTS)
    # Rounding at the bounds of a uniform prior must not leave its support.
    inside = as_float(np.clip(grid, lower + 1e-12, upper - 1e-12))
    return _interpolated(grid, np.asarray(log_prior_at(prior, inside)), float(scale))


def tabulate(density: LogDensity) -> TabulatedDensity:
    """Table of a density over the part of its range that holds all but e^-80 of it.

    Returns:
        The table; grid points beyond twice that depth are held there, to stay finite.
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
    step = float(high - low) / (n - 1)
    return TabulatedDensity(start=float(low), step=step, values=values)


def tabulated(density: LogDensity) -> LogDensity:
    """The same density, read from a table.

    Returns:
        Density with the ends of the table.
    """
    table = tabulate(density)
    return _interpolated(table.grid, table.values, density.scale)


def _interpolated(
    grid: Float[np.ndarray, " g"], values: Float[np.ndarray, " g"], scale: float
) -> LogDensity:
    """Density through given points: each shape of JAX arrays would be compiled anew."""
    spline = scipy.interpolate.CubicSpline(grid, values, extrapolate=False)
    return LogDensity(
        lower=float(grid[0]),
        upper=float(grid[-1]),
        scale=scale,
        log_prob=lambda u: np.nan_to_num(spline(u), nan=-np.inf),
    )
