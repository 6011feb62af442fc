"""The same grasp pushed again and again: errors scatter, and sets hold, as they say.

Heights from one truth with fresh noise. Unlike truths drawn from a prior (which
benchmarks/coverage/one_sweep.py measures), this is the promise that a likelihood set
makes.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.profiles.profile_sets import profile_set, threshold
from pushfit.fit.profiles.profiles import likelihood_profiles
from tests.fit.tables import case_table, log_contact, setup_of
from tests.problems import CASES
from tests.tolerances import MAX_Z

PROBS = (0.5, 0.9, 0.95)
# Binomial limits that a right set leaves once in 1000.
LIMITS = 0.999
# What a noise understated by this factor makes of the probability of a set.
UNDERSTATED = 0.7
# 99.9 % point of Kolmogorov's distribution.
MAX_KS = 1.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """A truth, its pushes, and what is asked of them."""

    case: str
    theta_deg: np.ndarray
    alpha_deg: np.ndarray | None
    noise: float
    repeats: int
    truths: dict[str, float]

    def table(self, seed):
        return case_table(
            CASES[self.case],
            noise=self.noise,
            seed=seed,
            repeats=self.repeats,
            theta_deg=self.theta_deg,
            alpha_deg=self.alpha_deg,
        )

    @property
    def alpha(self):
        return float(np.radians(CASES[self.case].alpha_deg))


FIRM = log_contact(CASES["firm"].params)
# No push at a critical angle: at a kink a likelihood is no parabola at any noise.
DESIGNS = {
    "sweep": Design(
        case="firm",
        theta_deg=np.arange(7.5, 88.0, 5.0),
        alpha_deg=None,
        noise=0.01,
        repeats=1,
        truths={
            "theta_c": CASES["firm"].critical_angle_deg,
            **{name: float(np.exp(FIRM[f"ln_{name}"])) for name in ("A", "B", "C_rr")},
        },
    ),
    "both sweeps": Design(
        case="ellipse",
        theta_deg=np.r_[np.arange(7.5, 88.0, 10.0), np.full(6, 15.0)],
        alpha_deg=np.r_[np.full(9, 30.0), np.arange(0.0, 151.0, 30.0)],
        noise=0.01,
        repeats=1,
        truths={
            "theta_c": CASES["ellipse"].critical_angle_deg,
            "alpha_star": CASES["ellipse"].soft_axis_deg,
        },
    ),
}


@pytest.mark.slow
def test_errors_and_sums_of_squares_scatter_as_they_say():
    """Pulls have mean 0 and variance 1; χ² has n - 3 degrees of freedom."""
    design, n = DESIGNS["sweep"], 100
    fits = [
        fit_least_squares(setup_of(design.table(seed)), reference_alpha=design.alpha)
        for seed in range(n)
    ]
    truth = np.array([FIRM[name] for name in fits[0].names])
    pulls = np.array([(fit.estimate - truth) / fit.standard_error for fit in fits])
    assert np.all(np.abs(pulls.mean(axis=0)) < MAX_Z / np.sqrt(n))
    assert np.all(np.abs(np.mean(pulls**2, axis=0) - 1) < MAX_Z * np.sqrt(2 / n))
    sums = np.array([fit.chi_square for fit in fits])
    chi_square = stats.chi2(fits[0].degrees_of_freedom)
    assert stats.kstest(sums, chi_square.cdf).statistic < MAX_KS / np.sqrt(n)
    # The test can fail: the same sums with the noise understated.
    wrong = sums / UNDERSTATED**2
    assert stats.kstest(wrong, chi_square.cdf).statistic > MAX_KS / np.sqrt(n)


def understated(prob):
    """Level of the set whose threshold an understated noise would have given."""
    return float(stats.chi2.cdf(UNDERSTATED**2 * threshold(prob, np.inf), 1))


def held(pieces, truth):
    return any(
        (low is None or low <= truth) and (high is None or truth <= high)
        for low, high in pieces
    )


@pytest.mark.slow
@pytest.mark.parametrize(("name", "n"), [("sweep", 300), ("both sweeps", 120)])
def test_sets_hold_a_fixed_truth_as_often_as_they_say(name, n):
    design = DESIGNS[name]
    hits, wrong_hits = {}, {}
    for seed in range(n):
        setup = setup_of(design.table(seed))
        fit = fit_least_squares(setup, reference_alpha=design.alpha)
        profiles = likelihood_profiles(
            setup,
            fit,
            reference_alpha=design.alpha,
            prob=max(PROBS),
            reach=(0.0, np.pi),
        )
        for quantity, truth in design.truths.items():
            for prob in PROBS:
                key = quantity, prob
                is_held = held(profile_set(profiles[quantity], prob), truth)
                hits[key] = hits.get(key, 0) + is_held
                pieces = profile_set(profiles[quantity], understated(prob))
                wrong_hits[key] = wrong_hits.get(key, 0) + held(pieces, truth)
    shares = {key: count / n for key, count in hits.items()}
    for (quantity, prob), count in hits.items():
        low, high = stats.binom.interval(LIMITS, n, prob)
        assert low <= count <= high, (quantity, prob, shares)
        # Sets of an understated noise are found out, at the levels that tell most.
        if prob > 0.5:
            assert wrong_hits[quantity, prob] < low
