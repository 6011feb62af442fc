"""Offsets and gains of whole repeats: found exactly without noise, and taken out."""

import re
from dataclasses import replace

import numpy as np
import pytest
import scipy

from pushfit.data.tables.merge import merge_tables
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.problem.encoding import encode
from pushfit.fit.problem.noise import choose_noise
from pushfit.fit.problem.repeats.effects import (
    both_ways,
    effect_sds,
    repeat_effect,
    repeat_p_value,
    scatter_beside_effects,
    without_repeat_effects,
)
from pushfit.fit.sweep.prior import make_target
from pushfit.model import as_float
from pushfit.parameters import SIX
from tests.fit.tables import SEVEN_DEG, case_table, config
from tests.problems import CASES
from tests.tolerances import EXACT, ROUTES

SHIFT = np.array([-0.1, 0.03, 0.07])
GAIN = np.array([0.96, 1.01, 1.03])
# Means of seven heights with noise of 0.02 N: two and a half times their own.
MEANS = 0.02
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
    moved = changed(clean, moves, gains)
    found = without_repeat_effects(moved, kind)
    heights, true = found.heights("height"), clean.heights("height")
    left = heights - true if kind == "offset" else heights / true
    sweeps = np.split(left, [one.n_pushes])
    for own in sweeps:
        np.testing.assert_allclose(own, own[0], rtol=0, atol=ROUTES)
    # Over the heights of what is connected effects are 0, or 1, on average.
    old = moved.heights("height")
    effects = old - heights if kind == "offset" else old / heights - 1
    for own in [effects] if n_shared else np.split(effects, [one.n_pushes]):
        np.testing.assert_allclose(np.mean(own), 0.0, atol=ROUTES)
    apart = 0.5 if kind == "offset" else 0.1
    np.testing.assert_allclose(
        sweeps[1][0] - sweeps[0][0], 0.0 if n_shared else apart, rtol=0, atol=ROUTES
    )


def test_pushes_that_are_left_out_take_no_part():
    clean = case_table(CASES["firm"])
    moved = changed(clean, SHIFT, np.ones(3)).with_flag([4], "saturated")
    found = without_repeat_effects(moved, "offset")
    used = found.is_used
    assert found.heights("height")[4] == moved.heights("height")[4]
    shift = (found.heights("height") - clean.heights("height"))[used]
    np.testing.assert_allclose(shift, shift[0], rtol=0, atol=EXACT)


def test_noise_within_repeats_is_all_that_a_fit_is_left_with():
    """Pooled noise of 0.02 N where repeats lie 0.1 N apart."""
    table = case_table(CASES["firm"], noise=0.02, seed=2, theta_deg=SEVEN_DEG)
    plain = replace(table, frame=table.frame.drop(columns="height_sd_n"))
    moved = changed(plain, SHIFT, np.ones(3))
    pooled = '[noise]\nsigma = "pooled"\n'
    alike = fit_table(moved, config(f'{pooled}repeats = "alike"\n')).fit.sigma[0]
    fitted = fit_table(moved, config(f'{pooled}repeats = "offset"\n'))
    own = fitted.fit.sigma[0]
    said = {warning.code: warning.text for warning in fitted.warnings}
    moves = re.findall(r"([+-][\d.]+) \(\d\)", said["repeat_offsets"])
    np.testing.assert_allclose([float(m) for m in moves], SHIFT, atol=MEANS)
    assert alike > 0.07
    # 12 degrees of freedom: 20 % of the noise, two and a half times.
    assert 0.01 < own < 0.03


@pytest.mark.parametrize(
    ("kind", "offset", "gain"),
    [("offset", SHIFT, np.ones(3)), ("gain", np.zeros(3), GAIN)],
)
def test_by_default_repeats_have_the_effects_that_they_show(kind, offset, gain):
    table = case_table(CASES["firm"], noise=0.01, seed=1, theta_deg=SEVEN_DEG)
    assert repeat_codes(fit_table(table, config())) == []
    moved = changed(table, offset, gain)
    found = fit_table(moved, config())
    stated = fit_table(moved, config(f'[noise]\nrepeats = "{kind}"\n'))
    assert repeat_codes(found) == [f"repeat_{kind}s"]
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
    np.testing.assert_allclose(found, (np.sqrt(squares / dof), dof), rtol=ROUTES)


def test_repeats_without_a_common_direction_have_no_effects():
    table = case_table(CASES["firm"], repeats=1)
    with pytest.raises(ConfigError, match='repeats = "gain"') as caught:
        fit_table(table, config('[noise]\nrepeats = "gain"\n'))
    assert caught.value.code == "no_repeats"


def test_of_effects_that_tell_about_as_much_it_is_an_offset():
    """By heights that are nearly alike gains are a little likelier, if at all."""
    clean = case_table(CASES["firm"], theta_deg=SEVEN_DEG)
    direction, repeat = both_ways(clean)
    rng, chances = np.random.default_rng(5), []
    for _ in range(20):
        heights = (1 + direction / 50) * (1 + 0.02 * (GAIN[repeat] - 1))
        heights = heights + 5e-4 * rng.standard_normal(heights.size)
        table = replace(clean, frame=clean.frame.assign(height_n=heights))
        mean = (np.bincount(direction, heights) / np.bincount(direction))[direction]
        noise = np.ones(heights.size)
        of_gain, of_offset = (
            repeat_p_value(heights, size, noise, direction=direction, repeat=repeat)
            for size in (mean, noise)
        )
        kind, chance = repeat_effect(table)
        is_plain = of_gain < 0.1 * of_offset
        assert kind == ("gain" if is_plain else "offset")
        expected = min(1.0, 2 * (of_gain if is_plain else of_offset))
        np.testing.assert_allclose(chance, expected, rtol=ROUTES)
        chances.append((of_gain < of_offset) and not is_plain)
    assert any(chances)


@pytest.mark.parametrize("n_sweeps", [1, 4])
def test_the_chance_of_repeats_that_are_alike_is_uniform(n_sweeps):
    """Of sweeps without a common direction each has its own two repeats."""
    sweep, direction, repeat = np.indices((n_sweeps, 8, 2)).reshape(3, -1)
    direction, repeat = direction + 8 * sweep, repeat + 2 * sweep
    rng = np.random.default_rng(2)
    size, noise = 1.0 + np.sin(direction), 1.0 + repeat / 2
    chances = [
        repeat_p_value(
            noise * rng.standard_normal(size.size),
            size,
            noise,
            direction=direction,
            repeat=repeat,
        )
        for _ in range(N_TABLES)
    ]
    assert scipy.stats.kstest(chances, "uniform").pvalue > LEVEL


@pytest.mark.parametrize("sigma", ["pooled", "sampled"])
@pytest.mark.parametrize("kind", ["offset", "gain"])
def test_heights_are_as_likely_as_a_normal_distribution_with_what_they_share(
    kind, sigma
):
    """Against a dense covariance; by the sweep as well, its repeats not pooled."""
    clean = case_table(CASES["firm"], noise=0.02, seed=3, theta_deg=SEVEN_DEG)
    plain = replace(clean, frame=clean.frame.drop(columns="height_sd_n"))
    table = changed(plain, SHIFT * (kind == "offset"), GAIN ** (kind == "gain"))
    text = f'[noise]\nrepeats = "{kind}"\nsigma = "{sigma}"\n'
    setup = fit_table(table, config(text)).setup
    problem, n = setup.problem, table.n_pushes
    truth = {name: getattr(CASES["firm"].params, name) for name in SIX}
    values = {name: np.array([value]) for name, value in truth.items()}
    sampled = values | {"sigma_height": np.array([0.025])}
    x = as_float(encode(problem, sampled)[0])
    state = problem.state(x)
    noise = np.asarray(problem.noise(state))[0, :n]
    # In units of the noise that was settled: what is shared grows with what is not.
    scale = noise / np.asarray(problem.reference_sigma)[0, :n]
    v = scale * setup.noise.shared["height"]
    _, repeat = both_ways(table)
    assert np.array_equal(v != 0, np.arange(3)[:, None] == repeat)
    mean = np.asarray(problem.predict(state))[0, :n]
    expected = scipy.stats.multivariate_normal.logpdf(
        table.heights("height"), mean, np.diag(noise**2) + v.T @ v
    )
    found = float(problem.log_likelihood(state))
    np.testing.assert_allclose(found, expected, rtol=ROUTES)
    swept = make_target(problem, 0.0).log_prob(x) - problem.log_prior(x)
    np.testing.assert_allclose(float(swept), expected, rtol=ROUTES)


@pytest.mark.parametrize("kind", ["offset", "gain"])
def test_what_repeats_share_has_the_interval_of_student(kind):
    """1.645 of its standard deviations are t s / √n of the effects of n repeats."""
    clean = case_table(CASES["firm"])
    is_offset = kind == "offset"
    effects = SHIFT if is_offset else GAIN
    moved = changed(clean, *((SHIFT, np.ones(3)) if is_offset else (np.zeros(3), GAIN)))
    v = effect_sds(moved, without_repeat_effects(moved, kind), kind)["height"]
    share = np.max(v, axis=0) / (1.0 if is_offset else clean.heights("height"))
    low, high = scipy.stats.t.interval(0.9, 2, scale=scipy.stats.sem(effects))
    half = scipy.stats.norm.ppf(0.95) * share / np.sqrt(3)
    np.testing.assert_allclose(half, (high - low) / 2, rtol=ROUTES)


def test_one_direction_in_two_repeats_shows_an_effect_and_no_noise():
    table = case_table(CASES["firm"], theta_deg=SEVEN_DEG, noise=0.02)
    flags = [row for row in range(table.n_pushes) if row % 3 and row != 1]
    one = table.with_flag(flags, "saturated")
    found = scatter_beside_effects(without_repeat_effects(one, "offset"), "height")
    assert found[1] == 0
    assert np.isnan(found[0])


@pytest.mark.parametrize("n_repeats", [2, 3, 6])
@pytest.mark.parametrize("kind", ["offset", "gain"])
def test_what_repeats_may_have_in_common_is_as_wide_as_it_says(kind, n_repeats):
    """1.645 standard deviations of the mean effect hold it 90 times in 100."""
    one = case_table(CASES["firm"], repeats=n_repeats)
    mean = one.heights("height")
    _, repeat = both_ways(one)
    rng, n_hits = np.random.default_rng(4), 0
    for _ in range(N_TABLES):
        effects = 0.1 * rng.standard_normal(n_repeats)
        moved = mean + effects[repeat] * (1.0 if kind == "offset" else mean / 20)
        table = replace(one, frame=one.frame.assign(height_n=moved))
        v = effect_sds(table, without_repeat_effects(table, kind), kind)["height"]
        size = np.max(v, axis=0) / (1.0 if kind == "offset" else mean / 20)
        n_hits += abs(np.mean(effects)) < 1.645 * np.mean(size) / np.sqrt(n_repeats)
    low, high = scipy.stats.binom.interval(1 - LEVEL, N_TABLES, 0.9)
    assert low <= n_hits <= high


def test_the_sign_of_a_component_says_nothing_of_gains():
    """Pairs of opposite heights add up to nothing in each repeat."""
    one = case_table(CASES["firm"], theta_deg=np.arange(5, 85, 5), alpha_deg=[0] * 16)
    _, repeat = both_ways(one)
    heights = GAIN[repeat] * np.repeat(np.arange(1.0, 9.0), 6)
    found = []
    for sign in (1.0, np.repeat(np.tile([1.0, -1.0], 8), 3)):
        table = replace(one, frame=one.frame.assign(height_n=sign * heights))
        alone = without_repeat_effects(table, "gain")
        found.append(np.abs(effect_sds(table, alone, "gain")["height"]))
    np.testing.assert_allclose(found[1], found[0], rtol=ROUTES)


@pytest.mark.parametrize("kind", ["offset", "gain"])
def test_a_stated_effect_needs_no_repeated_direction(kind):
    """Each of two sweeps of one pass has an effect of its own, as large as stated."""
    one = case_table(CASES["firm"], repeats=1)
    other = case_table(
        CASES["firm"], repeats=1, theta_deg=[7.0, 33.0], alpha_deg=[0, 9]
    )
    table = merge_tables([one, other]).with_flag([4], "saturated")
    text = f'[noise]\n{kind}_sd = 0.03\nsigma = "sampled"\n'
    found = choose_noise(table, config(text)).shared["height"]
    size = np.ones(19) if kind == "offset" else table.heights("height")
    expected = 0.03 * size * np.stack([np.arange(19) < 17, np.arange(19) >= 17])
    expected[:, 4] = 0.0
    np.testing.assert_allclose(found, expected, rtol=EXACT)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('repeats = "alike"\ngain_sd = 0.03\n', "gain_sd says"),
        ('repeats = "gain"\noffset_sd = 0.03\n', "offset_sd says"),
        ("offset_sd = 0.03\ngain_sd = 0.02\n", "offset_sd = 0.03 and gain_sd = 0.02"),
        (
            'offset_sd = 0.03\ntheta_sd_deg = 1.0\nangle_errors = "shared"\n',
            "leaves nothing",
        ),
    ],
)
def test_effects_that_contradict_each_other_are_refused(text, word):
    with pytest.raises(ConfigError, match=word):
        config(f"[noise]\n{text}")
