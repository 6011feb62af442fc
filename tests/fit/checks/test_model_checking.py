"""Goodness of fit: quiet on data of the model, loud on data of another."""

import numpy as np
import pytest
from scipy import stats

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.leave_one_out import LeftOut
from pushfit.fit.checks.model_checking import (
    LEVEL,
    MIN_TESTED,
    chance_of_more,
    contradicted_quantities,
    goodness_of_fit,
)
from pushfit.fit.problem.noise import Noise
from pushfit.fit.results import (
    FitResult,
    FitStatus,
    LikelihoodProfile,
    PredictiveCheck,
    Verdict,
)
from tests.tolerances import EXACT, MAX_Z, ROUTES

SIGMA = 0.1
MIN_P = 1e-3  # a false alarm once in 1000 seeds
# Most of its variance that a prediction that is the same for all heights explains.
NOTHING = 0.0
THETA_DEG = np.repeat(np.linspace(5.0, 85.0, 17), 3)
COMPONENTS = ("height_normal", "height_tangential")


def criticise(
    predicted,
    observed,
    *,
    kind="given",
    theta_deg=THETA_DEG,
    alpha_deg=0.0,
    channels=("height",),
    **checks,
):
    """Goodness of fit of a prediction, taken as a fit with three coordinates.

    Heights of all channels are one after the other.
    """
    n, n_channels = observed.size, len(channels)
    table = PeakTable.from_arrays(
        theta=np.radians(theta_deg),
        alpha=np.radians(np.broadcast_to(alpha_deg, theta_deg.shape)),
        heights=dict(zip(channels, np.split(observed, n_channels), strict=True)),
        unit="n",
    )
    residuals = (predicted - observed) / SIGMA
    fit = FitResult(
        names=("ln_A", "ln_B", "ln_C_rr"),
        estimate=np.zeros(3),
        covariance=np.eye(3),
        jacobian=np.zeros((n, 3)),
        singular_values=np.ones(3),
        modes=(),
        chi_square=float(residuals @ residuals),
        n_data=n,
        n_free=3,
        sigma=np.full(n, SIGMA),
        predicted=predicted,
        channel=tuple(np.repeat(channels, n // n_channels).tolist()),
        row=tuple(range(n // n_channels)) * n_channels,
        status=FitStatus.OK,
    )
    sd = {"height": np.full(n, SIGMA)}
    noise = Noise(kind=kind, sd=sd, sigma=sd, degrees_of_freedom=np.inf)
    return goodness_of_fit(table, fit, noise, seed=0, **checks)


@pytest.mark.parametrize(
    ("centre", "shape", "found"),
    [
        (40.0, "closed", ()),
        # Beside the set of 90 %, which ends at 43.3°.
        (47.5, "closed", ()),
        (52.0, "closed", ("θ_c",)),
        (28.0, "closed", ("θ_c",)),
        (52.0, "open", ()),
        (52.0, "of two modes", ()),
        (52.0, "of no fit", ()),
    ],
)
def test_a_posterior_beside_the_likelihood_is_told_of(centre, shape, found):
    """Δχ² = ((θ - 40°) / 2°)² leaves 33.4° to 46.6° with 999 in 1000."""
    values = np.linspace(20.0, 60.0, 81)
    delta = ((values - 40.0) / 2.0) ** 2
    delta[values > 40.0] *= shape != "open"
    if shape == "of two modes":
        delta = np.minimum(delta, ((values - 55.0) / 2.0) ** 2)
    if shape == "of no fit":
        delta = np.full(values.size, np.nan)
    profile = LikelihoodProfile(
        name="theta_c",
        unit="deg",
        values=values,
        delta_chi_square=delta,
        pieces=(),
        verdict=Verdict.DETERMINED,
        prob=0.9,
    )
    # Normal draws, from 5 to 95 %: 3.3° either side.
    draws = stats.norm.ppf((np.arange(1000) + 0.5) / 1000, centre, 2.0)
    samples, profiles = {"theta_c": draws}, {"theta_c": profile}
    assert contradicted_quantities(samples, profiles, prob=0.9) == found
    # Most draws have no such angle.
    samples["theta_c"] = np.append(draws, np.full(4000, np.nan))
    assert contradicted_quantities(samples, profiles, prob=0.9) == ()


def curve() -> np.ndarray:
    return 1.0 + 2.0 * np.sin(np.radians(THETA_DEG))


def noisy(seed: int, values: np.ndarray) -> np.ndarray:
    return values + np.random.default_rng(seed).normal(0, SIGMA, values.size)


def test_residuals_far_below_the_noise_may_follow_their_neighbours():
    """Heights that are all the same leave the rounding of the solver."""
    wave = 1e-9 * np.sin(np.radians(4 * THETA_DEG))
    missed = (PredictiveCheck(feature="pattern", p_value=0.0),)
    found = criticise(curve(), curve() + wave, predictive=missed)
    assert found.is_adequate
    assert found.pattern_p_value is None
    assert found.predictive == ()


@pytest.mark.parametrize(("share", "is_asked"), [(0.09, False), (0.12, True)])
def test_a_tenth_of_the_noise_is_what_a_pattern_needs(share, is_asked):
    found = criticise(curve(), curve() + share * SIGMA)
    assert (found.pattern_p_value is not None) is is_asked


@pytest.mark.parametrize(("n_directions", "is_asked"), [(7, False), (8, True)])
def test_a_pattern_needs_eight_directions(n_directions, is_asked):
    n = 3 * n_directions
    found = criticise(curve()[:n], noisy(1, curve())[:n], theta_deg=THETA_DEG[:n])
    assert (found.pattern_p_value is not None) is is_asked


def test_the_chance_of_a_pattern_is_that_of_another_permutation_test():
    """Over the upper half, where azimuths meet; each direction up to five times."""
    rng, n_directions, n_permutations = np.random.default_rng(1), 600, 4999
    along = np.sort(rng.uniform(0.0, 1.0, n_directions))
    azimuth_deg = rng.uniform(0.0, 360.0, n_directions)
    counts = rng.integers(1, 6, n_directions)
    order = rng.permutation(np.repeat(np.arange(n_directions), counts))
    theta_deg, alpha_deg = np.degrees(np.arcsin(along))[order], azimuth_deg[order]
    errors = rng.normal(0.0, SIGMA, order.size)
    flat = np.full(order.size, 2.0)
    found = criticise(flat, flat - errors, theta_deg=theta_deg, alpha_deg=alpha_deg)

    across = np.sqrt(1 - along**2) * np.exp(1j * np.radians(azimuth_deg))
    points = np.stack([across.real, across.imag, along])
    nearest = np.argmax(points.T @ points - 2 * np.eye(n_directions), axis=1)
    means = np.bincount(order, errors) / np.sqrt(counts)
    expected = stats.permutation_test(
        (means,),
        lambda x, axis: np.sum(x * x[..., nearest], axis=axis),
        permutation_type="pairings",
        vectorized=True,
        n_resamples=n_permutations,
        alternative="greater",
        rng=rng,
    ).pvalue
    error = np.sqrt(2 * expected * (1 - expected) / n_permutations)
    assert abs(found.pattern_p_value - expected) < MAX_Z * error


def test_a_pattern_that_no_permutation_has_is_one_of_all_that_there_are():
    theta_deg, flat = np.linspace(5.0, 85.0, 40), np.ones(40)
    bent = flat + np.cos(np.radians(2 * theta_deg))
    found = criticise(flat, bent, theta_deg=theta_deg)
    assert found.pattern_p_value == 1 / 5000


@pytest.mark.parametrize(("share", "is_adequate"), [(0.75, False), (0.85, True)])
def test_a_fit_explains_four_fifths_or_is_said_to_explain_little(share, is_adequate):
    """Of errors that are even in size and of both signs."""
    theta_deg = np.linspace(5.0, 85.0, 40)
    observed = np.linspace(1.0, 3.0, 40)
    sizes = np.sqrt((1 - share) * np.var(observed)) * np.resize([1.0, -1.0], 40)
    found = criticise(observed + sizes, observed, kind="sampled", theta_deg=theta_deg)
    np.testing.assert_allclose(found.r_squared, share, rtol=ROUTES)
    assert found.is_adequate is is_adequate
    assert ("these heights: it explains only 75%" in found.sentence) != is_adequate


@pytest.mark.parametrize(("n", "is_adequate"), [(3, True), (4, False)])
def test_as_many_directions_as_unknowns_are_met_by_any_model(n, is_adequate):
    """And what explains less than nothing is said to explain nothing."""
    theta_deg, observed = np.linspace(10.0, 80.0, n), np.linspace(1.0, 2.0, n)
    found = criticise(observed[::-1], observed, kind="sampled", theta_deg=theta_deg)
    assert found.is_adequate is is_adequate
    assert ("explains only 0%" in found.sentence) != is_adequate


def test_repeats_judge_a_fit_better_than_what_it_explains():
    flat = np.full(THETA_DEG.size, 2.0)
    found = criticise(flat, noisy(6, flat), kind="sampled")
    assert found.r_squared <= NOTHING
    assert found.lack_of_fit_p_value > LEVEL
    assert found.is_adequate


def test_a_noise_that_was_taken_from_the_misfit_is_said_where_nothing_fails():
    good = criticise(curve(), noisy(1, curve()), is_scattered=True)
    assert "a noise that is taken from what it misses" in good.sentence
    bent = curve() + 0.3 * np.sin(np.radians(4 * THETA_DEG))
    bad = criticise(curve(), noisy(3, bent), is_scattered=True)
    assert "does not describe" in bad.sentence


def test_of_pushes_that_others_do_not_predict_the_first_is_an_outlier():
    left_out = [
        LeftOut(row=row, channel="height", height=1.0, predicted=2.0, p_value=1e-6)
        for row in (7, 2)
    ]
    found = criticise(curve(), curve(), left_out=left_out)
    assert found.outliers == ("push 8 (θ = 15°, α = 0°)",)


def test_few_heights_are_not_said_to_fit():
    """Twice the noise is mostly seen from that many residuals beyond the unknowns."""

    def power(dof: int) -> float:
        return stats.chi2.sf(stats.chi2.isf(LEVEL, dof) / 4, dof)

    assert power(MIN_TESTED - 1) < 0.5 < power(MIN_TESTED)
    enough = 3 + MIN_TESTED
    for n, can_tell in ((enough, True), (enough - 1, False)):
        found = criticise(curve()[:n], curve()[:n], theta_deg=THETA_DEG[:n])
        assert found.is_adequate
        assert ("describes the heights" in found.sentence) is can_tell


def test_noise_alone_is_not_faulted():
    """60 tables of three tests at level 1e-3: more than two alarms is 1 in 10³."""
    found = [criticise(curve(), noisy(seed, curve())) for seed in range(60)]
    assert sum(not f.is_adequate for f in found) <= 2
    p_values = [f.pattern_p_value for f in found]
    assert stats.kstest(p_values, "uniform").pvalue > MIN_P


@pytest.mark.parametrize("n", [10, 50])
def test_the_chance_of_a_sum_is_uniform_by_either_noise(n):
    """Of residuals whose standard deviation is as stated, Student's with ν = 4."""
    rng = np.random.default_rng(0)
    normal = np.sum(rng.standard_normal((2000, n)) ** 2, axis=1)
    chances = [chance_of_more(chi_square, n, "normal") for chi_square in normal]
    np.testing.assert_allclose(chances, stats.chi2.sf(normal, n), rtol=ROUTES)
    t = rng.standard_t(4, (2000, n))
    deviances = np.sum(5 * np.log1p(t**2 / 4), axis=1)
    chances = [chance_of_more(deviance, n, "student_t") for deviance in deviances]
    assert stats.kstest(chances, "uniform").pvalue > LEVEL
    # In its tail, too: 40 of 2000, and three standard errors.
    assert 20 < np.sum(np.array(chances) < 0.02) < 60


def test_chi_square_and_its_p_value_are_scipys():
    found = criticise(curve(), noisy(1, curve()))
    residuals = (noisy(1, curve()) - curve()) / SIGMA
    expected = stats.chi2.sf(np.sum(residuals**2), residuals.size - 3)
    np.testing.assert_allclose(found.p_value, expected, rtol=ROUTES)


@pytest.mark.parametrize("channels", [("height",), COMPONENTS])
def test_lack_of_fit_is_the_one_way_f_test(channels):
    """With no coordinate fitted it is SciPy's f_oneway on residuals about zero mean."""
    predicted = np.tile(curve(), len(channels))
    observed = noisy(2, predicted)
    found = criticise(predicted, observed, channels=channels)
    groups = ((observed - predicted) / SIGMA).reshape(-1, 3)
    n = len(groups)
    within = np.sum((groups - groups.mean(axis=1, keepdims=True)) ** 2) / (2 * n)
    between = 3 * np.sum(groups.mean(axis=1) ** 2) / (n - 3)
    expected = stats.f.sf(between / within, n - 3, 2 * n)
    np.testing.assert_allclose(found.lack_of_fit_p_value, expected, rtol=ROUTES)


def test_repeats_of_as_many_directions_as_unknowns_show_no_lack_of_fit():
    few = slice(9)
    found = criticise(curve()[few], noisy(2, curve())[few], theta_deg=THETA_DEG[few])
    assert found.lack_of_fit_p_value is None


def test_means_of_components_explain_nothing_however_far_apart():
    means = np.repeat([1.0, 5.0], THETA_DEG.size)
    observed = means + np.tile(curve() - curve().mean(), 2)
    found = criticise(means, observed, channels=COMPONENTS)
    np.testing.assert_allclose(found.r_squared, 0.0, atol=EXACT)


@pytest.mark.parametrize("kind", ["given", "sampled"])
def test_a_missed_trend_is_faulted(kind):
    bent = curve() + 0.3 * np.sin(np.radians(4 * THETA_DEG))
    found = criticise(curve(), noisy(3, bent), kind=kind)
    assert not found.is_adequate
    assert found.pattern_p_value < LEVEL
    assert (found.p_value is None) == (kind == "sampled")


def test_heights_that_the_model_does_not_explain_are_called_so():
    observed = np.random.default_rng(4).normal(2.0, 1.0, THETA_DEG.size)
    flat = np.full(THETA_DEG.size, 2.0)
    once = np.linspace(5.0, 85.0, THETA_DEG.size)
    found = criticise(flat, observed, kind="sampled", theta_deg=once)
    assert found.r_squared <= NOTHING
    assert "does not describe" in found.sentence


@pytest.mark.parametrize(("height", "is_met"), [(2.0, True), (2.4, False)])
def test_heights_that_do_not_vary_are_explained_where_they_are_met(height, is_met):
    """Repeats that agree to the digit judge no fit, so this does."""
    flat = np.full(THETA_DEG.size, 2.0)
    found = criticise(flat, np.full(THETA_DEG.size, height), kind="sampled")
    assert found.r_squared == float(is_met)
    assert found.is_adequate is is_met


def test_repeats_of_one_direction_do_not_fault_the_model():
    """Heights that vary by noise alone leave nothing to explain."""
    same = np.full(THETA_DEG.size, 30.0)
    observed = noisy(6, np.full(THETA_DEG.size, 2.0))
    found = criticise(
        np.full(THETA_DEG.size, 2.0), observed, kind="sampled", theta_deg=same
    )
    assert found.r_squared <= NOTHING
    assert found.is_adequate


def test_an_outlying_push_is_named():
    observed = noisy(5, curve())
    observed[7] += 10 * SIGMA
    found = criticise(curve(), observed)
    assert found.outliers == ("push 8 (θ = 15°, α = 0°)",)


@pytest.mark.parametrize(
    ("p_value", "is_adequate"), [(2 * LEVEL, True), (LEVEL / 2, False)]
)
def test_data_that_simulated_heights_never_resemble_are_not_described(
    p_value, is_adequate
):
    check = PredictiveCheck(feature="largest", p_value=p_value)
    found = criticise(curve(), noisy(1, curve()), predictive=(check,))
    assert found.is_adequate == is_adequate
    assert ("almost never show as large a residual" in found.sentence) != is_adequate
    assert found.predictive == (check,)
