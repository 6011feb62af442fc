"""Beliefs whose answers are known: draws from a prior, without any inference."""

import numpy as np

from pushfit.explore.belief.belief import Belief
from pushfit.model import Grasp

PLAIN = Grasp(push_length=0.005)


def prior_draws(n, rng, *, ellipse=False):
    """Parameters from the default priors, A, B and theta_c by the paper's formulas."""
    medians = {"K_sn": 800, "K_dn": 2000, "K_st": 400, "C_rr": 0.3, "C_d": 0.5}
    draws = {k: m * np.exp(0.8 * rng.standard_normal(n)) for k, m in medians.items()}
    draws["L"] = 0.04 * np.exp(0.3 * rng.standard_normal(n))
    A = draws["K_sn"] * draws["K_dn"] / (draws["K_sn"] + draws["K_dn"])
    compliance = 1 / draws["K_st"] + draws["L"] ** 2 / draws["C_d"]
    draws["theta_c"] = np.degrees(np.arctan2(1 / compliance, A * draws["C_rr"]))
    for name in ("e1", "e2"):
        draws[name] = rng.standard_normal(n) if ellipse else np.zeros(n)
    if ellipse:
        twice = np.arctan2(draws["e2"], draws["e1"])
        draws["alpha_star"] = np.mod(90.0 + np.degrees(twice) / 2, 180.0)
    return draws


def belief_of(draws, *, channels=("height",), sigma=0.05, log_weights=None):
    """Equal draws, or draws of given weight, and a stated noise."""
    n = draws["theta_c"].size
    return Belief(
        samples=draws,
        log_weights=np.zeros(n) if log_weights is None else log_weights,
        scatter=np.zeros((len(channels), n)),
        sd=np.full(len(channels), sigma),
        is_sd_used=True,
        channels=channels,
        grasp=PLAIN,
        likelihood="normal",
        is_guess=False,
    )


def likely(draws, theta, heights, predicted, sigma):
    """Log likelihood of heights at theta, for weights."""
    return -0.5 * np.sum(((heights[:, None] - predicted) / sigma) ** 2, axis=0)
