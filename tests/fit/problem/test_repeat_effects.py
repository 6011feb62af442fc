"""Offsets and gains of whole repeats: found exactly without noise, and taken out."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.data.tables.merge import merge_tables
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError
from pushfit.fit.fitted import fit_table
from pushfit.fit.problem.repeat_effects import (
    both_ways,
    effects_log_factor,
    repeat_effect,
    repeat_p_value,
    scatter_beside_effects,
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


@pytest.mark.parametrize(
    ("kind", "offset", "gain"),
    [("offset", SHIFT, np.ones(3)), ("gain", np.zeros(3), GAIN)],
)
@pytest.mark.parametrize("n_shared", [0, 1])
def test_another_sweep_has_repeats_of_its_own(kind, offset, gain, n_shared):
    """Taken out of each by itself, and between them only by directions of both.

    The other sweep is moved, or grows, as a whole as well; a direction of both shows
    that, and it is divided among them by their numbers of heights.
    """
    one = case_table(CASES["firm"])
    theta = one.theta[: 8 * 3] + (0.0 if n_shared else 0.01)
    alpha = np.where(np.arange(theta.size) < 3, one.alpha[0], one.alpha[0] + 0.1)
    other = PeakTable.from_arrays(
        theta=theta,
        alpha=alpha,
        heights={"height": one.heights("height")[: theta.size]},
        unit="n",
    )
    clean = merge_tables([one, other])
    moves = np.concatenate([offset, offset[::-1] + (kind == "offset") * 0.5])
    gains = np.concatenate([gain, gain[::-1] * (1 + (kind == "gain") * 0.1)])
    found = without_repeat_effects(changed(clean, moves, gains), kind)
    heights, true = found.heights("height"), clean.heights("height")
    left = heights - true if kind == "offset" else heights / true
    sweeps = np.split(left, [one.n_pushes])
    for own in sweeps:
        np.testing.assert_allclose(own, own[0], atol=1e-9)
    apart = 0.5 if kind == "offset" else 0.1
    np.testing.assert_allclose(
        sweeps[1][0] - sweeps[0][0], 0.0 if n_shared else apart, atol=1e-9
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
    alike = fit_table(moved, config('[noise]\nrepeats = "alike"\n')).fit.sigma[0]
    fitted = fit_table(moved, config('[noise]\nrepeats = "offset"\n'))
    own = fitted.fit.sigma[0]
    said = {warning.code: warning.text for warning in fitted.warnings}
    moves = re.findall(r"([+-][\d.]+) \(\d\)", said["repeat_offsets"])
    # Means of 17 heights, four times their noise.
    np.testing.assert_allclose([float(m) for m in moves], -SHIFT, atol=0.02)
    assert alike > 0.07
    # 34 degrees of freedom: 12 % of the noise, four times.
    assert 0.01 < own < 0.03


@pytest.mark.parametrize(
    ("kind", "offset", "gain"),
    [("alike", SHIFT, np.ones(3)), ("gain", np.zeros(3), GAIN)],
)
def test_by_default_gains_of_repeats_are_taken_out(kind, offset, gain):
    """Offsets stay in the noise: that of all repeats together moves θ_c unseen."""
    table = case_table(CASES["firm"], noise=0.01, seed=1)
    assert repeat_codes(fit_table(table, config())) == []
    moved = changed(table, offset, gain)
    found = fit_table(moved, config())
    stated = fit_table(moved, config(f'[noise]\nrepeats = "{kind}"\n'))
    assert repeat_codes(found) == (["repeat_gains"] if kind == "gain" else [])
    assert repeat_effect(moved)[0] == ("gain" if kind == "gain" else "offset")
    assert found.config == stated.config
    np.testing.assert_array_equal(found.fit.estimate, stated.fit.estimate)


def repeat_codes(fitted) -> list[str]:
    """Warnings of what was taken out of whole repeats."""
    return [w.code for w in fitted.warnings if w.code.startswith("repeat_")]


def test_repeats_of_the_same_heights_are_alike():
    """Heights that repeat to the last digit, or but for rounding, show no effect."""
    clean = case_table(CASES["firm"])
    assert np.isnan(repeat_effect(clean)[1])
    rounding = changed(clean, 1e-12 * SHIFT, np.ones(3))
    assert np.isnan(repeat_effect(rounding)[1])


def test_pooled_noise_is_that_of_a_two_way_analysis_of_variance():
    """Residual mean square of directions and repeats, two sweeps and their gaps."""
    one = case_table(CASES["firm"], noise=0.02, seed=1)
    other = case_table(CASES["firm"], noise=0.02, seed=2, theta_deg=[7.0, 33.0, 58.0])
    table = merge_tables([one, other]).with_flag([4, 60], "saturated")
    found = scatter_beside_effects(without_repeat_effects(table, "offset"), "height")
    direction, repeat = both_ways(table)
    heights = table.heights("height")[table.is_used]
    design = np.hstack([np.eye(n.max() + 1)[n] for n in (direction, repeat)])
    left, _, rank, _ = np.linalg.lstsq(design, heights, rcond=None)
    squares = np.sum((heights - design @ left) ** 2)
    dof = heights.size - rank
    np.testing.assert_allclose(found, (np.sqrt(squares / dof), dof), rtol=1e-9)


def test_repeats_without_a_common_direction_have_no_effects():
    table = case_table(CASES["firm"], repeats=1)
    with pytest.raises(ConfigError, match='repeats = "gain"') as caught:
        fit_table(table, config('[noise]\nrepeats = "gain"\n'))
    assert caught.value.code == "no_repeats"


@pytest.mark.parametrize("n_sweeps", [1, 4])
def test_the_chance_of_repeats_that_are_alike_is_uniform(n_sweeps):
    """Of sweeps without a common direction each has its own two repeats."""
    sweep, direction, repeat = np.indices((n_sweeps, 8, 2)).reshape(3, -1)
    direction, repeat = direction + 8 * sweep, repeat + 2 * sweep
    rng = np.random.default_rng(2)
    size, noise = 1.0 + np.sin(direction), 1.0 + repeat / 2
    chances = [
        repeat_p_value(
            noise * rng.standard_normal(size.size), size, noise, direction, repeat
        )
        for _ in range(N_TABLES)
    ]
    assert scipy.stats.kstest(chances, "uniform").pvalue > LEVEL


@pytest.mark.parametrize(
    ("kind", "offset", "gain", "tolerance"),
    [("offset", SHIFT, np.ones(3), 1e-9), ("gain", np.zeros(3), GAIN, 0.02)],
)
def test_effects_are_as_likely_as_a_normal_distribution_with_them(
    kind, offset, gain, tolerance
):
    """Against dense covariances; gains are 4 %, and their squares count in Q of 20."""
    clean = case_table(CASES["firm"])
    table = changed(clean, offset, gain)
    without, mean = without_repeat_effects(table, kind), clean.heights("height")
    direction, repeat = both_ways(table)
    size = np.ones(mean.size) if kind == "offset" else mean
    effects = size[:, None] * np.eye(3)[repeat]
    means = np.eye(direction.max() + 1)[direction]
    left = effects - means @ np.linalg.pinv(means) @ effects
    noise = np.array([0.05, 0.1])
    found = effects_log_factor(
        table, without, np.ones((2, 1, mean.size)) * noise[:, None, None]
    )
    n = mean.size / 3
    for sd, log_factor in zip(noise, found, strict=True):
        prior = n * sd**2 * np.linalg.pinv(left.T @ left, rcond=EXACT)
        own = sd**2 * np.eye(mean.size)
        both = own + left @ prior @ left.T
        normal = scipy.stats.multivariate_normal
        expected = normal.logpdf(table.heights("height"), mean, both)
        expected -= normal.logpdf(without.heights("height"), mean, own)
        assert abs(log_factor - expected) < tolerance * abs(expected)
