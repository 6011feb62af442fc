"""What a push does to draws, against densities of SciPy."""

import numpy as np
import pytest
from scipy import stats

from pushfit.explore.belief.belief import Belief
from pushfit.model import Grasp
from tests.tolerances import EXACT, MAX_Z

N, N_HEIGHTS = 50, 100_000
NOISE = {
    "normal": stats.norm(),
    # Of unit variance.
    "student_t": stats.t(4, scale=2**-0.5),
}


def believed(scatter, *, sd, **changes):
    usual = {"is_sd_used": True, "likelihood": "normal"}
    n = scatter.shape[1]
    return Belief(
        samples={},
        log_weights=changes.pop("log_weights", np.zeros(n)),
        scatter=scatter,
        sd=sd,
        channels=("height", "height_tangential")[: len(sd)],
        grasp=Grasp(push_length=0.005),
        is_guess=False,
        **usual | changes,
    )


@pytest.mark.parametrize("likelihood", NOISE)
def test_a_push_weighs_draws_by_the_density_of_its_heights(likelihood):
    """The sd stated with a height adds to what is not stated, and both are sds."""
    rng = np.random.default_rng(0)
    scatter, predicted = rng.uniform(0.1, 0.3, (1, N)), rng.normal(size=(1, N))
    height, sd = np.array([0.3]), np.array([0.2])
    belief = believed(scatter, sd=np.zeros(1), likelihood=likelihood)
    found = belief.updated(height, predicted, sd).weights
    noise = np.hypot(scatter[0], sd)
    density = NOISE[likelihood].pdf((height - predicted[0]) / noise) / noise
    np.testing.assert_allclose(found, density / density.sum(), rtol=EXACT)


def test_pushes_and_channels_multiply_their_densities():
    rng = np.random.default_rng(1)
    scatter, sd = rng.uniform(0.5, 0.9, (2, N)), np.array([0.2, 0.4])
    predicted, heights = rng.normal(size=(3, 2, N)), rng.normal(size=(3, 2))
    belief, product = believed(scatter, sd=sd), np.ones(N)
    for told, made in zip(heights, predicted, strict=True):
        belief = belief.updated(told, made, sd)
        noise = np.hypot(scatter, sd[:, None])
        product *= np.prod(stats.norm.pdf(told[:, None], made, noise), axis=0)
    np.testing.assert_allclose(belief.weights, product / product.sum(), rtol=EXACT)


@pytest.mark.parametrize(
    ("is_sd_used", "stated", "counts"),
    [(True, 0.5, 0.5), (True, None, 0.2), (False, 0.5, 0.2)],
)
def test_a_height_has_the_sd_that_is_stated_with_it_where_that_counts(
    is_sd_used, stated, counts
):
    belief = believed(np.zeros((1, N)), sd=np.array([0.2]), is_sd_used=is_sd_used)
    found = belief.noise(None if stated is None else np.array([stated]))
    np.testing.assert_allclose(found, counts, rtol=EXACT)


def test_the_next_height_scatters_as_draws_and_sensor_do_together():
    rng = np.random.default_rng(2)
    scatter, log_weights = rng.uniform(0.1, 0.9, (1, N)), 2 * rng.standard_normal(N)
    belief = believed(scatter, sd=np.array([0.3]), log_weights=log_weights)
    draw = rng.choice(N, N_HEIGHTS, p=belief.weights)
    heights = scatter[0, draw] * rng.standard_normal(N_HEIGHTS)
    heights += 0.3 * rng.standard_normal(N_HEIGHTS)
    # The kurtosis of a mixture makes it no more than twice that of a normal.
    error = 2 * belief.sigma[0] / np.sqrt(2 * N_HEIGHTS)
    assert abs(np.std(heights) - belief.sigma[0]) < MAX_Z * error


def test_draws_without_weight_are_none_that_wore_out():
    """Half of them fill up what programs are compiled for."""
    padded = np.where(np.arange(N) < N // 2, 0.0, -np.inf)
    belief = believed(np.ones((1, N)), sd=np.ones(1), log_weights=padded)
    assert (belief.ess, belief.effective_share) == pytest.approx(
        (N / 2, 1.0), rel=EXACT
    )
    assert belief.lacks("theta_c") == "only 25 draws of it are left"
