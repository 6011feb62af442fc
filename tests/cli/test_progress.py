"""How far a command is: what a log gets, what a terminal, and what neither loses."""

import contextlib
import itertools
import os
import pty
import re
import sys

from pushfit.cli import main
from pushfit.cli.progress import ProgressLines
from tests.cli.test_app import session
from tests.fit.tables import HARD, NORMAL, TOML

ESCAPE = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# The columns of a terminal that holds the bar in one line.
COLUMNS = "120"


def test_a_log_gets_a_line_for_each_stage_with_what_is_left():
    """At constant speed what is left is elapsed (1 - share) / share."""
    said, seconds = [], itertools.count(step=3)
    course = ProgressLines(said.append, clock=lambda: float(next(seconds)))
    course("least squares", 0.0)
    course("likelihood sets", 0.25)
    course.tell("best fit: 40°")
    course("posterior", 0.5)
    assert said == [
        "least squares: 0 % done",
        "likelihood sets: 25 % done, about 18 s left",
        "best fit: 40°",
        "posterior: 50 % done, about 9 s left",
    ]


def test_a_log_names_every_stage_however_short():
    """Two stages within one percent: each is said, and a number makes none."""
    said = []
    course = ProgressLines(said.append)
    stages = ["set of θ_c", "posterior", "posterior", "table 1 of 9", "table 2 of 9"]
    for place, stage in enumerate(stages):
        course(stage, 0.2 + place / 1000)
    assert [line.partition(":")[0] for line in said] == [*stages[:2], stages[3]]


def test_a_log_of_ten_thousand_tables_is_short():
    said = []
    course = ProgressLines(said.append)
    for number in range(10_000):
        course(f"table {number}", number / 10_000)
    assert 10 < len(said) <= 35


def test_quiet_says_nothing(capsys):
    with session(is_quiet=True).progress() as progress:
        progress("least squares", 0.0)
        progress.tell("best fit")
    assert capsys.readouterr() == ("", "")


def everything(terminal: int) -> str:
    """What was written to a terminal, once nobody can write to it any more."""
    seen = b""
    # A read returns what is there, and fails where all has been read.
    with contextlib.suppress(OSError):
        while received := os.read(terminal, 1 << 16):
            seen += received
    os.close(terminal)
    return ESCAPE.sub("", seen.decode())


def test_a_terminal_gets_a_bar_and_the_first_answer_above_it(monkeypatch, capsys):
    reader, writer = pty.openpty()
    monkeypatch.setenv("COLUMNS", COLUMNS)
    monkeypatch.setenv("TERM", "xterm")
    with os.fdopen(writer, "w") as stream:
        monkeypatch.setattr(sys, "stderr", stream)
        with session().progress() as progress:
            print("the report")
            progress("posterior", 0.5)
            progress.tell("best fit: 40° \x1b[31m")
        monkeypatch.undo()
    seen = everything(reader)
    assert "best fit: 40°" in seen
    assert "posterior" in seen
    assert "50%" in seen
    assert capsys.readouterr().out == "the report\n"


def test_a_command_says_theta_c_before_the_posterior(capsys, tmp_path):
    """What is on standard output stays what it was: the report alone."""
    table, grasp = tmp_path / "peaks.csv", tmp_path / "grasp.toml"
    # By the switch of the paper, whose programs other tests have as well.
    grasp.write_text(TOML + HARD + NORMAL)
    rows = ["theta_deg,alpha_deg,height_n"]
    rows += [f"{5 * i},0,{0.02 * i**1.5:.3f}" for i in range(1, 18)]
    table.write_text("\n".join(rows))
    words = ["fit", str(table), "-c", str(grasp)]
    assert main(words) == 0
    said, out = capsys.readouterr()[::-1]
    order = ["least squares", "first look", "best fit by"]
    order += ["likelihood set of", "posterior by"]
    places = [said.index(words) for words in order]
    assert places == sorted(places)
    assert not any(words in out for words in order[:4])
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == (out, "")
