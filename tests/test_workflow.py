"""One call from whatever holds the pushes: files, frames and records are one thing."""

import inspect
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

import pushfit
from pushfit import workflow
from pushfit.batch.run import identify_batch
from pushfit.config import as_config
from pushfit.data.tables.peak_table import read_table
from pushfit.errors import ConfigError, ConvergenceError, DataError
from pushfit.fit.comparison import compare_models
from pushfit.fit.coverage import coverage_study
from pushfit.fit.results import FitStatus, Identification, Recipe
from pushfit.fit.sweep import posterior as sweep
from tests.batch.makers import table_text
from tests.fit.tables import case_table, config
from tests.problems import CASES

EXAMPLE = Path(__file__).parents[1] / "examples" / "foam_box"
SWEEP, PLAN = EXAMPLE / "alpha_sweep.csv", EXAMPLE / "alpha_schedule.csv"


class Asked(Exception):
    """What the identification was asked for."""


@pytest.fixture
def asked(monkeypatch):
    """Call `identify` and give the table, settings and seed that it would fit."""

    def stop(table, config, **options):
        raise Asked(table, config, options)

    monkeypatch.setattr(workflow, "identify_table", stop)

    def ask(*arguments, **options):
        with pytest.raises(Asked) as caught:
            pushfit.identify(*arguments, engine="sweep", **options)
        return caught.value.args

    return ask


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "peaks.csv"
    path.write_text(table_text(1, n=6))
    return path


def test_a_table_is_the_same_as_path_frame_and_record(table, asked):
    frames = [
        asked(given)[0].frame
        for given in (table, str(table), pd.read_csv(table), pushfit.read_table(table))
    ]
    for frame in frames[1:]:
        pd.testing.assert_frame_equal(frame, frames[0])


def test_a_recording_is_the_same_as_path_frame_and_record(asked):
    recording = pushfit.read_recording(SWEEP)
    schedule = pushfit.read_schedule(PLAN)
    inputs = [
        (SWEEP, PLAN),
        ([str(SWEEP)], [str(PLAN)]),
        (recording, schedule),
        (pd.read_csv(SWEEP), pd.read_csv(PLAN)),
    ]
    frames = [asked(*given)[0].frame for given in inputs]
    assert len(frames[0]) == 18
    for frame in frames[1:]:
        pd.testing.assert_frame_equal(frame, frames[0])


def test_settings_are_the_same_as_file_and_as_dictionary(table, tmp_path, asked):
    path = tmp_path / "grasp.toml"
    path.write_text("[push]\nlength_mm = 4.0\n")
    settings = {"push": {"length_mm": 4.0}}
    assert asked(table, config=path)[1] == asked(table, config=settings)[1]
    with pytest.raises(ConfigError, match="did you mean length_mm"):
        pushfit.identify(table, config={"push": {"lenght_mm": 4.0}})


def test_the_seed_is_zero_unless_stated(table, asked):
    assert asked(table)[2]["seed"] == 0
    assert asked(table, seed=3)[2]["seed"] == 3


def test_settings_in_the_place_of_a_schedule_are_known_by_their_name(table):
    with pytest.raises(ConfigError, match="settings, no schedule; give it as `config`"):
        pushfit.identify(table, "grasp.toml")


@pytest.mark.parametrize(
    "begin",
    [
        lambda table, out: pushfit.identify(table, seed=-1),
        lambda table, out: identify_batch(SWEEP, out, seed=-1),
        lambda table, out: compare_models(read_table(table), config(), seed=-1),
        lambda table, out: coverage_study(
            read_table(table), config(), n_tables=1, seed=-1
        ),
    ],
    ids=["identify", "batch", "compare", "coverage"],
)
def test_a_seed_below_0_is_refused_before_anything_is_fitted(begin, table, tmp_path):
    with pytest.raises(ConfigError, match=r"seed = -1: .* 0 or above"):
        begin(table, tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.repeated
@pytest.mark.parametrize("seed", [1.5, None, "1"])
def test_a_seed_is_a_whole_number(seed, table, tmp_path):
    with pytest.raises(ConfigError, match=f"seed = {seed!r}: .* 0 or above"):
        pushfit.identify(table, seed=seed)
    with pytest.raises(ConfigError, match=f"seed = {seed!r}: .* 0 or above"):
        identify_batch(SWEEP, tmp_path / "out", seed=seed)


def test_an_engine_that_is_unknown_ends_a_batch_at_once(tmp_path):
    with pytest.raises(ConfigError, match="engine = 'exact' is not known"):
        identify_batch(SWEEP, tmp_path / "out", engine="exact")
    assert not (tmp_path / "out").exists()


def test_every_function_for_users_has_the_same_seed():
    public = [getattr(pushfit, name) for name in pushfit.__all__]
    functions = [*filter(inspect.isroutine, public), coverage_study, pushfit.Explorer]
    seeds = {
        function.__name__: inspect.signature(function).parameters["seed"].default
        for function in functions
        if "seed" in inspect.signature(function).parameters
    }
    assert seeds == dict.fromkeys(seeds, 0)
    assert {"identify", "compare_models", "coverage_study", "Explorer"} <= set(seeds)


def test_what_identify_takes_is_explained():
    told = inspect.getdoc(pushfit.identify)
    names = inspect.signature(pushfit.identify).parameters
    assert [name for name in names if f"\n    {name}: " not in told] == []


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        (("none.csv",), ConfigError, "no such file"),
        ((PLAN,), DataError, "is a schedule"),
        (([SWEEP, SWEEP], PLAN), ConfigError, "2 recordings and 1 schedule;"),
        ((SWEEP,), DataError, "no angles"),
    ],
)
def test_inputs_that_do_not_go_together_are_refused(arguments, error, words):
    with pytest.raises(error, match=words):
        pushfit.identify(*arguments)


def test_a_table_goes_with_nothing_else(table):
    with pytest.raises(ConfigError, match="takes no schedule"):
        pushfit.identify(table, PLAN)
    with pytest.raises(ConfigError, match="1 table and 1 recording at once"):
        pushfit.identify([table, SWEEP])


def test_only_files_can_be_verified_later(table):
    config = as_config(None)
    given = config.model_dump(mode="json")
    assert workflow.recipe_of([table], [], config) == Recipe(
        config=given, table=str(table)
    )
    assert workflow.recipe_of([SWEEP], [PLAN], config) == Recipe(
        config=given, recordings=(str(SWEEP),), schedules=(str(PLAN),)
    )
    assert workflow.recipe_of([pd.DataFrame()], [], config) is None


def test_a_notebook_shows_what_is_known_and_the_stage(monkeypatch):
    shown = []

    class Handle:
        def update(self, data, *, raw):
            assert raw
            shown.append(data["text/plain"])

    notebook = ModuleType("IPython")
    notebook.get_ipython = lambda: type("Shell", (), {"kernel": 1})()
    notebook.display = type(
        "Display", (), {"display": staticmethod(lambda *a, **k: Handle())}
    )
    monkeypatch.setitem(sys.modules, "IPython", notebook)
    clock = iter([100.0, 103.0, 106.0])
    monkeypatch.setattr(workflow.time, "perf_counter", lambda: next(clock))
    with workflow.shown_progress(None) as (progress, tell):
        assert progress is not None
        tell("best fit: θ_c = 41°")
        progress("least squares", 0.1)
        progress("sampling", 0.25)
    known = "best fit: θ_c = 41°"
    # A quarter in 6 s leaves three of them; a tenth foretells nothing.
    assert shown == [
        known,
        f"{known}\nleast squares: 10 % done",
        f"{known}\nsampling: 25 % done, about 18 s left",
        known,
    ]


def test_without_a_notebook_nothing_is_shown(monkeypatch, capsys):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    with workflow.shown_progress(None) as (progress, tell):
        assert progress is None
        tell("best fit")
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_a_frame_becomes_a_result(table):
    result = pushfit.identify(pd.read_csv(table), config={"push": {"length_mm": 5}})
    assert isinstance(result, pushfit.Result)
    assert isinstance(result, Identification)
    assert "6 pushes, 6 used" in str(result)


@pytest.mark.parametrize("given", [np.zeros((3, 2)), 3, {"theta_deg": [10.0]}])
def test_what_holds_no_pushes_is_refused_with_what_would(given):
    config = as_config(None)
    with pytest.raises(ConfigError, match="give a path, a DataFrame"):
        workflow.gather([given], [], config)
    with pytest.raises(ConfigError, match="is no schedule; give a path"):
        workflow.gather([SWEEP], [given], config)


def test_nothing_is_nothing_to_identify():
    with pytest.raises(ConfigError, match="nothing to identify"):
        pushfit.identify([])


def test_errors_of_a_frame_name_no_file():
    frame = pd.DataFrame({"a": [10, 20, 30], "b": [0, 0, 0]})
    with pytest.raises(DataError, match=r"^DataFrame, line 1: no time") as caught:
        pushfit.identify(frame)
    assert {one.path for one in caught.value.problems} == {"DataFrame"}
    plan = pd.DataFrame({"theta_deg": ["x"], "alpha_deg": [0.0]})
    with pytest.raises(DataError, match=r"^DataFrame, line 2, column theta_deg"):
        pushfit.identify(SWEEP, plan)


def test_a_posterior_that_is_not_to_be_trusted_raises_where_that_is_asked(monkeypatch):
    monkeypatch.setattr(sweep, "TOO_FEW", 1e9)
    asked = {"config": config(), "engine": "sweep"}
    table = case_table(CASES["firm"], noise=0.02)
    result = pushfit.identify(table, **asked)
    assert result.status is FitStatus.NOT_CONVERGED
    with pytest.raises(ConvergenceError) as caught:
        pushfit.identify(table, **asked, throw=True)
    error = caught.value
    assert (str(error), error.code) == (result.status.value, "not_converged")
    assert error.names == result.fit.names
    assert error.points[0] == result.fit.estimate.tolist()
    assert error.costs[0] == result.fit.chi_square


def test_a_posterior_that_is_to_be_trusted_is_given_also_where_others_raise():
    table = case_table(CASES["firm"], noise=0.02)
    result = pushfit.identify(table, config=config(), engine="sweep", throw=True)
    assert result.status is FitStatus.OK
