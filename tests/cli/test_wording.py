"""Messages name arguments in Python, and options or keys of grasp.toml in commands."""

import ast
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import pushfit
from pushfit.cli import main
from pushfit.cli.wording import in_options
from pushfit.data.tables.peak_table import read_table
from pushfit.errors import PushfitError, stated

PACKAGE = Path(pushfit.__file__).parent
COMMANDS = PACKAGE / "cli"
LIBRARY = [
    path
    for path in sorted(PACKAGE.rglob("*.py"))
    if not path.is_relative_to(COMMANDS) or path.is_relative_to(COMMANDS / "look")
]
OPTION = re.compile(r"(?<![\w-])--[a-z]")
# Dialects are called after the commands of others that write them.
COMMANDS_OF_OTHERS = {"mcap cat --format=csv", "ros2 topic echo --csv"}
FLAGS = {"rate": "--rate", "map": "--map", "begin": "--from", "force": "--force"}


def texts_of(path: Path) -> list[str]:
    """Every string of a file that is no docstring."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    strings = [n for n in ast.walk(tree) if isinstance(n, ast.Constant)]
    alone = {id(n.value) for n in ast.walk(tree) if isinstance(n, ast.Expr)}
    return [n.value for n in strings if isinstance(n.value, str) and id(n) not in alone]


def test_the_library_knows_no_options():
    said = {text for path in LIBRARY for text in texts_of(path) if OPTION.search(text)}
    assert said == COMMANDS_OF_OTHERS


@pytest.mark.parametrize(
    ("library", "command"),
    [
        ("the samples per second by `rate`", "the samples per second by --rate"),
        (stated(rate=100), "--rate 100"),
        (stated(force=True), "--force"),
        (stated(begin=2.5), "--from 2.5"),
        (
            stated(mapping={"force": "AI1 (V)"}, units={"force": "n"}),
            "--map 'force=AI1 (V)' and recording.unit = { force = \"n\" }",
        ),
        (stated(units={"AI1 (V)": "n"}), 'recording.unit = { "AI1 (V)" = "n" }'),
        (stated(columns=["a_s", "..."]), 'recording.columns = ["a_s", "..."]'),
        (stated(exclude=[(1.0, 2.5)]), "peaks.exclude = [[1.0, 2.5]]"),
        (stated(invert=True), "peaks.invert = true"),
        ("`min_height`", "peaks.min_height"),
        # Neither options nor settings: commands, functions, and what is no argument.
        *[
            (text, text)
            for text in ("`peaks`", "`merge_tables`", "`a) b`", "``", "`1`")
        ],
    ],
)
def test_arguments_are_put_in_the_words_of_a_command(library, command):
    assert in_options(f"say {library}, then", FLAGS) == f"say {command}, then"


@pytest.mark.parametrize(
    ("content", "command", "library", "line"),
    [
        ("0,1\n1,2\n", "validate", "`rate=100` if none", "--rate 100 if none"),
        ("0,1\n1,2\n", "identify", "`rate=100` if", "--rate 100 if"),
        (
            "t_s,pdc\n0,1\n1,2\n",
            "peaks",
            "`mapping={'pressure': 'pdc'}, units={'pressure': 'counts'}`",
            "--map pressure=pdc --unit pressure=counts",
        ),
        (
            "t,f_n\n0,1\n1,2\n",
            "peaks",
            "state `units={'time': 's'}` (",
            "state --unit time=s (",
        ),
    ],
)
def test_one_fault_is_said_at_both_doors(
    content, command, library, line, tmp_path, capsys
):
    path = tmp_path / "log.csv"
    path.write_text(content)
    with pytest.raises(PushfitError) as caught:
        pushfit.read_recording(path)
    assert library in "\n".join(problem.message for problem in caught.value.problems)
    assert main([command, str(path)]) == 3
    assert line in capsys.readouterr().err


def test_an_option_is_called_as_its_command_calls_it(tmp_path, capsys):
    """Time is looked at from and to, which are no names in Python."""
    time = np.arange(0.0, 16.0, 0.01)
    since = np.abs(time[:, None] - [2.0, 6.0, 10.0])
    level = 100 * np.clip(1 - since, 0, 1).sum(axis=1) + 150 * (np.abs(time - 6) < 2)
    level += np.random.default_rng(4).standard_normal(time.size)
    path = tmp_path / "log.csv"
    pd.DataFrame({"time_s": time, "f_n": level}).to_csv(path, index=False)
    assert main(["peaks", str(path), "-o", str(tmp_path / "heights.csv")]) == 0
    assert "read so between --from and --to within it" in capsys.readouterr().err


def test_a_command_that_has_no_such_option_names_the_key(tmp_path, capsys):
    """A flat signal: `peaks` takes --min-height and --invert, `identify` does not."""
    path = tmp_path / "flat.csv"
    path.write_text("time_s,f_n\n" + "".join(f"{k / 100},1\n" for k in range(300)))
    plan = tmp_path / "plan.csv"
    plan.write_text("theta_deg,alpha_deg\n30,0\n")
    for command, word in (("peaks", "--min-height"), ("identify", "peaks.min_height")):
        assert main([command, str(path), "-s", str(plan)]) == 3
        assert f"in n by {word}\n" in capsys.readouterr().err


def test_a_column_without_a_unit_that_is_named_as_channel_is_told_so(tmp_path, capsys):
    path = tmp_path / "log.csv"
    path.write_text("time_s,c,f_n\n" + "".join(f"{k / 100},1,{k}\n" for k in range(9)))
    assert main(["peaks", str(path), "--channel", "c"]) == 2
    said = capsys.readouterr().err
    assert "column 'c' states no unit, so it is no channel; state --unit c=n" in said
    assert main(["peaks", str(path), "--channel", "g"]) == 2
    assert "channel 'g' is not there; the recording has f" in capsys.readouterr().err


def test_what_is_kept_of_a_table_is_in_the_words_of_its_command(tmp_path):
    """The notes that a summary and a page repeat: dips, which may be pushes."""
    time = np.arange(0.0, 30.0, 0.01)
    pushes = [
        100.0 * s * np.exp(-(((time - 6 * k - 3) / 0.4) ** 2))
        for k, s in enumerate([-2, 1, 1.2, 0.8, 1])
    ]
    level = sum(pushes) + np.random.default_rng(4).standard_normal(time.size)
    columns = {"time_s": time, "f_n": level, "theta_deg": 30.0, "alpha_deg": 0.0}
    path, out = tmp_path / "log.csv", tmp_path / "peaks.parquet"
    pd.DataFrame(columns).to_csv(path, index=False)
    assert main(["peaks", str(path), "-o", str(out)]) == 0
    (note,) = [note for note in read_table(out).notes if "falls below rest" in note]
    assert note.endswith("state peaks.signed = true if these are pushes as well")
