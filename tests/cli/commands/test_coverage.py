"""`pushfit coverage`: the whole way for a user's table."""

import json

from pushfit.cli import main
from pushfit.data.tables.peak_table import write_table
from tests.fit.tables import HARD, NORMAL, TOML, case_table
from tests.problems import CASES


def test_few_tables_are_counted_and_nothing_is_claimed_of_them(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    write_table(case_table(CASES["firm"], noise=0.03, seed=1), "peaks.csv")
    (tmp_path / "grasp.toml").write_text(TOML + HARD + NORMAL)
    words = ["coverage", "peaks.csv", "-c", "grasp.toml", "--tables", "2"]
    words += ["--seed", "6"]
    assert main([*words, "--plot", "coverage.svg", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["engine"], found["n_pushes"]) == ("sweep", 51)
    counted = found["n_tables"] - found["n_failed"]
    assert {c["name"] for c in found["coverage"]} == {"theta_c", "A", "B", "C_rr"}
    for coverage in found["coverage"]:
        low, high = coverage["limits"]
        assert coverage["n_tables"] <= counted
        # Two tables are compatible with almost anything.
        assert high - low > 0.8
        assert coverage["is_compatible"]
    assert sum(found["verdicts"]["theta_c"].values()) == counted
    assert (tmp_path / "coverage.svg").read_text().startswith("<?xml")
    assert main([*words, "--plot", "coverage.svg"]) == 2
    assert "--force" in capsys.readouterr().err
