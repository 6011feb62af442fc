"""Densities and draws of the parameters behind A and B, from the package's tables."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from pushfit.fit.problem.priors.conditional_prior import (
    SCORES,
    ConditionalPrior,
    Pair,
)
from pushfit.fit.problem.priors.tabulated_density import (
    LogDensity,
    TabulatedDensity,
    tabulate,
)
from pushfit.model import as_float


class DensityTable(eqx.Module):
    """Log density on a regular grid, for use inside compiled code.

    Args:
        start: First grid point [ln unit].
        step: Distance of grid points [ln unit].
        values: Log density at them, up to a constant.
        mean: Mean of the log [ln unit].
        sd: Standard deviation of the log.
    """

    start: Float[Array, ""]
    step: Float[Array, ""]
    values: Float[Array, " g"]
    mean: Float[Array, ""]
    sd: Float[Array, ""]


def density_table(density: LogDensity) -> DensityTable:
    """Table of a density, with its moments."""
    table = tabulate(density)
    mean, sd = moments(table)
    return DensityTable(
        start=as_float(table.start),
        step=as_float(table.step),
        values=as_float(table.values),
        mean=as_float(mean),
        sd=as_float(sd),
    )


def moments(table: TabulatedDensity) -> tuple[float, float]:
    """Mean and standard deviation of the log, by the trapezoidal rule."""
    grid, mass = table.grid, np.exp(table.values - np.max(table.values))
    mass[[0, -1]] /= 2
    mean = np.sum(mass * grid) / np.sum(mass)
    return float(mean), float(np.sqrt(np.sum(mass * (grid - mean) ** 2) / np.sum(mass)))


def end(table: DensityTable) -> Float[Array, ""]:
    """Last grid point."""
    return table.start + table.step * (table.values.size - 1)


def log_density(table: DensityTable, u: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Cubic through the four nearest grid points; -inf outside the grid."""
    place = (u - table.start) / table.step
    inside = (place >= 0) & (place <= table.values.size - 1)
    first = jnp.clip(jnp.floor(place) - 1, 0, table.values.size - 4)
    t = jnp.where(inside, place - first, 1.0)
    i = first.astype(int)
    a, b, c, d = (table.values[i + k] for k in range(4))
    cubic = (
        -a * (t - 1) * (t - 2) * (t - 3) / 6
        + b * t * (t - 2) * (t - 3) / 2
        - c * t * (t - 1) * (t - 3) / 2
        + d * t * (t - 1) * (t - 2) / 6
    )
    return jnp.where(inside, cubic, -jnp.inf)


def drawn(
    prior: ConditionalPrior,
    ln_A: Float[np.ndarray, " n"],
    ln_B: Float[np.ndarray, " n"],
    scores: Float[np.ndarray, "3 n"],
) -> dict[str, Float[np.ndarray, " n"]]:
    """Logs of the parameters behind A and B, drawn from the prior given these.

    Args:
        scores: Standard normal numbers that pick the draws.
    """
    K_sn, K_dn = _both(prior.normal, ln_A, scores[0])
    K_st, rotation = _both(prior.tangential, ln_B, scores[1])
    C_d, L = _both(prior.rotation, rotation, scores[2])
    return {"K_sn": K_sn, "K_dn": K_dn, "K_st": K_st, "C_d": C_d, "L": L}


def _both(
    pair: Pair, whole: Float[np.ndarray, " n"], scores: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Logs of both of a pair, from those of its combination."""
    rows, table = pair.quantiles
    places = [
        (whole - rows[0]) / (rows[-1] - rows[0]) * (rows.size - 1),
        (scores - SCORES[0]) / (SCORES[-1] - SCORES[0]) * (SCORES.size - 1),
    ]
    t = scipy.ndimage.map_coordinates(table, places, order=1, mode="nearest")
    return pair.parts(whole, np.clip(t, *pair.interval(whole)))
