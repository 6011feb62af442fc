"""What a finished result says beside its numbers."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pushfit.config import parse_config
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.model_free import direction_disagreement
from pushfit.fit.assess.warnings import (
    against_prior,
    bound_warnings,
    contact_warnings,
    contradiction_warning,
    improbable,
    low_scatter_warning,
    result_warnings,
    scatter_warning,
    untested,
)
from pushfit.fit.checks.model_checking import LEVEL
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.results import FitStatus, Verdict
from pushfit.fit.sweep import posterior as sweep
from pushfit.model import Grasp
from pushfit.parameters import NAMED
from tests.fit.posteriors import posterior_of
from tests.fit.tables import SEVEN_DEG, case_table, config
from tests.problems import CASES, PUSH


@pytest.fixture(scope="module")
def found():
    """A result in which nothing is wrong."""
    table = case_table(CASES["firm"], noise=0.02)
    return identify_table(table, config(), seed=0, engine="sweep")


LOW, HIGH = -0.9, -0.1
BESIDE = np.random.default_rng(0).normal(0.0, 0.05, 1000)


@pytest.mark.parametrize(
    ("draws", "is_said"),
    [
        (LOW + BESIDE, True),
        (HIGH + BESIDE, True),
        (-0.5 + BESIDE, False),
        # As the prior has them.
        (np.linspace(LOW, HIGH, 1000), False),
    ],
    ids=["low", "high", "inside", "even"],
)
def test_a_bound_below_zero_is_a_bound(draws, is_said):
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
    posterior = posterior_of({"e1": np.clip(draws, LOW, HIGH)})
    codes = {warning.code for warning in bound_warnings(setup, posterior)}
    assert ("bound_touched" in codes) is is_said


# Half of the last digit that a ratio shows.
ONE_DIGIT = 0.05


@pytest.fixture(scope="module")
def stated():
    """Heights with standard deviations."""
    return fit_table(
        case_table(CASES["firm"], noise=0.02, theta_deg=SEVEN_DEG), config()
    )


@pytest.mark.parametrize(("times", "is_said"), [(0.9, True), (1.1, False)])
@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_scatter_is_said_to_be_other_than_stated_once_in_a_thousand(
    stated, times, is_said, scale
):
    """By chi-square, also where sigma is sampled, and twice what is stated then."""
    dof, kind = stated.fit.degrees_of_freedom, "given" if scale == 1.0 else "sampled"
    setup = replace(stated.setup, noise=replace(stated.setup.noise, kind=kind))
    for chi_square, of in (
        (stats.chi2.isf(times * LEVEL, dof), scatter_warning),
        (stats.chi2.ppf(times * LEVEL, dof), low_scatter_warning),
    ):
        sigma = scale * stated.fit.sigma
        fit = replace(stated.fit, chi_square=chi_square / scale**2, sigma=sigma)
        warning = of(stated.table, setup, fit)
        assert (warning is not None) is is_said
        if warning is not None:
            ratio = float(re.search(r"scatter (\S+) times", warning.text).group(1))
            assert ratio == pytest.approx(np.sqrt(chi_square / dof), abs=ONE_DIGIT)


@pytest.mark.parametrize(
    ("noise", "fit"),
    [
        ({"kind": "pooled"}, {}),
        ({"kind": "sampled", "height_share": np.nan}, {}),
        ({"kind": "sampled", "shared": {"height": np.zeros((1, 21))}}, {}),
        ({}, {"n_free": 21}),
    ],
    ids=["pooled", "in proportion", "of repeats", "none"],
)
def test_nothing_is_said_of_scatter_that_is_not_of_what_is_stated(stated, noise, fit):
    setup = replace(stated.setup, noise=replace(stated.setup.noise, **noise))
    for chi_square in (1e-9, 1e9):
        one = replace(stated.fit, chi_square=chi_square, **fit)
        assert scatter_warning(stated.table, setup, one) is None
        assert low_scatter_warning(stated.table, setup, one) is None


TAILS = '[noise]\nlikelihood = "student_t"\n'


def test_scatter_as_stated_is_no_more_by_heavy_tails():
    """Deviances of 102 normal residuals add up to 170, and of Student's to 140."""
    table = case_table(CASES["firm"], noise=0.02, repeats=6, seed=1)
    fitted = fit_table(table, config(TAILS))
    assert fitted.setup.noise.kind == "given"
    assert low_scatter_warning(table, fitted.setup, fitted.fit) is None
    # A tenth is stated: by as much as the likeliest scale of ν = 4.
    exact = replace(fitted.fit, sigma=fitted.fit.sigma / 10)
    residuals = (table.heights("height") - exact.predicted) / exact.sigma
    _, _, scale = stats.t.fit(residuals, f0=4, floc=0)
    warning = scatter_warning(table, fitted.setup, exact)
    assert warning is not None
    ratio = float(re.search(r"scatter (\S+) times", warning.text).group(1))
    assert ratio == pytest.approx(np.sqrt(2) * scale, abs=ONE_DIGIT)


EVEN = np.linspace(0.5, 1.5, 1000)


@pytest.mark.parametrize("name", ["A", "C_rr"])
def test_what_priors_hardly_allow_is_free_quoted_and_by_draws_to_be_trusted(name):
    samples = dict.fromkeys(("A", "B", "C_rr"), EVEN)
    before, far = samples, samples | {name: 3 * EVEN}
    known = config()
    assert improbable(known, posterior_of(samples, before)) == ()
    (letter,) = improbable(known, posterior_of(far, before))
    assert letter == NAMED[name].prose
    once_in_fifty = samples | {name: np.full(1000, np.quantile(EVEN, 0.99))}
    assert improbable(known, posterior_of(once_in_fifty, before)) == ()
    assert improbable(known, posterior_of(far, before, FitStatus.NOT_CONVERGED)) == ()
    fixed = before | {name: np.ones(1000)}
    assert improbable(known, posterior_of(far, fixed)) == ()
    of_unknown_length = improbable(
        parse_config("", path="g.toml"), posterior_of(far, before)
    )
    assert of_unknown_length == ((letter,) if name == "C_rr" else ())


@pytest.mark.parametrize(
    ("p", "status", "is_adequate", "is_said"),
    [
        (1.0, FitStatus.OK, True, True),
        (2.0, FitStatus.OK, True, False),
        (1.0, FitStatus.OK, False, False),
        (1.0, FitStatus.NOT_CONVERGED, True, False),
    ],
)
def test_a_transition_is_soft_where_one_in_seven_of_the_prior_is(
    p, status, is_adequate, is_said
):
    """The prior has p evenly from 0 to 10."""
    known = dict.fromkeys(("A", "B", "C_rr"), EVEN)
    before = known | {"p": np.linspace(0.0, 10.0, 1000)}
    posterior = posterior_of(known | {"p": np.full(1000, p)}, before, status)
    told = against_prior(config(), posterior, is_adequate=is_adequate)
    assert ("unusually_soft" in {warning.code for warning in told}) is is_said


@pytest.mark.parametrize(
    ("stated", "lower", "n_sigma", "is_said"),
    [
        ("1.0", 0.2, 5.0, True),
        ("1.0", 0.05, 5.0, False),
        ("1.0", 0.11, 0.0, False),
        ('"estimate"', 0.2, 5.0, False),
    ],
)
def test_a_lifted_finger_reads_minus_the_preload_but_for_drift_and_noise(
    found, stated, lower, n_sigma, is_said
):
    """Lower by more than a tenth of the tallest height and five deviations."""
    table, rows = found.table, (3,)
    heights = table.heights("height").copy()
    heights[3] = -1.0 - lower * np.max(heights) - n_sigma * np.max(found.fit.sigma)
    frame = table.frame.assign(height_n=heights)
    lifted = PeakTable.from_frame(frame).with_flag(rows, "lost_contact")
    settings = config(f"[grasp]\npreload_n = {stated}\n")
    told = {w.code for w in contact_warnings(lifted, settings, rows, fit=found.fit)}
    assert ("preload_contradicted" in told) is is_said
    normal = {n: n.replace("ht_", "ht_normal_") for n in ("height_n", "height_sd_n")}
    other = PeakTable.from_frame(frame.rename(columns=normal))
    told = [w.code for w in contact_warnings(other, settings, rows, fit=found.fit)]
    assert told == ["lost_contact"]


def test_how_wide_an_angle_is_and_nothing_of_one_that_was_not_asked(found):
    wide = replace(found.theta_c, verdict=Verdict.WIDE, interval=(10.0, 50.0))
    setup = build_problem(found.table, config())
    warnings = [*result_warnings(setup, replace(found, theta_c=wide))]
    (text,) = [w.text for w in warnings if w.code == "theta_c_wide"]
    assert text.startswith("θ_c: its interval is 40° wide")
    assert not any(w.code.startswith("alpha_star") for w in warnings)


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
        (6, "heights exceed unknowns by 6 only"),
    ],
)
def test_heights_that_leave_nothing_to_test_are_counted_right(degrees_of_freedom, said):
    (warning,) = untested(degrees_of_freedom)
    assert warning.text.startswith(f"{said}, which would not show an outlier")
    assert list(untested(7)) == []


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
    ("interval", "is_said"),
    [((176.0, 184.0), False), ((166.0, 174.0), True), (None, False)],
)
def test_directions_on_either_side_of_a_half_turn_are_near_each_other(
    found, interval, is_said
):
    by_model = replace(found.theta_c, name="alpha_star", interval=(1.0, 5.0))
    told = direction_disagreement(
        by_model,
        replace(by_model, interval=interval),
        found.table,
        grasp=Grasp(push_length=PUSH),
        predict=lambda angles: np.empty((0, angles.shape[1])),
    )
    assert bool(list(told)) is is_said


@pytest.mark.parametrize(("name", "symbol"), [("K_sn", "A"), ("K_st", "B")])
def test_a_spring_that_is_softer_than_the_series_that_it_is_part_of_is_named(
    found, name, symbol
):
    whole = np.exp(found.fit.estimate[found.fit.names.index(f"ln_{symbol}")])
    for factor in (0.9, 1.1):
        fixed = f"[parameters.{name}]\nfixed = {factor * whole}\n"
        setup = build_problem(found.table, config(fixed))
        warning = contradiction_warning(setup, found.fit)
        assert (warning is not None) is (factor < 1)
        if warning is not None:
            assert warning.text.startswith(f"{name} is fixed at ")
            assert f"a series stiffness {symbol} of {whole:.3g}," in warning.text


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
