"""summary.json: valid by its schema, safe as JSON, silent about what is unknown."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from pushfit.fit.results import Mode
from pushfit.report.answers import alpha_star_answer, theta_c_answer
from pushfit.report.json_values import from_json, json_safe
from pushfit.report.store.summary import summary_dict
from pushfit.report.store.summary_schema import summary_schema

# What readers of results rely on. Where it changes and is meant to, it is written anew:
# what `python -m pushfit.report.store.summary_schema` prints.
COMMITTED = Path(__file__).with_name("summary.schema.json")


def test_the_schema_itself_is_valid():
    jsonschema.Draft202012Validator.check_schema(summary_schema())


def test_the_schema_of_the_records_is_the_committed_one():
    assert summary_schema() == json.loads(COMMITTED.read_text("utf-8"))


def test_every_kind_of_result_follows_the_schema(any_identification):
    jsonschema.validate(summary_dict(any_identification), summary_schema())


def test_a_summary_is_strict_json_and_survives_it(any_identification):
    summary = summary_dict(any_identification)
    text = json.dumps(summary, allow_nan=False)
    text.encode("utf-8")
    assert json.loads(text) == summary


def test_the_contract_of_the_main_command_holds(two_modes):
    summary = summary_dict(two_modes)
    assert summary["status"] == "ok"
    assert summary["n_pushes"] == 69
    assert summary["theta_c_deg"]["verdict"] == "several_modes"
    assert summary["theta_c_deg"]["sets"] == [[38.4, 41.6], [54.4, 57.6]]
    assert summary["theta_c_deg"]["estimate"] is None
    assert summary["alpha_star_deg"]["estimate"] == 65.0
    assert summary["alpha_star_deg"]["interval"] == [63.0, 67.0]
    assert summary["parameters"]["C_rr"]["contraction"] == 0.97
    assert summary["combinations"]["A"]["unit"] == "N/m"
    assert summary["inputs"][0]["sha256"] == "ab" * 32
    assert summary["warnings"][0]["code"] == "pushes_left_out"
    assert summary["config"]["push"]["length_mm"] == 5.0
    assert summary["seed"] == 11


def test_the_sentences_are_those_of_the_text(any_identification):
    sentences = summary_dict(any_identification)["sentences"]
    assert sentences == json_safe(
        {
            "theta_c": theta_c_answer(any_identification).sentence,
            "alpha_star": alpha_star_answer(any_identification).sentence,
        }
    )


def test_an_open_end_is_null(one_sided):
    theta_c = summary_dict(one_sided)["theta_c_deg"]
    assert theta_c["sets"] == [[61.2, None]]
    assert theta_c["interval"] is None
    assert theta_c["estimate"] is None


def test_an_unconverged_posterior_gives_no_interval(not_converged):
    summary = summary_dict(not_converged)
    assert summary["status"] == "not_converged"
    quantities = [
        summary["theta_c_deg"],
        summary["alpha_star_deg"],
        *summary["parameters"].values(),
        *summary["combinations"].values(),
    ]
    for quantity in quantities:
        assert quantity["interval"] is None
        assert quantity["sets"] == []
        assert quantity["estimate"] is None or quantity["verdict"] == "fixed"


def test_stiffness_is_null_where_the_push_length_is_unknown(unknown_length):
    summary = summary_dict(unknown_length)
    for name in ("K_sn", "K_dn", "K_st", "C_d"):
        assert summary["parameters"][name]["estimate"] is None
    assert summary["combinations"]["A"]["likelihood_sets"] == []
    assert all(mode["coordinates"] == {} for mode in summary["fit"]["modes"])


@pytest.mark.parametrize("value", [np.nan, np.inf, np.float64("nan"), None])
def test_what_is_not_a_number_is_null(value):
    assert json_safe({"x": [value]}) == {"x": [None]}


def test_null_is_read_as_nan_only_where_a_number_is_declared():
    entry = {"coordinates": {"A": None}, "theta_c_deg": None, "chi_square": None}
    mode = from_json(Mode, entry)
    assert np.isnan(mode.coordinates["A"])
    assert np.isnan(mode.chi_square)
    assert mode.theta_c_deg is None


def test_numpy_becomes_plain_python():
    safe = json_safe({"a": np.arange(2), "b": np.bool_(True), "c": np.float32(0.5)})
    assert safe == {"a": [0, 1], "b": True, "c": 0.5}
    assert type(safe["b"]) is bool


def test_a_file_name_that_is_not_utf8_can_be_written():
    assert json_safe("caf\udce9.csv") == "caf\\udce9.csv"
