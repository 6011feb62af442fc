"""What `peaks` reads from recordings with known pushes, and what it says of them.

Excluded: what is written where (`tests.cli.test_output`).
"""

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pushfit.cli.app import main

PERIOD, HALF_WIDTH, NOISE = 2.5, 0.5, 0.02
# Heights of six directions [N], and which of these is pushed when [s].
HEIGHTS = np.array([1.0, 1.2, 1.4, 1.6, 1.8, 2.0])
MADE = np.array([3, 2, 0, 5, 4, 1])
STARTS = 1.75 + PERIOD * np.argsort(MADE)
PLAN = pd.DataFrame(
    {
        "push": 1 + np.arange(6),
        "theta_deg": np.arange(10.0, 70.0, 10.0),
        "alpha_deg": 90.0,
        "time_s": STARTS,
    }
)
# Six pulls and their scatter exceed it once in 10^4 seeds.
MAX_Z = 4.5


def recorded(folder: Path, lost: int | None = None, **more: np.ndarray) -> str:
    """Write a recording of the six pushes, of which one may not be made.

    Args:
        more: Further columns, by the pushes in the order in which they are made.
    """
    time = np.arange(0.0, 17.0, 0.02)
    force = 1.0 + NOISE * np.random.default_rng(1).standard_normal(time.size)
    for k, start in enumerate(STARTS):
        since = time - start - HALF_WIDTH
        hump = np.where(abs(since) < HALF_WIDTH, np.cos(np.pi * since) ** 2, 0)
        force += HEIGHTS[k] * hump * (k != lost)
    path = folder / "rec.csv"
    now = np.clip((time - STARTS.min() + 0.5) // PERIOD, 0, 5).astype(int)
    columns = {name: values[now] for name, values in more.items()}
    frame = pd.DataFrame({"time_s": time, "force_n": force, **columns})
    frame.to_csv(path, index=False)
    return str(path)


def written(folder: Path, plan: pd.DataFrame) -> str:
    path = folder / "plan.csv"
    plan.to_csv(path, index=False)
    return str(path)


# Sorted by direction, made last first, and with two rows swapped by hand.
@pytest.mark.parametrize("order", [np.arange(6), MADE[::-1], MADE[[0, 2, 1, 3, 4, 5]]])
@pytest.mark.parametrize("origin", [0.0, 1e4])
@pytest.mark.parametrize("lost", [None, 2])
def test_times_place_pushes_whatever_the_order_of_the_rows(
    order, origin, lost, tmp_path, capsys
):
    plan = PLAN.assign(time_s=PLAN["time_s"] + origin).iloc[order]
    assert main(["peaks", recorded(tmp_path, lost), "-s", written(tmp_path, plan)]) == 0
    found = pd.read_csv(io.StringIO(capsys.readouterr().out))
    columns = ["push", "theta_deg"]
    np.testing.assert_array_equal(found[columns], plan[columns])
    truth = np.where(order == lost, 0.0, HEIGHTS[order])
    pulls = ((found["height_n"] - truth) / found["height_sd_n"]).to_numpy()
    assert np.abs(pulls).max() < MAX_Z
    is_missing = found["flags"] == "missing"
    np.testing.assert_array_equal(is_missing, order == lost)
