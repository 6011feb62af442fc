"""The advice in a result: the push of `pushfit next`, and none where none is needed."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.explore.advice import with_next_push
from pushfit.explore.explorer import Explorer
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.results import Verdict
from tests.fit.tables import LOW_DEG, config, one_sided_table


@pytest.fixture(scope="module")
def one_sided():
    return identify_table(one_sided_table(), config(), seed=1, engine="sweep")


def test_the_push_that_would_help_is_that_of_the_explorer(one_sided):
    advice = with_next_push(one_sided).identifiability.advice
    table = one_sided.table
    explorer = Explorer(config(), channels=table.channels, unit=table.unit, seed=1)
    explorer.attach(table)
    (best,) = explorer.ask()
    assert best.theta_deg > LOW_DEG.max()
    assert f"θ = {best.theta_deg:.0f}°, α = {best.alpha_deg:.0f}° would" in advice[0]
    assert advice[1:] == one_sided.identifiability.advice


def test_no_push_beyond_the_reach_is_recommended(one_sided):
    settings = one_sided.config.with_keys("reach", theta_deg=(5.0, 70.0))
    kept = with_next_push(replace(one_sided, config=settings)).identifiability.advice
    assert kept[1:] == one_sided.identifiability.advice
    named = float(kept[0].removeprefix("One more push at θ = ").split("°")[0])
    assert LOW_DEG.max() < named <= 70.0


def test_no_push_out_of_the_box_is_recommended(one_sided):
    """Of the settings, which `pushfit next` keeps to as well."""
    length = one_sided.config.push.length_mm
    deepest = length * np.sin(np.radians(70.0))
    box = ((-length, length), (-length, length), (0.0, float(deepest)))
    settings = one_sided.config.with_keys("explore", workspace_mm=box)
    kept = with_next_push(replace(one_sided, config=settings)).identifiability.advice
    named = float(kept[0].removeprefix("One more push at θ = ").split("°")[0])
    assert LOW_DEG.max() < named <= 70.0
    # Nowhere but by shorter pushes, which make no row of the table.
    flat = tuple((-0.5, 0.5) for _ in box)
    settings = one_sided.config.with_keys("explore", workspace_mm=flat)
    none = with_next_push(replace(one_sided, config=settings)).identifiability
    assert none.advice == one_sided.identifiability.advice


def test_a_determined_angle_needs_no_push(one_sided):
    angle = replace(one_sided.theta_c, verdict=Verdict.DETERMINED)
    known = replace(one_sided, theta_c=angle)
    assert with_next_push(known).identifiability == known.identifiability


def test_a_push_that_tells_nothing_is_not_recommended(one_sided):
    samples = dict(one_sided.posterior.samples)
    samples["theta_c"] = np.full_like(samples["theta_c"], 40.0)
    posterior = replace(one_sided.posterior, samples=samples)
    known = replace(one_sided, posterior=posterior)
    assert with_next_push(known).identifiability.advice == known.identifiability.advice
