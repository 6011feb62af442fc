"""A grasp to explore, and a belief about it by brute force instead of an engine."""

import numpy as np
from scipy.special import logsumexp

from pushfit.config import parse_config
from pushfit.explore.belief.belief import N_BELIEF_DRAWS, Belief, Question
from pushfit.explore.belief.predict import predict
from pushfit.model import Grasp, Parameters, Pushes, forward
from tests.explore.beliefs import PLAIN, belief_of, prior_draws

CONFIG = parse_config("[push]\nlength_mm = 5.0\n", path="grasp.toml")
COMPONENTS = ("height_normal", "height_tangential")
SIGMA = 0.05
# A = 571 and B = 175 N/m, C_rr = 0.3: θ_c = 45.6°.
TRUTH = Parameters(K_sn=800, K_dn=2000, K_st=400, C_rr=0.3, C_d=0.5, L=0.04)
THETA_C = 45.6
# The same as settings, for commands and nodes.
TRUTH_FILE = """\
[push]
length_mm = 5.0
[parameters]
K_sn = { fixed = 800.0 }
K_dn = { fixed = 2000.0 }
K_st = { fixed = 400.0 }
C_rr = { fixed = 0.3 }
C_d = { fixed = 0.5 }
L = { fixed = 0.04 }
"""
N_PRIOR = 1 << 15
# Beliefs by what was asked, of 0.6 MB each.
_known: dict[tuple, Belief] = {}


def importance(table, question: Question, seed: int) -> Belief:
    """Draws from the prior, weighed by all pushes and drawn anew.

    Many tests begin alike, or go on with one journal: what was asked is kept.
    """
    asked = question.ask, question.channels, question.sigma, seed
    if table is not None:
        heights = [table.heights(c) for c in question.channels]
        pushes = np.stack([table.theta, table.alpha, table.is_used, *heights])
        asked = *asked, pushes.tobytes()
    if asked not in _known:
        _known[asked] = _weighed(table, question, seed)
    return _known[asked]


def _weighed(table, question: Question, seed: int) -> Belief:
    rng = np.random.default_rng(seed)
    ellipse = "alpha_star" in question.ask
    draws = prior_draws(N_PRIOR, rng, ellipse=ellipse)
    sigma = question.sigma or SIGMA
    many = belief_of(draws, channels=question.channels, sigma=sigma)
    weights = np.full(N_PRIOR, 1 / N_PRIOR)
    if table is not None:
        heights = predict(many, table.theta, table.alpha).heights
        seen = np.stack([table.heights(c) for c in question.channels], axis=1)
        misses = ((heights - seen[..., None]) / sigma)[table.is_used]
        squares = np.sum(misses**2, axis=(0, 1))
        weights = np.exp(-squares / 2 - logsumexp(-squares / 2))
    rows = rng.choice(N_PRIOR, size=N_BELIEF_DRAWS, p=weights)
    found = {name: values[rows] for name, values in draws.items()}
    if not ellipse:
        found.pop("alpha_star", None)
    return belief_of(found, channels=question.channels, sigma=sigma)


def feel(suggestion, number, *, params=TRUTH, channels=COMPONENTS, sigma=SIGMA):
    """Heights of a push; noise belongs to its number, so that runs can be repeated."""
    rng = np.random.default_rng([7, number])
    grasp = Grasp(push_length=float(PLAIN.push_length) * suggestion.length_share)
    push = Pushes(np.array([suggestion.theta]), np.array([suggestion.alpha]))
    found = forward(params, push, grasp)
    noise = sigma * rng.standard_normal(len(channels))
    return {
        c: float(getattr(found, c)[0] + e) for c, e in zip(channels, noise, strict=True)
    }
