"""Offsets and gains of whole repeats: found exactly without noise, and taken out."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.errors import ConfigError
from pushfit.fit.fitted import fit_table
from pushfit.fit.problem.repeat_effects import (
    both_ways,
    repeat_p_value,
    without_repeat_effects,
)
from tests.fit.tables import case_table, config
from tests.problems import CASES

SHIFT = np.array([-0.1, 0.03, 0.07])
GAIN = np.array([0.96, 1.01, 1.03])
EXACT = 1e-12
# F tests of pure noise are uniform; a false alarm once in 10^3.
N_TABLES, LEVEL = 200, 1e-3


def changed(table, offset, gain):
    """Heights of each repeat moved."""
    _, repeat = both_ways(table)
    heights = table.heights("height") * gain[repeat] + offset[repeat]
    return replace(table, frame=table.frame.assign(height_n=heights))


@pytest.mark.parametrize(
    ("kind", "offset", "gain"),
    [("offset", SHIFT, np.ones(3)), ("gain", np.zeros(3), GAIN)],
)
def test_what_tells_one_repeat_from_another_is_taken_out(kind, offset, gain):
    """Effects of mean 0, or 1, on a table in which every repeat has every direction."""
    clean = case_table(CASES["firm"])
    found = without_repeat_effects(changed(clean, offset, gain), kind)
    np.testing.assert_allclose(
        found.heights("height"), clean.heights("height"), rtol=EXACT
    )


def test_pushes_that_are_left_out_take_no_part():
    clean = case_table(CASES["firm"])
    moved = changed(clean, SHIFT, np.ones(3)).with_flag([4], "saturated")
    found = without_repeat_effects(moved, "offset")
    used = found.is_used
    assert found.heights("height")[4] == moved.heights("height")[4]
    shift = (found.heights("height") - clean.heights("height"))[used]
    np.testing.assert_allclose(shift, shift[0], atol=EXACT)


def test_noise_within_repeats_is_all_that_a_fit_is_left_with():
    """Pooled noise of 0.02 N where repeats lie 0.1 N apart."""
    table = case_table(CASES["firm"], noise=0.02, seed=1)
    plain = replace(table, frame=table.frame.drop(columns="height_sd_n"))
    moved = changed(plain, SHIFT, np.ones(3))
    alike = fit_table(moved, config()).fit.sigma[0]
    fitted = fit_table(moved, config('[noise]\nrepeats = "offset"\n'))
    own = fitted.fit.sigma[0]
    said = {warning.code: warning.text for warning in fitted.warnings}
    moves = re.findall(r"([+-][\d.]+) \(\d\)", said["repeat_offsets"])
    # Means of 17 heights, four times their noise.
    np.testing.assert_allclose([float(m) for m in moves], -SHIFT, atol=0.02)
    assert alike > 0.07
    # 34 degrees of freedom: 12 % of the noise, four times.
    assert 0.01 < own < 0.03


def test_repeats_without_a_common_direction_have_no_effects():
    table = case_table(CASES["firm"], repeats=1)
    with pytest.raises(ConfigError, match='repeats = "gain"') as caught:
        fit_table(table, config('[noise]\nrepeats = "gain"\n'))
    assert caught.value.code == "no_repeats"


def test_the_chance_of_repeats_that_are_alike_is_uniform():
    direction, repeat = both_ways(case_table(CASES["firm"]))
    rng = np.random.default_rng(2)
    size = 1.0 + np.sin(direction)
    chances = [
        repeat_p_value(rng.standard_normal(51), size, direction, repeat)
        for _ in range(N_TABLES)
    ]
    assert scipy.stats.kstest(chances, "uniform").pvalue > LEVEL
