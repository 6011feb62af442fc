"""Pushes that cannot answer a question are told apart from those that can.

Deficient designs: one elevation, all pushes below θ_c, one azimuth, the same two
directions again and again. Whatever a sampler says, such a quantity gets no ±.
"""

import numpy as np
import pytest
from scipy import stats

from pushfit.data.simulate import simulate_table
from pushfit.fit.assess.reporting_rules import within_verdict
from pushfit.fit.assess.verdicts import angle_quantity
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.fit.results import Verdict
from tests.fit.posteriors import posterior_of
from tests.fit.tables import setup_of
from tests.problems import PLAIN, paper_parameters

PROB = 0.95
SD_LOG = {"K_sn": 0.8, "K_dn": 0.8, "K_st": 0.8, "C_rr": 0.8, "C_d": 0.8, "L": 0.3}
MEDIANS = {
    "K_sn": 800,
    "K_dn": 2000,
    "K_st": 400,
    "C_rr": 0.3,
    "C_d": 0.5,
    "L": 0.04,
}
# Truths whose critical angle good pushes surround.
SURROUNDED = (25.0, 65.0)
NOISE = 0.005  # of the tallest height
COMPONENTS = ("height_normal", "height_tangential")
MAGNITUDE = ("height",)
# A false alarm once in 1000 sets of tables.
LIMITS = 0.999
# Sets of this share of their width hold three truths in four; too few tables do not
# tell that from 95 %.
NARROWED, ENOUGH = 0.6, 100


def truth(rng):
    """Parameters from the default prior, and θ_c by the printed formula [deg]."""
    while True:
        values = {n: m * np.exp(SD_LOG[n] * rng.normal()) for n, m in MEDIANS.items()}
        A = 1 / (1 / values["K_sn"] + 1 / values["K_dn"])
        B = 1 / (1 / values["K_st"] + values["L"] ** 2 / values["C_d"])
        theta_c = float(np.degrees(np.arctan2(B, A * values["C_rr"])))
        if SURROUNDED[0] < theta_c < SURROUNDED[1]:
            return paper_parameters(**values), A, theta_c


# Up to 16 pushes: one compiled program serves every design with the same channels.
def one_elevation(theta_c, rng):
    return np.full(5, rng.uniform(10, 80)), 90.0


def below_the_critical_angle(theta_c, rng):
    return np.linspace(0.2, 0.9, 5) * theta_c, 90.0


def two_directions_again_and_again(theta_c, rng):
    return np.repeat(np.sort(rng.uniform(10, 80, 2)), 3), 90.0


def one_azimuth(theta_c, rng):
    return np.linspace(10, 80, 5), 90.0


# Which question each cannot answer.
DEFICIENT = {
    one_elevation: "theta_c",
    below_the_critical_angle: "theta_c",
    two_directions_again_and_again: "theta_c",
    one_azimuth: "alpha_star",
}


def quantity(name, params, A, design, rng, *, channels, repeats):
    """What is said of an angle of such a table when the chain claims 45 ± 1°."""
    theta_deg, alpha_deg = design
    noise = NOISE * A * float(PLAIN.push_length)
    table = simulate_table(
        params,
        PLAIN,
        theta=np.radians(theta_deg),
        alpha=float(np.radians(alpha_deg)),
        repeats=repeats,
        noise=noise,
        rng=rng,
        channels=channels,
        state_sd=True,
    )
    setup = setup_of(table)
    words = {"reference_alpha": float(np.radians(alpha_deg))}
    fit = fit_least_squares(setup, **words)
    profiles = likelihood_profiles(setup, fit, prob=PROB, reach=(0.0, np.pi), **words)
    found = angle_quantity(name, confident(rng), profiles.get(name), prob=PROB)
    return within_verdict(found, wanted_width_deg=30.0)


def confident(rng):
    """A chain that has converged to 45 ± 1° for either angle."""
    draws = {name: rng.normal(45, 1, 500) for name in ("theta_c", "alpha_star")}
    before = {name: rng.uniform(0, 90, 500) for name in draws}
    return posterior_of(draws, before)


def holds(pieces, value, *, share=1.0):
    """Whether a piece, drawn in to a share of its width, holds a value."""
    for low, high in pieces:
        ends = -np.inf if low is None else low, np.inf if high is None else high
        margin = (1 - share) / 2 * (ends[1] - ends[0]) if np.isfinite(ends).all() else 0
        if ends[0] + margin <= value <= ends[1] - margin:
            return True
    return False


def is_flagged(found):
    return found.verdict is not Verdict.DETERMINED


@pytest.mark.parametrize("n", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_what_pushes_cannot_tell_is_flagged_and_gets_no_error(n):
    flags = []
    for design, name in DEFICIENT.items():
        for seed in range(n):
            rng = np.random.default_rng(seed)
            params, A, theta_c = truth(rng)
            words = {"channels": MAGNITUDE, "repeats": 2}
            found = quantity(name, params, A, design(theta_c, rng), rng, **words)
            flags.append(is_flagged(found))
            if flags[-1]:
                assert found.estimate is None
                is_open = found.verdict is not Verdict.SEVERAL_MODES
                assert found.interval is None or not is_open
    # Where an end predicts the heights of the truth, a set leaves it out as rarely.
    assert np.mean(flags) >= PROB


@pytest.mark.slow
@pytest.mark.parametrize("n", [6, 200])
def test_what_pushes_tell_is_not_flagged_and_its_sets_hold(n):
    theta_deg = np.linspace(5, 85, 8)
    flags, hits, narrowed_hits = [], 0, 0
    for seed in range(n):
        rng = np.random.default_rng(1000 + seed)
        params, A, theta_c = truth(rng)
        words = {"channels": COMPONENTS, "repeats": 2}
        found = quantity("theta_c", params, A, (theta_deg, 90.0), rng, **words)
        flags.append(is_flagged(found))
        hits += holds(found.likelihood_sets, theta_c)
        narrowed_hits += holds(found.likelihood_sets, theta_c, share=NARROWED)
        assert is_flagged(found) or found.estimate is not None
    assert np.mean(flags) <= 0.01
    low, high = stats.binom.interval(LIMITS, n, PROB)
    print(f"{n} tables: {np.sum(flags)} flagged, {hits} sets hold the truth")
    assert low <= hits <= high
    assert n < ENOUGH or narrowed_hits < low
