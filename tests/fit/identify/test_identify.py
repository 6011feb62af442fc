"""Whole identifications: what may be said is said, and nothing more."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from pushfit.config import parse_config
from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.errors import ConfigError, DataError
from pushfit.fit.assess.reporting_rules import reported
from pushfit.fit.assess.verdicts import angle_quantity, quantities
from pushfit.fit.checks.violations import Violation
from pushfit.fit.identify import fit_table as fit_table_module
from pushfit.fit.identify import fitted as fitted_module
from pushfit.fit.identify.by_mechanics import profiles_of
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import sweep
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.results import FitStatus, PosteriorResult, Verdict
from tests.fit.tables import (
    FRICTION_ONLY,
    HARD,
    NORMAL,
    SEVEN_DEG,
    case_table,
    config,
    one_sided_table,
)
from tests.problems import CASES

# Noise that is the same for all heights, whatever their residuals show.
CONSTANT = "[noise]\nheight_share = 0.0\n"
# The same, normal or heavy-tailed as the heights have it.
CHOSEN = CONSTANT + 'likelihood = "auto"\n'
# 18 degrees of freedom: sigma is known to 17 %; more than two of them.
SIGMA = 0.4
# 14 of them, without repeats: it is known to 19 %; two and a half of them.
SIGMA_ONCE = 0.5
# A set may reach beyond the lowest push by a fifth of a step between pushes [deg].
BETWEEN = 1.0
# The channel of which friction is all that other tests leave free, too.
FRICTION = ("height_tangential",)
# R² of a model that leaves most of the variance of the heights.
POOR = 0.5
# Standard deviation of noise with heavy tails [N].
TAIL_SD = 0.02
# What one free number takes of either noise, half a χ² of one degree of freedom, is
# much the same of both.
OF_ONE_NUMBER = 0.5
# Quantiles of 8192 draws that lie within 2°, several standard errors, and the width of
# the kernel that smooths them [deg].
DRAWN, SMOOTHED = 0.1, 0.5
# The sd of 51 normal heights is known to 10 %.
SD_OF_51 = 0.1


@pytest.fixture(scope="module")
def determined():
    table = case_table(CASES["firm"], noise=0.03, seed=1)
    return identify_table(table, config(), seed=1, engine="sweep")


@pytest.fixture(scope="module")
def one_sided():
    return identify_table(one_sided_table(), config(), seed=1, engine="sweep")


def warning_codes(result) -> set[str]:
    return {warning.code for warning in result.warnings}


def test_a_determined_angle_has_an_interval_that_holds_the_truth(determined):
    theta_c = determined.theta_c
    assert determined.status is FitStatus.OK
    assert theta_c.verdict is Verdict.DETERMINED
    low, high = theta_c.interval
    assert low < CASES["firm"].critical_angle_deg < high
    assert low < theta_c.estimate < high
    assert len(theta_c.sets) == len(theta_c.likelihood_sets) == 1


def test_a_sharp_profile_determines_nothing_where_the_draws_are_those_of_the_prior(
    determined,
):
    """As many parameters as pushes fit anything; the posterior does not follow."""
    posterior = determined.posterior
    n = posterior.log_prob.size
    samples = {k: np.resize(v, n) for k, v in posterior.prior_samples.items()}
    ignorant = replace(posterior, samples=samples)
    profile = determined.profiles["theta_c"]
    theta_c = angle_quantity("theta_c", ignorant, profile, prob=0.9)
    assert profile.verdict is Verdict.DETERMINED
    assert theta_c.verdict is Verdict.NOT_DETERMINED
    shown = reported(replace(determined, theta_c=theta_c)).theta_c
    assert shown.estimate is shown.interval is None
    assert shown.sets == ()


def test_a_contact_that_never_rolls_has_no_critical_angle_and_no_bound():
    """Components see no tangential force but the share of friction's limit."""
    case = CASES["never_rolls"]
    table = case_table(
        case, noise=0.02, channels=("height_normal", "height_tangential")
    )
    settings = config("[grasp]\npreload_n = 4.0\n")
    found = identify_table(table, settings, seed=1, engine="sweep")
    theta_c = found.theta_c
    assert theta_c.verdict is Verdict.ABSENT
    assert theta_c.estimate is theta_c.interval is None
    assert theta_c.sets == theta_c.likelihood_sets == ()
    assert not any(code.startswith("theta_c") for code in warning_codes(found))


@pytest.mark.parametrize(
    ("centres", "sd", "verdict"),
    [
        ((100.0,), 5.0, Verdict.DETERMINED),
        ((40.0, 130.0), 5.0, Verdict.SEVERAL_MODES),
        ((100.0,), 500.0, Verdict.NOT_DETERMINED),
    ],
)
def test_draws_alone_tell_of_a_direction_without_a_profile(
    determined, centres, sd, verdict
):
    """As on two supports, where the best direction is not the soft axis."""
    posterior, rng = determined.posterior, np.random.default_rng(0)
    n = posterior.log_prob.size
    draws = (rng.choice(centres, n) + sd * rng.standard_normal(n)) % 180.0
    anything = rng.uniform(0.0, 180.0, posterior.prior_samples["theta_c"].size)
    posterior = replace(
        posterior,
        samples={"alpha_star": draws},
        prior_samples={"alpha_star": anything},
    )
    found = angle_quantity(
        "alpha_star", posterior, None, prob=0.9, is_axis=True, by_draws=True
    )
    assert found.verdict is verdict
    unasked = angle_quantity("alpha_star", posterior, None, prob=0.9)
    assert unasked.verdict is Verdict.NOT_DETERMINED


@pytest.mark.parametrize("reach", [(0.0, 150.0), (-30.0, 60.0), (200.0, 260.0)])
def test_the_best_direction_lies_within_the_reach(determined, reach):
    """Draws at both ends of it: as of an axis, the interval would be what is between
    them beyond the reach."""
    low, high = reach
    posterior, rng = determined.posterior, np.random.default_rng(0)
    n = posterior.log_prob.size
    ends = rng.choice([low, high - 2], n) + 2 * rng.random(n)
    anything = rng.uniform(low, high, posterior.prior_samples["theta_c"].size)
    posterior = replace(
        posterior, samples={"alpha_star": ends}, prior_samples={"alpha_star": anything}
    )
    found = angle_quantity("alpha_star", posterior, None, prob=0.9, by_draws=True)
    # A twentieth beyond either end of it: a tenth of those at that end.
    assert found.interval == pytest.approx((low + 0.2, high - 0.2), abs=DRAWN)
    assert found.sets[0][0] == pytest.approx(low, abs=SMOOTHED)
    assert found.sets[-1][1] == pytest.approx(high, abs=SMOOTHED)


def test_a_result_is_made_as_it_is_reported(determined, one_sided):
    """A one-sided B has a bound, and neither a middle nor an interval."""
    for result in (determined, one_sided):
        again = reported(result)
        for name in ("theta_c", "alpha_star", "parameters", "combinations"):
            assert getattr(again, name) == getattr(result, name)
    open_sided = [q for q in one_sided.combinations if q.verdict is Verdict.ONE_SIDED]
    assert all(q.estimate is q.interval is None for q in open_sided)


def test_the_configuration_in_force_says_what_auto_came_to(determined, one_sided):
    """Both tables state the sd of every height, which repeats do not contradict."""
    for result in (determined, one_sided):
        assert result.config.noise.sigma == "given"


def test_combinations_are_determined_and_single_stiffnesses_are_not(determined):
    case = CASES["firm"]
    for quantity, truth in zip(determined.combinations, (case.A, case.B), strict=True):
        low, high = quantity.interval
        assert quantity.verdict is Verdict.DETERMINED
        assert low < truth < high
    by_name = {quantity.name: quantity for quantity in determined.parameters}
    assert by_name["C_rr"].verdict is Verdict.LEARNED
    for name in ("K_sn", "K_dn", "K_st", "C_d", "L"):
        assert by_name[name].verdict in (Verdict.PARTLY, Verdict.ASSUMED)


def test_heights_fix_three_directions_of_six(determined):
    """The rank of the Jacobian on the table's own pushes is that of (A, B, C_rr)."""
    found = determined.identifiability
    assert (found.rank, found.n_parameters) == (3, 6)
    assert [c.is_determined for c in found.directions] == [True] * 3 + [False] * 3
    assert all("L" not in c.formula.split(" · ")[0] for c in found.directions[:1])


def test_one_azimuth_gives_no_direction(determined):
    assert determined.alpha_star.verdict is Verdict.NOT_DETERMINED
    assert determined.alpha_star.estimate is None
    assert determined.alpha_star_model_free is None


def test_a_one_sided_angle_is_a_bound_without_a_number(one_sided):
    theta_c = one_sided.theta_c
    assert theta_c.verdict is Verdict.ONE_SIDED
    assert theta_c.estimate is None
    assert theta_c.interval is None
    low, high = theta_c.sets[-1]
    assert high is None
    assert low < CASES["one_sided"].critical_angle_deg
    assert "theta_c_one_sided" in warning_codes(one_sided)


def test_bands_hold_the_noise_free_curve(determined):
    """At the table's own angles the 90 % band holds most of the true heights."""
    (band,) = determined.bands
    table = case_table(CASES["firm"])
    truth = np.interp(
        band.angle_deg, table.frame["theta_deg"][::3], table.heights("height")[::3]
    )
    inside = (band.lower <= truth) & (truth <= band.upper)
    within = (band.angle_deg > 6) & (band.angle_deg < 84)
    # The curve has three free numbers: it leaves its band together or not at all.
    assert inside[within].mean() > 0.5
    assert np.all(band.lower <= band.median)
    assert np.all(band.median <= band.upper)


def test_components_determine_what_a_magnitude_does_not():
    text = '[noise]\nsigma = "given"\n'
    widths = []
    for channels in (("height",), ("height_normal", "height_tangential")):
        table = case_table(
            CASES["blind_magnitude"], noise=0.05, seed=2, channels=channels
        )
        result = identify_table(table, config(text), seed=0, engine="sweep")
        low, high = result.theta_c.likelihood_sets[-1]
        widths.append((90.0 if high is None else high) - (low or 0.0))
    assert widths[1] < widths[0] / 3


def test_an_unknown_push_length_quotes_no_stiffness():
    table = case_table(CASES["firm"], noise=0.03, seed=1, theta_deg=SEVEN_DEG)
    result = identify_table(table, unequal(), seed=1, engine="sweep")
    assert "push_length_unknown" in warning_codes(result)
    quoted = {q.name: q for q in (*result.parameters, *result.combinations)}
    for name in ("K_sn", "K_dn", "K_st", "C_d", "A", "B"):
        assert quoted[name].estimate is None
        assert quoted[name].interval is None
        assert quoted[name].likelihood_sets == ()
    assert quoted["C_rr"].estimate is not None


def test_pushes_that_lift_the_finger_off_are_left_out():
    """A S_p sin 60° exceeds a preload of 1 N downwards."""
    case = CASES["preload"]
    table = case_table(case, noise=0.02, theta_deg=np.arange(-60.0, 61.0, 10.0))
    # As from a sensor, which does not know that the finger has left.
    table = type(table).from_frame(table.frame.drop(columns="flags"))
    settings = config(f"[grasp]\npreload_n = {float(case.grasp.preload)!r}\n")
    fitted = fit_table(table, settings)
    lifted = np.radians(-60.0)
    A = case.A * 0.005
    is_lost = float(case.grasp.preload) + A * np.sin(fitted.table.theta) < 0
    assert float(case.grasp.preload) + A * np.sin(lifted) < 0
    np.testing.assert_array_equal(~fitted.table.is_used, is_lost)
    assert {warning.code for warning in fitted.warnings} >= {"lost_contact"}


@pytest.mark.parametrize(
    ("lowest", "share", "is_said"), [(-30.0, 0.5, True), (-60.0, 1.0, False)]
)
def test_heights_below_that_of_a_lifted_finger_contradict_the_preload(
    lowest, share, is_said
):
    """They are left out as lifted off, and θ_c by the rest is sure and wrong."""
    case = CASES["preload"]
    table = case_table(case, noise=0.02, theta_deg=np.arange(lowest, 61.0, 10.0))
    table = type(table).from_frame(table.frame.drop(columns="flags"))
    preload = share * float(case.grasp.preload)
    settings = config(f"[grasp]\npreload_n = {preload!r}\n")
    found = identify_table(table, settings, seed=0, engine="sweep", is_brief=True)
    codes = warning_codes(found)
    assert "lost_contact" in codes
    assert ("preload_contradicted" in codes) is is_said
    assert found.goodness_of_fit.is_adequate is not is_said
    if is_said:
        assert found.theta_c.interval is None
        assert "preload" in found.goodness_of_fit.sentence


def test_standard_deviations_that_repeats_contradict_are_widened():
    table = case_table(CASES["firm"], noise=0.05, seed=3, theta_deg=SEVEN_DEG)
    frame = table.frame.assign(height_sd_n=0.005)
    fitted = fit_table(type(table).from_frame(frame), config())
    assert "sd_contradicted" in {warning.code for warning in fitted.warnings}
    np.testing.assert_allclose(np.median(fitted.fit.sigma), 0.05, rtol=SIGMA)


def test_scatter_beyond_the_stated_sd_widens_every_interval():
    table = case_table(CASES["firm"], noise=0.05, seed=3, repeats=1)
    frame = table.frame.assign(height_sd_n=0.005)
    fitted = fit_table(type(table).from_frame(frame), config())
    assert "scatter_exceeds_sd" in {warning.code for warning in fitted.warnings}
    np.testing.assert_allclose(np.median(fitted.fit.sigma), 0.05, rtol=SIGMA_ONCE)
    found = identify_table(fitted.table, config(), seed=0, engine="sweep")
    assert "the stated one does not explain" in found.goodness_of_fit.sentence


def unequal():
    """Settings without a push length: what repeats scatter by is no sensor's noise."""
    return parse_config(HARD + NORMAL, path="grasp.toml")


@pytest.mark.parametrize(("sd", "n_said"), [(0.005, 1), (0.05, 0)])
def test_scatter_beyond_the_stated_sd_is_said_where_pushes_may_be_unequal(sd, n_said):
    """Noise is sampled there, beside the standard deviations that are stated."""
    table = case_table(CASES["firm"], noise=0.05, seed=3, theta_deg=SEVEN_DEG)
    frame = table.frame.assign(height_sd_n=sd)
    fitted = fit_table(type(table).from_frame(frame), unequal())
    texts = [w.text for w in fitted.warnings if w.code == "scatter_exceeds_sd"]
    assert len(texts) == n_said
    # By 18 degrees of freedom it is known to 17 %.
    ratios = [float(text.split()[2]) for text in texts]
    np.testing.assert_allclose(ratios, [10.0] * n_said, rtol=SIGMA)


@pytest.mark.parametrize(
    ("settings", "repeats", "times", "n_said"),
    [
        (config(CONSTANT), 3, 10, 1),
        (unequal(), 3, 10, 1),
        # By fourteen degrees of freedom less than 0.47 times is one in 1000.
        (config(CONSTANT), 1, 4, 1),
        (config(CONSTANT), 1, 1, 0),
    ],
)
def test_standard_deviations_that_are_too_large_are_said_to_be(
    settings, repeats, times, n_said
):
    theta_deg = SEVEN_DEG if repeats > 1 else np.linspace(5.0, 85.0, 17)
    table = case_table(
        CASES["firm"], noise=0.03, seed=3, theta_deg=theta_deg, repeats=repeats
    )
    frame = table.frame.assign(height_sd_n=times * 0.03)
    found = identify_table(
        type(table).from_frame(frame), settings, seed=1, engine="sweep"
    )
    texts = [w.text for w in found.warnings if w.code == "scatter_below_sd"]
    assert len(texts) == n_said
    ratios = [float(text.split()[2]) for text in texts]
    np.testing.assert_allclose(ratios, [1 / times] * n_said, rtol=SIGMA_ONCE)


def test_a_fixed_value_that_the_heights_contradict_is_named():
    table = case_table(CASES["firm"], noise=0.03, theta_deg=SEVEN_DEG)
    fixed = {"K_dn": 300.0, "K_st": 450.0, "C_d": 0.36, "L": 0.04}
    text = "".join(f"[parameters.{n}]\nfixed = {v}\n" for n, v in fixed.items())
    fitted = fit_table(table, config(text))
    codes = {warning.code for warning in fitted.warnings}
    assert "fixed_value_contradicted" in codes


def test_a_table_without_a_usable_push_is_refused():
    table = case_table(CASES["firm"], repeats=1)
    flagged = table.with_flag(range(table.n_pushes), "saturated")
    with pytest.raises(DataError, match="17 pushes are flagged"):
        fit_table(flagged, config())


def test_an_unknown_engine_is_refused():
    table = case_table(CASES["firm"], noise=0.03)
    with pytest.raises(ConfigError, match="nuts"):
        identify_table(table, config(), seed=0, engine="nuts")


@pytest.mark.parametrize("repeats", [1, pytest.param(3, marks=pytest.mark.slow)])
def test_constant_heights_without_sd_bound_an_angle_from_one_side(repeats):
    """Any θ_c below the lowest push fits them: A = B, and nothing rolls."""
    theta = np.radians(np.repeat(np.arange(5.0, 86.0, 5.0), repeats))
    table = PeakTable.from_arrays(
        theta=theta,
        alpha=np.full(theta.size, 1.5),
        heights={"height": np.full(theta.size, 2.0)},
        unit="n",
    )
    # A result of them would be provisional: no sensor reads the same to the last digit.
    fitted = fit_table(table, config())
    profile = profiles_of(fitted, ("theta_c",))["theta_c"]
    theta_c = angle_quantity("theta_c", sweep(fitted, 0), profile, prob=0.9)
    assert theta_c.verdict is Verdict.ONE_SIDED
    assert theta_c.sets[0][0] is None
    assert theta_c.sets[-1][1] < 5.0 + BETWEEN


def test_a_model_that_is_rejected_gives_no_interval():
    """Heights of a contact that rolls at steep pushes and not at flat ones."""
    table = case_table(CASES["firm"], noise=0.01, seed=1)
    wave = 0.2 * np.sin(np.radians(8 * table.frame["theta_deg"]))
    heights = table.frame["height_n"] + wave
    wrong = type(table).from_frame(table.frame.assign(height_n=heights))
    settings = config('[noise]\nsigma = "given"\n')
    result = identify_table(wrong, settings, seed=1, engine="sweep")
    assert not result.goodness_of_fit.is_adequate
    quantities = (result.theta_c, *result.combinations, *result.parameters)
    determined = {Verdict.DETERMINED, Verdict.LEARNED, Verdict.PARTLY}
    assert not determined & {q.verdict for q in quantities}
    assert all(
        q.interval is None for q in quantities if q.verdict is not Verdict.ASSUMED
    )


def test_a_prior_far_from_the_heights_rejects_the_model():
    """Heights of friction 0.5, and a lab that is sure of 0.1."""
    channels = ("height_normal", "height_tangential")
    table = case_table(CASES["firm"], noise=0.03, seed=1, channels=channels)
    sure = "[parameters.C_rr]\nlognormal = { median = 0.1, sd_log = 0.05 }\n"
    result = identify_table(table, config(sure), seed=1, engine="auto")
    assert result.status is FitStatus.OK
    assert "keeps θ_c and C_rr from where the heights" in (
        result.goodness_of_fit.sentence
    )
    assert reported(result).theta_c.interval is None


@pytest.mark.slow
def test_a_real_table_that_is_no_push_of_this_model_is_said_to_be_none(real_data):
    table = read_table(real_data / "probing" / "probingRAL2018_T1_height_table.csv")
    settings = parse_config("[push]\nlength_mm = 2.0\n", path="grasp.toml")
    result = identify_table(table, settings, seed=0)
    assert not result.goodness_of_fit.is_adequate
    assert result.goodness_of_fit.r_squared < POOR
    assert "model_inadequate" in warning_codes(result)


def heavy_tailed() -> PeakTable:
    """51 heights with noise of Student's t of 2 degrees of freedom."""
    clean = case_table(CASES["paper"], channels=FRICTION)
    noise = 0.02 * np.random.default_rng(4).standard_t(2.0, 51)
    return PeakTable.from_arrays(
        theta=clean.theta,
        alpha=clean.alpha,
        heights={FRICTION[0]: clean.heights(FRICTION[0]) + noise},
        unit="n",
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "chosen"), [("normal", "normal"), ("heavy", "student_t")]
)
def test_noise_is_chosen_by_its_evidence(noise, chosen):
    """51 heights with tails of Student's t of 2 degrees of freedom, or without."""
    table = (
        heavy_tailed()
        if noise == "heavy"
        else case_table(CASES["paper"], noise=0.02, channels=FRICTION)
    )
    fitted = fit_table(table, config('[noise]\nlikelihood = "auto"\n' + FRICTION_ONLY))
    assert fitted.setup.problem.likelihood == chosen
    assert fitted.config.noise.likelihood == chosen
    codes = [warning.code for warning in fitted.warnings]
    assert ("student_t_chosen" in codes) == (chosen == "student_t")


def noise_of_student() -> np.ndarray:
    """51 quantiles of Student's t of four degrees of freedom and unit variance."""
    quantiles = stats.t.ppf((np.arange(51) + 0.5) / 51, 4) / stats.t.std(4)
    return np.random.default_rng(1).permutation(quantiles)


def swept_by(kind: str, likelihood: str) -> PosteriorResult:
    """Draws of C_rr, and of a sigma, by 51 heights with Student-t noise of TAIL_SD."""
    clean = case_table(CASES["paper"], channels=FRICTION)
    heights = clean.heights(FRICTION[0]) + TAIL_SD * noise_of_student()
    table = PeakTable.from_arrays(
        theta=clean.theta,
        alpha=clean.alpha,
        heights={FRICTION[0]: heights},
        sd={FRICTION[0]: np.full(51, TAIL_SD)} if kind == "given" else None,
        unit="n",
    )
    text = CONSTANT + f'sigma = "{kind}"\nlikelihood = "{likelihood}"\n'
    return sweep(fit_table(table, config(text + FRICTION_ONLY)), 0)


def test_tails_beside_a_stated_sd_are_as_likely_as_scipy_has_them():
    """One free number takes next to nothing of either noise."""
    normal, student = (swept_by("given", kind) for kind in ("normal", "student_t"))
    noise = noise_of_student()
    expected = np.sum(
        stats.t.logpdf(noise, 4, scale=1 / stats.t.std(4)) - stats.norm.logpdf(noise)
    )
    found = student.log_evidence - normal.log_evidence
    assert found == pytest.approx(expected, abs=OF_ONE_NUMBER)


@pytest.mark.parametrize("likelihood", ["normal", "student_t"])
def test_sampled_noise_is_a_standard_deviation_whatever_its_tails(likelihood):
    sigma = swept_by("sampled", likelihood).samples[f"sigma_{FRICTION[0]}"]
    assert np.median(sigma) == pytest.approx(TAIL_SD, rel=SD_OF_51)


@pytest.mark.parametrize(
    ("pieces", "verdict"),
    [(((0.2, 0.9),), Verdict.LEARNED), (((0.2, None),), Verdict.PARTLY)],
)
def test_what_the_likelihood_leaves_open_is_not_learned(determined, pieces, verdict):
    """However narrow the posterior: its open end is that of the prior."""
    fitted = fit_table(determined.table, config())
    posterior, n = determined.posterior, determined.posterior.log_prob.size
    narrow = np.random.default_rng(0).lognormal(np.log(0.5), 0.01, n)
    posterior = replace(posterior, samples=posterior.samples | {"C_rr": narrow})
    profile = replace(determined.profiles["theta_c"], name="C_rr", pieces=pieces)
    found, _ = quantities(
        fitted.setup, posterior, {"C_rr": profile}, prob=0.9, unit="n"
    )
    (C_rr,) = [q for q in found if q.name == "C_rr"]
    assert C_rr.verdict is verdict


@pytest.mark.parametrize(
    ("code", "p_value", "is_told"),
    [
        ("looks_like_angle_errors", 0.01, True),
        ("looks_like_angle_errors", 0.2, False),
        ("looks_heavy_tailed", 0.01, False),
    ],
)
def test_heavy_tails_hide_nothing_that_shows_more(monkeypatch, code, p_value, is_told):
    """Of noise that is not normal less is asked, as where a model is rejected."""
    shown = (Violation(code=code, p_value=p_value, text=""),)
    monkeypatch.setattr(fitted_module, "violations", lambda *_, slopes: shown)
    fitted = fit_table(heavy_tailed(), config(CHOSEN + FRICTION_ONLY))
    codes = [warning.code for warning in fitted.warnings]
    assert "student_t_chosen" in codes
    assert (code in codes) == is_told


def proportional(seed: int) -> PeakTable:
    """51 heights that scatter by a share of their own."""
    return scattering("proportional", seed)


def scattering(kind: str, seed: int) -> PeakTable:
    """The same, or heights that scatter evenly, or evenly with heavy tails."""
    clean = case_table(CASES["paper"], channels=FRICTION)
    heights, rng = clean.heights(FRICTION[0]), np.random.default_rng(seed)
    even = 0.02 * np.max(heights)
    scatter = {
        "proportional": lambda: 0.05 * heights * rng.standard_normal(51),
        "even": lambda: even * rng.standard_normal(51),
        "heavy": lambda: even * rng.standard_t(2.5, 51),
    }[kind]()
    return PeakTable.from_arrays(
        theta=clean.theta,
        alpha=clean.alpha,
        heights={FRICTION[0]: heights + scatter},
        unit="n",
    )


@pytest.mark.parametrize(
    ("share", "stated"), [("estimate", "proportional"), (0.0, "constant")]
)
def test_noise_is_in_proportion_where_residuals_ask_for_it(share, stated):
    """By default as if it were stated, to the last digit."""
    table = proportional(0)
    if stated == "constant":
        table = case_table(CASES["paper"], noise=0.02, channels=FRICTION)
    fitted = fit_table(table, config(FRICTION_ONLY))
    text = f"[noise]\nheight_share = {share!r}\n" + FRICTION_ONLY
    known = fit_table(table, config(text))
    assert fitted.config.noise == known.config.noise
    assert fitted.config.noise.height_share == share
    np.testing.assert_array_equal(fitted.fit.estimate, known.fit.estimate)
    codes = [warning.code for warning in fitted.warnings]
    assert ("height_share" in codes) == (share == "estimate")


@pytest.mark.parametrize(
    ("kind", "share"), [("proportional", "estimate"), ("even", 0.0), ("heavy", 0.0)]
)
def test_fifty_pushes_tell_noise_in_proportion_from_other_noise(kind, share):
    """Of six seeds in a row each shows its own; tails of seed 36 look like a share."""
    settings = config(FRICTION_ONLY)
    fitted = [fit_table(scattering(kind, seed), settings) for seed in range(34, 40)]
    assert [one.config.noise.height_share for one in fitted] == 6 * [share]


@pytest.mark.parametrize(
    "text", ['sigma = "pooled"\n', "theta_sd_deg = 1.0\n", "alpha_sd_deg = 1.0\n"]
)
def test_noise_stays_constant_where_its_size_is_stated_otherwise(text):
    fitted = fit_table(proportional(1), config(f"[noise]\n{text}" + FRICTION_ONLY))
    assert fitted.config.noise.height_share == 0.0


def test_what_another_cause_explains_is_not_taken_for_heavy_tails(monkeypatch):
    """Noise of several sizes has them, too; it is named, and not hidden by them."""
    table, settings = proportional(1), config(CHOSEN + FRICTION_ONLY)
    evidence = []
    for likelihood in ("student_t", "normal"):
        text = CONSTANT + f'sigma = "sampled"\nlikelihood = "{likelihood}"\n'
        fitted = fit_table(table, config(text + FRICTION_ONLY))
        evidence.append(sweep(fitted, 0).log_evidence)
    assert evidence[0] > evidence[1] + 1
    assert fit_table(table, settings).setup.problem.likelihood == "normal"
    monkeypatch.setattr(fit_table_module, "_is_explained", lambda fitted: False)
    assert fit_table(table, settings).setup.problem.likelihood == "student_t"


def test_draws_that_noise_was_chosen_by_are_those_of_the_sweep(monkeypatch):
    monkeypatch.setattr(fit_table_module, "_is_explained", lambda fitted: False)
    fitted = fit_table(proportional(0), config(CHOSEN + FRICTION_ONLY))
    (known,) = fitted.swept.values()
    anew = sweep(replace(fitted, swept={}), 0)
    np.testing.assert_array_equal(known.samples["theta_c"], anew.samples["theta_c"])
    assert sweep(fitted, 1) is not known
