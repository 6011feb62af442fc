"""The notebooks run as plain scripts, and the examples beside them as printed."""

import os
import runpy
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pushfit import critical_angle, read_config
from pushfit.data.grasp import make_grasp
from pushfit.data.truth import stated_parameters

ROOT = Path(__file__).parents[2]
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.py"))
AXIS_DEG = 1.0  # α* of the tutorial has a standard deviation of 0.2°; five of them


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
    printed, result = capsys.readouterr().out, names["result"]
    if path.stem == "exploring":
        assert "θ_c decided to ± 3°" in printed
        low, high = result.theta_c.interval
        truth = read_config(ROOT / "examples" / "foam_box" / "truth.toml")
        angle = critical_angle(
            stated_parameters(truth), make_grasp(truth, "kpa"), np.pi / 2
        )
        assert low < np.degrees(angle) < high
    else:
        assert "critical angle" in printed
        assert result.alpha_star.estimate == pytest.approx(65.0, abs=AXIS_DEG)
        assert (workplace / "main.png").stat().st_size > 10_000


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.name)
def test_a_notebook_and_its_script_are_the_same(path):
    """`make notebooks` writes the one from the other."""
    jupytext = pytest.importorskip("jupytext")
    cells = [
        [(cell.cell_type, cell.source) for cell in jupytext.read(file).cells]
        for file in (path, path.with_suffix(".ipynb"))
    ]
    assert cells[0] == cells[1]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.name)
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_notebook_shows_its_pictures_and_its_card(path, workplace):
    """Executed as Jupyter does, without a screen."""
    nbclient = pytest.importorskip("nbclient")
    nbformat = pytest.importorskip("nbformat")
    notebook = nbformat.read(path.with_suffix(".ipynb"), as_version=4)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    client = nbclient.NotebookClient(notebook, timeout=600)
    client.execute(cwd=str(workplace), env=environment)
    shown = [
        output.get("data", {})
        for cell in notebook.cells
        if cell.cell_type == "code"
        for output in cell.outputs
    ]
    n_pictures = 2 if path.stem == "exploring" else 4
    assert sum("image/png" in data for data in shown) == n_pictures
    (card,) = [d["text/html"] for d in shown if "θ" in d.get("text/html", "")]
    assert "data:image/png;base64," in card


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
