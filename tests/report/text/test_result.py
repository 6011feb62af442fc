"""The report in words: right for every verdict, at every width."""

import re
from dataclasses import replace

import numpy as np
import pytest

from pushfit.config import GraspConfig
from pushfit.fit.assess.reporting_rules import reported
from pushfit.fit.assess.verdicts import angle_quantity
from pushfit.fit.results import FitStatus, ResultWarning, Verdict
from pushfit.report.answers import ANSWERS, alpha_star_answer, theta_c_answer
from pushfit.report.fact_rows import angle_rows
from pushfit.report.frames import correlations, result_frame
from pushfit.report.text.result import render_text
from tests.report.makers import make_angle, make_answer
from tests.tolerances import EXACT, MAX_Z

# Standard error of a median of 1000 draws and of 800, over their standard deviation.
OF_1000, OF_800 = np.sqrt(np.pi / 2 / np.array([1000, 800]))
# "40° to 42°" or "± 2": what must not stand where nothing is determined.
INTERVAL = re.compile(r"±|\d°? to \d")


def test_a_determined_angle_is_quoted_with_its_interval(determined):
    assert theta_c_answer(determined).sentence == (
        "The critical angle θ_c for pushes at α = 90° is 40.1° "
        "(90 % interval: 38.1° to 42.1°)."
    )


def test_the_angle_of_an_object_that_tilts_is_quoted_with_the_push_length(
    make_identification,
):
    both = (make_answer("tilting"), make_answer("linear"))
    sentence = theta_c_answer(make_identification(by_mechanics=both)).sentence
    assert sentence.startswith("The critical angle θ_c for pushes of 5 mm at α = 90°")


def test_optima_that_read_alike_are_counted(determined):
    one = determined.fit.modes[0]
    fit = replace(determined.fit, modes=(one, one, replace(one, chi_square=99.0)))
    text = " ".join(render_text(replace(determined, fit=fit)).split())
    assert re.search(r"3: 2 × θ_c \S+ \(χ² \S+\), θ_c \S+ \(χ² 99.0\)", text)


@pytest.mark.parametrize(("grasp", "is_said"), [({}, True), ({"preload_n": 2}, False)])
def test_a_preload_that_nobody_stated_is_said(make_identification, grasp, is_said):
    config = GraspConfig(push={"length_mm": 5.0}, grasp=grasp)
    text = render_text(make_identification(config=config))
    assert ("taken as 0, as none is stated" in text) is is_said


def test_a_wide_interval_is_given_without_a_middle(make_identification):
    wide = make_angle("theta_c", 40.0, interval=(12.0, 71.0))
    result = make_identification(theta_c=wide)
    assert result.theta_c.verdict is Verdict.WIDE
    assert result.theta_c.estimate is None
    sentence = theta_c_answer(result).sentence
    assert "is 12° to 71° (90 % interval), which is wider than was wanted" in sentence
    wish = GraspConfig(push={"length_mm": 5.0}, report={"wanted_width_deg": 60.0})
    content = make_identification(theta_c=wide, config=wish).theta_c
    assert content.verdict is Verdict.DETERMINED
    assert content.estimate == 40.0


def test_what_numerics_stopped_short_of_has_no_verdict_of_the_data(not_converged):
    for quantity in (not_converged.theta_c, *not_converged.combinations):
        assert quantity.verdict is Verdict.UNKNOWN
        assert quantity.estimate is quantity.interval is None


def test_what_both_mechanics_say_stands_side_by_side(make_identification):
    linear = make_answer("linear", best=44.0, log_evidence=None, rms_residual=0.1734)
    both = (make_answer("tilting", log_evidence=-12.34), linear)
    text = render_text(make_identification(by_mechanics=both), width=120)
    lines = text.splitlines()
    first, second = (line for line in lines if "heights off by" in line)
    assert "tilting" in first
    assert "40.0° (38.0° to 42.0°)" in first
    assert "ln evidence -12.3" in first
    assert "heights off by 0.173 N, rms" in second
    assert "linear mechanics" in second
    assert "44.0° (42.0° to 46.0°)" in second
    assert "evidence" not in second
    alone = render_text(make_identification())
    assert "tilting" not in alone


def test_an_evidence_that_rounds_to_nothing_has_no_sign(make_identification):
    both = tuple(
        make_answer(name, log_evidence=-0.02) for name in ("tilting", "linear")
    )
    text = render_text(make_identification(by_mechanics=both), width=120)
    assert text.count("ln evidence 0.0") == 2


def test_two_modes_are_named_both_and_never_their_hull(two_modes):
    sentence = theta_c_answer(two_modes).sentence
    assert "40° or 56°" in sentence
    assert "38.4° to 41.6° or 54.4° to 57.6°" in sentence
    assert "38.6" not in sentence


def test_one_sided_data_give_a_bound(one_sided):
    sentence = theta_c_answer(one_sided).sentence
    assert "above 61°" in sentence
    assert not INTERVAL.search(sentence)


def test_what_is_not_determined_is_said_with_the_reason(not_determined):
    sentence = theta_c_answer(not_determined).sentence
    assert "not determined by these data: all pushes have the elevation 15°" in sentence
    assert not INTERVAL.search(sentence)


def test_without_a_note_the_missing_directions_are_the_reason(theta_only):
    alpha_star = replace(theta_only.alpha_star, note="")
    sentence = alpha_star_answer(replace(theta_only, alpha_star=alpha_star)).sentence
    assert "the pushes have only 1 azimuth, and at least 3 are needed" in sentence


@pytest.mark.parametrize(
    "status", [FitStatus.NOT_CONVERGED, FitStatus.MAX_STEPS, FitStatus.NO_FINITE_START]
)
def test_untrusted_numerics_quote_no_number_of_the_posterior(determined, status):
    by_model = replace(determined, status=status, alpha_star_model_free=None)
    result = reported(by_model)
    for answer in ANSWERS.values():
        sentence = answer(result).sentence
        assert status.value in sentence
        assert not INTERVAL.search(sentence)
    parameters = render_text(result).split("Parameters\n")[1].split("Correlations")[0]
    assert not INTERVAL.search(parameters)


def test_numerics_take_nothing_from_what_no_model_was_needed_for(determined):
    """A cosine through the heights alone has its minimum at 66.0°, within 2°."""
    result = reported(replace(determined, status=FitStatus.NOT_CONVERGED))
    sentence = alpha_star_answer(result).sentence
    assert sentence.endswith(
        "A cosine through the heights alone gives 66.0° (64.0° to 68.0°)."
    )


def test_an_unconverged_posterior_is_untrusted_even_if_the_result_forgot_to_say_so(
    not_converged,
):
    result = replace(not_converged, status=FitStatus.OK)
    assert "has not converged" in theta_c_answer(result).sentence


def test_no_interval_is_ever_of_zero_width(make_identification):
    at_the_end = make_angle("alpha_star", 150.0, interval=(150.0, 150.0), sets=())
    result = make_identification(
        alpha_star=at_the_end,
        config=GraspConfig(push={"length_mm": 5.0}, reach={"alpha_deg": (0.0, 150.0)}),
    )
    sentence = alpha_star_answer(result).sentence
    assert sentence.startswith("The best push direction α* is 150°. It is the end of")
    assert not INTERVAL.search(sentence)


def test_an_axis_across_180_degrees_is_one_interval(make_identification):
    axis = make_angle(
        "alpha_star", 178.0, interval=(174.0, 183.0), sets=((174.0, 183.0),)
    )
    sentence = alpha_star_answer(make_identification(alpha_star=axis)).sentence
    assert "178.0° (90 % interval: 174.0° to 180° and on to 3.0°)" in sentence


@pytest.mark.parametrize(
    ("free", "word"), [(176.0, "agrees"), (3.0, "agrees"), (90.0, "disagrees")]
)
def test_the_model_free_direction_is_compared_on_the_circle(
    make_identification, free, word
):
    result = make_identification(
        alpha_star=make_angle("alpha_star", 179.5),
        alpha_star_model_free=make_angle("alpha_star", free),
    )
    assert f"alone {word}" in alpha_star_answer(result).sentence


def test_a_cosine_through_pushes_that_roll_does_not_disagree(make_identification):
    result = make_identification(
        alpha_star=make_angle("alpha_star", 65.0),
        alpha_star_model_free=make_angle("alpha_star", 155.0),
        warnings=(ResultWarning(code="alpha_star_of_rolling_pushes", text=""),),
    )
    sentence = alpha_star_answer(result).sentence
    assert "differs, as pushes that roll meet most resistance along α*" in sentence


@pytest.mark.parametrize(("theta_c", "is_said"), [(70.0, True), (50.0, False)])
def test_a_sweep_of_the_azimuth_below_the_critical_angle_is_named(
    make_identification, theta_c, is_said
):
    """Azimuths were swept at 60°."""
    axis = replace(
        make_angle("alpha_star", None), interval=None, verdict=Verdict.NOT_DETERMINED
    )
    result = make_identification(
        theta_c=make_angle("theta_c", theta_c), alpha_star=axis
    )
    sentence = alpha_star_answer(result).sentence
    assert "no preferred direction" in sentence
    assert ("at θ = 60°, which is below θ_c" in sentence) is is_said


def test_a_contact_that_never_rolls_has_no_critical_angle(determined):
    draws = dict(determined.posterior.samples) | {"theta_c": np.full(2000, np.nan)}
    posterior = replace(determined.posterior, samples=draws)
    theta_c = angle_quantity(
        "theta_c", posterior, determined.profiles["theta_c"], prob=0.9
    )
    result = reported(replace(determined, posterior=posterior, theta_c=theta_c))
    sentence = theta_c_answer(result).sentence
    assert "does not exist: this contact never rolls" in sentence
    assert "without the heights" not in sentence
    # As of a preload, and a friction of which the heights tell nothing.
    before = dict(posterior.prior_samples) | {"theta_c": draws["theta_c"]}
    known = replace(posterior, prior_samples=before)
    assert (
        "without the heights"
        in theta_c_answer(replace(result, posterior=known)).sentence
    )
    # The likelihood of those that roll is not said beside it.
    assert dict(angle_rows(result))["θ_c"] == "does not exist"


@pytest.mark.parametrize(("share", "is_why"), [(0.001, False), (0.2, True)])
def test_a_few_draws_that_never_roll_are_no_reason(share, is_why, determined):
    draws = dict(determined.posterior.samples)
    draws["theta_c"] = np.where(np.arange(2000) < 2000 * share, np.nan, 40.0)
    posterior = replace(determined.posterior, samples=draws)
    theta_c = angle_quantity("theta_c", posterior, None, prob=0.9)
    result = reported(replace(determined, posterior=posterior, theta_c=theta_c))
    sentence = theta_c_answer(result).sentence
    assert "not determined by these data" in sentence
    assert (f"{share:.1%} of the posterior never rolls" in sentence) is is_why


def test_modes_across_the_seam_are_typical_of_their_own_draws(determined):
    rng = np.random.default_rng(1)
    draws = np.append(rng.normal(0.0, 1.0, 1000) % 180, rng.normal(90.0, 1.0, 1000))
    samples = dict(determined.posterior.samples) | {"alpha_star": draws}
    result = replace(
        determined,
        alpha_star=make_angle(
            "alpha_star",
            None,
            sets=((88.0, 92.0), (178.0, 182.0)),
            verdict=Verdict.SEVERAL_MODES,
        ),
        posterior=replace(determined.posterior, samples=samples),
    )
    first, second = alpha_star_answer(result).values
    assert abs(first - 90.0) < MAX_Z * OF_1000
    assert min(second, 180.0 - second) < MAX_Z * OF_1000


def test_modes_up_to_an_open_end_are_typical_of_their_own_draws(two_modes):
    """Above the highest of them there is no seam."""
    open_set = ((38.4, 41.6), (54.4, None))
    theta_c = replace(two_modes.theta_c, sets=open_set, likelihood_sets=open_set)
    first, second = theta_c_answer(replace(two_modes, theta_c=theta_c)).values
    assert abs(first - 40.0) < MAX_Z * OF_1000
    assert abs(second - 56.0) < MAX_Z * OF_1000


def test_an_inadequate_model_is_the_first_thing_said(inadequate):
    assert render_text(inadequate).startswith(
        "The model does not describe these heights"
    )
    sentence = theta_c_answer(inadequate).sentence
    assert sentence.startswith("Not to be relied on, because the model does not fit")
    assert "would be 40° if it did" in sentence
    assert not INTERVAL.search(sentence)
    assert theta_c_answer(inadequate).pieces == ()


def test_no_parameter_is_quoted_before_the_model_is_said_not_to_describe(inadequate):
    """Nothing but the alarm comes before it, in particular no symbol with a value."""
    text = render_text(inadequate)
    alarm = text.index("The model does not describe these heights")
    reason = text.index("χ² = 812")
    first = min(text.index(name) for name in ("K_sn", "C_rr", "θ_c", "α*", "N/m"))
    assert alarm < reason < first


def test_predictive_checks_are_reported_beside_the_other_tests(determined):
    text = render_text(determined)
    assert "scatter p = 0.42; largest residual p < 0.001" in text


def test_untrusted_numerics_are_the_first_thing_said(not_converged):
    assert render_text(not_converged).startswith("Do not use these numbers")


def test_the_report_ends_with_one_sentence_on_each_angle(determined):
    last = " ".join(render_text(determined).split())
    assert last.endswith(
        theta_c_answer(determined).sentence
        + " "
        + alpha_star_answer(determined).sentence
    )


def test_stiffness_is_not_quoted_where_the_push_length_is_unknown(unknown_length):
    text = render_text(unknown_length)
    for name in ("K_sn", "K_dn", "K_st", "C_d", "A", "B"):
        assert re.search(rf"^{name} +not quoted", text, re.MULTILINE)
    assert re.search(r"^C_rr +0.300", text, re.MULTILINE)
    assert "push length is unknown" in text


def test_the_report_tells_learned_from_assumed_and_fixed(determined):
    text = render_text(determined)
    assert re.search(r"^C_rr .*learned", text, re.MULTILINE)
    assert re.search(r"^K_sn .*assumed", text, re.MULTILINE)
    assert re.search(r"^L +0.04 +m +fixed", text, re.MULTILINE)


def test_the_report_names_what_would_help(determined):
    assert "Measure L with callipers" in render_text(determined)


def test_a_one_sided_stiffness_shows_its_bound_and_no_value(make_identification):
    result = make_identification()
    first, second = result.combinations
    bound = ((77.0, None),)
    second = replace(
        second, verdict=Verdict.ONE_SIDED, sets=bound, likelihood_sets=bound
    )
    text = render_text(replace(result, combinations=(first, second)))
    assert re.search(r"^B +see set +above 77.0 +N/m +one-sided", text, re.MULTILINE)
    narrow = render_text(replace(result, combinations=(first, second)), width=40)
    assert "B: above 77.0 N/m; one-sided" in narrow


@pytest.mark.parametrize("width", [20, 44, 71, 80, 120])
def test_no_line_is_longer_than_the_terminal(any_identification, width):
    assert (
        max(map(len, render_text(any_identification, width=width).split("\n"))) <= width
    )


def test_nothing_of_a_number_is_cut_on_a_narrow_terminal(determined):
    narrow = " ".join(render_text(determined, width=30).split())
    assert "K_sn = 800 N/m (500 to 1300)" in narrow
    assert "…" not in narrow


def test_what_is_not_quoted_has_no_unit_and_one_reason(unknown_length):
    why = "not quoted: the push length is not known"
    parameters = tuple(replace(q, note=why) for q in unknown_length.parameters)
    result = replace(unknown_length, parameters=parameters)
    narrow = " ".join(render_text(result, width=30).split())
    assert "K_sn: not quoted; the push length is not known K_dn: not quoted" in narrow


def test_user_text_cannot_send_control_characters(hostile):
    text = render_text(hostile)
    assert all(char.isprintable() for char in text.replace("\n", ""))


def test_marks_of_the_figures_are_the_answers_of_the_sentence(two_modes):
    low, high = theta_c_answer(two_modes).values
    assert abs(low - 40.0) < MAX_Z * OF_800 * 0.9
    assert abs(high - 56.0) < MAX_Z * OF_800 * 0.9


def test_the_frame_holds_every_parameter_and_no_number_that_is_not_quoted(
    unknown_length,
):
    frame = result_frame(unknown_length)
    quantities = (*unknown_length.parameters, *unknown_length.combinations)
    assert list(frame.index) == [
        *("theta_c", "alpha_star"),
        *(q.name for q in quantities),
    ]
    assert np.isnan(
        frame.loc["K_sn", ["estimate", "lower", "upper"]].astype(float)
    ).all()
    assert frame.loc["C_rr", "estimate"] == 0.3


def test_correlations_are_those_of_the_logs_of_positive_quantities(determined):
    samples = determined.posterior.samples
    expected = np.corrcoef(np.log(samples["K_sn"]), np.log(samples["K_dn"]))[0, 1]
    (pair,) = correlations(determined)
    assert (pair.first, pair.second) == ("K_sn", "K_dn")
    assert abs(pair.value - expected) < EXACT


def test_an_untrusted_posterior_has_no_correlations(not_converged):
    assert correlations(not_converged) == ()
