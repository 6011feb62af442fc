"""`pushfit verify`: a result is computed again, and what differs is named."""

import json
import shutil
from pathlib import Path

import jsonschema
import pytest

from pushfit.cli import main
from pushfit.data.tables.peak_table import write_table
from pushfit.report.store import folder as folder_module
from pushfit.report.store.summary_schema import summary_schema
from tests.fit.tables import HARD, TOML, case_table
from tests.problems import CASES


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a table, its config and its result, made by the commands."""
    place = tmp_path_factory.mktemp("verify")
    write_table(case_table(CASES["firm"], noise=0.03, seed=1), place / "peaks.csv")
    (place / "grasp.toml").write_text(TOML + HARD + "[report]\nprob = 0.8\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        patch.setattr(folder_module, "figure_files", lambda _, **__: {})
        patch.setattr(folder_module, "render_html", lambda _, **__: "")
        options = ["--engine", "sweep", "--seed", "4", "--out", "result"]
        assert main(["sample", "peaks.csv", "-c", "grasp.toml", *options]) == 0
    # Nothing of the config is needed any more: the result holds it.
    (place / "grasp.toml").unlink()
    return place


@pytest.fixture
def place(made, tmp_path, monkeypatch):
    """A copy of it to work in."""
    shutil.copytree(made, tmp_path / "place")
    monkeypatch.chdir(tmp_path / "place")
    return tmp_path / "place"


def test_an_untouched_result_is_reproduced_exactly_wherever_its_input_is(place, capsys):
    (place / "elsewhere").mkdir()
    (place / "peaks.csv").rename(place / "elsewhere" / "peaks.csv")
    assert main(["verify", "result", "--inputs", "elsewhere", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "pushfit.verify/1"
    assert document["status"] == "reproduced"
    assert document["is_exact"]
    assert document["differences"] == []
    assert document["n_numbers"] > 8000
    assert document["inputs"] == {"peaks.csv": "elsewhere/peaks.csv"}


def test_a_summary_that_names_its_files_follows_the_schema(place):
    summary = json.loads((place / "result" / "summary.json").read_text())
    jsonschema.validate(summary, summary_schema())
    assert summary["recipe"]["table"] == "peaks.csv"


def test_a_number_that_was_changed_is_named(place, capsys):
    path = place / "result" / "summary.json"
    summary = json.loads(path.read_text())
    estimate = summary["combinations"]["A"]["estimate"]
    summary["combinations"]["A"]["estimate"] = 2 * estimate
    path.write_text(json.dumps(summary))
    assert main(["verify", "result"]) == 4
    shown = capsys.readouterr().out
    assert "not reproduced: 1 of" in shown
    assert f"combinations.A.estimate: {2 * estimate} recorded, {estimate} now" in shown


def test_an_input_that_has_changed_is_refused_by_name(place, capsys):
    with (place / "peaks.csv").open("a") as file:
        file.write("\n")
    assert main(["verify", "result"]) == 3
    message = capsys.readouterr().err
    recorded = json.loads((place / "result" / "summary.json").read_text())["inputs"]
    assert "peaks.csv" in message
    assert recorded[0]["sha256"] in message


def test_an_input_that_is_gone_is_refused_by_name(place, capsys):
    (place / "peaks.csv").unlink()
    assert main(["verify", "result"]) == 3
    message = capsys.readouterr().err
    assert "peaks.csv" in message
    assert "--inputs" in message


def test_a_folder_that_is_no_result_is_a_rejected_input(place, capsys):
    assert main(["verify", "."]) == 3
    assert "not a result" in capsys.readouterr().err


def test_a_result_made_in_python_says_that_it_cannot_be_verified(place, capsys):
    path = place / "result" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"recipe": None}))
    assert main(["verify", "result"]) == 2
    assert "made in Python" in capsys.readouterr().err


def test_a_result_without_its_files_is_refused_with_another_way(place, capsys):
    """As `explore` leaves it, whose table no file became."""
    path = place / "result" / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"recipe": None}))
    assert main(["verify", "result"]) == 2
    said = capsys.readouterr().err
    assert (
        "`pushfit fit result/peaks.csv --config GRASP.TOML --seed 4 --out ANEW`" in said
    )
    # Which is a way: the folder's own table gives the numbers of the result.
    Path("same.toml").write_text(TOML + HARD + "[report]\nprob = 0.8\n")
    words = ["-c", "same.toml", "--engine", "sweep", "--seed", "4", "--json"]
    assert main(["fit", "result/peaks.csv", *words]) == 0
    again = json.loads(capsys.readouterr().out)
    first = json.loads(path.read_text())
    assert again["combinations"] == first["combinations"]
