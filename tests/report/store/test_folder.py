"""The result folder: complete or absent, nobody else's files touched."""

import errno
import json
import os
import threading
from pathlib import Path

import arviz_base
import numpy as np
import pytest
import xarray as xr

from pushfit.cli import main
from pushfit.data.tables.peak_table import read_table
from pushfit.errors import ConfigError
from pushfit.report.store import folder as folder_module
from pushfit.report.store.archive import posterior_tree
from pushfit.report.store.folder import write_result_folder
from pushfit.report.store.output_folder import CONTENT, EXPLORED
from pushfit.report.store.summary import summary_dict
from pushfit.report.text.result import render_text


def listing(path):
    """Every entry below a folder, hidden ones included."""
    return sorted(str(entry.relative_to(path)) for entry in path.rglob("*"))


@pytest.mark.slow
def test_a_format_that_is_asked_for_comes_on_top(theta_only, tmp_path):
    write_result_folder(theta_only, tmp_path / "out", force=False, pictures="png")
    names = {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    assert {"main.png", "main.svg", "traces.png"} <= names
    assert "traces.svg" not in names


@pytest.mark.slow
def test_a_result_holds_everything_that_the_design_names(theta_only, tmp_path):
    out = write_result_folder(theta_only, tmp_path / "result", force=False)
    assert {entry.name for entry in out.iterdir()} == CONTENT - set(EXPLORED)
    names = {path.name for path in (out / "figures").iterdir()}
    assert {"main.svg", "theta_c.svg", "corner_parameters.png", "traces.png"} <= names
    # Each figure once; a second format only for who asks.
    assert len({Path(name).stem for name in names}) == len(names)
    assert json.loads((out / "summary.json").read_text()) == summary_dict(theta_only)
    assert (out / "report.txt").read_text() == render_text(theta_only)
    assert "Content-Security-Policy" in (out / "report.html").read_text()
    table = read_table(out / "peaks.csv")
    np.testing.assert_array_equal(
        table.heights("height"), theta_only.table.heights("height")
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["result"]


@pytest.mark.usefixtures("undrawn")
def test_the_posterior_survives_the_file(determined, tmp_path):
    out = write_result_folder(determined, tmp_path / "result", force=False)
    with xr.open_datatree(out / "result.nc", engine="h5netcdf") as tree:
        for name, draws in determined.posterior.samples.items():
            stored = tree["posterior"][name].to_numpy()
            np.testing.assert_array_equal(stored, draws[np.newaxis])
        for name, draws in determined.posterior.prior_samples.items():
            np.testing.assert_array_equal(tree["prior"][name].to_numpy()[0], draws)
        np.testing.assert_array_equal(
            tree["sample_stats"]["lp"].to_numpy()[0], determined.posterior.log_prob
        )
        np.testing.assert_array_equal(
            tree["ensembles"]["chain"].to_numpy(), determined.posterior.chain
        )
        used = determined.table.heights("height")[determined.used]
        np.testing.assert_array_equal(tree["observed_data"]["height"].to_numpy(), used)
        assert tree["posterior"]["K_sn"].attrs["units"] == "N/m"
        assert tree["posterior"]["theta_c"].attrs["units"] == "deg"
        attrs = dict(tree.attrs)
    assert attrs["seed"] == determined.seed
    assert attrs["ci_prob"] == 0.9
    assert attrs["status"] == "ok"
    assert json.loads(attrs["sha256"]) == ["ab" * 32]
    assert json.loads(attrs["versions"])["jax"] == "0.10.2"
    assert json.loads(attrs["config"])["push"]["length_mm"] == 5.0


def test_the_posterior_is_in_the_form_that_arviz_reads(determined):
    draws = arviz_base.extract(posterior_tree(determined), var_names="C_rr")
    np.testing.assert_array_equal(draws, determined.posterior.samples["C_rr"])


@pytest.mark.usefixtures("undrawn")
def test_hostile_text_reaches_the_summary_as_it_is(hostile, tmp_path):
    out = write_result_folder(hostile, tmp_path / "result", force=False)
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))["notes"]
    assert found == list(hostile.table.notes)


@pytest.mark.usefixtures("undrawn")
def test_what_stands_there_is_not_overwritten(determined, tmp_path):
    out = tmp_path / "result"
    out.mkdir()
    with pytest.raises(ConfigError, match="force=True") as caught:
        write_result_folder(determined, out, force=False)
    assert caught.value.code == "output_exists"
    assert listing(tmp_path) == ["result"]


@pytest.mark.usefixtures("undrawn")
def test_force_replaces_a_result(determined, two_modes, tmp_path):
    out = write_result_folder(determined, tmp_path / "result", force=False)
    write_result_folder(two_modes, out, force=True)
    assert "40° or 56°" in (out / "report.txt").read_text()
    assert [entry.name for entry in tmp_path.iterdir()] == ["result"]


@pytest.mark.usefixtures("undrawn")
def test_force_removes_nothing_that_is_no_result(determined, tmp_path):
    out = tmp_path / "home"
    out.mkdir()
    (out / "thesis.tex").write_text("years of work")
    with pytest.raises(ConfigError, match=r"thesis\.tex"):
        write_result_folder(determined, out, force=True)
    assert listing(tmp_path) == ["home", "home/thesis.tex"]


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("is_there", [False, True])
def test_a_link_stays_and_the_result_is_where_it_leads(determined, tmp_path, is_there):
    place = tmp_path / "disk"
    (place / "run").mkdir(parents=True) if is_there else place.mkdir()
    out = tmp_path / "result"
    out.symlink_to("disk/run")
    if is_there:
        with pytest.raises(ConfigError, match="not overwritten"):
            write_result_folder(determined, out, force=False)
        assert listing(place) == ["run"]
    write_result_folder(determined, out, force=is_there)
    assert out.is_symlink()
    assert (place / "run" / "summary.json").is_file()
    assert [p.name for p in place.iterdir()] == ["run"]
    assert {p.name for p in tmp_path.iterdir()} == {"disk", "result"}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("force", [False, True])
def test_what_is_behind_a_link_is_protected_as_well(determined, tmp_path, force):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "thesis.tex").write_text("years of work")
    (tmp_path / "result").symlink_to("home")
    with pytest.raises(ConfigError, match="not"):
        write_result_folder(determined, tmp_path / "result", force=force)
    assert listing(tmp_path / "home") == ["thesis.tex"]
    (tmp_path / "lost").symlink_to("no/run")
    with pytest.raises(ConfigError, match="create it first"):
        write_result_folder(determined, tmp_path / "lost", force=force)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("force", [False, True])
def test_a_fifo_is_no_folder(determined, tmp_path, force):
    os.mkfifo(tmp_path / "result")
    with pytest.raises(ConfigError, match="another name"):
        write_result_folder(determined, tmp_path / "result", force=force)
    assert (tmp_path / "result").is_fifo()


@pytest.mark.usefixtures("undrawn")
def test_a_missing_parent_is_named(determined, tmp_path):
    with pytest.raises(ConfigError, match="create it first"):
        write_result_folder(determined, tmp_path / "no" / "result", force=False)


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("error", [OSError("disk full"), KeyboardInterrupt()])
def test_a_failure_leaves_the_old_result_whole_and_nothing_else(
    determined, two_modes, tmp_path, monkeypatch, error
):
    out = write_result_folder(determined, tmp_path / "result", force=False)
    before = {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()}

    def fail(_):
        raise error

    monkeypatch.setattr(folder_module, "render_text", fail)
    with pytest.raises(type(error)):
        write_result_folder(two_modes, out, force=True)
    after = {p.name: p.read_bytes() for p in out.iterdir() if p.is_file()}
    assert before == after
    assert [entry.name for entry in tmp_path.iterdir()] == ["result"]


@pytest.mark.usefixtures("undrawn")
def test_what_a_full_disk_refuses_is_named(determined, tmp_path, monkeypatch):
    def refuse(path: Path, content: str, **_: str) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_text", refuse)
    with pytest.raises(OSError, match="No space left") as raised:
        write_result_folder(determined, tmp_path / "result", force=False)
    assert raised.value.filename == str(tmp_path / "result")
    assert not os.listdir(tmp_path)


@pytest.mark.usefixtures("undrawn")
def test_the_posterior_is_written_by_what_a_full_disk_stops_with_an_error(
    determined, tmp_path, monkeypatch
):
    """HDF5 ends the process instead: the library may not write the file itself."""
    written = []
    write = Path.write_bytes

    def note(path: Path, content: bytes) -> int:
        written.append(path.name)
        return write(path, content)

    monkeypatch.setattr(Path, "write_bytes", note)
    out = write_result_folder(determined, tmp_path / "result", force=False)
    assert "result.nc" in written
    assert xr.open_datatree(out / "result.nc").groups


@pytest.mark.usefixtures("undrawn")
def test_a_failed_exchange_puts_the_old_result_back(
    determined, two_modes, tmp_path, monkeypatch
):
    out = write_result_folder(determined, tmp_path / "result", force=False)
    rename = os.rename

    def fail_for_fresh(source, target):
        if str(source).endswith(".partial"):
            raise OSError("no")
        rename(source, target)

    monkeypatch.setattr(folder_module.os, "rename", fail_for_fresh)
    with pytest.raises(OSError, match="no"):
        write_result_folder(two_modes, out, force=True)
    assert "40.1°" in (out / "report.txt").read_text()
    assert [entry.name for entry in tmp_path.iterdir()] == ["result"]


@pytest.mark.usefixtures("undrawn")
def test_a_result_is_on_disk_before_it_has_its_name(determined, tmp_path, monkeypatch):
    events = []
    fsync, rename = os.fsync, os.rename

    def note_sync(descriptor):
        events.append("fsync")
        fsync(descriptor)

    def note_rename(source, target):
        events.append("rename")
        rename(source, target)

    monkeypatch.setattr(folder_module.os, "fsync", note_sync)
    monkeypatch.setattr(folder_module.os, "rename", note_rename)
    write_result_folder(determined, tmp_path / "result", force=False)
    # Six entries and the folder before, the parent after.
    assert events.index("rename") >= len(CONTENT - set(EXPLORED)) + 1
    assert events[-1] == "fsync"


@pytest.mark.usefixtures("undrawn")
def test_others_may_read_a_result_as_they_may_read_any_new_folder(determined, tmp_path):
    ordinary = tmp_path / "ordinary"
    ordinary.mkdir()
    out = write_result_folder(determined, tmp_path / "result", force=False)
    assert out.stat().st_mode == ordinary.stat().st_mode


@pytest.mark.usefixtures("undrawn")
def test_the_page_of_a_result_goes_into_a_fifo(determined, tmp_path):
    write_result_folder(determined, tmp_path / "result", force=False)
    fifo, received = tmp_path / "page", []
    os.mkfifo(fifo)
    reader = threading.Thread(target=lambda: received.append(fifo.read_bytes()))
    reader.start()
    assert main(["report", str(tmp_path / "result"), "-o", str(fifo)]) == 0
    reader.join(5)
    assert received[0].startswith(b"<!DOCTYPE html>")
    assert fifo.is_fifo()
