"""Explorations that the tests begin, and how they are run to their end."""

import numpy as np

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.model import Grasp
from tests.explore.worlds import (
    COMPONENTS,
    CONFIG,
    SIGMA,
    TRUTH,
    feel,
    importance,
)
from tests.fit.tables import HARD, TOML

WIDTH = 9.0  # what is asked for, ± 4.5° [deg]


def explorer(**changes):
    usual = {
        "width_deg": WIDTH,
        "budget": 30,
        "sigma": SIGMA,
        "channels": COMPONENTS,
        "source": importance,
    }
    return Explorer(CONFIG, **(usual | changes))


def without_a_noise(**changes):
    """One whose question is wide, with the switch of the paper, and without a sigma.

    Its pushes are fitted, by programs that tests of tables have as well.
    """
    wide = {"width_deg": 80.0, "budget": 30, "limits": Limits(reference_every=0)}
    settings = parse_config(TOML + HARD, path="grasp.toml")
    return Explorer(settings, source=importance, **(wide | changes))


def run(own, *, n=1000, **world):
    """Push until there is an answer; every suggestion with its order."""
    asked = []
    for _ in range(n):
        suggestions = own.ask(2)
        if not suggestions:
            break
        first = suggestions[0]
        asked.append(first)
        own.tell(
            first.theta,
            first.alpha,
            feel(first, len(own.history.told), **world),
            sd=None,
        )
    return asked


def hopeless_table():
    """Twelve pushes to 10°, which cannot tell a θ_c above."""
    return simulate_table(
        TRUTH,
        Grasp(push_length=0.005),
        theta=np.radians([5.0, 10.0]),
        alpha=np.pi / 2,
        repeats=6,
        noise=SIGMA,
        rng=np.random.default_rng(1),
        channels=COMPONENTS,
    )
