"""Prior densities that tables share: what scales with the unit of the heights."""

import numpy as np
import pytest

from pushfit.fit.problem.setup import build_problem
from pushfit.fit.sweep.prior import marginal_priors
from tests.fit.tables import case_table, config
from tests.oracle.priors import moments
from tests.problems import CASES

FACTOR = 250.0
N_DRAWS = 4000
# Equal on paper: rounding of numbers near 10, with ample room.
SHIFT_TOL = 1e-9
# N normal draws tell a standard deviation to 1 / sqrt(2 N) = 1.1 %; these have tails.
SD_TOL = 0.06


@pytest.fixture(scope="module")
def problems():
    """Heights in the sensor's own unit, and in one that is smaller by a factor."""
    table = case_table(CASES["firm"], noise=0.02)
    found = []
    for factor in (1.0, FACTOR):
        frame = table.frame.drop(columns=["push", "repeat"])
        frame = frame.rename(
            columns=lambda name: (
                name.removesuffix("_n") + "_au" if name.startswith("height") else name
            )
        )
        heights = [name for name in frame if name.startswith("height")]
        frame[heights] *= factor
        found.append(build_problem(type(table).from_frame(frame), config()).problem)
    return found


def test_another_unit_shifts_the_densities_of_stiffnesses_alone(problems):
    one, other = (marginal_priors(problem) for problem in problems)
    assert set(one) == {"A", "B", "C_rr"}
    for name, table in one.items():
        shift = 0.0 if name == "C_rr" else np.log(FACTOR)
        assert np.array_equal(table.values, other[name].values)
        assert float(other[name].start - table.start) == pytest.approx(
            shift, abs=SHIFT_TOL
        )


def test_tables_are_densities_of_draws_of_the_parameters(problems):
    rng = np.random.default_rng(0)
    draws = {
        name: np.exp(prior.sample(rng, N_DRAWS))
        for name, prior in problems[1].priors.items()
    }
    wanted = {
        "A": 1 / (1 / draws["K_sn"] + 1 / draws["K_dn"]),
        "B": 1 / (1 / draws["K_st"] + draws["L"] ** 2 / draws["C_d"]),
        "C_rr": draws["C_rr"],
    }
    for name, table in marginal_priors(problems[1]).items():
        logs = np.log(wanted[name])
        mean, sd = moments(table)
        # Four standard errors of the mean.
        assert np.mean(logs) == pytest.approx(mean, abs=4 * sd / np.sqrt(N_DRAWS))
        assert np.std(logs) == pytest.approx(sd, rel=SD_TOL)
