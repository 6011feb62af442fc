"""`pushfit look`: what is refused before, what is saved, and that it can be used."""

import shlex

import numpy as np
import pandas as pd
import pytest

from pushfit.cli import main
from pushfit.cli.commands import look as look_module
from pushfit.cli.commands.look import Saver, read_look
from pushfit.cli.session import CommandSession
from pushfit.config import read_config
from pushfit.data.plans.schedule import PushSchedule, write_schedule
from pushfit.data.simulate import Session as Robot
from pushfit.data.simulate import simulate_recording, write_recording
from pushfit.errors import ConfigError
from tests.cli.look.makers import recording
from tests.problems import CASES
from tests.tolerances import EXACT

THETA_DEG = np.arange(10.0, 90.0, 10.0)
QUIET = CommandSession(is_quiet=True, is_verbose=False, is_debug=False, is_json=False)
TARGETS = ["a_schedule.csv", "a_grasp.toml"]


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_recording(recording(), tmp_path / "a.csv")
    return tmp_path


@pytest.fixture
def robot(place):
    """A simulated sweep whose angles nobody recorded, with a push too many."""
    case = CASES["paper"]
    plan = PushSchedule.planned(
        np.radians([*THETA_DEG, 45.0]), np.radians(90.0), repeats=1
    )
    simulated = simulate_recording(
        case.params,
        case.grasp,
        plan,
        session=Robot(noise=0.002),
        rng=np.random.default_rng(3),
    ).recording
    bare = type(simulated)(
        time=simulated.time, channels=simulated.channels, units=simulated.units
    )
    write_recording(bare, place / "sweep.csv")
    return place / "sweep.csv"


def decided(place, path):
    """The last push clicked away, and the others named."""
    look = read_look(QUIET, path, schedule=None, settings=read_config(None))
    look.toggle(look.pushes[-1])
    look.fill("10:80:10", "90", 1)
    return look


def next_command(said: str) -> list[str]:
    """Words after `pushfit` of the command that was told."""
    return shlex.split(said.partition(": ")[2])[1:]


def test_what_is_saved_is_what_the_command_it_tells_then_reads(robot, place, capsys):
    look = decided(place, robot.relative_to(place))
    words = next_command(Saver(QUIET, robot, place, force=False)(look))
    assert words[0] == "identify"
    assert main(["peaks", *words[1:], "-o", "peaks.csv"]) == 0
    table = pd.read_csv("peaks.csv")
    assert table["theta_deg"].tolist() == THETA_DEG.tolist()
    shown = look.measure().frame
    np.testing.assert_allclose(table["height_n"], shown["height_n"], rtol=EXACT)


def test_what_is_saved_goes_through_links_which_stay(robot, place):
    saver = Saver(QUIET, robot, place, force=False)
    (place / "disk").mkdir()
    for path in (saver.schedule, saver.config):
        path.symlink_to(f"disk/{path.name}")
    saver(decided(place, robot))
    for path in (saver.schedule, saver.config):
        assert path.is_symlink()
        assert (place / "disk" / path.name).stat().st_size > 100


@pytest.mark.slow
def test_the_command_it_tells_runs_to_the_end(robot, place, capsys):
    words = next_command(Saver(QUIET, robot, place, force=False)(decided(place, robot)))
    assert main([*words, "--out", "result"]) == 0
    assert "8 pushes" in capsys.readouterr().out


def test_names_with_blanks_survive_the_shell(place):
    (place / "a.csv").rename(place / "my run.csv")
    look = read_look(
        QUIET, place / "my run.csv", schedule=None, settings=read_config(None)
    )
    look.fill("0", "90", 1)
    words = next_command(Saver(QUIET, place / "my run.csv", place, force=False)(look))
    assert main(["validate", words[1], words[3]]) == 0


def test_the_settings_in_force_are_saved_with_the_windows(place):
    (place / "mine.toml").write_text("[push]\nlength_mm = 4.0\n[peaks]\nsplit = 0.3\n")
    look = read_look(
        QUIET, place / "a.csv", schedule=None, settings=read_config("mine.toml")
    )
    look.toggle(look.pushes[0])
    look.fill("0", "90", 1)
    save = Saver(QUIET, place / "a.csv", place, force=False)
    save(look)
    saved = read_config(save.config)
    assert saved == look.settled()
    assert (saved.push.length_mm, saved.peaks.split) == (4.0, 0.3)
    assert len(saved.peaks.exclude) == 2


@pytest.mark.parametrize("taken", TARGETS)
def test_files_that_are_there_are_not_replaced_unasked(place, taken, capsys):
    (place / taken).write_text("precious")
    assert main(["look", "a.csv", "--no-browser"]) == 2
    assert f"{taken}: exists already" in capsys.readouterr().err
    look = read_look(QUIET, place / "a.csv", schedule=None, settings=read_config(None))
    look.fill("0", "90", 1)
    with pytest.raises(ConfigError, match="exists already"):
        Saver(QUIET, place / "a.csv", place, force=False)(look)
    assert [path.name for path in place.iterdir() if path.name in TARGETS] == [taken]
    assert (place / taken).read_text() == "precious"
    Saver(QUIET, place / "a.csv", place, force=True)(look)
    assert (place / taken).read_text() != "precious"


def test_what_was_saved_a_moment_ago_is_replaced(place):
    look = read_look(QUIET, place / "a.csv", schedule=None, settings=read_config(None))
    look.fill("0", "90", 1)
    save = Saver(QUIET, place / "a.csv", place, force=False)
    save(look)
    look.fill("15", "90", 1)
    save(look)
    assert "15.0" in save.schedule.read_text()


def test_nothing_is_saved_while_an_angle_is_missing(place):
    look = read_look(QUIET, place / "a.csv", schedule=None, settings=read_config(None))
    with pytest.raises(Exception, match="have no angles"):
        Saver(QUIET, place / "a.csv", place, force=False)(look)
    assert [path.name for path in place.iterdir()] == ["a.csv"]


def test_the_page_is_exported_and_says_what_peaks_would(place, capsys):
    assert main(["look", "a.csv", "--export", "page.html"]) == 0
    assert "wrote page.html" in capsys.readouterr().err
    assert "pushfit look: a.csv" in (place / "page.html").read_text()
    assert main(["look", "a.csv", "--export", "page.html"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["look", "a.csv", "--export", "page.html", "--force"]) == 0


def test_an_export_is_not_in_the_way_of_what_was_saved(place):
    for name in TARGETS:
        (place / name).write_text("precious")
    assert main(["look", "a.csv", "--export", "page.html"]) == 0


def test_a_missing_library_is_said_before_the_recording_is_read(
    place, monkeypatch, capsys
):
    (place / "a.csv").write_text("no recording at all")
    monkeypatch.setattr(look_module, "find_spec", lambda name: None)
    assert main(["look", "a.csv", "--no-browser"]) == 2
    assert "not installed; `pip install '.[look]'` in the" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["none.csv"], 2, "none.csv: no such file"),
        (["a.csv", "--out", "none"], 2, "the folder none does not exist"),
        (["a.csv", "--channel", "moment"], 2, "moment"),
        (["plan.csv"], 3, "plan.csv"),
    ],
)
def test_what_cannot_be_shown_is_refused(place, arguments, code, words, capsys):
    write_schedule(PushSchedule.planned(0.5, 1.0, repeats=3), place / "plan.csv")
    assert main(["look", *arguments, "--no-browser"]) == code
    assert words in capsys.readouterr().err
