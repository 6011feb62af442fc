"""What a push does to draws, against densities of SciPy."""

import numpy as np
import pytest
from scipy import stats

from pushfit.explore.belief.belief import Belief
from pushfit.model import Grasp
from tests.tolerances import EXACT

N = 50
NOISE = {
    "normal": stats.norm(),
    # Of unit variance.
    "student_t": stats.t(4, scale=2**-0.5),
}


@pytest.mark.parametrize("likelihood", NOISE)
def test_a_push_weighs_draws_by_the_density_of_its_heights(likelihood):
    """The sd stated with a height adds to what is not stated, and both are sds."""
    rng = np.random.default_rng(0)
    scatter, predicted = rng.uniform(0.1, 0.3, (1, N)), rng.normal(size=(1, N))
    height, sd = np.array([0.3]), np.array([0.2])
    belief = Belief(
        samples={},
        log_weights=np.zeros(N),
        scatter=scatter,
        sd=np.zeros(1),
        is_sd_used=True,
        channels=("height",),
        grasp=Grasp(push_length=0.005),
        likelihood=likelihood,
        is_guess=False,
    )
    found = belief.updated(height, predicted, sd).weights
    noise = np.hypot(scatter[0], sd)
    density = NOISE[likelihood].pdf((height - predicted[0]) / noise) / noise
    np.testing.assert_allclose(found, density / density.sum(), rtol=EXACT)
