"""What a finished result says beside its numbers."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.warnings import (
    bound_warnings,
    result_warnings,
    untested,
)
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.results import FitStatus, PosteriorResult, Verdict
from pushfit.fit.sweep import posterior as sweep
from pushfit.model import Grasp
from tests.fit.tables import case_table, config
from tests.problems import CASES, PUSH


@pytest.fixture(scope="module")
def found():
    """A result in which nothing is wrong."""
    table = case_table(CASES["firm"], noise=0.02)
    return identify_table(table, config(), seed=0, engine="sweep")


@pytest.mark.parametrize(
    ("end", "is_said"), [(-0.9, True), (-0.1, True), (-0.5, False)]
)
def test_a_bound_below_zero_is_a_bound(end, is_said):
    """e1 may have any sign."""
    text = "[parameters.e1]\nuniform = { low = -0.9, high = -0.1 }\n"
    alpha_deg = np.tile(np.arange(0.0, 180.0, 30.0), 3)
    table = case_table(
        CASES["firm"],
        noise=0.02,
        theta_deg=np.repeat([20.0, 40.0, 60.0], 6),
        alpha_deg=alpha_deg,
    )
    setup = build_problem(table, config(text))
    draws = np.random.default_rng(0).normal(end, 0.05, 1000)
    posterior = PosteriorResult(
        samples={"e1": np.clip(draws, -0.9, -0.1)},
        prior_samples={},
        log_prob=np.zeros(1000),
        chain=None,
        chain_names=(),
        thin=1,
        engine="sweep",
        diagnostics=None,
        log_evidence=None,
        log_evidence_error=None,
        seed=0,
        status=FitStatus.OK,
    )
    codes = {warning.code for warning in bound_warnings(setup, posterior)}
    assert ("bound_touched" in codes) is is_said


def test_an_integral_that_is_not_settled_is_no_solver_that_stopped(monkeypatch):
    monkeypatch.setattr(sweep, "TOO_FEW", 1e9)
    table = case_table(CASES["firm"], noise=0.02)
    result = identify_table(table, config(), seed=0, engine="sweep")
    assert result.status is FitStatus.NOT_CONVERGED
    assert result.theta_c.verdict is Verdict.UNKNOWN
    texts = [n.text for n in result.warnings if n.code == "not_converged"]
    assert len(texts) == 1
    assert "of the weighted draws" in texts[0]
    # That of emcee says nothing of another engine: `auto` came from it.
    assert 'engines "auto" and "emcee"' in texts[0]
    assert "engine" not in FitStatus.NOT_CONVERGED.value
    assert "step limit" not in " ".join(n.text for n in result.warnings)


@pytest.mark.parametrize(
    ("degrees_of_freedom", "said"),
    [
        (-2, "heights are fewer than unknowns"),
        (0, "heights are as many as unknowns"),
        (1, "heights exceed unknowns by 1 only"),
    ],
)
def test_heights_that_leave_nothing_to_test_are_counted_right(degrees_of_freedom, said):
    (warning,) = untested(degrees_of_freedom)
    assert warning.text.startswith(f"{said}, which would not show an outlier")


def test_outliers_come_with_what_to_do(found):
    goodness = replace(found.goodness_of_fit, outliers=("push 8",))
    warnings = result_warnings(
        build_problem(found.table, config()), replace(found, goodness_of_fit=goodness)
    )
    (text,) = [w.text for w in warnings if w.code == "outliers"]
    assert text.startswith("more than 5 sigma from the fit: push 8; look at")


def test_what_is_far_from_the_prior_is_said_of_a_rejected_model_too():
    """Millinewtons in a column of newtons may be what it is rejected for."""
    frame = case_table(CASES["firm"], noise=0.02).frame
    large = {name: 1e3 * frame[name] for name in ("height_n", "height_sd_n")}
    table = PeakTable.from_frame(frame.assign(**large))
    found = identify_table(table, config(), seed=0, engine="sweep")
    goodness = replace(found.goodness_of_fit, is_adequate=False)
    warnings = result_warnings(
        build_problem(found.table, config()), replace(found, goodness_of_fit=goodness)
    )
    assert {"model_inadequate", "far_from_prior"} <= {w.code for w in warnings}


@pytest.mark.parametrize(("n", "is_said"), [(12, True), (13, False)])
def test_what_most_pushes_are_is_no_outlier(found, n, is_said):
    """Of 51 pushes; with many the model is what does not fit."""
    names = tuple(f"push {i}" for i in range(n))
    goodness = replace(found.goodness_of_fit, outliers=names)
    warnings = result_warnings(
        build_problem(found.table, config()), replace(found, goodness_of_fit=goodness)
    )
    assert ("outliers" in {w.code for w in warnings}) is is_said


@pytest.mark.parametrize("estimate", [20.0, None])
def test_directions_that_disagree_are_said_also_without_an_estimate(found, estimate):
    """A best direction that is too wide to be quoted by one number has an interval."""
    direction = replace(found.theta_c, name="alpha_star")
    found = replace(
        found,
        alpha_star=replace(direction, estimate=estimate, interval=(10.0, 30.0)),
        alpha_star_model_free=replace(direction, estimate=80.0, interval=(75.0, 85.0)),
    )
    warnings = result_warnings(build_problem(found.table, config()), found)
    (text,) = [w.text for w in warnings if w.code == "alpha_star_disagreement"]
    assert "10° to 30° by the model but in 75° to 85° by a cosine" in text


@pytest.mark.parametrize(
    ("preload", "prior_of_p", "is_said"),
    [(1.0, 8.0, True), (0.0, 8.0, False), (1.0, 1.5, False)],
    ids=["preload-not-stated", "as-stated", "soft-by-the-prior"],
)
def test_a_transition_that_hides_what_was_not_stated_is_unusually_soft(
    preload, prior_of_p, is_said
):
    """Transitions are hard, and all tables pass as those of soft ones."""
    case = replace(CASES["firm"], grasp=Grasp(push_length=PUSH, preload=preload))
    table = case_table(case, noise=0.01, theta_deg=np.linspace(5.0, 85.0, 17))
    text = f"""[transition]
sharpness = "auto"
[parameters.p]
lognormal = {{ median = {prior_of_p}, sd_log = 1.0 }}
"""
    found = identify_table(table, config(text), seed=0, engine="sweep")
    assert found.goodness_of_fit.is_adequate
    assert ("unusually_soft" in {w.code for w in found.warnings}) is is_said
