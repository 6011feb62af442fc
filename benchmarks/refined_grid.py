"""Posteriors of many tables side by side, against quadrature refined table by table.

    python -m benchmarks.refined_grid [--tables 500] [--seed 0]

Mean and standard deviation of θ_c of every table by lanes are compared with those of
the adaptive engine, which refines its cells until the evidence is known to 1e-6.
"""

import argparse

import jax
import numpy as np
from pushfit.fit.lane_posterior import integrate_lanes

from benchmarks import tables
from pushfit.fit.lane_fit import fit_lanes
from pushfit.fit.lane_results import N_LANES, Ready
from pushfit.fit.least_squares import fit_least_squares
from pushfit.fit.quadrature import KRONROD
from tests.oracle.exact import exact_grid

PERCENTILES = [50.0, 99.0, 100.0]


def moments(u: np.ndarray, log_mass: np.ndarray) -> np.ndarray:
    """Mean and standard deviation of θ_c on weighted nodes of ln tan θ_c [deg]."""
    weight = np.exp(log_mass - np.max(log_mass)).ravel()
    theta = np.degrees(np.arctan(np.exp(u))).ravel()
    mean = np.average(theta, weights=weight)
    return np.array([mean, np.sqrt(np.average((theta - mean) ** 2, weights=weight))])


def refined(item: Ready) -> np.ndarray:
    """Moments by the adaptive engine."""
    grid = exact_grid(item.setup, fit_least_squares(item.setup, reference_alpha=0.0))
    cells = grid.cells
    assert cells is not None, "A, B and C_rr are free"
    half = (cells.upper - cells.lower) / 2
    return moments(
        cells.nodes, cells.log_values + np.log(KRONROD) + np.log(half)[:, None]
    )


def main() -> None:
    """Print percentiles of the differences."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    items = tables.in_lanes(tables.prior_tables(options.tables, seed=options.seed))
    found = []
    for first in range(0, len(items), N_LANES):
        chunk = items[first : first + N_LANES]
        lanes = tables.stacked([*chunk, *chunk[-1:] * (N_LANES - len(chunk))])
        posterior = integrate_lanes(lanes, fit_lanes(lanes))
        u, log_mass = jax.tree.map(np.asarray, (posterior.u, posterior.log_mass))
        for lane, item in enumerate(chunk):
            mean, sd = refined(item)
            own_mean, own_sd = moments(u[lane], log_mass[lane])
            found.append([abs(own_mean - mean) / sd, abs(own_sd / sd - 1)])
    print(f"{options.tables} tables, percentiles {PERCENTILES} of the difference")
    for name, values in zip(
        ("mean, in sd", "sd, relative"), np.array(found).T, strict=True
    ):
        print(name, *(f"{v:.1e}" for v in np.percentile(values, PERCENTILES)))


if __name__ == "__main__":
    main()
