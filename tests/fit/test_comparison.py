"""Comparison of models: against closed forms, refits, and brute-force evidence."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from scipy import special

from pushfit.config.rivals import (
    NOISES,
    SOFT_SHARPNESS,
    rival_configs,
)
from pushfit.errors import DataError
from pushfit.fit import comparison
from pushfit.fit.checks.push_densities import PushDensities
from pushfit.fit.comparison import compare_models
from pushfit.fit.problem.setup import build_problem
from pushfit.model import Pushes, forward
from tests.fit.tables import (
    SEVEN_DEG,
    case_table,
    config,
)
from tests.oracle.test_exact import on_grid
from tests.problems import CASES, PUSH
from tests.report.makers import make_comparison
from tests.tolerances import EXACT

# Of the brute-force sums below, by doubling their grids.
BRUTE_FORCE = 2e-3
# Standard errors of the evidence that one table in 16 000 leaves, and the largest that
# may be stated: a factor of 1.02.
ERRORS, SMALL_ERROR = 4, 0.02
# Differences that are drawn, and standard errors of their mean that one in 16 000
# leaves.
N_SUMS, MEAN_ERRORS = 2000, 4


def scored(*densities):
    """Models of which nothing is known but the densities of their pushes."""
    (score, *_) = make_comparison().models
    scores = []
    for elpd in map(np.array, densities):
        none = np.zeros(elpd.size)
        found = PushDensities(elpd=elpd, p_loo=none, pareto_k=none, max_pareto_k=0.7)
        scores.append(dataclasses.replace(score, densities=found))
    return comparison.against_best(scores)


def test_the_square_of_the_standard_error_of_a_difference_is_its_variance():
    """In the mean over differences between few pushes, whose sum varies by n sd²."""
    n, sd = 6, 0.3
    rng = np.random.default_rng(0)
    squares = []
    for _ in range(N_SUMS):
        difference = rng.normal(-9.0, sd, size=n)
        _, worse = scored(np.zeros(n), difference)
        squares.append(worse.elpd_difference_se**2)
    # That of chi-square with n - 1 degrees of freedom, over the square of its mean.
    error = np.sqrt(2 / (n - 1) / N_SUMS)
    assert abs(np.mean(squares) / (n * sd**2) - 1) < MEAN_ERRORS * error


def test_a_difference_in_a_single_push_has_no_standard_error():
    best, worse = scored([0.0], [-9.0])
    assert best.elpd_difference == 0.0
    assert worse.elpd_difference == -9.0
    assert worse.elpd_difference_se is None
    assert not worse.predicts_worse


@pytest.mark.parametrize(("difference", "is_worse"), [(-3.9, False), (-4.1, True)])
def test_models_that_predict_nearly_alike_are_not_told_apart(difference, is_worse):
    """By whatever standard error: here it is none but for rounding."""
    n = 20
    _, other = scored(np.zeros(n), np.full(n, difference / n))
    assert other.elpd_difference_se < EXACT
    assert other.predicts_worse is is_worse


def test_without_rolling_the_tangential_force_is_elastic_at_every_elevation():
    case = CASES["paper"]
    table = case_table(case, theta_deg=np.array([0.01, 1.0, 30.0, 89.0]), repeats=1)
    problem = build_problem(table, rival_configs(config())["no_rolling"]).problem
    assert "C_rr" in problem.fixed
    params = eqx.tree_at(lambda p: p.C_rr, case.params, problem.fixed["C_rr"])
    channels = forward(params, problem.pushes, problem.grasp)
    expected = case.B * PUSH * np.cos(table.theta)
    found = np.asarray(channels.height_tangential)[: table.n_pushes]
    np.testing.assert_allclose(found, expected, rtol=EXACT)


def test_a_table_that_cannot_be_right_is_refused(monkeypatch):
    """At once: equal heights kept emcee busy for minutes."""
    monkeypatch.setattr(comparison, "fitted_by_leading", None)
    table = case_table(CASES["firm"])
    stuck = type(table).from_frame(table.frame.assign(height_n=1.5))
    with pytest.raises(DataError, match=r"height_n is 1\.5 in all 51 pushes"):
        compare_models(stuck, config())


@pytest.mark.parametrize(
    ("share", "erring_deg", "is_told"),
    [(0.0, 0.0, False), (0.2, 0.0, True), (0.0, 3.0, False)],
)
def test_noise_that_residuals_have_none_of_is_no_other_model(
    share, erring_deg, is_told, monkeypatch
):
    """Beside a constant part that is stated; a fifth of the height is far above it."""

    def some(config, **_):
        return {"soft": config, "proportional": rival_configs(config)["proportional"]}

    monkeypatch.setattr(comparison, "rival_configs", some)
    table = case_table(CASES["firm"], noise=0.05, seed=5, theta_deg=SEVEN_DEG)
    rng = np.random.default_rng(1)
    theta = np.radians(table.frame["theta_deg"].to_numpy())
    theta += np.radians(erring_deg) * rng.normal(size=theta.size)
    pushes = Pushes(theta, np.zeros(theta.size))
    case = CASES["firm"]
    clean = np.asarray(forward(case.params, pushes, case.grasp).height)
    # Half of what is stated, so that nothing is left beside it.
    heights = clean + (0.025 + share * clean) * rng.normal(size=clean.size)
    table = dataclasses.replace(table, frame=table.frame.assign(height_n=heights))
    noise = '[noise]\ntheta_sd_deg = "estimate"\n' if erring_deg else ""
    found = compare_models(table, config(noise), seed=0)
    names = {model.name for model in found.models}
    assert names == {"soft", "proportional"} - set(found.left_out)
    assert ("proportional" in names) is is_told


def test_as_many_heights_as_unknowns_that_no_draw_meets_are_not_described(monkeypatch):
    """Rolled, those of 5° and 10° are 1 : 2, else nearer; here they are 1 : 4."""
    monkeypatch.setattr(comparison, "rival_configs", lambda c, **_: {"hard": c})
    table = case_table(CASES["firm"], noise=2e-3, repeats=1, theta_deg=[5.0, 10.0, 15])
    frame = table.frame.assign(height_n=[0.07, 0.31, 0.55])
    (hard,) = compare_models(dataclasses.replace(table, frame=frame), config()).models
    assert not hard.is_adequate


def test_a_noise_that_is_not_the_stated_one_is_said(monkeypatch):
    """Heights scatter ten times as much, and each model takes what it leaves."""
    monkeypatch.setattr(comparison, "rival_configs", lambda c, **_: {"hard": c})
    table = case_table(CASES["firm"], noise=0.05, seed=3, repeats=1)
    frame = table.frame.assign(height_sd_n=0.005)
    (hard,) = compare_models(dataclasses.replace(table, frame=frame), config()).models
    assert hard.is_adequate
    assert "the stated one does not explain" in hard.verdict


@pytest.mark.slow
def test_models_are_ranked_as_by_brute_force():
    """Evidence over a dense grid of ln A, ln B and ln C_rr, in NumPy."""
    theta_deg = np.array([10.0, 30.0, 45.0, 60.0, 80.0])
    table = case_table(CASES["firm"], noise=0.1, theta_deg=theta_deg)
    scores = compare_models(table, config(), seed=0).models
    found = {m.name: m for m in scores if m.name not in NOISES}
    for model, score in found.items():
        expected = brute_force_evidence(table, model)
        error = BRUTE_FORCE + ERRORS * score.log_evidence_error
        assert abs(score.log_evidence - expected) < error, model
        assert score.log_evidence_error < SMALL_ERROR, model
    best = max(score.log_evidence for score in scores)
    for score in found.values():
        assert score.log_bayes_factor == score.log_evidence - best
        assert score.elpd_difference <= 0
    assert found["no_rolling"].is_less_evident
    assert found["no_rolling"].predicts_worse


def brute_force_evidence(table, model):
    """Log evidence by sums over the three combinations, default priors."""
    ln_A, ln_B = np.linspace(5.4, 6.8, 140), np.linspace(0.0, 8.5, 250)
    ln_C = np.linspace(-4.0, 2.5, 160) if model != "no_rolling" else np.zeros(1)
    pushes = zip(table.theta, table.heights("height"), table.sd("height"), strict=True)

    p = SOFT_SHARPNESS
    laws = {
        "hard": np.minimum,
        "soft": lambda elastic, limit: (elastic**-p + limit**-p) ** (-1 / p),
        "no_rolling": lambda elastic, _: elastic,
    }
    log_f = on_grid((ln_A, ln_B, ln_C), pushes, bounded=laws[model])
    steps = [axis[1] - axis[0] for axis in (ln_A, ln_B, ln_C) if axis.size > 1]
    return special.logsumexp(log_f) + np.sum(np.log(steps))


@pytest.mark.parametrize(
    "among", [{"hard", "offset"}, pytest.param(None, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(("moved", "is_favoured"), [(0.5, True), (0.0, False)])
def test_repeats_that_are_moved_are_told_from_repeats_alike(
    moved, is_favoured, among, monkeypatch
):
    """Of repeats alike, effects are as small as these differ, and gain nothing."""

    def some(config, *, has_repeats):
        rivals = rival_configs(config, has_repeats=has_repeats)
        return {k: rivals[k] for k in rivals if among is None or k in among}

    monkeypatch.setattr(comparison, "rival_configs", some)
    table = case_table(CASES["firm"], noise=0.15, seed=5, theta_deg=SEVEN_DEG)
    repeat = table.frame["repeat"].to_numpy()
    heights = table.heights("height") + moved * (repeat - np.mean(repeat))
    frame = table.frame.drop(columns="height_sd_n").assign(height_n=heights)
    table = dataclasses.replace(table, frame=frame)
    found = {m.name: m for m in compare_models(table, config(), seed=0).models}
    assert found["offset"].densities is None
    assert found["hard"].is_less_evident is is_favoured
    assert (found["offset"].log_bayes_factor == 0) is is_favoured
    assert found["offset"].is_less_evident is False
