"""Noise-free heights of truths from the prior give those truths back, or are flagged.

A truth whose critical angle has no push beyond it is not in its heights. What must not
happen is a wrong number with a standard error.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.data.simulate import simulate_table
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.results import FitStatus
from tests.fit.tables import case_table, config, setup_of
from tests.problems import CASES, PLAIN, sweep

# Noise-free residuals end at rounding, 1e-10 of the tallest height; the least
# determined truths have condition numbers of some 1000.
RECOVERED = 1e-6
RECOVERED_ANGLE = 1e-4  # rad
MIN_RECOVERED = 0.995
ALPHA = np.pi / 2
REACH = (0.0, np.pi)
# Elevations and azimuths [deg], each pushed once.
DESIGNS = {
    "sweep": (np.arange(5.0, 86.0, 5.0), [90.0]),
    "grid": (np.arange(5.0, 86.0, 10.0), np.arange(0.0, 151.0, 30.0)),
}
# Two pushes beyond θ_c on either side, at every azimuth: three unknowns of a magnitude
# need two heights of one branch and one of the other.
SEEN_BETWEEN = {"sweep": (10.0, 80.0), "grid": (15.0, 75.0)}


def recovery(design, n, *, seed=5):
    """For each truth: whether it is seen, whether recovered, whether flagged."""
    pushes = sweep(*DESIGNS[design])
    degrees = np.degrees(pushes.theta), np.degrees(pushes.alpha)
    table = case_table(
        CASES["paper"], repeats=1, theta_deg=degrees[0], alpha_deg=degrees[1]
    )
    problem = build_problem(table, config()).problem
    x = prior_x_samples(problem, np.random.default_rng(seed), n)
    low, high = SEEN_BETWEEN[design]
    angles = np.stack(
        [
            samples_mapping(problem, x, float(alpha), reach=REACH)["theta_c"]
            for alpha in np.radians(DESIGNS[design][1])
        ]
    )
    is_seen = np.all((low < angles) & (angles < high), axis=0)
    truths = samples_mapping(problem, x, ALPHA, reach=REACH)
    recovered, flagged = [], []
    for index in range(n):
        params = problem.state(jnp.asarray(x[index])).params
        clean = simulate_table(
            params,
            PLAIN,
            theta=np.asarray(pushes.theta),
            alpha=np.asarray(pushes.alpha),
            repeats=1,
            noise=0.0,
            rng=np.random.default_rng(0),
        )
        fit = fit_least_squares(setup_of(clean), reference_alpha=ALPHA, throw=False)
        truth = {name: values[index] for name, values in truths.items()}
        recovered.append(is_recovered(fit, truth))
        flagged.append(is_flagged(fit))
    return is_seen, np.array(recovered), np.array(flagged)


def is_flagged(fit):
    """Whether the fit says that it has no standard errors."""
    return fit.status is not FitStatus.OK or not np.all(np.isfinite(fit.covariance))


def is_recovered(fit, truth):
    """Whether A, B, C_rr, θ_c and the soft axis are those of the truth."""
    found = dict(zip(fit.names, fit.estimate, strict=True))
    errors = [np.expm1(found[f"ln_{n}"] - np.log(truth[n])) for n in ("A", "B", "C_rr")]
    theta_c = fit.modes[0].theta_c_deg
    angles = [np.nan if theta_c is None else np.radians(theta_c - truth["theta_c"])]
    if "f1" in found:
        one = np.arctan2(found["f2"], found["f1"])
        other = np.arctan2(truth["f2"], truth["f1"])
        angles.append(np.angle(np.exp(1j * (one - other))) / 2)
    is_close = np.max(np.abs(errors)) < RECOVERED
    return bool(is_close and np.max(np.abs(angles)) < RECOVERED_ANGLE)


@pytest.mark.parametrize(
    ("design", "n"),
    [
        ("sweep", 20),
        pytest.param("sweep", 500, marks=pytest.mark.slow),
        pytest.param("grid", 100, marks=pytest.mark.slow),
    ],
)
def test_noise_free_truths_come_back_or_are_flagged(design, n):
    is_seen, recovered, flagged = recovery(design, n)
    print(
        f"{n} truths: {is_seen.sum()} seen, {recovered[is_seen].sum()} of them and "
        f"{recovered.sum()} in all recovered, {flagged.sum()} without standard errors"
    )
    assert is_seen.mean() > 0.5
    assert np.mean(recovered[is_seen]) >= MIN_RECOVERED
    # No wrong number with a standard error, whatever the truth.
    assert np.all(recovered | flagged)
