"""The example that comes with pushfit: reproducible, and like the paper's figures."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pushfit.config import read_config
from pushfit.data.grasp import make_grasp
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import read_schedule
from pushfit.data.recordings.recording import read_recording
from pushfit.data.simulate import ALPHA_SWEEP
from pushfit.data.truth import simulate_from_config, stated_parameters
from pushfit.errors import ConfigError, DataError
from pushfit.model import Pushes, forward

FOLDER = Path(__file__).parents[2] / "examples" / "foam_box"
# Pressures are rounded to 0.01 kPa; another platform may round a last digit otherwise.
LAST_DIGIT = 0.011


@pytest.fixture(scope="module")
def script():
    """The module that made the recordings."""
    spec = importlib.util.spec_from_file_location(
        "make_recordings", FOLDER / "make_recordings.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def heights(schedule) -> np.ndarray:
    """Noise-free heights of a schedule under the truth of the example."""
    config = read_config(FOLDER / "truth.toml")
    pushes = Pushes(theta=schedule.theta, alpha=schedule.alpha)
    grasp = make_grasp(config, "kpa")
    return np.asarray(forward(stated_parameters(config), pushes, grasp).height)


@pytest.mark.slow
def test_the_committed_recordings_come_from_the_script(script, tmp_path):
    script.main(tmp_path)
    for name in ("theta_sweep", "alpha_sweep", "theta_schedule", "alpha_schedule"):
        committed = pd.read_csv(FOLDER / f"{name}.csv")
        made = pd.read_csv(tmp_path / f"{name}.csv")
        np.testing.assert_allclose(made, committed, rtol=0, atol=LAST_DIGIT)


def test_heights_are_nearly_linear_in_theta(script):
    """Figure 10: one line for each azimuth, from negative to positive heights."""
    sweep = script.THETA_SWEEP
    measured = heights(sweep)
    for alpha in np.unique(sweep.alpha):
        line = measured[sweep.alpha == alpha], sweep.theta[sweep.alpha == alpha]
        assert np.corrcoef(*line)[0, 1] > 0.98
        assert line[0].min() < 0 < line[0].max()


def test_heights_over_alpha_have_a_valley_near_65_degrees():
    """Figure 8: the lowest of the six directions are the two around 65°."""
    by_alpha = heights(ALPHA_SWEEP).reshape(-1, 3).mean(axis=1)
    assert set(np.argsort(by_alpha)[:2]) == {2, 3}  # 60° and 90°
    assert by_alpha[2] < by_alpha[3]
    assert by_alpha[[0, -1]].min() > 1.2 * by_alpha.min()


def test_a_simulation_needs_every_parameter():
    with pytest.raises(
        ConfigError, match=r"nothing about .*; a simulation needs every"
    ):
        stated_parameters(read_config(FOLDER / "grasp.toml"))


def test_a_simulation_needs_a_preload(tmp_path):
    text = (FOLDER / "truth.toml").read_text(encoding="utf-8")
    path = tmp_path / "grasp.toml"
    path.write_text(text.replace("preload_kpa = 12.0", 'preload_kpa = "estimate"'))
    with pytest.raises(ConfigError, match="needs a number for"):
        simulate_from_config(
            ALPHA_SWEEP, read_config(path), unit="kpa", noise=0.0, seed=0
        )


def test_the_seed_decides_the_noise():
    config = read_config(FOLDER / "truth.toml")
    one, same, other = (
        simulate_from_config(ALPHA_SWEEP, config, unit="kpa", noise=0.1, seed=seed)
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.channels["pressure"], same.channels["pressure"])
    assert not np.array_equal(one.channels["pressure"], other.channels["pressure"])


def test_a_schedule_of_the_other_sweep_is_refused():
    recording = read_recording(FOLDER / "theta_sweep.csv")
    with pytest.raises(DataError, match="that of another recording") as caught:
        extract_peaks(recording, read_schedule(FOLDER / "alpha_schedule.csv"))
    assert caught.value.code == "push_mismatch"
