"""What `peaks` and `validate` read from files of known content, and say of them.

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


def told(capsys, *arguments: str) -> str:
    assert main(["peaks", *arguments]) == 0
    return capsys.readouterr().err


IN_ORDER = PLAN.iloc[MADE].drop(columns="time_s")
THETA, ALPHA = IN_ORDER["theta_deg"].to_numpy(), IN_ORDER["alpha_deg"].to_numpy()


def test_a_plan_that_recorded_angles_contradict_is_told_with_both(tmp_path, capsys):
    """The rows are sorted by theta, and without times: 6 was not made sixth."""
    own = recorded(tmp_path, theta_deg=THETA, alpha_deg=ALPHA)
    sorted_by_theta = PLAN.drop(columns="time_s")
    said = told(capsys, own, "-s", written(tmp_path, sorted_by_theta))
    # Planned 60 is made with 20, the farthest of all.
    assert "directions of 5 pushes are up to 40° off those of the schedule" in said
    assert "push 1 (10, 90) and (40, 90), push 2 (20, 90) and (30, 90)" in said
    assert "and 2 more. Put the rows" in said
    assert "push 5" not in said


ODD = np.array([0, 0, 20.0, 0, 0, 0])
HIDDEN = np.where(ODD > 0, np.nan, 0.0)


@pytest.mark.parametrize(
    ("angles", "is_told"),
    [
        ({}, False),
        ({"theta_deg": THETA + 4, "alpha_deg": ALPHA - 360}, False),
        ({"theta_deg": THETA + 6, "alpha_deg": ALPHA}, True),
        ({"theta_deg": THETA, "alpha_deg": ALPHA + ODD}, True),
        ({"theta_deg": THETA + HIDDEN, "alpha_deg": ALPHA + ODD}, False),
        ({"theta_deg": THETA}, False),
        ({"theta_deg": THETA + ODD}, True),
        ({"alpha_deg": ALPHA + ODD}, True),
    ],
)
def test_recorded_angles_speak_as_far_as_they_are_there(
    angles, is_told, tmp_path, capsys
):
    plan, config = written(tmp_path, IN_ORDER), tmp_path / "grasp.toml"
    config.write_text('[recording]\ngaps = "split"\n')
    own = recorded(tmp_path, **angles)
    said = told(capsys, own, "-s", plan, "-c", str(config))
    assert ("off those of the schedule" in said) is is_told


def test_recorded_angles_that_scatter_by_what_they_are_off_do_not_speak(
    tmp_path, capsys
):
    """A tracker errs by 8° with a scatter of 10°: 90 % are within 1.6 of that."""
    path = Path(recorded(tmp_path, theta_deg=THETA + 8.0, alpha_deg=ALPHA))
    plan, frame = written(tmp_path, IN_ORDER), pd.read_csv(path)
    assert "off those of the schedule" in told(capsys, str(path), "-s", plan)
    noise = 10.0 * np.random.default_rng(4).standard_normal(len(frame))
    frame["theta_deg"] = np.minimum(frame["theta_deg"] + noise, 90.0)
    frame.to_csv(path, index=False)
    assert "off those of the schedule" not in told(capsys, str(path), "-s", plan)


@pytest.mark.parametrize("cell", ["inf", "1e999", ""])
def test_a_height_that_is_no_number_is_cured_by_what_is_said(cell, tmp_path, capsys):
    path = tmp_path / "peaks.csv"
    lines = ["theta_deg,alpha_deg,height_n", f"10,90,{cell}", "20,90,0.6", "30,90,0.5"]
    path.write_text("\n".join(lines))
    assert main(["validate", str(path)]) == 3
    said = capsys.readouterr().err
    assert said.strip().endswith("or remove the row")
    path.write_text("\n".join(lines[:1] + lines[2:]))
    assert main(["validate", str(path)]) == 0


@pytest.mark.parametrize(
    ("column", "advice"),
    [
        (
            "force_kN",
            "--map force=force_kN --unit force=n (if it is in n; known are n, mn,",
        ),
        ("Force", "--map force=Force --unit force=n (if it is in n; known are n, mn,"),
        ("pdc", "--map pressure=pdc --unit pressure=counts (if it is in counts;"),
    ],
)
def test_a_unit_is_an_example_and_of_what_the_column_is_called(
    column, advice, tmp_path, capsys
):
    path = tmp_path / "rec.csv"
    path.write_text(f"time_s,{column}\n0,1\n1,2\n")
    assert main(["peaks", str(path)]) == 3
    assert advice in capsys.readouterr().err
    mapped = ["--map", f"force={column}"]
    assert main(["peaks", str(path), *mapped]) == 3
    assert "state --unit force=n (if it is in n;" in capsys.readouterr().err
    assert main(["peaks", str(path), *mapped, "--unit", "force=kN"]) in (2, 3)
    assert capsys.readouterr().err.strip().endswith("N/mV; convert to one of these")


def test_what_is_odd_of_the_times_is_said_where_a_recording_is_refused(
    tmp_path, capsys
):
    path = Path(recorded(tmp_path))
    path.write_text(path.read_text().replace("time_s", "time_ms"))
    assert main(["peaks", str(path), "-s", written(tmp_path, PLAN)]) == 3
    said = capsys.readouterr().err
    assert "error: " in said
    assert "if times are in s and not in ms, name their column so, as time_s" in said


@pytest.mark.parametrize("column", ["theta_rad", "Theta (rad)"])
def test_an_angle_beyond_its_range_is_named_as_the_file_has_it(
    column, tmp_path, capsys
):
    path = tmp_path / "peaks.csv"
    path.write_text(f"{column},alpha_rad,height_n\n10,1.57,0.5\n1.2,1.57,0.6\n")
    assert main(["validate", str(path)]) == 3
    said = capsys.readouterr().err
    assert f"line 2, column {column}: 10 rad = 572.958° is outside [-90, 90]" in said
    assert "name a column of degrees theta_deg" in said
    assert "theta_deg:" not in said
    assert "line 3" not in said
