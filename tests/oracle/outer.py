"""The cells in u = ln tan θ_c that the posterior integral starts from.

They end at every elevation that was pushed, where the integrand has a kink, and crowd
around every mode of the likelihood. Excluded: integrating.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import FitResult
from tests.oracle.integrand import Integrand

# Prior standard deviations that the range covers.
N_SD = 10.0
# Cells around a mode grow by this factor from this many standard deviations on.
FIRST, GROWTH = 3.0, 5.0
# Widest cell to start from [log units].
WIDEST = 1.5
MAX_MODES = 8
ORDER = ("ln_A", "ln_B", "ln_C_rr")
# Of u = ln B - ln C_rr - ln A.
GRADIENT = {"ln_A": -1.0, "ln_B": 1.0, "ln_C_rr": -1.0}


def first_edges(integrand: Integrand, fit: FitResult) -> Float[np.ndarray, " e"]:
    """Ends of the cells to start from, ascending.

    Args:
        fit: Least squares; its modes are where the integrand peaks.
    """
    problem = integrand.problem
    used = np.any(np.asarray(problem.mask), axis=0)
    kinks = np.unique(np.round(np.asarray(problem.pushes.theta)[used], 9))
    kinks = np.log(np.tan(kinks if kinks.size else np.array([np.pi / 4])))
    tables = (integrand.prior_A, integrand.prior_B, integrand.prior_C)
    sds = {n: float(t.sd) for n, t in zip(ORDER, tables, strict=True)}
    ln_A, ln_B, ln_C = (float(table.mean) for table in tables)
    spread = N_SD * float(np.sqrt(sum(sd**2 for sd in sds.values())))
    centres, scales = _modes(problem, fit, sds)
    usual = ln_B - ln_C - ln_A
    low = min([kinks[0], usual - spread, *(centres - 2)])
    high = max([kinks[-1], usual + spread, *(centres + 2)])
    edges = [low, high, *kinks]
    for centre, scale in zip(centres, scales, strict=True):
        reach = FIRST * scale
        while reach < WIDEST:
            edges += [centre - reach, centre + reach]
            reach *= GROWTH
    # Edges of different modes that all but coincide would make empty cells.
    tolerance = min([*(scales / 2), 0.01])
    ordered = np.unique(edges)
    kept = ordered[np.r_[True, np.diff(ordered) > tolerance]]
    kept[-1] = ordered[-1]
    filled = [
        np.linspace(a, b, max(2, int(np.ceil((b - a) / WIDEST)) + 1))[:-1]
        for a, b in itertools.pairwise(kept)
    ]
    return np.concatenate([*filled, kept[-1:]])


def _modes(
    problem: Problem, fit: FitResult, sds: dict[str, float]
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """u of every mode and about the width of its peak."""
    names = problem.data_names
    gradient = np.array([GRADIENT[name] for name in names])
    precision = np.diag([1 / sds[name] ** 2 for name in names])
    centres, scales = [], []
    for mode in fit.modes[:MAX_MODES]:
        y = np.array([mode.coordinates[name] for name in names])
        jacobian = np.asarray(_jacobian(problem, jnp.asarray(y)))
        covariance = np.linalg.inv(jacobian.T @ jacobian + precision)
        scales.append(float(np.sqrt(gradient @ covariance @ gradient)))
        centres.append(float(gradient @ y))
    return np.array(centres), np.array(scales)


@compiled
def _jacobian(problem: Problem, y: Float[Array, " q"]) -> Float[Array, "m q"]:
    return jax.jacfwd(problem.data_residuals)(y)
