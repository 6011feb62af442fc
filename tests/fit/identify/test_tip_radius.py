"""Heights of round fingertips, by statics without the model, through the front door."""

import json
import math

import numpy as np
import pytest

from pushfit.cli import main
from pushfit.data.grasp import make_grasp
from pushfit.data.tables.peak_table import PeakTable, write_table
from pushfit.fit.identify.fit_table import fit_table
from pushfit.report.store.read import read_result
from pushfit.report.store.summary import summary_dict
from tests.fit.tables import config
from tests.mechanics.statics import Slab
from tests.problems import PUSH

SLAB = Slab(A=520.0, K=450.0, C_d=0.36, C_rr=0.5, L=0.04, radius=0.008)
THETA = np.radians(np.arange(10.0, 90.0, 5.0))
REPEATS, NOISE = 3, 0.02
TILTING = '[grasp]\nmechanics = "tilting"\n'
LENGTH = "[parameters.L]\nfixed = 0.04\n"
WITHIN_DEG = 1.0  # what is asked of tips of 8 mm
EXACT_DEG = 0.05  # heights without noise; what is known of s weighs a little


@pytest.fixture(scope="module")
def pushed() -> np.ndarray:
    """F_n and F_t of every push [N]."""
    return np.array([SLAB.pushed(theta, PUSH)[:2] for theta in THETA])


@pytest.fixture(scope="module")
def true_deg() -> float:
    return math.degrees(SLAB.critical_angle(PUSH))


def table_of(pushed, *, is_components: bool, noise: float, sd: float) -> PeakTable:
    normal, tangential = np.repeat(pushed, REPEATS, axis=0).T
    heights = {"height": np.hypot(normal, tangential)}
    if is_components:
        heights = {"height_normal": normal, "height_tangential": tangential}
    rng, theta = np.random.default_rng(8), np.repeat(THETA, REPEATS)
    return PeakTable.from_arrays(
        theta=theta,
        alpha=np.zeros_like(theta),
        heights={n: h + rng.normal(0.0, noise, h.size) for n, h in heights.items()},
        unit="n",
        sd={name: np.full(theta.size, sd) for name in heights},
    )


def test_the_radius_of_the_file_is_that_of_the_grasp():
    assert make_grasp(config(), "n").tip_radius is None
    stated = config("[grasp]\ntip_radius_mm = 8\n")
    assert make_grasp(stated, "n").tip_radius == 0.008


@pytest.mark.slow
@pytest.mark.parametrize(
    ("is_components", "least_bias_deg"), [(True, 1.0), (False, 3.0)]
)
def test_heights_without_noise_give_the_angle(
    pushed, true_deg, is_components, least_bias_deg
):
    """And by tips that are points another one."""
    table = table_of(pushed, is_components=is_components, noise=0.0, sd=1e-3)
    rolling = fit_table(table, config(TILTING + "tip_radius_mm = 8\n" + LENGTH))
    points = fit_table(table, config(TILTING + LENGTH))
    assert abs(rolling.fit.modes[0].theta_c_deg - true_deg) < EXACT_DEG
    assert abs(points.fit.modes[0].theta_c_deg - true_deg) > least_bias_deg


@pytest.mark.slow
def test_a_command_takes_the_radius_and_finds_the_angle(
    pushed, true_deg, tmp_path, capsys
):
    peaks, settings = tmp_path / "peaks.csv", tmp_path / "grasp.toml"
    write_table(table_of(pushed, is_components=True, noise=NOISE, sd=NOISE), peaks)
    settings.write_text(
        f"[push]\nlength_mm = 5\n{TILTING}tip_radius_mm = 8\n{LENGTH}", encoding="utf-8"
    )
    out = tmp_path / "result"
    words = ["fit", str(peaks), "--config", str(settings), "--out", str(out), "--json"]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    again = read_result(out)
    assert summary_dict(again) == said
    assert again.config.grasp.tip_radius_mm == 8
    low, high = again.theta_c.interval
    assert low < true_deg < high
    assert abs(again.theta_c.estimate - true_deg) < WITHIN_DEG
