"""emcee against quadrature, over tables from the prior, some of them with two modes.

The two share the model and the priors, but neither coordinates nor method, and
quadrature needs no start and no convergence: where they differ by more than
Monte-Carlo error the chain is wrong.
"""

import numpy as np
import pytest

from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.results import FitStatus
from pushfit.fit.sampler.emcee_posterior import sample_posterior
from tests.fit.sweep.agreement import z_values
from tests.fit.tables import case_table, setup_of, tables_of_the_prior
from tests.oracle.exact import exact_posterior
from tests.problems import CASES
from tests.tolerances import MAX_Z

ALPHA, REACH = np.pi / 2, (0.0, np.pi)
N_EXACT = 40_000
# Of so many tables with truths from the priors, those that are compared: first those
# whose posterior of θ_c has two modes.
N_POOL = 100
TWO_MODES = (3, 26, 27, 38, 50, 53, 70, 74)
OTHERS = (5, 6, 12, 19, 21, 39, 51, 63, 79, 84, 95, 97)
# Between two modes lies a bin with less than so much of the fullest one on either side,
# and with at least so much of the posterior on either side.
BIN_DEG, DIP, LEAST_SHARE = 2.0, 0.5, 0.05


@pytest.fixture(scope="module")
def pool():
    return tables_of_the_prior(N_POOL)


def assert_agreement(table):
    """Both engines say the same; returns what quadrature says."""
    setup = setup_of(table)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    words = {"reference_alpha": ALPHA, "reach": REACH}
    chain = sample_posterior(setup, fit, seed=0, **words)
    assert chain.status is FitStatus.OK, chain.diagnostics.problems
    exact = exact_posterior(setup, fit, n_draws=N_EXACT, seed=1, **words)
    z = z_values(setup.problem, chain, exact, alpha=ALPHA, reach=REACH)
    worst = max(z, key=lambda key: abs(z[key]))
    print(f"largest |z| {abs(z[worst]):.2f}, of {worst}")
    # 23 tables make 805 comparisons: a false alarm in one of 20 sets of seeds.
    assert abs(z[worst]) < MAX_Z, z
    return exact


def has_two_modes(theta_deg):
    counts, _ = np.histogram(theta_deg, np.arange(0.0, 90.1, BIN_DEG))
    # Neighbours together: a hard switch makes ripples one bin wide.
    counts = np.convolve(counts, [0.25, 0.5, 0.25], mode="same")
    for k in range(1, counts.size - 1):
        left, right = counts[:k], counts[k + 1 :]
        is_dip = counts[k] < DIP * min(left.max(), right.max())
        if is_dip and min(left.sum(), right.sum()) > LEAST_SHARE * counts.sum():
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize("index", [*TWO_MODES, *OTHERS])
def test_chains_agree_with_quadrature_over_the_prior(pool, index):
    exact = assert_agreement(pool[index])
    assert has_two_modes(exact.samples["theta_c"]) == (index in TWO_MODES)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["blind_magnitude", "one_sided", "paper"])
def test_chains_agree_with_quadrature_in_hard_cases(case):
    assert_agreement(case_table(CASES[case], noise=0.03, seed=1))
