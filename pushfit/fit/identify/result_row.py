"""An identification as one flat row of a table, and as draws to pool with others'.

The names of the columns are those of `summary.json`, with `_low` and `_high` for the
ends of intervals. What must not be quoted (`pushfit.fit.assess.reporting_rules`) is
None here, too. Excluded: the row of an item of a batch (`pushfit.batch.rows`).
"""

import functools
import json
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.fit.assess.reporting_rules import is_trusted
from pushfit.fit.problem.priors.tabulated_density import TabulatedDensity
from pushfit.fit.results import Identification, Quantity
from pushfit.parameters import HALF_TURN, STIFFNESSES

Cell = float | int | str | None

# Enough for means and spreads of a population; ten thousand of them fit in memory.
N_POOLED = 400
# Draws that are pooled, by the name of the sample; all but the angle in logs.
POOLED = {"theta_c": "theta_c_deg", "A": "ln_A", "B": "ln_B", "C_rr": "ln_C_rr"}
# Begins the name of the column with the log prior density of each draw.
LOG_PRIOR = "log_prior_"
# Angles nearer to an end of 0° to 90° count as this far from it.
MIN_ANGLE_DEG = 1e-3
# A density of ln tan θ_c that is lower has hardly a draw of the prior behind it.
MIN_DENSITY = 1e-6


def row_values(identification: Identification) -> dict[str, Cell]:
    """Everything that one row of a table of results says.

    Returns:
        Cells by column, None where a number is unknown or not to be quoted. Sets are
        JSON lists of [low, high], null for an open end; warnings are codes joined by
        ";".
    """
    found, fit = identification, identification.fit
    row: dict[str, Cell] = {
        "status": found.status.name.lower(),
        "mechanics": found.mechanics,
    }
    for quantity in (found.theta_c, found.alpha_star):
        row |= _angle(quantity)
    # Without it readers cannot tell whether 183° is 3°.
    is_axis = found.config.reach.is_whole
    row["alpha_star_period_deg"] = HALF_TURN if is_axis else None
    row["reference_alpha_deg"] = found.reference_alpha_deg
    for quantity in (*found.combinations, *found.parameters):
        row |= _number(quantity)
    row |= {
        "sigma": float(np.median(fit.sigma)) if fit.sigma.size else None,
        "height_unit": found.table.unit,
        "n_pushes": found.table.n_pushes,
        "n_used": int(np.sum(found.used)),
        "chi_square": fit.chi_square,
        "chi_square_p_value": found.goodness_of_fit.p_value,
        "log_evidence": found.posterior.log_evidence,
        "engine": found.posterior.engine,
        "warnings": ";".join(dict.fromkeys(w.code for w in found.warnings)),
    }
    return {name: _known(value) for name, value in row.items()}


def pooled_draws(
    identification: Identification, priors: Mapping[str, TabulatedDensity]
) -> dict[str, Float[np.ndarray, " n"]]:
    """Draws of what can be compared between grasps, and their prior densities.

    Args:
        priors: Prior densities of ln A, ln B and ln C_rr; see
            `pushfit.fit.sweep.prior.marginal_priors`.

    Returns:
        `theta_c_deg` [deg], NaN where the contact never rolls, and `ln_A`, `ln_B` and
        `ln_C_rr`, draw by draw; with each the log of its marginal prior density there,
        in a column with `LOG_PRIOR` in front. Empty without a trusted posterior;
        without A and B where the push length is unknown; a fixed number has no density.
    """
    posterior = identification.posterior
    samples = posterior.samples
    if not is_trusted(identification):
        return {}
    is_length_known = identification.config.push.length_known
    draws = {}
    for name, column in POOLED.items():
        if name in samples and (is_length_known or name not in STIFFNESSES):
            values = np.asarray(samples[name], dtype=float)
            thinned = np.linspace(0, values.size - 1, min(N_POOLED, values.size))
            chosen = values[thinned.astype(int)]
            draws[column] = chosen if name == "theta_c" else np.log(chosen)
            if name in priors:
                log_prior = tabulated_prior(priors[name], draws[column])
                draws[f"{LOG_PRIOR}{column}"] = log_prior
    if "theta_c_deg" in draws and "theta_c" in posterior.prior_samples:
        log_prior = prior_of_angle(
            draws["theta_c_deg"], np.asarray(posterior.prior_samples["theta_c"])
        )
        if log_prior is not None:
            draws[f"{LOG_PRIOR}theta_c_deg"] = log_prior
    return draws


def tabulated_prior(
    prior: TabulatedDensity, values: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Log density from its table; 20 points per standard deviation need no cubic."""
    return np.interp(values, prior.grid, prior.values)


def prior_of_angle(
    degrees: Float[np.ndarray, " n"], prior_degrees: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " n"] | None:
    """Log density of θ_c per degree where the contact rolls; None if it is fixed.

    Args:
        degrees: Where it is wanted; NaN where it never rolls [deg].
        prior_degrees: Draws, likewise [deg].
    """
    u = _stretched(prior_degrees[np.isfinite(prior_degrees)])
    if u.size < N_POOLED or np.ptp(u) == 0:
        return None
    grid, density = _density(u.tobytes())
    at = _stretched(degrees)
    log_density = np.log(np.maximum(np.interp(at, grid, density), MIN_DENSITY))
    # du/dθ = 1/(sin θ cos θ) = 2 cosh u per radian
    return log_density + np.log(2 * np.cosh(at)) + np.log(np.pi / 180)


def _stretched(degrees: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Ln tan θ, which has no ends at which a kernel would lose mass."""
    inside = np.clip(degrees, MIN_ANGLE_DEG, 90 - MIN_ANGLE_DEG)
    return np.log(np.tan(np.radians(inside)))


@functools.lru_cache(maxsize=256)
def _density(
    draws: bytes,
) -> tuple[Float[np.ndarray, " g"], Float[np.ndarray, " g"]]:
    """Grid and density of draws, which many tables share."""
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - slow to load

    grid, density, _ = array_stats.kde(np.frombuffer(draws, dtype=float))
    return grid, density


def _angle(quantity: Quantity) -> dict[str, Cell]:
    """Columns of an angle, its set among them.

    The interval of an axis may end beyond a half turn; its estimate lies between its
    ends, there as well.
    """
    name, estimate = quantity.name, quantity.estimate
    low, high = quantity.interval or (None, None)
    if low is not None and estimate is not None and estimate < low:
        estimate = low + (estimate - low) % HALF_TURN
    return {
        f"{name}_deg": estimate,
        f"{name}_low_deg": low,
        f"{name}_high_deg": high,
        f"{name}_sets": json.dumps(quantity.sets) if quantity.sets else None,
        f"{name}_verdict": quantity.verdict.value,
    }


def _number(quantity: Quantity) -> Mapping[str, Cell]:
    """Columns of a parameter or combination."""
    name = quantity.name
    low, high = quantity.interval or (None, None)
    return {
        name: quantity.estimate,
        f"{name}_low": low,
        f"{name}_high": high,
        f"{name}_unit": quantity.unit,
        f"{name}_verdict": quantity.verdict.value,
    }


def _known(value: Cell) -> Cell:
    """Cell with None for what is not finite, and Python's own number types."""
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
