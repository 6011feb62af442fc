"""An identification as one flat row of a table, and as draws to pool with others'.

The names of the columns are those of `summary.json`, with `_low` and `_high` for the
ends of intervals. What must not be quoted (`pushfit.fit.quoting`) is None here, too.
"""

import json
import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.fit.quoting import STIFFNESSES, is_trusted, quoted
from pushfit.fit.results import Identification, Quantity

Cell = float | int | str | None

# Enough for means and spreads of a population; ten thousand of them fit in memory.
N_POOLED = 400
# Draws that are pooled, by the name of the sample; all but the angle in logs.
POOLED = {"theta_c": "theta_c_deg", "A": "ln_A", "B": "ln_B", "C_rr": "ln_C_rr"}


def flat_values(identification: Identification) -> dict[str, Cell]:
    """Everything that one row of a table of results says.

    Args:
        identification: The result.

    Returns:
        Cells by column, None where a number is unknown or not to be quoted. Sets are
        JSON lists of [low, high], null for an open end; warnings are codes joined by
        ";".
    """
    found, fit = identification, identification.fit
    row: dict[str, Cell] = {"status": found.status.name.lower()}
    for quantity in (found.theta_c, found.alpha_star):
        row |= _angle(quoted(quantity, found))
    row["reference_alpha_deg"] = found.reference_alpha_deg
    for quantity in (*found.combinations, *found.parameters):
        row |= _number(quoted(quantity, found))
    row |= {
        "sigma": float(np.median(fit.sigma)) if fit.sigma.size else None,
        "height_unit": found.table.unit,
        "n_pushes": found.table.n_pushes,
        "n_used": int(np.sum(found.used)),
        "chi_square": fit.chi_square,
        "chi_square_p": found.goodness_of_fit.p_value,
        "log_evidence": found.posterior.log_evidence,
        "engine": found.posterior.engine,
        "warnings": ";".join(dict.fromkeys(w.code for w in found.warnings)),
    }
    return {name: _known(value) for name, value in row.items()}


def pooled_draws(identification: Identification) -> dict[str, Float[np.ndarray, " n"]]:
    """Draws of what can be compared between grasps.

    Args:
        identification: The result.

    Returns:
        `theta_c_deg` [deg], NaN where the contact never rolls, and `ln_A`, `ln_B` and
        `ln_C_rr`, draw by draw. Empty without a trusted posterior; without A and B
        where the push length is unknown.
    """
    samples = identification.posterior.samples
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
    return draws


def _angle(quantity: Quantity) -> dict[str, Cell]:
    """Columns of an angle, its set among them."""
    name = quantity.name
    low, high = quantity.interval or (None, None)
    return {
        f"{name}_deg": quantity.estimate,
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
