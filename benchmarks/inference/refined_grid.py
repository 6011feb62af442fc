"""Posteriors by the sweep against quadrature refined table by table.

    python -m benchmarks.inference.refined_grid [--tables 100] [--seed 0]

Mean and standard deviation of θ_c, and the evidence, are compared with those of the
quadrature of the tests, which refines its cells until the evidence is known to 1e-6.
"""

import argparse

import numpy as np

from benchmarks import tables
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.sweep.posterior import weighted_draws
from pushfit.fit.sweep.prior import make_target
from tests.oracle.cells import KRONROD
from tests.oracle.exact import exact_grid

PERCENTILES = [50.0, 99.0, 100.0]


def moments(theta: np.ndarray, log_mass: np.ndarray) -> np.ndarray:
    """Mean and standard deviation of θ_c on weighted points [deg]."""
    weight = np.exp(log_mass - np.max(log_mass)).ravel()
    mean = np.average(theta.ravel(), weights=weight)
    return np.array(
        [mean, np.sqrt(np.average((theta.ravel() - mean) ** 2, weights=weight))]
    )


def refined(setup: Setup) -> tuple[np.ndarray, float]:
    """Moments and log evidence by quadrature."""
    grid = exact_grid(setup, fit_least_squares(setup, reference_alpha=0.0))
    cells = grid.cells
    assert cells is not None, "A, B and C_rr are free"
    half = (cells.upper - cells.lower) / 2
    log_mass = cells.log_values + np.log(KRONROD) + np.log(half)[:, None]
    theta = np.degrees(np.arctan(np.exp(cells.nodes)))
    return moments(theta, log_mass), grid.log_evidence


def main() -> None:
    """Print percentiles of the differences."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    setups = tables.setups(tables.prior_tables(options.tables, seed=options.seed))
    found = []
    for index, setup in enumerate(setups):
        (mean, sd), log_evidence = refined(setup)
        own = weighted_draws(make_target(setup.problem, 0.0), seed=index)
        theta = samples_mapping(setup.problem, own.x, 0.0, (0.0, np.pi))["theta_c"]
        own_mean, own_sd = moments(theta, own.log_weights)
        distance = abs(own.log_evidence - log_evidence) / own.log_evidence_error
        found.append([abs(own_mean - mean) / sd, abs(own_sd / sd - 1), distance])
    print(f"{options.tables} tables, percentiles {PERCENTILES} of the difference")
    names = ("mean, in sd", "sd, relative", "ln evidence, in its error")
    for name, values in zip(names, np.array(found).T, strict=True):
        print(name, *(f"{v:.1e}" for v in np.percentile(values, PERCENTILES)))


if __name__ == "__main__":
    main()
