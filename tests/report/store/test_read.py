"""A result folder read back says what was written, or why it cannot."""

import base64
import json
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pandas as pd
import pytest

from pushfit.cli import main
from pushfit.data.tables.traces import ComponentTrace, SignedHeights
from pushfit.errors import DataError
from pushfit.report.html.result import render_html
from pushfit.report.store import folder as folder_module
from pushfit.report.store.archive import SIGNED_COLUMNS
from pushfit.report.store.folder import write_result_folder
from pushfit.report.store.read import read_result
from pushfit.report.store.summary import summary_dict
from pushfit.report.text.result import render_text
from tests.report.makers import make_answer


def assert_reads_back(identification, folder):
    out = write_result_folder(identification, folder, force=False)
    again = read_result(out)
    assert render_text(again) == render_text(identification)
    assert summary_dict(again) == summary_dict(identification)


@pytest.mark.usefixtures("undrawn")
def test_both_mechanics_are_read_as_they_were_written(make_identification, tmp_path):
    linear = make_answer("linear", best=None, width=None, log_evidence=None)
    both = (make_answer("tilting"), linear)
    identification = make_identification(by_mechanics=both)
    assert_reads_back(identification, tmp_path / "both")
    assert read_result(tmp_path / "both").by_mechanics == both


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("kind", ["determined", "two_modes", "hostile"])
def test_text_and_summary_of_what_is_read_are_those_of_what_was_written(
    kind, request, tmp_path
):
    assert_reads_back(request.getfixturevalue(kind), tmp_path / "result")


def differences(ours, theirs, at="result"):
    """Where two records differ, to the last bit; NaN is NaN."""
    if is_dataclass(ours):
        if type(ours) is not type(theirs):
            return [f"{at}: {type(ours).__name__}, {type(theirs).__name__}"]
        names = [field.name for field in fields(ours)]
        pairs = [(n, getattr(ours, n), getattr(theirs, n)) for n in names]
    elif isinstance(ours, Mapping):
        if set(ours) != set(theirs):
            return [f"{at}: {set(ours) ^ set(theirs)}"]
        pairs = [(name, ours[name], theirs[name]) for name in ours]
    elif isinstance(ours, tuple):
        if not isinstance(theirs, tuple) or len(ours) != len(theirs):
            return [f"{at}: {ours}, {theirs}"]
        pairs = [(i, *pair) for i, pair in enumerate(zip(ours, theirs, strict=True))]
    else:
        return [] if _is_same(ours, theirs) else [f"{at}: {ours}, {theirs}"]
    return [d for name, a, b in pairs for d in differences(a, b, f"{at}.{name}")]


def _is_same(ours, theirs) -> bool:
    if isinstance(ours, pd.DataFrame):
        pd.testing.assert_frame_equal(ours, theirs, check_exact=True, check_like=True)
        return True
    if isinstance(ours, float | np.ndarray) and theirs is not None:
        return np.array_equal(
            ours, theirs, equal_nan=np.asarray(ours).dtype.kind == "f"
        )
    return bool(ours == theirs)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    "kind",
    "determined one_sided not_determined two_modes prior_dominated inadequate "
    "not_converged unknown_length".split(),
)
def test_what_is_read_is_what_was_made(kind, request, tmp_path):
    """No number is in a fresh result that is not in the same result read back."""
    made = request.getfixturevalue(kind)
    folder = write_result_folder(made, tmp_path / "result", force=False)
    assert differences(made, read_result(folder)) == []


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_every_kind_of_result_reads_back(any_identification, tmp_path):
    assert_reads_back(any_identification, tmp_path / "result")


@pytest.mark.slow
def test_the_page_made_later_is_the_page_of_the_folder(determined, tmp_path):
    out = write_result_folder(determined, tmp_path / "result", force=False)
    assert render_html(read_result(out)) == (out / "report.html").read_text("utf-8")


def test_the_page_of_what_is_read_is_that_of_what_was_written(result, determined):
    assert render_html(read_result(result)) == render_html(determined)


def test_arrays_come_back_to_the_last_bit(result, determined):
    again = read_result(result)
    for name in ("estimate", "covariance", "jacobian", "sigma", "predicted"):
        stored = getattr(again.fit, name)
        np.testing.assert_array_equal(stored, getattr(determined.fit, name))
    assert again.fit.row == determined.fit.row
    np.testing.assert_array_equal(again.posterior.chain, determined.posterior.chain)
    for before, after in zip(determined.bands, again.bands, strict=True):
        np.testing.assert_array_equal(before.upper, after.upper)
        assert (before.swept, before.rows) == (after.swept, after.rows)
    (before,), (after,) = determined.table.traces, again.table.traces
    np.testing.assert_array_equal(before.signal, after.signal)
    assert before.sign == after.sign
    profile = again.profiles["theta_c"]
    assert profile.pieces == determined.profiles["theta_c"].pieces
    assert np.isinf(profile.degrees_of_freedom)


@pytest.mark.usefixtures("undrawn")
def test_force_components_come_back_with_the_traces_that_have_them(
    determined, tmp_path
):
    table = determined.table
    (trace,) = table.traces
    rng = np.random.default_rng(0)
    components = tuple(
        ComponentTrace(
            name=name,
            time=np.sort(rng.normal(size=n)),
            signal=np.append(rng.normal(size=n - 1), np.nan),
            is_jerk=rng.random(n) < 0.5,
            heights=SignedHeights(
                **{field: rng.normal(size=table.n_pushes) for field in SIGNED_COLUMNS}
            ),
        )
        for name, n in (("fx", 7), ("wrench/force.z", 9))
    )
    traces = (trace, replace(trace, components=components))
    forces = replace(determined, table=replace(table, traces=traces))
    write_result_folder(forces, tmp_path / "result", force=False)
    one, other = read_result(tmp_path / "result").table.traces
    assert one.components == ()
    for after, before in zip(other.components, components, strict=True):
        assert after.name == before.name
        for name in ("time", "signal", "is_jerk"):
            np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
        for name in SIGNED_COLUMNS:
            np.testing.assert_array_equal(
                getattr(after.heights, name), getattr(before.heights, name)
            )


def test_the_command_writes_the_page_and_never_over_another(
    result, determined, tmp_path, capsys
):
    page = tmp_path / "report.html"
    assert main(["report", str(result), "-o", str(page)]) == 0
    assert page.read_text("utf-8") == render_html(determined)
    page.write_text("mine")
    assert main(["report", str(result), "-o", str(page)]) == 2
    assert page.read_text() == "mine"
    assert "--force" in capsys.readouterr().err
    assert main(["report", str(result), "-o", str(page), "--force"]) == 0
    assert page.read_text("utf-8").startswith("<!DOCTYPE html>")


def test_the_page_of_an_explored_grasp_is_made_again_with_its_picture(
    determined, undrawn, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(folder_module, "render_html", render_html)
    picture, journal = b"\x89PNG drawn while exploring", b"{}"
    extra = {"exploration.png": picture, "journal.jsonl": journal}
    out = write_result_folder(determined, tmp_path / "out", force=False, extra=extra)
    page = (out / "report.html").read_text("utf-8")
    assert base64.b64encode(picture).decode() in page
    assert main(["report", str(out)]) == 0
    assert capsys.readouterr().out == page


def test_the_folder_of_a_batch_is_known_as_one(tmp_path, capsys):
    (tmp_path / "batch.sqlite").touch()
    assert main(["report", str(tmp_path)]) == 3
    said = capsys.readouterr().err
    assert "is the folder of a batch, and its page is report.html" in said
    assert "items/" in said


def test_a_folder_that_is_no_result_exits_as_rejected_input(tmp_path, capsys):
    page = tmp_path / "report.html"
    assert main(["report", str(tmp_path), "-o", str(page)]) == 3
    message = capsys.readouterr().err
    assert "not a result" in message
    assert "name the folder of a result" in message
    assert not page.exists()


def test_a_result_of_another_schema_is_named(result):
    path = result / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"schema": "x/9"}))
    with pytest.raises(DataError, match=r"'x/9'.*use the version") as caught:
        read_result(result)
    assert caught.value.exit_code == 3


@pytest.mark.parametrize("name", ["peaks.csv", "result.nc", "summary.json"])
@pytest.mark.parametrize("share", [0.0, 0.4, 0.9])
def test_a_file_that_was_cut_is_refused(name, share, result):
    path = result / name
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    if name == "peaks.csv" and share == 0.9:
        # Rows that are whole but too few no longer go with the fit.
        path.write_bytes(b"\n".join(content.split(b"\n")[:-9]) + b"\n")
    with pytest.raises(DataError, match="not a") as caught:
        read_result(result)
    assert caught.value.code in {"not_a_result", "result_not_whole"}


@pytest.mark.parametrize("key", ["fit", "theta_c_deg", "posterior"])
@pytest.mark.parametrize("value", [None, 3, []])
def test_a_summary_that_lacks_a_part_is_refused(key, value, result):
    path = result / "summary.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(DataError, match="not a whole result"):
        read_result(result)


@pytest.mark.parametrize("name", ["peaks.csv", "result.nc"])
def test_a_part_that_is_missing_is_named(name, result):
    (result / name).unlink()
    with pytest.raises(DataError, match=f"{name} is missing") as caught:
        read_result(result)
    assert caught.value.code == "result_not_whole"


def test_a_summary_that_was_edited_is_refused_by_the_key_and_no_address(result):
    path = result / "summary.json"
    summary = json.loads(path.read_text())
    summary["theta_c_deg"]["estimate"] = "abc"
    path.write_text(json.dumps(summary))
    with pytest.raises(DataError, match=r"theta_c_deg\.estimate") as caught:
        read_result(result)
    assert "http" not in str(caught.value)
    assert "\n" not in str(caught.value)
