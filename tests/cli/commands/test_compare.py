"""`pushfit compare`: what is printed, and when it fails."""

import json

import pytest

from pushfit.cli import main
from pushfit.data.tables.peak_table import write_table
from pushfit.fit import comparison
from pushfit.fit.results import FitStatus
from tests.fit.tables import TOML, case_table
from tests.problems import CASES
from tests.report.makers import make_comparison


@pytest.mark.parametrize(
    ("status", "code"), [(FitStatus.OK, 0), (FitStatus.NOT_CONVERGED, 4)]
)
def test_scores_are_printed_and_untrusted_ones_change_the_exit_code(
    status, code, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_table(case_table(CASES["firm"], noise=0.03, seed=1), "peaks.csv")
    (tmp_path / "grasp.toml").write_text(TOML)

    def compare_models(table, config, *, seed, progress):
        assert (table.n_pushes, config.push.length_mm, seed) == (51, 5.0, 3)
        return make_comparison(status=status)

    monkeypatch.setattr(comparison, "compare_models", compare_models)
    words = ["compare", "peaks.csv", "--config", "grasp.toml", "--seed", "3"]
    assert main(words) == code
    assert "cannot tell hard and soft (p = 8) apart" in capsys.readouterr().out
    assert main([*words, "--json"]) == code
    found = json.loads(capsys.readouterr().out)
    assert found["status"] == status.name.lower()


@pytest.mark.parametrize("command", ["compare", "fit"])
@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("flags", "saturated", "all 51 pushes are flagged"),
        ("height_n", 0.0, "the column height holds only zeros"),
        ("theta_deg", 0.0, "all pushes go along the surface"),
    ],
)
def test_a_table_that_tells_nothing_is_named(
    command, column, value, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    table = case_table(CASES["firm"], noise=0.03, seed=1)
    changed = table.frame.assign(**{column: value})
    write_table(type(table).from_frame(changed), "peaks.csv")
    assert main([command, "peaks.csv"]) == 3
    said = capsys.readouterr().err
    if command == "compare" and column == "height_n":
        words = "no models are compared: height_n is 0 in all 51"
    assert f"peaks.csv: {words}" in said
