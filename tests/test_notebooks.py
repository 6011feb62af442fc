"""The notebooks run as plain scripts, and the examples beside them as printed."""

import runpy
import shutil
from pathlib import Path

import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.py"))


@pytest.fixture
def workplace(tmp_path, monkeypatch):
    """A folder with the examples, to write in."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_is_a_percent_script(path):
    text = path.read_text("utf-8")
    assert "format_name: percent" in text
    assert text.count("\n# %%") > 5


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_runs_from_top_to_bottom(path, workplace, capsys):
    names = runpy.run_path(str(path))
    assert "critical angle" in capsys.readouterr().out
    assert names["result"].alpha_star.estimate == pytest.approx(65.0, abs=3.0)
    assert (workplace / "main.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_logs_come_from_their_script(tmp_path):
    folder = ROOT / "examples" / "logs"
    runpy.run_path(str(folder / "make_logs.py"))["main"](tmp_path)
    made = sorted(tmp_path.glob("*.csv"))
    assert len(made) == 4
    for path in made:
        committed = pd.read_csv(folder / path.name)
        # Forces are rounded to 1 mN; another platform may round a last digit otherwise.
        pd.testing.assert_frame_equal(pd.read_csv(path), committed, rtol=0, atol=1.1e-3)


@pytest.mark.slow
def test_the_comparison_prints_a_line_for_each_program(capsys, monkeypatch):
    pytest.importorskip("lmfit", reason="lmfit comes with the extra `bench`")
    monkeypatch.setattr("sys.argv", ["comparison.py", "--seed", "3"])
    runpy.run_path(str(ROOT / "examples" / "comparison.py"), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert [line[:9] for line in lines] == [
        "truth    ",
        "curve_fit",
        "lmfit    ",
        "curve_fit",
        "pyPESTO o",
        "pushfit  ",
    ]
    assert "90 % interval" in lines[-1]
