"""The command line, as a shell sees it: streams, exit codes, files."""

import inspect
import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import typer

from benchmarks.speed.waiting import COMMANDS
from pushfit.cli import main
from pushfit.cli.app import app
from pushfit.cli.commands import doctor, explore
from pushfit.cli.examples import EXAMPLES
from pushfit.cli.session import CommandSession
from pushfit.config import GraspConfig, read_config
from pushfit.config.inputs import RecordingSection
from pushfit.data.grasp import make_grasp
from pushfit.data.load import reader_options
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.samples import Gaps, ThetaFrom
from pushfit.data.simulate import Session
from pushfit.data.text.dialects import Format
from pushfit.data.text.scan import Tail
from pushfit.data.truth import stated_parameters
from pushfit.errors import ConfigError, DataError, FitError, InputProblem
from pushfit.mechanics.directions import critical_angle
from tests.batch.makers import table_text


def session(**options: bool) -> CommandSession:
    flags = {"is_quiet": False, "is_verbose": False, "is_debug": False}
    return CommandSession(**(flags | {"is_json": False} | options))


def raising(error: BaseException):
    def work() -> None:
        raise error

    return work


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ConfigError("a", code="x"), 2),
        (DataError("a", code="x"), 3),
        (FitError("a", code="x"), 4),
        (KeyboardInterrupt(), 130),
        (ZeroDivisionError("a"), 1),
        (PermissionError(13, "Permission denied", "out"), 2),
    ],
)
def test_every_failure_has_its_exit_code_and_one_line(error, code, capsys):
    assert session().run(raising(error)) == code
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1


def test_the_list_of_commands_breaks_no_sentence_off(capsys):
    assert main(["--help"]) == 0
    listed = capsys.readouterr().out.partition("Commands:")[2]
    assert listed.count("\n") > 15
    assert "..." not in listed
    for name in ("init", "doctor"):
        assert f"  {name} " in listed


def test_a_failure_under_json_is_a_document(capsys):
    problem = InputProblem(code="bad", message="line 3: bad")
    error = DataError("a.csv: bad", code="bad_cell", problems=(problem,))
    session(is_json=True).run(raising(error))
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "pushfit.error/1"
    assert document["status"] == "bad_cell"
    assert document["problems"] == ["line 3: bad"]


def test_debug_shows_the_traceback():
    with pytest.raises(ZeroDivisionError):
        session(is_debug=True).run(raising(ZeroDivisionError()))


def test_quiet_says_nothing_but_errors(capsys):
    session(is_quiet=True).say("hello")
    assert capsys.readouterr().err == ""


def test_text_from_files_cannot_steer_the_terminal(capsys):
    session().run(raising(DataError("cell '\x1b[31m'", code="x")))
    assert "\x1b[31m" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fit", "t.csv", "--engine", "foo"], "'--engine'"),
        (["fit"], "'TABLE'"),
        (["coverage", "t.csv", "--tables", "0"], "'--tables'"),
        (["fit", "t.csv", "--no-such"], "--no-such"),
        (["no-such"], "'no-such'"),
    ],
)
def test_a_usage_error_under_json_is_a_document(words, said, capsys, monkeypatch):
    assert main(words) == 2
    alone = capsys.readouterr()
    assert alone.out == ""
    monkeypatch.setattr("sys.argv", ["pushfit", *words, "--json"])
    assert main() == 2
    captured = capsys.readouterr()
    assert captured.err == alone.err
    document = json.loads(captured.out)
    assert (document["schema"], document["status"]) == ("pushfit.error/1", "usage")
    assert said in document["message"]
    assert f"Error: {document['message']}" in captured.err


def test_init_writes_a_config_that_can_be_read(tmp_path, capsys):
    path = tmp_path / "grasp.toml"
    assert main(["init", str(path)]) == 0
    assert read_config(path) == read_config(None)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "length_mm" in captured.err


def test_init_overwrites_only_by_force(tmp_path, capsys):
    path = tmp_path / "grasp.toml"
    path.write_text("[push]\nlength_mm = 4.0\n")
    assert main(["init", str(path)]) == 2
    assert "--force" in capsys.readouterr().err
    assert read_config(path).push.length_mm == 4.0
    assert main(["init", str(path), "--force"]) == 0
    assert not read_config(path).push.length_known


def test_init_can_print(capsys):
    assert main(["init", "-"]) == 0
    assert capsys.readouterr().out.startswith("# What is known")


def test_doctor_names_what_users_lack_and_not_what_developers_do(monkeypatch):
    monkeypatch.setattr(doctor, "_version", {"numpy": "2", "pytest": "9"}.get)
    versions = doctor.installed_versions()
    assert versions["numpy"] == "2"
    assert versions["pytest"] == "9"
    assert versions["jinja2"] is versions["rosbags"] is None
    assert not {"ruff", "mkdocs", "lmfit"} & versions.keys()


def test_doctor_prints_one_document(capsys):
    assert main(["doctor", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "pushfit.doctor/1"
    assert document["status"] == "ok"
    assert document["versions"]["jax"]


LAST = """
import atexit, sys
import pushfit.__main__, pushfit.cli
pushfit.cli.main = lambda: atexit.register(print, "last words") and 3
sys.exit(pushfit.__main__.main())
"""


def test_a_process_ends_with_its_code_and_all_that_was_to_be_said():
    """It frees nothing, but what was registered on the way runs, and is printed."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    ended = subprocess.run(
        [sys.executable, "-c", LAST],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (ended.returncode, ended.stdout) == (3, "last words\n")


@pytest.mark.parametrize("closed", [("stdout",), ("stderr",), ("stdout", "stderr")])
@pytest.mark.parametrize(
    "words", [["init", "-"], ["validate", "{}", "--json"], ["fit", "--json"]]
)
def test_a_closed_pipe_is_no_bug(tmp_path, words, closed):
    """Whether an answer or a refusal goes there; what goes elsewhere is said."""
    header = tmp_path / "table.csv"
    header.write_text("theta_deg,alpha_deg,height_n\n", "utf-8")
    reader, writer = os.pipe()
    os.close(reader)
    streams = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    ended = subprocess.run(
        [sys.executable, "-m", "pushfit", *(w.format(header) for w in words)],
        check=False,
        text=True,
        **(streams | dict.fromkeys(closed, writer)),
    )
    os.close(writer)
    goes_there = "stdout" in closed or words[0] != "init"
    assert ended.returncode == (141 if goes_there else 0)
    assert "this is a bug" not in (ended.stderr or "")


@pytest.mark.parametrize("platforms", ["cuda", "nonsense"])
def test_a_device_that_is_not_there_is_no_bug(platforms):
    environment = os.environ | {"JAX_PLATFORMS": platforms, "CUDA_VISIBLE_DEVICES": ""}
    ended = subprocess.run(
        [sys.executable, "-m", "pushfit", "doctor"],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == ConfigError.exit_code
    assert f"error: JAX_PLATFORMS = {platforms}: " in ended.stderr


@pytest.fixture
def not_compiled(monkeypatch) -> Iterator[None]:
    """JAX as it is where the environment forbids it to compile."""
    monkeypatch.setenv("JAX_DISABLE_JIT", "1")
    jax.config.update("jax_disable_jit", True)
    yield
    jax.config.update("jax_disable_jit", False)


@pytest.mark.parametrize("command", ["fit", "coverage", "batch"])
def test_an_environment_that_forbids_to_compile_is_no_bug(
    command, not_compiled, tmp_path, capsys
):
    (tmp_path / "peaks.csv").write_text(table_text(seed=0))
    out = [] if command == "coverage" else ["--out", str(tmp_path / "out")]
    code = main([command, str(tmp_path / "peaks.csv"), *out])
    assert code == ConfigError.exit_code
    assert "error: JAX_DISABLE_JIT = 1: " in capsys.readouterr().err


EXAMPLE = Path(__file__).parents[2] / "examples" / "foam_box"


def test_validate_says_what_each_file_is(capsys):
    files = ["theta_sweep.csv", "alpha_schedule.csv"]
    assert main(["validate", "--json", *(str(EXAMPLE / name) for name in files)]) == 0
    recording, schedule = json.loads(capsys.readouterr().out)["files"]
    assert recording["kind"] == "recording"
    assert recording["channels"] == ["pressure_kpa"]
    assert (schedule["kind"], schedule["pushes"]) == ("schedule", 18)


def test_validate_lists_all_problems_of_all_files(tmp_path, capsys):
    for name in ("a.csv", "b.csv"):
        (tmp_path / name).write_text("time_s,force_n\n0.0,1.0\n0.1,x\n0.2,2.0\n")
    files = [str(tmp_path / name) for name in ("a.csv", "b.csv")]
    assert main(["validate", "--json", *files]) == 3
    captured = capsys.readouterr()
    problems = json.loads(captured.out)["problems"]
    assert [Path(p["path"]).name for p in problems] == ["a.csv", "b.csv"]
    assert captured.err.count("\n") == len(problems)


def test_validate_says_what_the_files_are_that_are_not_refused(tmp_path, capsys):
    (tmp_path / "a.csv").write_text("time_s,force_n\n0.0,1.0\n0.1,x\n0.2,2.0\n")
    good = str(EXAMPLE / "alpha_schedule.csv")
    assert main(["validate", str(tmp_path / "a.csv"), good]) == 3
    captured = capsys.readouterr()
    assert "line 3, column force_n" in captured.err
    assert good in captured.out


def test_simulate_is_reproducible(tmp_path):
    plan, truth = EXAMPLE / "alpha_schedule.csv", EXAMPLE / "truth.toml"
    options = ["--config", str(truth), "--unit", "kpa", "--noise", "0.1", "--seed", "3"]
    for name in ("one.csv", "two.csv"):
        arguments = ["simulate", str(plan), *options, "-o", str(tmp_path / name)]
        assert main(arguments) == 0
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "two.csv").read_bytes()
    assert main(["validate", str(tmp_path / "one.csv")]) == 0


def test_simulate_takes_the_unit_of_the_preload(tmp_path):
    plan, truth = EXAMPLE / "alpha_schedule.csv", EXAMPLE / "truth.toml"
    made = tmp_path / "made.csv"
    assert main(["simulate", str(plan), "-c", str(truth), "-o", str(made)]) == 0
    assert list(read_recording(made).units.values()) == ["kpa"]


def test_simulate_names_the_option_for_a_unit_that_the_preload_is_not_in(capsys):
    plan, truth = EXAMPLE / "alpha_schedule.csv", EXAMPLE / "truth.toml"
    words = ["simulate", str(plan), "-c", str(truth), "-o", "none.csv"]
    assert main([*words, "--unit", "counts"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "--unit kpa" in said
    assert str(truth) in said


@pytest.mark.parametrize(
    "name", ["made.npz", "made.npy", "made.parquet", "made.csv.gz"]
)
def test_text_gets_no_name_that_readers_take_for_another_format(name, tmp_path, capsys):
    plan, truth = EXAMPLE / "alpha_schedule.csv", EXAMPLE / "truth.toml"
    made = tmp_path / name
    assert main(["simulate", str(plan), "-c", str(truth), "-o", str(made)]) == 2
    assert f"{name}: is written as CSV" in " ".join(capsys.readouterr().err.split())
    assert not made.exists()


def test_simulate_says_by_how_much_directions_are_off_without_noise(capsys):
    assert main(["simulate", "--help"]) == 0
    off = np.degrees(Session().angle_resolution) / 2
    assert f"off by up to {off:g} degrees" in " ".join(capsys.readouterr().out.split())


def test_validate_says_once_what_is_wrong_in_many_rows(tmp_path, capsys):
    rows = [f"{theta},0,{'x' if theta == 15 else 1},0" for theta in (5, 10, 15, 20)]
    table = tmp_path / "peaks.csv"
    table.write_text("\n".join(["theta_deg,alpha_deg,height_n,height_sd_n", *rows]))
    assert main(["validate", str(table)]) == 3
    (bad_height,) = capsys.readouterr().err.splitlines()
    assert ", line 4, column height_n: 'x' is not a number" in bad_height
    table.write_text(table.read_text().replace("x", "1"))
    assert main(["validate", "--json", str(table)]) == 3
    captured = capsys.readouterr()
    (bad_sd,) = captured.err.splitlines()
    assert ", lines 2–5, column height_sd_n: 0 is no standard deviation" in bad_sd
    assert len(json.loads(captured.out)["problems"]) == len(rows)


def test_validate_describes_grasp_by_grasp(tmp_path, capsys):
    (tmp_path / "long.csv").write_text(
        "grasp,theta_deg,alpha_deg,height_n\na,30,0,1\nb,45,0,2\nb,60,0,3\n"
    )
    assert main(["validate", "--json", str(tmp_path / "long.csv")]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert [(f["grasp"], f["pushes"]) for f in files] == [("a", 1), ("b", 2)]


def test_validate_says_what_a_table_shows_that_cannot_be_right(tmp_path, capsys):
    rows = ["1,30,0,1,2.5", "2,45,0,1,2750", "3,60,0,1,2.75"]
    table = tmp_path / "peaks.csv"
    table.write_text("\n".join(["push,theta_deg,alpha_deg,repeat,height_n", *rows]))
    assert main(["validate", str(table)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "warning push 2 (θ = 45°, α = 0°): height_n = 2750 is about 1000" in said
    assert main(["validate", "--json", str(table)]) == 0
    (file,) = json.loads(capsys.readouterr().out)["files"]
    assert [warning["code"] for warning in file["warnings"]] == ["other_unit"]


def test_simulate_does_not_overwrite(tmp_path, capsys):
    target = tmp_path / "there.csv"
    target.write_text("mine")
    plan, truth = EXAMPLE / "alpha_schedule.csv", EXAMPLE / "truth.toml"
    assert main(["simulate", str(plan), "-c", str(truth), "-o", str(target)]) == 2
    assert target.read_text() == "mine"


def test_the_reader_and_its_section_of_the_config_agree():
    """Config knows no data, so `[recording]` repeats what `read_recording` takes."""
    parameters = inspect.signature(read_recording).parameters
    for name, value in reader_options(GraspConfig()).items():
        assert parameters[name].default == value, name


@pytest.mark.parametrize(
    ("key", "choices"),
    [("format", Format), ("gaps", Gaps), ("theta_from", ThetaFrom), ("tail", Tail)],
)
def test_the_choices_of_the_reader_and_the_config_agree(key, choices):
    field = RecordingSection.model_fields[key]
    assert get_args(field.annotation) == get_args(choices)


@pytest.mark.slow
def test_the_demo_finds_what_was_simulated(tmp_path, capsys):
    """End to end; truth by `critical_angle` and by the soft axis of truth.toml."""
    out = tmp_path / "result"
    assert main(["demo", "--json", "--seed", "5", "--out", str(out)]) == 0
    summary = json.loads(capsys.readouterr().out)
    config = read_config(EXAMPLE / "truth.toml")
    theta_c = critical_angle(
        stated_parameters(config), make_grasp(config, "kpa"), jnp.asarray(np.pi / 2)
    )
    for name, truth in {
        "theta_c_deg": np.degrees(float(theta_c)),
        "alpha_star_deg": 65.0,
    }.items():
        lower, upper = summary[name]["interval"]
        # A 90 % interval misses once in ten; twice its width, once in a thousand.
        margin = (upper - lower) / 2
        assert lower - margin < truth < upper + margin
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == summary
    assert (out / "figures" / "main.svg").stat().st_size > 0
    assert main(["verify", str(out)]) == 0
    assert "reproduced exactly" in capsys.readouterr().out
    assert main(["demo", "--out", str(out)]) == 2
    assert "--force" in capsys.readouterr().err


@pytest.mark.slow
def test_the_same_seed_gives_the_same_numbers(tmp_path, capsys):
    """In two processes, and whatever else is in the folder."""
    documents = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        command = [sys.executable, "-m", "pushfit", "demo", "--json", "--seed", "7"]
        result = subprocess.run(
            command, cwd=tmp_path / name, capture_output=True, check=True
        )
        documents.append(result.stdout)
    assert documents[0] == documents[1]


def test_completion_is_offered_for_the_shell(capsys, monkeypatch):
    """Which shell it is, typer asks the processes above; here it is told."""
    monkeypatch.setattr("shellingham.detect_shell", lambda: ("bash", "/bin/bash"))
    assert main(["--show-completion"]) == 0
    assert "complete -o default -F _pushfit_completion pushfit" in (
        capsys.readouterr().out
    )


def test_every_command_ends_its_help_with_an_example_that_it_understands():
    group = typer.main.get_command(app)
    for name, known in group.commands.items():
        example, _ = EXAMPLES[name]
        first, second, *arguments = shlex.split(example)
        assert (first, second) == ("pushfit", name)
        # Raises for an option or argument that the command does not have.
        known.make_context(name, arguments)


def test_the_examples_that_fit_nothing_work_on_the_foam_box(tmp_path, monkeypatch):
    """With its files under the names of the examples; of `explore` all but pushes."""
    monkeypatch.chdir(tmp_path)
    for name in ("truth.toml", "grasp.toml"):
        shutil.copy(EXAMPLE / name, name)
    for name in ("sweep.csv", "schedule.csv"):
        shutil.copy(EXAMPLE / f"theta_{name}", name)
    monkeypatch.setattr(explore, "_run", lambda *_, **__: 0)
    for name in ("validate", "peaks", "simulate", "explore"):
        assert main(shlex.split(EXAMPLES[name][0])[1:]) == 0
    # What comes after `simulate` begins with this.
    assert main(["peaks", "simulated.csv", "-s", "schedule.csv"]) == 0


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS)
def test_what_the_benchmark_of_waits_runs_is_understood(words):
    name, *arguments = words
    typer.main.get_command(app).commands[name].make_context(name, arguments)


def test_help_shows_the_example_on_a_line_of_its_own(capsys):
    assert main(["fit", "--help"]) == 0
    assert "\n    pushfit fit peaks.csv -c grasp.toml\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments",
    [
        ["fit", "none.csv"],
        ["identify", "none.csv"],
        ["peaks", "none.csv"],
        ["compare", "none.csv"],
        ["coverage", "none.csv"],
        ["validate", "none.csv"],
        ["simulate", "none.csv", "-o", "x.csv"],
    ],
    ids=lambda a: a[0],
)
def test_a_missing_file_is_said_before_anything_heavy_is_loaded(arguments):
    code = (
        "import sys; from pushfit.cli import main\n"
        f"code = main({arguments!r})\n"
        "print(code, {'jax', 'pandas', 'numpy', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "2 set()\n"
    assert "no such file" in done.stderr


def test_a_folder_that_is_taken_is_said_before_anything_heavy_is_loaded(tmp_path):
    code = (
        "import sys; from pushfit.cli import main\n"
        f"code = main(['demo', '-o', {str(tmp_path)!r}])\n"
        "print(code, {'jax', 'matplotlib'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout == "2 set()\n"
    assert "--force" in done.stderr


def test_all_commands_name_their_output_alike():
    """-o and --out, whether a file or a folder."""
    group = typer.main.get_command(app)
    for known in group.commands.values():
        for parameter in known.params:
            if "out" in (parameter.name or ""):
                assert {"-o", "--out"} <= set(parameter.opts)


def test_all_commands_take_their_settings_alike():
    """By --config and -c; `init` writes them, `report` to `verify` have them inside."""
    group = typer.main.get_command(app)
    options = {
        n: {w for p in c.params for w in p.opts} for n, c in group.commands.items()
    }
    without = {"init", "demo", "doctor", "report", "diff", "verify"}
    assert {n for n, words in options.items() if {"-c", "--config"} <= words} == (
        set(options) - without
    )


def test_whatever_reads_a_recording_can_be_told_how_it_is_laid_out():
    group = typer.main.get_command(app)
    options = {"--format", "--map", "--unit", "--columns", "--rate", "--profile"}
    for name in ("identify", "validate", "peaks", "look"):
        known = {word for p in group.commands[name].params for word in p.opts}
        assert options <= known, name


@pytest.mark.parametrize(("words", "level"), [([], "3"), (["--debug"], None)])
def test_what_xla_logs_is_for_debugging(words, level, monkeypatch):
    """It calls it an error that a program takes minutes to compile."""
    monkeypatch.setenv("TF_CPP_MIN_LOG_LEVEL", "")
    monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL")
    main(["doctor", *words])
    assert os.environ.get("TF_CPP_MIN_LOG_LEVEL") == level
