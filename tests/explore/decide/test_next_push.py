"""What is left out to be quick changes no choice."""

import numpy as np
import pytest

from pushfit.explore.belief.belief import N_BELIEF_DRAWS, Question
from pushfit.explore.decide.forecast import imagine, p_decided
from pushfit.explore.decide.gain import information_gain
from pushfit.explore.decide.intervals import AskedAngle, shortest_interval
from pushfit.explore.decide.next_push import Surveyor
from pushfit.explore.limits import Limits
from tests.explore.beliefs import belief_of
from tests.explore.decide.test_gain import after_pushes
from tests.explore.worlds import COMPONENTS, CONFIG
from tests.tolerances import ROUTES

ANGLES = ("theta_c", "alpha_star")
# Share of the best gain, about α* at a gain of 0.06: five hundred draws lose 4 %.
LOST = 0.03
# A truth on the edge of the width may fall on either side by a bin.
ONE_TRUTH = 1 / 48


def surveyor(ask=ANGLES):
    question = Question(
        config=CONFIG,
        ask=ask,
        channels=COMPONENTS,
        unit="n",
        sigma=0.05,
        reference_alpha=np.pi / 2,
    )
    return Surveyor(question, Limits())


def belief(seed, noise=0.15):
    rng = np.random.default_rng(seed)
    draws = after_pushes(
        rng, N_BELIEF_DRAWS, channels=COMPONENTS, ellipse=True, noise=noise
    )
    return belief_of(draws, channels=COMPONENTS)


@pytest.mark.parametrize(
    ("noise", "asked"),
    [
        (0.15, ("theta_c",)),
        (0.15, ANGLES),
        *(
            pytest.param(noise, asked, marks=pytest.mark.slow)
            for noise in (0.05, 0.15, 0.3)
            for asked in (("theta_c",), ("alpha_star",), ANGLES)
        ),
    ],
)
def test_screening_by_few_draws_leaves_the_best_push_the_best(noise, asked):
    """204 directions, all of them by all draws, and the twenty that were screened."""
    own, found = surveyor(), belief(int(100 * noise), noise=noise)
    quick = own.survey(found, undecided=asked)
    full = own.survey(found, undecided=asked, is_full=True)
    assert full.theta.size > 150
    assert quick.ranks[0] == full.ranks[0]


@pytest.mark.slow
@pytest.mark.parametrize("asked", [("theta_c",), ("alpha_star",), ANGLES], ids=len)
def test_where_hardly_anything_is_known_screening_loses_next_to_nothing(asked):
    """Neighbours then tell alike, and draws decide between them."""
    own, found = surveyor(), belief(3, noise=1.0)
    quick = own.survey(found, undecided=asked)
    full = own.survey(found, undecided=asked, is_full=True)
    assert full.gains[quick.ranks[0]] > (1 - LOST) * full.gains.max()


def test_gains_of_two_angles_at_once_are_those_of_each():
    found = belief(0)
    heights = surveyor().survey(found, undecided=ANGLES).predicted.heights[:20]
    angles = [found.samples[name] for name in ANGLES]
    both = information_gain(heights, angles, found.weights, sigma=found.sigma)
    each = [
        information_gain(heights, [values], found.weights, sigma=found.sigma)
        for values in angles
    ]
    np.testing.assert_allclose(both, sum(each), rtol=ROUTES, atol=ROUTES)


@pytest.mark.parametrize(
    "width",
    [
        pytest.param(22.0, marks=pytest.mark.slow),
        25.0,
        pytest.param(30.0, marks=pytest.mark.slow),
    ],
)
def test_a_forecast_is_that_of_imagined_pushes_one_by_one(width):
    """Means of three pushes in every direction, weighed in double precision."""
    rng = np.random.default_rng(4)
    found, n_each, sigma = belief(1), 3, 0.3
    theta_c = found.samples["theta_c"]
    target = AskedAngle(values=theta_c, is_axis=False, width=width, prob=0.9)
    heights = surveyor(("theta_c",)).survey(found, undecided=ANGLES).predicted.heights
    heights, noise = heights[::12], np.full(2, sigma)
    k = len(heights)
    rows, gains = np.arange(k), np.zeros(k)
    ways = imagine(heights, found.weights, noise, rows=rows, gains=gains, rng=rng)
    spread, _ = ways
    share = p_decided((spread,), found.weights, (target,), n_pushes=n_each * k)

    again = np.random.default_rng(4)
    truths = again.choice(N_BELIEF_DRAWS, size=48, p=found.weights)
    errors = again.standard_normal((k * 2, 48)) * sigma / np.sqrt(n_each)
    predicted = heights.reshape(k * 2, N_BELIEF_DRAWS)
    is_decided = []
    for t, truth in enumerate(truths):
        felt = predicted[:, truth] + errors[:, t]
        squares = np.sum((predicted - felt[:, None]) ** 2, axis=0)
        log_weights = -n_each * squares / (2 * sigma**2)
        weights = np.exp(log_weights - log_weights.max())
        low, high = shortest_interval(target, weights / weights.sum())
        is_decided.append(high - low <= width)
    assert 0 < np.mean(is_decided) < 1
    np.testing.assert_allclose(share, np.mean(is_decided), atol=ONE_TRUTH)
