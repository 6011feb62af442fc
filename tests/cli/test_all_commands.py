"""Every command that fits, once, on one problem that takes seconds.

Two parameters are free, so that all commands run through the same small programs. What
a command says of its truth is looked at; figures are drawn by the tests of the figures.
"""

import csv
import json

import numpy as np
import pytest

from pushfit.cli import main
from pushfit.fit import comparison
from pushfit.report.store.read import read_result
from pushfit.report.store.summary import summary_dict
from pushfit.report.text.result import render_text
from tests.fit.tables import HARD, TOML
from tests.problems import CASES
from tests.report.makers import leave_out_figures

CASE = CASES["paper"]
KNOWN = {"K_dn": 600.0, "K_st": 300.0, "C_d": 0.24, "L": 0.04}
ALL = KNOWN | {"K_sn": 1200.0, "C_rr": 0.25}
# Of tilting mechanics there is more in `test_matrix.py`.
LINEAR = '[grasp]\nmechanics = "linear"\n'
NOISE = "0.02"
# Standard deviations from a truth that no seed here leaves.
FAR = 4.0
# Standard deviation over a truth: a quarter of that of the priors, 0.8 of a log.
LEARNED = 0.2
# Ends of intervals scatter by 0.03 of their width where 500 draws of emcee count.
ENGINES = 0.1
# Medians of two seeds are 0.07° apart, by 3000 draws that count; five of them.
OTHER_SEED = 0.35


def stated(values: dict[str, float]) -> str:
    return "".join(f"[parameters.{n}]\nfixed = {v}\n" for n, v in values.items())


@pytest.fixture(scope="module")
def identified(tmp_path_factory):
    """A recording that a command simulated, and its result, which another one wrote."""
    place = tmp_path_factory.mktemp("commands")
    (place / "truth.toml").write_text(TOML + HARD + LINEAR + stated(ALL))
    (place / "grasp.toml").write_text(TOML + HARD + LINEAR + stated(KNOWN))
    rows = [f"{i + 1},{10 * (i % 8 + 1)},90,{i // 8 + 1}" for i in range(24)]
    plan = "\n".join(["push,theta_deg,alpha_deg,repeat", *rows])
    (place / "plan.csv").write_text(plan)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(place)
        leave_out_figures(patch)
        words = ["simulate", "plan.csv", "-c", "truth.toml", "--unit", "n"]
        assert main([*words, "--noise", NOISE, "-o", "run.csv"]) == 0
        words = ["identify", "run.csv", "-s", "plan.csv", "-c", "grasp.toml"]
        assert main([*words, "--engine", "sweep", "--out", "result"]) == 0
    return place


@pytest.fixture
def place(identified, monkeypatch):
    monkeypatch.chdir(identified)
    leave_out_figures(monkeypatch)
    return identified


def said(capsys, *words):
    """What a command prints for programs."""
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def assert_near_the_truth(summary):
    """The angle and both free parameters, in units of a quarter of their intervals."""
    truths = {"K_sn": ALL["K_sn"], "C_rr": ALL["C_rr"]}
    found = {n: summary["parameters"][n]["interval"] for n in truths}
    found["theta_c"] = summary["theta_c_deg"]["interval"]
    truths["theta_c"] = CASE.critical_angle_deg
    for name, (low, high) in found.items():
        sd = (high - low) / (2 * 1.645)
        assert abs((low + high) / 2 - truths[name]) < FAR * sd, name
        assert sd < LEARNED * truths[name], name


def test_identify_writes_the_truth_and_report_reads_it(place):
    found = read_result(place / "result")
    summary = json.loads((place / "result" / "summary.json").read_text("utf-8"))
    assert summary == summary_dict(found)
    assert (place / "result" / "report.txt").read_text("utf-8") == render_text(found)
    assert_near_the_truth(summary)
    assert main(["report", "result", "-o", "page.html"]) == 0
    assert 'class="answers"' in (place / "page.html").read_text("utf-8")


def test_fit_and_sample_say_of_its_table_what_identify_said(place, capsys):
    """The sweep to the last digit, emcee as far as draws scatter."""
    first = json.loads((place / "result" / "summary.json").read_text("utf-8"))
    words = ["result/peaks.csv", "-c", "grasp.toml"]
    again = said(capsys, "fit", *words, "--engine", "sweep")
    assert again["theta_c_deg"] == first["theta_c_deg"]
    other = said(capsys, "sample", *words, "--engine", "emcee")
    assert other["posterior"]["engine"] == "emcee"
    assert_near_the_truth(other)
    low, high = first["theta_c_deg"]["interval"]
    shift = np.subtract(other["theta_c_deg"]["interval"], (low, high))
    assert np.max(np.abs(shift)) < ENGINES * (high - low)


def test_a_batch_has_the_row_of_its_table(place):
    first = json.loads((place / "result" / "summary.json").read_text("utf-8"))
    words = ["batch", "result/peaks.csv", "-c", "grasp.toml", "--out", "rows"]
    assert main(words) == 0
    with (place / "rows" / "results.csv").open(encoding="utf-8") as lines:
        (row,) = csv.DictReader(lines)
    assert float(row["theta_c_deg"]) == pytest.approx(
        first["theta_c_deg"]["estimate"], abs=OTHER_SEED
    )


def test_compare_finds_that_the_object_rolls(place, capsys, monkeypatch):
    """Of the rivals two, as each takes seconds; of all there are slow tests."""
    rivals = comparison.rival_configs

    def two_of(config, **words):
        return {n: rivals(config, **words)[n] for n in ("hard", "no_rolling")}

    monkeypatch.setattr(comparison, "rival_configs", two_of)
    found = said(capsys, "compare", "result/peaks.csv", "-c", "grasp.toml")
    factors = {n: m["log_bayes_factor"] for n, m in found["models"].items()}
    assert factors["no_rolling"] < -10 < factors["hard"]


def test_next_ranks_pushes_after_the_table(place, capsys):
    words = ["next", "result/peaks.csv", "-c", "grasp.toml", "-n", "3"]
    assert main([*words, "--plot", "next.png", "--json"]) == 0
    shown = capsys.readouterr()
    found = json.loads(shown.out)
    assert found["schema"] == "pushfit.next/1"
    assert found["n_pushes"] == 24
    assert len(found["suggestions"]) == 3
    assert [one["code"] for one in found["warnings"]] == ["preload_unknown"]
    said = [line.split(":")[0] for line in shown.err.splitlines()]
    stages = [word for word in said if word != "warning"]
    assert stages[-4:] == [
        *("posterior by linear mechanics", "next push", "picture"),
        "wrote next.png",
    ]
