"""Which mechanics are believed, and where the belief is the engine's."""

import gc
from dataclasses import replace
from pathlib import Path

import jax
import numpy as np
import pytest

from pushfit.config import parse_config, read_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import FitError
from pushfit.explore.belief import from_fit
from pushfit.explore.belief.belief import ASKABLE, N_BELIEF_DRAWS, Question
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.belief.learning import learnt, weighed
from pushfit.explore.belief.tables import told_rows
from pushfit.fit.checks.tilt_check import do_draws_tilt
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.identify.progress import Stages
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.programs import compile as programs
from pushfit.fit.programs import folder
from pushfit.fit.results import FitStatus, PosteriorResult
from pushfit.fit.sweep.prior import make_target
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp
from tests.explore.worlds import COMPONENTS, TRUTH
from tests.fit.tables import HARD, NORMAL
from tests.tolerances import EXACT

# Four standard errors of medians of so many draws.
MEDIANS = 0.08

FOAM_BOX = Path(__file__).parents[3] / "examples/foam_box/grasp.toml"
CALLIPERS = "[parameters.L]\nnormal = { mean = 0.04, sd = 0.001 }\n"
# Programs that other tests have of the paper's switch and of normal noise.
SHARED = HARD + NORMAL


def question(length_mm, mechanics="auto", parameters=CALLIPERS):
    text = f'[push]\nlength_mm = {length_mm}\n[grasp]\nmechanics = "{mechanics}"\n'
    return Question(
        config=parse_config(text + parameters, path="grasp.toml"),
        ask=("theta_c",),
        channels=COMPONENTS,
        unit="n",
        sigma=None,
        reference_alpha=np.pi / 2,
    )


def table(grasp, *, share=0.01, channels=COMPONENTS):
    """Ten elevations; noise is a share of the tallest height."""
    stiffness = 571.0
    return simulate_table(
        TRUTH,
        grasp,
        theta=np.radians(np.linspace(5.0, 85.0, 10)),
        alpha=np.pi / 2,
        repeats=1,
        noise=share * stiffness * float(grasp.push_length),
        rng=np.random.default_rng(0),
        channels=channels,
        state_sd=True,
    )


def interval(belief):
    return np.quantile(belief.samples["theta_c"], [0.05, 0.95])


@pytest.mark.slow
def test_a_large_tilt_is_believed_as_it_is():
    """5 mm on an object of 40 mm; the paper's equations miss θ_c there."""
    grasp = Grasp(push_length=0.005, mechanics="tilting")
    truth = float(np.degrees(critical_angle(TRUTH, grasp, np.pi / 2)))
    made = table(grasp)
    belief = believe(made, question(5.0), 0)
    assert belief.grasp.mechanics == "tilting"
    low, high = interval(belief)
    assert low < truth < high
    low, high = interval(believe(made, question(5.0, "linear"), 0))
    assert not low < truth < high


@pytest.mark.slow
def test_a_small_tilt_is_left_to_the_equations_of_the_paper():
    made = table(Grasp(push_length=2e-4, mechanics="tilting"), share=0.03)
    belief = believe(made, question(0.2), 0)
    only = believe(made, question(0.2, "linear"), 0)
    assert belief.grasp.mechanics == "linear"
    np.testing.assert_array_equal(belief.samples["theta_c"], only.samples["theta_c"])


@pytest.mark.parametrize("sigma", [None, 0.03, 1.0])
def test_a_preload_tells_the_scale_of_a_sensor_without_one(sigma):
    """Springs of median stiffness push as hard as the preload, whatever the noise."""
    text = "[push]\nlength_mm = 5.0\n[grasp]\npreload_kpa = 12.0\n"
    asked = Question(
        config=parse_config(text, path="grasp.toml"),
        ask=("theta_c",),
        channels=("height",),
        unit="kpa",
        sigma=sigma,
        reference_alpha=np.pi / 2,
    )
    belief = believe(None, asked, 0)
    support, contact = (np.median(belief.samples[name]) for name in ("K_sn", "K_dn"))
    height = 0.005 * support * contact / (support + contact)
    assert height == pytest.approx(12.0, rel=MEDIANS)
    assert np.mean(np.isnan(belief.samples["theta_c"])) < 0.5


def drawn(theta_c_deg, log_evidence):
    """Draws of an interval of 10° that count alike."""
    values = np.linspace(theta_c_deg - 5.0, theta_c_deg + 5.0, 101)
    return PosteriorResult(
        samples={"theta_c": values},
        prior_samples={},
        log_prob=np.zeros(values.size),
        chain=None,
        chain_names=(),
        thin=1,
        engine="sweep",
        diagnostics=None,
        log_evidence=log_evidence,
        log_evidence_error=0.0,
        ess=float(values.size),
        pareto_k=0.0,
        seed=0,
        status=FitStatus.OK,
    )


@pytest.mark.parametrize(
    ("theta_c_deg", "log_evidence", "is_leading"),
    [
        (44.0, -10.0, True),
        (44.0, -14.0, True),
        (44.0, -16.0, False),  # the heights speak against it
        (42.0, -10.0, False),  # a fifth of the width is not worth it
        (45.0, None, True),  # and nobody knows
    ],
)
def test_tilting_draws_lead_where_they_matter_and_are_no_worse(
    theta_c_deg, log_evidence, is_leading
):
    linear = drawn(40.0, -10.0)
    tilting = drawn(theta_c_deg, log_evidence)
    assert do_draws_tilt(linear, tilting, prob=0.9) is is_leading


def test_without_a_stated_lever_there_is_nothing_to_tilt_by():
    """By a transition that is open, as by default."""
    made = table(Grasp(push_length=0.005, mechanics="tilting"), channels=("height",))
    own = replace(question(5.0, parameters=NORMAL), channels=made.channels)
    belief = believe(made, own, 0)
    assert belief.grasp.mechanics == "linear"


def test_errors_of_the_joints_are_believed_as_they_are_identified():
    """Elevations of ± 2°: the same posterior, and the next push scatters so, too."""
    made = table(Grasp(push_length=0.005), share=1e-3)
    own = question(5.0, parameters=SHARED + "theta_sd_deg = 2.0\n")
    belief, exact = (
        believe(made, own, 0),
        believe(made, question(5.0, parameters=SHARED), 0),
    )
    found = identify_table(made, own.settings, seed=0, engine="sweep", is_brief=True)
    expected = np.quantile(found.posterior.samples["theta_c"], [0.05, 0.95])
    np.testing.assert_allclose(interval(belief), expected, atol=0.1 * np.ptp(expected))
    assert np.ptp(interval(belief)) > 2 * np.ptp(interval(exact))
    added = np.sqrt(np.median(found.fit.sigma**2 - made.sd(COMPONENTS[0])[0] ** 2))
    assert 0.3 * added < np.mean(belief.sigma) < 3 * added


@pytest.mark.slow
def test_the_mechanics_believed_are_those_that_lead_the_identification():
    made = table(Grasp(push_length=0.005, mechanics="tilting"))
    own = question(5.0)
    found = identify_table(made, own.settings, seed=0, engine="sweep")
    assert found.by_mechanics[0].mechanics == "tilting"
    assert believe(made, own, 0).grasp.mechanics == "tilting"


@pytest.mark.slow
def test_what_is_asked_turns_no_choice_of_the_mechanics():
    """Six pushes across the supports, of an object that may tilt as it likes."""
    made = PeakTable.from_arrays(
        theta=np.radians([40.0, 5.0, -40.0, -10.0, 40.0, 15.0]),
        alpha=np.full(6, np.pi / 2),
        heights={"height": np.array([9.277, 3.44, -7.853, -0.624, 9.224, 5.191])},
        unit="kpa",
        sd={"height": np.full(6, 0.1)},
    )
    own = Question(
        config=read_config(FOAM_BOX),
        ask=("theta_c",),
        channels=("height",),
        unit="kpa",
        sigma=0.1,
        reference_alpha=np.pi / 2,
    )
    found = identify_table(made, own.settings, seed=0, engine="sweep", is_brief=True)
    leading = found.by_mechanics[0].mechanics
    for ask in ASKABLE.values():
        assert believe(made, replace(own, ask=ask), 6).grasp.mechanics == leading


@pytest.fixture(scope="module")
def pushes() -> PeakTable:
    """An exploration of 60 pushes, no two of them alike."""
    rng = np.random.default_rng(0)
    return simulate_table(
        TRUTH,
        Grasp(push_length=0.005),
        theta=rng.permutation(np.radians(np.linspace(5.0, 85.0, 60))),
        alpha=np.pi / 2,
        repeats=1,
        noise=0.05,
        rng=rng,
        channels=COMPONENTS,
        state_sd=True,
    )


def begun(pushes: PeakTable, n: int) -> PeakTable:
    """The first n pushes of an exploration."""
    return replace(pushes, frame=pushes.frame.iloc[:n])


def test_a_table_that_grows_is_drawn_from_by_few_programs(pushes):
    """An exploration of 60 pushes needs four lengths; each costs tens of megabytes."""
    asked = question(5.0, "linear")
    lengths = set()
    for n in range(1, 61):
        setup = build_problem(begun(pushes, n), asked.settings)
        target = make_target(setup.problem, np.pi / 2)
        pooled = target.pooled.problem
        lengths.add((pooled.pushes.theta.size, *pooled.mask.shape))
    assert len(lengths) == 4


def test_redraws_compile_nothing_and_keep_nothing(pushes, monkeypatch):
    """Fresh draws from 17 to 24 pushes are made by the same two programs."""
    asked, made, n_live = question(5.0, "linear", parameters=SHARED), set(), []
    program = programs._program

    def noted(function, folder, form):
        made.add((function, form))
        return program(function, folder, form)

    monkeypatch.setattr(programs, "_program", noted)
    for n in (17, 20, 24):
        believe(begun(pushes, n), asked, n)
        gc.collect()
        n_live.append(len(jax.live_arrays()))
    names = [function.__name__ for function, _ in made]
    assert (names.count("_sheet"), names.count("_draws")) == (1, 1)
    assert n_live[1:] == n_live[:-1]


def table_of_two():
    return PeakTable.from_arrays(
        theta=np.radians([20.0, 65.0]),
        alpha=np.full(2, np.pi / 2),
        heights=dict.fromkeys(COMPONENTS, np.array([0.7, 1.5])),
        unit="n",
    )


@pytest.mark.parametrize("stages", [None, Stages(())])
def test_python_hears_of_minutes_of_compiling_as_commands_do(
    monkeypatch, tmp_path, caplog, stages
):
    """Before the first draws, and the programs are kept for later ones."""
    monkeypatch.setenv(folder.SWITCH, str(tmp_path / "compiled"))
    # Set, so that what is set is taken back.
    monkeypatch.setenv(folder.PROGRAMS, "")

    def never(*_):
        raise InterruptedError

    monkeypatch.setattr(from_fit, "_drawn", never)
    with pytest.raises(InterruptedError):
        believe(table_of_two(), question(5.0, "linear"), 0, stages=stages)
    said = [record.message for record in caplog.records]
    assert len(said) == (1 if stages is None else 0)
    assert all("minutes" in text and str(tmp_path) in text for text in said)
    assert (folder.programs_folder() is not None) is (stages is None)


def test_heights_without_a_posterior_weigh_the_priors(monkeypatch):
    """Where neither engine gives draws, a push is asked for all the same."""
    made, own = table_of_two(), question(5.0, "linear", parameters=SHARED)
    own = replace(own, sigma=0.05)

    def none(*_, **__):
        raise FitError("no start", code="solver")

    monkeypatch.setattr(from_fit, "sweep_posterior", none)
    told = told_rows(made)
    belief = learnt(told, own, n_drawn=len(told), source=believe, seed=0)
    assert belief.is_guess
    alone = believe(None, own, len(told))
    for row in told:
        alone = weighed(alone, row, own)
    np.testing.assert_allclose(belief.weights, alone.weights, rtol=EXACT)
    assert belief.ess < N_BELIEF_DRAWS / 2


def sweep_of_azimuths():
    """Two pushes at each of nine azimuths, elastic: the soft axis lies at 65°."""
    made = Grasp(push_length=0.005)
    along = np.radians(2 * 65.0 - 180.0)
    return simulate_table(
        replace(TRUTH, e1=1.4 * np.cos(along), e2=1.4 * np.sin(along)),
        made,
        theta=np.radians(60.0),
        alpha=np.radians(20.0 * np.arange(9)),
        repeats=2,
        noise=0.01,
        rng=np.random.default_rng(0),
        state_sd=True,
    )


@pytest.mark.parametrize("turned", [0.0, 90.0])
def test_a_best_direction_is_believed_as_far_as_a_cosine_bears_it_out(
    turned, monkeypatch
):
    """Draws that are turned by a right angle are of no table, however many count."""
    made = sweep_of_azimuths()
    own = replace(
        question(5.0, "linear", parameters=SHARED),
        ask=("alpha_star",),
        channels=made.channels,
    )
    draw = from_fit.sweep_posterior

    def turn(*given, **more):
        found = draw(*given, **more)
        alpha = np.mod(found.samples["alpha_star"] + turned, 180.0)
        return replace(found, samples={**found.samples, "alpha_star": alpha})

    monkeypatch.setattr(from_fit, "sweep_posterior", turn)
    belief = believe(made, own, 0)
    codes = [warning.code for warning in belief.warnings]
    assert codes.count("alpha_star_disagreement") == (turned > 0)
    assert (belief.lacks("alpha_star") is None) is (turned == 0)
    assert belief.lacks("theta_c") is None


def test_draws_that_no_engine_vouches_for_give_no_interval(monkeypatch):
    made = table(Grasp(push_length=0.005))
    own = question(5.0, "linear", parameters=SHARED)
    draw = from_fit.sweep_posterior

    def unsure(*given, **more):
        return replace(draw(*given, **more), status=FitStatus.NOT_CONVERGED)

    monkeypatch.setattr(from_fit, "sweep_posterior", unsure)
    monkeypatch.setattr(
        from_fit,
        "draw_posterior",
        lambda fitted, *, seed, engine: unsure(
            fitted.setup,
            seed=seed,
            reference_alpha=fitted.reference_alpha,
            reach=(0.0, np.pi),
        ),
    )
    belief = believe(made, own, 0)
    assert not belief.is_guess
    assert belief.lacks("theta_c") == "its draws are not to be trusted"
    assert "not_converged" in {warning.code for warning in belief.warnings}


@pytest.mark.parametrize("is_random", [False, True])
def test_heights_that_nothing_explains_are_told_of_as_in_an_identification(is_random):
    """Without a noise that says how far: twelve heights in any order."""
    theta, rng = np.radians(np.linspace(5.0, 80.0, 12)), np.random.default_rng(3)
    heights = 2.8 * np.sin(theta) + 0.02 * rng.standard_normal(theta.size)
    if is_random:
        heights = rng.permutation(heights)
    made = PeakTable.from_arrays(
        theta=theta,
        alpha=np.full(theta.size, np.pi / 2),
        heights={"height": heights},
        unit="n",
    )
    own = replace(question(5.0, "linear", parameters=SHARED), channels=("height",))
    belief = believe(made, own, 0)
    found = identify_table(made, own.settings, seed=0, engine="sweep", is_brief=True)
    assert found.goodness_of_fit.is_adequate is not is_random
    codes = {warning.code for warning in belief.warnings}
    assert ("model_inadequate" in codes) is is_random


def test_what_an_identification_warns_of_is_believed_with_it():
    """Kilonewtons under newtons, and four heights at the limit of the sensor."""
    made, asked = table(Grasp(push_length=0.005)), question(5.0, parameters=SHARED)
    frame = made.frame.copy()
    for name in ("height_normal_n", "height_tangential_n"):
        frame[name] = np.minimum(frame[name], frame[name].sort_values().iloc[-4])
    for factor, code in ((1.0, "heights_at_limit"), (1e-3, "far_from_prior")):
        columns = [c for c in frame if c.endswith("_n")]
        scaled = frame.assign(**{c: factor * frame[c] for c in columns})
        belief = believe(type(made).from_frame(scaled), asked, 0)
        codes = {warning.code for warning in belief.warnings}
        assert code in codes
        assert "model_untested" not in codes
    few = believe(type(made).from_frame(made.frame[:3]), asked, 0)
    assert "model_untested" in {warning.code for warning in few.warnings}
