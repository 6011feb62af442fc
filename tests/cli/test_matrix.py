"""Every mechanics, channel, engine, transition and noise through the front door."""

import itertools
import json

import numpy as np
import pytest

from pushfit.cli import main
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import write_table
from pushfit.model import Grasp
from pushfit.report.store.read import read_result
from pushfit.report.store.summary import summary_dict
from pushfit.report.text.result import render_text
from tests.problems import PUSH, paper_parameters

CHANNELS = {
    "height": ("height",),
    "components": ("height_normal", "height_tangential"),
    "all": ("height", "height_normal", "height_tangential"),
}
MECHANICS = ("linear", "tilting", "auto")
ENGINES = ("sweep", "emcee")
NOISES = {
    "as it is": "",
    "shared angles": 'theta_sd_deg = 1.0\nangle_errors = "shared"\n',
    "angles": "theta_sd_deg = 1.0\nalpha_sd_deg = 1.0\n",
    "estimated angles": 'theta_sd_deg = "estimate"\n',
    "student": 'likelihood = "student_t"\n',
    "proportional": 'height_share = "estimate"\n',
    "offset": 'repeats = "offset"\n',
    "gain": 'repeats = "gain"\n',
    "stated offset": "offset_sd = 0.02\n",
}
ROWS = [
    *itertools.product(MECHANICS, CHANNELS, ENGINES, ["hard"], ["as it is"]),
    *itertools.product(MECHANICS, ["height"], ENGINES, ["auto"], ["as it is"]),
    *itertools.product(["auto"], ["components"], ["sweep"], ["hard"], NOISES),
]
# L and K_dn are known: emcee then converges in seconds.
CONFIG = """\
[push]
length_mm = 5.0

[grasp]
mechanics = "{mechanics}"
preload_n = 1.0

[transition]
sharpness = "{transition}"

[parameters]
K_dn = {{ fixed = 600.0 }}
L = {{ fixed = 0.04 }}

[noise]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mechanics", "channels", "engine", "transition", "noise"), sorted(set(ROWS))
)
def test_what_a_command_writes_is_what_it_said(
    mechanics, channels, engine, transition, noise, tmp_path, capsys
):
    table = simulate_table(
        paper_parameters(),
        Grasp(push_length=PUSH, preload=1.0, mechanics="tilting"),
        theta=np.radians(np.arange(-30.0, 86.0, 10.0)),
        alpha=0.0,
        repeats=3,
        noise=0.01,
        rng=np.random.default_rng(5),
        channels=CHANNELS[channels],
        state_sd=True,
    )
    peaks, config = tmp_path / "peaks.csv", tmp_path / "grasp.toml"
    write_table(table, peaks)
    text = CONFIG.format(mechanics=mechanics, transition=transition)
    config.write_text(text + NOISES[noise], encoding="utf-8")
    words = ["fit", str(peaks), "--config", str(config), "--engine", engine]
    out = tmp_path / "result"
    code = main([*words, "--out", str(out), "--json"])
    said = json.loads(capsys.readouterr().out)
    assert code == 0, said["status_text"]
    again = read_result(out)
    assert summary_dict(again) == said
    assert json.loads((out / "summary.json").read_text(encoding="utf-8")) == said
    assert (out / "report.txt").read_text(encoding="utf-8") == render_text(again)
    assert said["posterior"]["engine"] == engine
    assert ("p" in said["parameters"]) == (transition == "auto")
    expected = {"linear", "tilting"} if mechanics == "auto" else {mechanics}
    assert {one["mechanics"] for one in said["by_mechanics"]} == expected
    page = tmp_path / "page.html"
    assert main(["report", str(out), "-o", str(page)]) == 0
    assert "θ_c" in page.read_text(encoding="utf-8")
