"""Simulated tables and recordings: they carry the truth they claim."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from pushfit.data.simulate import (
    ALPHA_SWEEP,
    THETA_SWEEP,
    Session,
    _to_resolution,
    simulate_recording,
    simulate_table,
    write_recording,
)
from pushfit.model import Grasp, Parameters
from tests.problems import BIOTAC
from tests.tolerances import FEW_OPERATIONS

# The sd of a sample sd is sd/sqrt(2n) = 1.1 %; four of them.
SAMPLED = 0.045
# The clock may miss the tip by half a step: 0.5 ms of a rise of 1 s.
CLOCK = 6e-4
# Joints report whole degrees; of 27 pushes one misses by most of a half.
HALF_DEGREE, MOST = 0.5, 0.3
PARAMS = Parameters(K_sn=800.0, K_dn=1500.0, K_st=400.0, C_rr=0.3, C_d=0.3, L=0.04)
GRASP = Grasp(push_length=5e-3)


def test_noise_free_heights_below_the_critical_angle_follow_eq_13():
    """P_rr = A sin θ sqrt(1 + C_rr²), and height = S_p P_rr."""
    theta = np.radians([5.0, 10.0])
    table = simulate_table(
        PARAMS,
        GRASP,
        theta=theta,
        alpha=0.0,
        repeats=1,
        noise=0.0,
        rng=np.random.default_rng(0),
    )
    A = 800.0 * 1500.0 / 2300.0
    expected = 5e-3 * A * np.sin(theta) * np.sqrt(1 + 0.3**2)
    np.testing.assert_allclose(table.heights("height"), expected, rtol=FEW_OPERATIONS)


def test_table_noise_has_the_stated_sd():
    table = simulate_table(
        PARAMS,
        GRASP,
        theta=np.full(1, 0.5),
        alpha=0.0,
        repeats=4000,
        noise=0.1,
        rng=np.random.default_rng(1),
        state_sd=True,
    )
    np.testing.assert_allclose(table.pooled_sd("height")[0], 0.1, rtol=SAMPLED)
    assert set(table.sd("height")) == {0.1}


def test_pushes_that_lift_the_finger_off_are_flagged():
    table = simulate_table(
        PARAMS,
        Grasp(push_length=5e-3, preload=1.0),
        theta=np.radians([-60.0, 60.0]),
        alpha=0.0,
        repeats=1,
        noise=0.0,
        rng=np.random.default_rng(0),
    )
    assert table.is_used.tolist() == [False, True]


def test_the_sweeps_are_the_papers():
    assert (THETA_SWEEP.n_pushes, ALPHA_SWEEP.n_pushes) == (27, 18)
    assert np.degrees(THETA_SWEEP.theta[[0, -1]]).round(9).tolist() == [-60, 60]
    assert np.degrees(ALPHA_SWEEP.alpha[[0, -1]]).round(9).tolist() == [0, 150]


@pytest.mark.parametrize("shape", ["triangle", "sine", "plateau"])
def test_without_disturbance_the_top_of_a_push_is_its_height(shape):
    session = Session(shape=shape, rate=1000.0, level=3.0)
    made = simulate_recording(
        PARAMS, GRASP, ALPHA_SWEEP, session=session, rng=np.random.default_rng(2)
    )
    top = np.interp(
        made.t_peak, made.recording.time, made.recording.channels["pressure"]
    )
    np.testing.assert_allclose(top - 3.0, made.truth.height, rtol=CLOCK)


def test_joints_reach_directions_within_half_their_resolution():
    made = simulate_recording(
        PARAMS, GRASP, THETA_SWEEP, session=Session(), rng=np.random.default_rng(3)
    )
    miss = np.degrees(made.theta - THETA_SWEEP.theta)
    assert MOST < np.abs(miss).max() <= HALF_DEGREE


def test_readings_stop_at_the_limit_of_the_sensor():
    session = dataclasses.replace(BIOTAC, limit=2600.0)
    made = simulate_recording(
        PARAMS,
        Grasp(push_length=5e-3, gain=200.0),
        THETA_SWEEP,
        session=session,
        rng=np.random.default_rng(4),
    )
    pressure = made.recording.channels["pressure"]
    assert pressure.max() == 2600.0
    assert np.array_equal(pressure, np.rint(pressure))


def test_force_components_add_up_to_the_two_heights():
    session = Session(forces=True, rate=1000.0)
    made = simulate_recording(
        PARAMS, GRASP, ALPHA_SWEEP, session=session, rng=np.random.default_rng(5)
    )
    forces = {
        name: np.interp(made.t_peak, made.recording.time, values)
        for name, values in made.recording.channels.items()
    }
    tangential = np.hypot(forces["fx"], forces["fy"])
    np.testing.assert_allclose(tangential, made.truth.height_tangential, rtol=CLOCK)
    np.testing.assert_allclose(forces["fz"], made.truth.height_normal, rtol=CLOCK)


def test_a_written_recording_holds_the_same_numbers(tmp_path):
    made = simulate_recording(
        PARAMS, GRASP, ALPHA_SWEEP, session=BIOTAC, rng=np.random.default_rng(6)
    )
    write_recording(made.recording, tmp_path / "r.csv")
    again = pd.read_csv(tmp_path / "r.csv", float_precision=None)
    assert list(again) == ["time_s", "pressure_counts", "theta_deg", "alpha_deg"]
    pressure = made.recording.channels["pressure"]
    np.testing.assert_array_equal(again["pressure_counts"], pressure)


def test_a_joint_at_zero_reports_no_negative_zero():
    """Half of all joints err to below 0."""
    resolution = Session().angle_resolution
    reported = _to_resolution(np.array([-0.4, 0.4]) * resolution, Session())
    assert not np.signbit(reported).any()
