"""Fits by tilting mechanics: coordinates, recovery, sets, and when it is warned."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.config import parse_config
from pushfit.config.rivals import rival_configs
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.simulate import Session, simulate_recording, simulate_table
from pushfit.errors import ConfigError
from pushfit.fit.assess.advice import measurements
from pushfit.fit.comparison import compare_models
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import reach_of
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.constraint_terms import held_names, held_values
from pushfit.fit.problem.data_coordinates import tilting_point
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.fit.results import FitStatus, Verdict
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp, Parameters, Pushes, contact, forward
from tests.fit.tables import HARD, config
from tests.problems import PUSH, TILTED_ELLIPSE, paper_parameters
from tests.tolerances import EXACT

# 4000 draws know a standard deviation to 1.1 %; four of them.
SD_TOL = 0.05
# A linear solve: rounding, with ample room.
HELD_TOL = 1e-9
# Angles are recorded to 1e-9 rad, and the top of a push is a sample beside it.
SAMPLED = 1e-6
# Without noise the optimum is the truth, but for what priors pull and solvers leave.
RECOVERED, RECOVERED_ANGLE = 1e-3, 1e-4
THETA_DEG = np.arange(10.0, 90.0, 5.0)
FIRM = Parameters(1300, 2600 / 3, 450, 0.5, 0.36, 0.04)
TILTING = Grasp(push_length=PUSH, mechanics="tilting")
HELD = Grasp(push_length=PUSH, mechanics="tilting", support_span=0.06)
LENGTH = "[parameters.L]\nfixed = 0.04\n"
MEASURED = "[parameters.L]\nnormal = { mean = 0.04, sd = 0.001 }\n"
MECHANICS = '[grasp]\nmechanics = "tilting"\n'
COMPONENTS = ("height_normal", "height_tangential")


def pushed(params=FIRM, grasp=TILTING, *, noise=0.02, seed=0, **changes):
    """A sweep of θ; without noise where noise is 0."""
    words = {"theta": np.radians(THETA_DEG), "alpha": 0.0, "repeats": 3}
    return simulate_table(
        params,
        grasp,
        noise=noise,
        rng=np.random.default_rng(seed),
        state_sd=noise > 0,
        **(words | changes),
    )


def true_angle(params=FIRM, grasp=TILTING) -> float:
    return float(np.degrees(critical_angle(params, grasp, jnp.asarray(0.0))))


def test_what_tilting_mechanics_lack_is_refused_with_the_remedy():
    with pytest.raises(ConfigError, match=r"measure it and set parameters\.L"):
        config(MECHANICS)


@pytest.mark.parametrize(
    ("mechanics", "extent"),
    [(MECHANICS, "best"), pytest.param("", "only", marks=pytest.mark.slow)],
)
def test_the_advice_says_how_far_K_st_and_C_d_can_be_told_apart(mechanics, extent):
    problem = build_problem(pushed(), config(mechanics + LENGTH)).problem
    known = {"is_calibrated": True, "has_direction": True, "is_ordered": False}
    advice = measurements(problem, verdicts={}, **known)
    assert f"The data fix B = K_st C_d/(L² K_st + C_d) {extent};" in advice[-1]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (LENGTH, ("ln_A", "ln_B", "ln_C_rr", "ln_s")),
        pytest.param(
            MEASURED,
            ("ln_A", "ln_B", "ln_C_rr", "ln_s", "ln_L"),
            marks=pytest.mark.slow,
        ),
        (
            LENGTH + "[parameters.K_st]\nfixed = 450\n",
            ("ln_A", "ln_C_rr", "ln_s"),
        ),
        pytest.param(
            LENGTH + "[parameters.K_st]\nfixed = 450\n[parameters.C_d]\nfixed = 0.36\n",
            ("ln_A", "ln_C_rr"),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_s_and_L_are_data_coordinates_as_far_as_they_are_free(text, names):
    """Every point of the prior has the same heights in both coordinate systems."""
    problem = build_problem(
        pushed(noise=0.1, repeats=1), config(MECHANICS + text)
    ).problem
    assert problem.data_names == names
    x = prior_x_samples(problem, np.random.default_rng(1), 3)
    for point in x:
        z = dict(zip(problem.names, jnp.asarray(point), strict=True))
        y = {name: z[name] for name in names}
        found = tilting_point(y, problem.fixed)
        expected = contact(problem.state(jnp.asarray(point)).params)
        for name in ("A", "B", "C_rr", "L", "s"):
            np.testing.assert_allclose(
                getattr(found, name), getattr(expected, name), rtol=EXACT
            )


def test_what_is_known_of_L_and_s_holds_them_and_nothing_else():
    text = MECHANICS + "[parameters.L]\nlognormal = { median = 0.04, sd_log = 0.05 }\n"
    problem = build_problem(pushed(noise=0.1, repeats=1), config(text)).problem
    assert held_names(problem) == ("ln_L", "ln_s")
    pull = np.asarray(problem.constraint)
    on_L = dict(zip(problem.data_names, pull[0], strict=True))
    np.testing.assert_allclose(on_L["ln_L"], 1 / 0.05, rtol=SD_TOL)
    assert all(on_L[name] == 0 for name in ("ln_A", "ln_B", "ln_C_rr", "ln_s"))
    points = held_values(problem, np.random.default_rng(0).normal(size=(4, 5)))
    np.testing.assert_allclose(
        points @ pull.T - np.asarray(problem.constraint_offset), 0.0, atol=HELD_TOL
    )


def test_comparison_takes_up_the_other_mechanics_where_L_is_stated():
    assert "tilting" not in rival_configs(config())
    base = config(LENGTH)
    rival = rival_configs(base)["tilting"]
    assert rival.grasp.mechanics == "tilting"
    same = rival.model_copy(update={"grasp": base.grasp})
    assert same == base
    assert "linear" in rival_configs(config(MECHANICS + LENGTH))


def test_tables_are_simulated_by_the_mechanics_of_the_grasp():
    table = pushed(noise=0.0, repeats=1, theta=np.radians([2.0, 20.0, 60.0]))
    pushes = Pushes(np.radians([2.0, 20.0, 60.0]), np.zeros(3))
    expected = forward(FIRM, pushes, TILTING).height
    np.testing.assert_allclose(table.heights("height"), expected, rtol=EXACT)
    # 2° without a preload: the push point sinks by more than it is pressed.
    assert list(table.flags) == [{"lost_contact"}, set(), set()]


@pytest.mark.slow
def test_recordings_are_simulated_by_the_mechanics_of_the_grasp():
    pushes = Pushes(np.radians([20.0, 60.0]), np.zeros(2))
    expected = forward(FIRM, pushes, TILTING).height
    schedule = PushSchedule.planned(np.radians([20.0, 60.0]), 0.0, repeats=1)
    made = {
        mechanics: simulate_recording(
            FIRM,
            dataclasses.replace(TILTING, mechanics=mechanics),
            schedule,
            session=Session(angle_resolution=1e-9),
            rng=np.random.default_rng(0),
        )
        for mechanics in ("linear", "tilting")
    }
    heights = {
        name: found.recording.channels["pressure"].max() for name, found in made.items()
    }
    assert heights["tilting"] < heights["linear"]
    np.testing.assert_allclose(heights["tilting"], np.max(expected), rtol=SAMPLED)


@pytest.mark.slow
@pytest.mark.parametrize("channels", [("height",), COMPONENTS], ids=["height", "parts"])
def test_the_truth_is_recovered_without_noise(channels):
    table = pushed(noise=0.0, channels=channels)
    text = MECHANICS + LENGTH + '[noise]\nsigma = "sampled"\n'
    fitted = fit_table(table, config(text))
    assert fitted.fit.status is FitStatus.OK
    truth = contact(FIRM)
    values = fitted.fit.modes[0].coordinates
    # Noise-free heights weigh so much that what is known of s cannot shift it.
    for name in ("A", "B", "C_rr", "s"):
        np.testing.assert_allclose(
            np.exp(values[f"ln_{name}"]),
            getattr(truth, name),
            rtol=RECOVERED,
            err_msg=name,
        )
    np.testing.assert_allclose(
        fitted.fit.modes[0].theta_c_deg, true_angle(), rtol=RECOVERED_ANGLE
    )


@pytest.mark.slow
def test_at_the_truth_a_preloaded_ellipse_leaves_no_residual():
    params = paper_parameters(**TILTED_ELLIPSE)
    grasp = dataclasses.replace(TILTING, preload=0.5)
    theta_deg, alpha_deg = np.meshgrid([10.0, 25.0, 45.0, 70.0], np.arange(0, 180, 30))
    table = pushed(
        params,
        grasp,
        noise=0.0,
        theta=np.radians(theta_deg.ravel()),
        alpha=np.radians(alpha_deg.ravel()),
        repeats=1,
        channels=COMPONENTS,
    )
    text = '[grasp]\nmechanics = "tilting"\npreload_n = 0.5\n'
    settings = config(text + LENGTH + '[noise]\nsigma = "sampled"\n')
    problem = build_problem(table, settings).problem
    assert problem.data_names == ("ln_A", "ln_B", "ln_C_rr", "f1", "f2", "ln_s")
    group = contact(params)
    logs = [float(np.log(getattr(group, name))) for name in ("A", "B", "C_rr", "s")]
    y = jnp.array([*logs[:3], float(group.f1), float(group.f2), logs[3]])
    errors = problem.predict(problem.data_state(y)) - problem.observed
    errors = np.asarray(errors)[np.asarray(problem.mask)]
    np.testing.assert_allclose(errors, 0.0, atol=EXACT)


@pytest.mark.slow
def test_profiles_hold_the_truth_and_leave_s_to_its_prior():
    settings = config(
        MECHANICS + "[parameters.L]\nnormal = { mean = 0.04, sd = 0.001 }\n"
    )
    fitted = fit_table(pushed(), settings)
    profiles = likelihood_profiles(
        fitted.setup,
        fitted.fit,
        reference_alpha=fitted.reference_alpha,
        prob=0.99,
        reach=reach_of(settings),
    )
    assert profiles["theta_c"].verdict is Verdict.DETERMINED
    ((low, high),) = profiles["theta_c"].pieces
    assert low < true_angle() < high
    for name, value in (("A", 520.0), ("B", 150.0), ("C_rr", 0.5)):
        ((low, high),) = profiles[name].pieces
        assert low < value < high, name
    assert "s" not in profiles
    assert profiles["K_st"].verdict is Verdict.ONE_SIDED


@pytest.mark.slow
def test_an_identification_by_tilting_mechanics_is_whole():
    """Emcee, sets and criticism agree on what these heights tell of θ_c.

    An interval of 99 % misses the truth in one of a hundred tables.
    """
    settings = config(
        MECHANICS
        + "[parameters.L]\nnormal = { mean = 0.04, sd = 0.001 }\n"
        + "[report]\nprob = 0.99\n"
    )
    result = identify_table(pushed(channels=COMPONENTS), settings, seed=1)
    assert result.status is FitStatus.OK
    assert result.theta_c.verdict is Verdict.DETERMINED
    low, high = result.theta_c.interval
    assert low < true_angle() < high
    assert result.goodness_of_fit.is_adequate
    assert "large_tilt" not in {warning.code for warning in result.warnings}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("push_length", "channels", "leading"),
    [
        (5e-3, COMPONENTS, "tilting"),
        (1e-3, ("height",), "tilting"),
        (5e-4, COMPONENTS, "linear"),
    ],
    ids=["5 mm", "1 mm", "0.5 mm"],
)
def test_the_mechanics_that_lead_are_those_of_the_push(push_length, channels, leading):
    """By hand: 5 mm tilt this grasp by several degrees, a tenth of them by none.

    Magnitudes of 1 mm, which tilt it by 1.4°, are off by half of the linear interval.
    """
    grasp = Grasp(push_length=push_length, mechanics="tilting")
    noise = 0.02 * push_length / PUSH
    table = pushed(grasp=grasp, noise=noise, channels=channels)
    text = f"[push]\nlength_mm = {1e3 * push_length}\n{LENGTH}{HARD}"
    settings = parse_config(text, path="grasp.toml")
    both = identify_table(table, settings, seed=1, engine="sweep")
    assert both.mechanics == leading
    assert {answer.mechanics for answer in both.by_mechanics} == {"linear", "tilting"}
    low, high = both.theta_c.interval
    assert low < true_angle(grasp=grasp) < high
    assert "large_tilt" not in {warning.code for warning in both.warnings}
    if leading == "linear":
        # Every height has the same noise, and L no residual: χ² = n (rms / σ)².
        first = both.by_mechanics[0]
        rms_residual = noise * np.sqrt(first.chi_square / both.fit.n_data)
        assert first.rms_residual == pytest.approx(rms_residual, rel=EXACT)
    for answer in both.by_mechanics:
        text_of_one = f'{text}[grasp]\nmechanics = "{answer.mechanics}"\n'
        settings = parse_config(text_of_one, path="grasp.toml")
        (alone,) = identify_table(table, settings, seed=1, engine="sweep").by_mechanics
        assert alone.theta_c.estimate == answer.theta_c.estimate
        # Checks of the mechanics alone may withhold its interval.
        assert dataclasses.replace(alone, theta_c=answer.theta_c) == answer


@pytest.mark.slow
def test_heights_that_speak_against_a_tilt_are_believed_and_told_of():
    """Pushes of 5 mm that do not tilt the object, as where L is far longer."""
    table = pushed(grasp=Grasp(push_length=PUSH), channels=COMPONENTS)
    settings = parse_config(
        f"[push]\nlength_mm = {1e3 * PUSH}\n{LENGTH}{HARD}", path="grasp.toml"
    )
    found = identify_table(table, settings, seed=1, engine="sweep", is_brief=True)
    assert found.mechanics == "linear"
    (told,) = [w.text for w in found.warnings if w.code == "large_tilt"]
    assert "the heights prefer them to tilting mechanics, so check L" in told


@pytest.mark.slow
def test_models_are_compared_by_the_mechanics_that_lead():
    """As heights of 5 mm are of mechanics that tilt, the others are less evident."""
    text = f"[push]\nlength_mm = {1e3 * PUSH}\n{LENGTH}{HARD}"
    found = compare_models(
        pushed(channels=COMPONENTS), parse_config(text, path="grasp.toml"), seed=1
    )
    assert found.mechanics == "tilting"
    models = {model.name: model for model in found.models}
    assert models["linear"].is_less_evident
    assert not models["hard"].is_less_evident


def test_two_supports_join_the_mechanics_and_their_rivals():
    settings = config(MECHANICS + "support_span_mm = 60.0\n" + MEASURED)
    problem = build_problem(pushed(grasp=HELD, noise=0.1, repeats=1), settings).problem
    assert problem.grasp.support_span == 0.06
    assert problem.data_names == ("ln_A", "ln_B", "ln_C_rr", "ln_s", "ln_L")
    linear = settings.model_copy(
        update={"grasp": settings.grasp.model_copy(update={"mechanics": "linear"})}
    )
    assert "tilting" in rival_configs(linear)


@pytest.mark.slow
def test_at_the_truth_two_supports_leave_no_residual():
    theta_deg, alpha_deg = np.meshgrid(THETA_DEG[::4], [20.0, 60.0, 90.0])
    table = pushed(
        grasp=HELD,
        noise=0.0,
        channels=COMPONENTS,
        theta=np.radians(theta_deg.ravel()),
        alpha=np.radians(alpha_deg.ravel()),
        repeats=1,
    )
    text = MECHANICS + "support_span_mm = 60.0\n" + LENGTH
    text += "[parameters.e1]\nfixed = 0.0\n[parameters.e2]\nfixed = 0.0\n"
    settings = config(text + '[noise]\nsigma = "sampled"\n')
    problem = build_problem(table, settings).problem
    assert problem.data_names == ("ln_A", "ln_B", "ln_C_rr", "ln_s")
    group = contact(FIRM)
    y = jnp.log(jnp.stack([group.A, group.B, group.C_rr, group.s]))
    errors = problem.predict(problem.data_state(y)) - problem.observed
    errors = np.asarray(errors)[np.asarray(problem.mask)]
    np.testing.assert_allclose(errors, 0.0, atol=EXACT)
