"""What results will lack is said before the work."""

import shutil
from pathlib import Path

import pytest

from pushfit.cli import main
from tests.cli.test_app import EXAMPLE


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["fit", "bare.csv", "--out", "o"], "report.html and corner plots"),
        (["identify", "bare.csv", "--out", "o"], "report.html and corner plots"),
        (["batch", "bare.csv", "--out", "o"], "report.html"),
        (["fit", "bare.csv"], None),
    ],
)
def test_what_a_missing_library_leaves_out_is_said_before_the_work(
    words, parts, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(
        "pushfit.report.store.output_folder.find_spec", lambda name: None
    )
    monkeypatch.chdir(tmp_path)
    Path("bare.csv").write_text("1,2\n")
    assert main(words) in (3, 5)
    first, *_ = capsys.readouterr().err.splitlines()
    assert first.startswith(f"warning: {parts} will be left out" if parts else "error")
    assert ("pip install '.[report]'" in first) is (parts is not None)


@pytest.mark.parametrize(("is_terminal", "code"), [(True, 2), (False, 3)])
def test_a_page_is_refused_on_a_terminal_alone(
    is_terminal, code, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("sys.stdout.isatty", lambda: is_terminal)
    assert main(["report", str(tmp_path)]) == code
    said = capsys.readouterr().err
    assert ("name a file by --out" in said) is is_terminal
    assert ("not a result" in said) is not is_terminal


def test_a_page_that_nothing_can_fill_in_is_refused_before_a_result_is_read(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr("pushfit.report.html.pages.find_spec", lambda name: None)
    assert main(["report", str(tmp_path)]) != 0
    assert "pip install '.[report]'" in capsys.readouterr().err


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize(
    ("name", "said"), [("folder", "is a folder; name a file"), ("-", "is no name")]
)
def test_what_no_file_can_be_called_is_refused_as_one(
    name, said, force, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    Path("samples.csv").write_text("time_s,force_n\n0,1\n0.01,2\n")
    assert main(["peaks", "samples.csv", "-o", name, *force]) == 2
    assert said in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "samples.csv"]


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize(
    "words",
    [
        ["peaks", "samples.csv", "-o", "o.png", "--plot", "o.png"],
        ["peaks", "samples.csv", "-o", "here/../o.png", "--plot", "o.png"],
        ["peaks", "samples.csv", "-o", "link.png", "--plot", "here/o.png"],
        ["fit", "samples.csv", "--out", "o", "--checkpoint", "o"],
        ["look", "samples.csv", "--out", "o", "--export", "o"],
    ],
)
def test_no_output_takes_the_place_of_another(
    words, force, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    Path("here").mkdir()
    Path("link.png").symlink_to("here/o.png")
    shutil.copy(EXAMPLE / "theta_sweep.csv", "samples.csv")
    there = sorted(tmp_path.rglob("*"))
    assert main([*words, *force]) == 2
    assert "one would replace the other" in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == there


@pytest.mark.parametrize("force", [[], ["--force"]])
@pytest.mark.parametrize("checkpoint", ["o/chain", "o/deep/chain", "link/chain"])
def test_what_is_kept_beside_a_result_is_not_in_its_folder(
    checkpoint, force, tmp_path, monkeypatch, capsys
):
    """A result, once computed, would not have replaced the folder."""
    monkeypatch.chdir(tmp_path)
    Path("link").symlink_to("o")
    Path("o").mkdir()
    Path("peaks.csv").write_text("theta_deg,height_n\n10,1\n")
    words = ["fit", "peaks.csv", "--out", "o", "--checkpoint", checkpoint]
    assert main([*words, *force]) == 2
    said = capsys.readouterr().err
    assert f"error: {checkpoint}: lies in o, which is replaced as a whole" in said
    assert not list(Path("o").iterdir())


# Takes a file from nobody, not even from root.
CLOSED = Path("/proc")


@pytest.mark.skipif(not CLOSED.is_dir(), reason="there is no such folder here")
@pytest.mark.parametrize(
    "words",
    [
        ["init", "{}"],
        ["fit", "bare.csv", "--out", "{}"],
        ["identify", "bare.csv", "--out", "{}"],
        ["demo", "--out", "{}"],
        ["peaks", "bare.csv", "--out", "{}"],
        ["peaks", "bare.csv", "--plot", "{}.png"],
        ["look", "bare.csv", "--export", "{}"],
        ["simulate", "bare.csv", "--out", "{}"],
        ["report", ".", "--out", "{}"],
        ["diff", ".", ".", "--plot", "{}.png"],
        ["coverage", "bare.csv", "--plot", "{}.png"],
        ["next", "bare.csv", "--plot", "{}.png"],
        ["explore", "--hand", "simulated", "--out", "{}"],
    ],
    ids=lambda words: f"{words[0]} {words[-2]}",
)
def test_a_folder_that_takes_no_file_is_named_before_anything_is_read(
    words, tmp_path, monkeypatch, capsys
):
    """What is read is no input of any command, which would end in 3."""
    monkeypatch.chdir(tmp_path)
    Path("bare.csv").write_text("1,2\n")
    assert main([word.format(CLOSED / "new") for word in words]) == 2
    said = capsys.readouterr().err
    assert f"error: {CLOSED / 'new'}" in said
    assert f"the folder {CLOSED} takes no file" in said
