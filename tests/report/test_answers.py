"""What is said of an angle where something is close to a limit, or missing."""

from dataclasses import replace

import numpy as np
import pytest

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.results import Verdict
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from tests.report.makers import make_angle

N = 2000
# Of a draw about its mode; medians scatter by less [deg].
SCATTER = 0.1


def with_draws(result, **draws):
    samples = dict(result.posterior.samples) | draws
    return replace(result, posterior=replace(result.posterior, samples=samples))


def undetermined(name, **changes):
    unknown = {"interval": None, "verdict": Verdict.NOT_DETERMINED, "note": ""}
    return make_angle(name, None, **(unknown | changes))


@pytest.mark.parametrize(("share", "is_said"), [(0.005, False), (0.04, True)])
def test_that_there_may_be_no_angle_is_said_from_one_in_a_hundred(
    share, is_said, determined, not_determined
):
    draws = np.where(np.arange(N) < N * share, np.nan, 40.0)
    words = " 4 % it does not exist: the contact never rolls."
    sentence = theta_c_answer(with_draws(determined, theta_c=draws)).sentence
    _, said, more = sentence.partition("With probability")
    assert (bool(said), more) == (is_said, words if is_said else "")
    # Of an angle that is not determined its reason says it, if anything does.
    nothing = theta_c_answer(with_draws(not_determined, theta_c=draws)).sentence
    assert "With probability" not in nothing


def test_the_azimuth_is_named_where_there_are_several(determined, theta_only):
    assert "for pushes at α = 90° is" in theta_c_answer(determined).sentence
    assert "α =" not in theta_c_answer(theta_only).sentence


def test_of_three_modes_all_fit(determined):
    """One of the two of an axis lies across its end, at 1°."""
    rng = np.random.default_rng(1)
    means = np.array([30.0, 90.0, 181.0])
    draws = rng.normal(np.repeat(means, N // 3), SCATTER) % 180
    several = make_angle(
        "alpha_star",
        None,
        sets=tuple((mean - 3, mean + 3) for mean in means),
        verdict=Verdict.SEVERAL_MODES,
    )
    result = with_draws(replace(determined, alpha_star=several), alpha_star=draws)
    found = alpha_star_answer(result)
    np.testing.assert_allclose(found.values, [30.0, 90.0, 1.0], atol=SCATTER)
    assert "; all fit the data." in found.sentence
    pair = replace(several, sets=several.sets[:2])
    both = alpha_star_answer(replace(result, alpha_star=pair)).sentence
    assert "; both fit the data." in both


def test_what_is_assumed_is_no_answer(determined):
    assumed = make_angle("theta_c", 40.0, verdict=Verdict.ASSUMED)
    found = theta_c_answer(replace(determined, theta_c=assumed))
    assert found.short == "not determined by these data"
    assert found.values == found.pieces == ()


@pytest.mark.parametrize(
    ("azimuths", "is_third_used", "is_few"),
    [
        ([90.0, 60.0], True, True),
        ([90.0, 60.0, 30.0], True, False),
        ([90.0, 60.0, 30.0], False, True),
    ],
)
def test_two_azimuths_are_too_few(azimuths, is_third_used, is_few, theta_only):
    """Those of pushes that are left out are none."""
    frame = theta_only.table.frame
    turn = np.arange(len(frame)) % len(azimuths)
    table = PeakTable.from_frame(frame.assign(alpha_deg=np.array(azimuths)[turn]))
    result = replace(
        theta_only,
        table=table,
        used=theta_only.used & (is_third_used | (turn < 2)),
        alpha_star=undetermined("alpha_star"),
    )
    sentence = alpha_star_answer(result).sentence
    few = " azimuths, and at least 3 are needed"
    assert (few in sentence) is is_few


def test_an_angle_of_a_model_that_does_not_fit_has_no_other_reason(theta_only):
    """Neither few azimuths nor flat heights."""
    angle = undetermined("alpha_star", verdict=Verdict.PROVISIONAL)
    sentence = alpha_star_answer(replace(theta_only, alpha_star=angle)).sentence
    assert "not determined by these data: the model does not describe them." in sentence


def test_an_angle_that_settings_fix_is_called_configured(determined):
    fixed = make_angle("alpha_star", 65.0, interval=None, verdict=Verdict.FIXED)
    answer = alpha_star_answer(replace(determined, alpha_star=fixed))
    said = "The best push direction α* is 65°, as configured."
    assert answer.sentence.startswith(said)
    assert answer.short == "65°"


@pytest.mark.parametrize(("n_left", "is_why"), [(0.0, True), (1.0, False)])
def test_a_noise_that_nothing_tells_is_a_reason(n_left, is_why, determined):
    profile = replace(determined.profiles["theta_c"], degrees_of_freedom=n_left)
    result = replace(
        determined, theta_c=undetermined("theta_c"), profiles={"theta_c": profile}
    )
    sentence = theta_c_answer(result).sentence
    assert ("as many unknowns as heights" in sentence) is is_why
    assert ("fit every critical angle about equally well" in sentence) is not is_why


@pytest.mark.parametrize(
    ("reach", "estimate", "is_end"),
    [
        ((0.0, 150.0), 149.8, True),
        ((0.0, 150.0), 148.0, False),
        ((20.0, 150.0), 20.3, True),
        # All axes are reached, and the last of them is the first.
        ((0.0, 180.0), 179.8, False),
    ],
)
def test_a_direction_at_the_end_of_the_reach_is_called_so(
    make_identification, reach, estimate, is_end
):
    result = make_identification(
        alpha_star=make_angle("alpha_star", estimate),
        config=GraspConfig(push={"length_mm": 5.0}, reach={"alpha_deg": reach}),
    )
    sentence = alpha_star_answer(result).sentence
    assert ("It is the end of the reach" in sentence) is is_end


@pytest.mark.parametrize(("gap", "word"), [(3.9, "agrees"), (4.1, "disagrees")])
def test_a_cosine_agrees_while_its_interval_touches(make_identification, gap, word):
    """Both are known to ± 2°."""
    result = make_identification(
        alpha_star=make_angle("alpha_star", 65.0),
        alpha_star_model_free=make_angle("alpha_star", 65.0 + gap),
    )
    assert f"alone {word}: " in alpha_star_answer(result).sentence
