"""Peak extraction: what is found in which recording, and what is said about it."""

import dataclasses
import re

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from pushfit.config import GraspConfig
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find_pushes
from pushfit.data.peaks.extract import extract_peaks, measure_pushes
from pushfit.data.peaks.notes import extraction_notes
from pushfit.data.plans.pairing import pair
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.found_humps import FoundHumps
from pushfit.data.pushes.running_means import RunningMeans
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import (
    ALPHA_SWEEP,
    THETA_SWEEP,
    Session,
)
from pushfit.data.text.files import Source
from pushfit.data.units import UNITS
from pushfit.errors import ConfigError, DataError
from pushfit.model import Grasp
from tests.data.peaks.sweeps import simulated, with_signal
from tests.problems import BIOTAC
from tests.tolerances import MAX_Z, ROUTES

# Residuals are compared with stated standard deviations; 27 of them exceed four by
# chance once in 600 seeds.
MAX_PULL = 4.5
# The family of shapes misses a thousandth of a height without noise; five of them.
SHAPE = 5e-3
# Jitter of a tracked azimuth [deg], the share of its samples that are spikes, and how
# many samples are near the top of a push: half of the second above half its height.
JITTER, SPIKES, N_TOP = 3.0, 0.1, 50
# Spikes to one side move a median among the others, by their share, and its standard
# error is sqrt(π / 2) of that of a mean.
SHIFT = JITTER * stats.norm.ppf((0.5 - SPIKES) / (1 - SPIKES))
OF_MEDIAN = JITTER * np.sqrt(np.pi / 2 / ((1 - SPIKES) * N_TOP))
# A push of height 100 is above noise of 1 for so long: exp(-(t / 0.4 s)²) > 1/100 [s].
ABOVE_NOISE = 2 * 0.4 * np.sqrt(np.log(100))
TOLD = 0.01  # time and depth of a dip of 200, 0.7 s long, in noise of 1
KEPT = 1e-10  # angles are kept to nine decimals of a degree [rad]
# Read by eye to about three counts, as the largest sample: up to 2 % above the top.
BY_EYE, ABOVE = 3.0, 0.03


def pulls(table, made):
    error = table.heights("height") - np.asarray(made.truth.height)
    return error / table.sd("height")


@pytest.mark.parametrize("shape", ["triangle", "sine", "plateau"])
def test_heights_of_a_biotac_like_sweep_are_the_true_ones(shape):
    made = simulated(shape=shape)
    table = extract_peaks(made.recording, ALPHA_SWEEP)
    assert table.n_pushes == 18
    assert table.is_used.all()
    assert np.abs(pulls(table, made)).max() < MAX_PULL


@pytest.mark.parametrize("shape", ["triangle", "sine"])
def test_heights_without_noise_are_the_true_ones(shape):
    """Equal readings at the top of the highest plateau are those of a limit."""
    made = simulated(session=Session(shape=shape))
    table = extract_peaks(made.recording, ALPHA_SWEEP)
    assert table.is_used.all()
    np.testing.assert_allclose(table.heights("height"), made.truth.height, rtol=SHAPE)


def test_a_preloaded_theta_sweep_has_dips_below_the_plane_and_humps_above():
    made = simulated(THETA_SWEEP, Grasp(push_length=5e-3, gain=200.0, preload=2.0))
    table = extract_peaks(made.recording, THETA_SWEEP)
    assert table.n_pushes == 27
    assert np.sign(table.heights("height"))[[0, -1]].tolist() == [-1, 1]
    assert np.abs(pulls(table, made)).max() < MAX_PULL
    assert any("both ways" in note for note in table.notes)


def test_an_inverted_recording_gives_the_same_heights():
    made = simulated()
    plain = extract_peaks(made.recording, ALPHA_SWEEP)
    turned = extract_peaks(
        with_signal(made.recording, np.negative),
        ALPHA_SWEEP,
        settings=PeakSettings(invert=True),
    )
    np.testing.assert_array_equal(turned.heights("height"), plain.heights("height"))


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 100.0), (1e3, 0.0), (0.0365, -3.0)])
def test_heights_know_no_offset_and_scale_with_the_unit(gain, offset):
    """Counts leave ties everywhere; rounding must not break them one way or another."""
    made = simulated(THETA_SWEEP, Grasp(push_length=5e-3, gain=200.0, preload=2.0))
    moved = with_signal(made.recording, lambda y: gain * y + offset)
    plain = extract_peaks(made.recording, THETA_SWEEP)
    table = extract_peaks(moved, THETA_SWEEP)
    # Rounding of the moved samples only.
    np.testing.assert_allclose(
        table.heights("height") / gain, plain.heights("height"), rtol=ROUTES
    )


def test_a_missing_push_is_named_with_its_direction_and_time():
    made = simulated()
    lost = made.recording.time > made.t_start[7] - 0.1
    lost &= made.recording.time < made.t_start[7] + 2.1
    rest = 2440.0 + BIOTAC.drift * made.recording.time
    noise = BIOTAC.noise * np.random.default_rng(2).standard_normal(lost.size)
    flat = np.where(lost, np.rint(rest + noise), made.recording.channels["pressure"])
    recording = dataclasses.replace(made.recording, channels={"pressure": flat})
    table = extract_peaks(recording, ALPHA_SWEEP)
    assert table.frame["push"].tolist() == list(range(1, 19))
    assert [k for k, words in enumerate(table.flags) if "missing" in words] == [7]
    assert any(
        "push 8 (theta 15, alpha 60" in text and "no hump" in text
        for text in table.cautions
    )
    # It felt nothing: its height is 0 but for the noise of its rests.
    assert abs(table.heights("height")[7] / table.sd("height")[7]) < MAX_PULL
    used = extract_peaks(
        recording, ALPHA_SWEEP, settings=PeakSettings(use_missing=True)
    )
    assert used.is_used[7]


def test_two_assignments_that_fit_alike_are_both_shown_and_refused():
    """The first or the last push may be missing: nothing tells which."""
    made = simulated()
    time = made.recording.time
    lost = time < made.t_start[0] + 2.5
    flat = np.where(lost, 2440.0, made.recording.channels["pressure"])
    longer = np.arange(len(time), len(time) + 400) * 0.01
    rng = np.random.default_rng(1)
    tail = np.rint(flat[-1] + 0.7 * rng.standard_normal(400))
    recording = Recording(
        time=np.concatenate([time, longer]),
        channels={"pressure": np.concatenate([flat, tail])},
        units=made.recording.units,
    )
    with pytest.raises(DataError, match="Two assignments fit nearly as well") as caught:
        extract_peaks(recording, ALPHA_SWEEP)
    error = caught.value
    assert error.code == "push_mismatch"
    assert "(a) push 1 " in str(error)
    assert "(b) push 1 " in str(error)
    likeliest = PeakSettings(allow_missing=True)
    assert extract_peaks(recording, ALPHA_SWEEP, settings=likeliest).n_pushes >= 17


def test_held_pushes_in_time_are_paired_wherever_each_is_at_its_highest():
    time = np.arange(0.0, 26.0, 0.01)
    level = np.random.default_rng(0).standard_normal(time.size)
    for start, highest in zip(2 + 6 * np.arange(4), [0.4, 2.6, 0.4, 2.6], strict=True):
        since = time - start
        level += 100 * np.clip(np.minimum(since, 3 - since) / 0.3, 0, 1)
        level += 3 * np.exp(-(((since - highest) / 0.2) ** 2))
    recording = Recording(time=time, channels={"f": level}, units={"f": "n"})
    plan = PushSchedule.planned(np.radians(45.0), 0.0, repeats=4)
    table = extract_peaks(recording, plan)
    assert set(table.frame["definition"]) == {"plateau"}
    assert table.is_used.tolist() == [True] * 4


def test_humps_are_left_out_and_taken_in_by_their_time():
    made = simulated()
    time = made.recording.time
    bump = 12.0 * np.exp(-(((time - made.t_start[5] + 0.7) / 0.1) ** 2))
    bumped = with_signal(made.recording, lambda y: y + bump)
    when = float(made.t_start[5] - 0.7)
    window = ((when - 0.3, when + 0.3),)
    assert len(find_pushes(bumped, settings=PeakSettings(include=window))) == 19
    first = (float(made.t_start[0]), float(made.t_start[0]) + 2.0)
    out = PeakSettings(exclude=(first,))
    assert len(find_pushes(bumped, settings=out)) == 17
    part = PeakSettings(begin=float(made.t_start[3]) - 0.8)
    assert extract_peaks(made.recording, settings=part).n_pushes == 15


def test_a_part_of_a_recording_has_the_rows_of_its_own_pushes_of_the_plan():
    """What lies before `begin` is no reason to doubt which push is which."""
    made = simulated()
    whole = extract_peaks(made.recording, ALPHA_SWEEP)
    part = PeakSettings(begin=float(made.t_start[3]) - 0.8)
    table = extract_peaks(made.recording, ALPHA_SWEEP, settings=part)
    assert table.frame["push"].tolist() == whole.frame["push"].tolist()[3:]


def test_only_heights_for_a_fit_are_told_to_be_mixed():
    """A cut push looks held where it ends; nobody compares it."""
    frame = pd.DataFrame(
        {
            "push": [1, 2],
            "height_n": [1.0, 2.0],
            "definition": ["apex", "plateau"],
            "flags": ["", "clipped"],
        }
    )
    nothing = FoundHumps(
        extents=(), course=RunningMeans.of(np.arange(3.0), np.zeros(3))
    )
    paired = pair(nothing, None, PeakSettings(), span=(0.0, 2.0))
    notes, cautions = extraction_notes(paired, frame, PeakSettings(), unit=UNITS["n"])
    assert "heights are those of the apex of each push" in notes
    assert not cautions


def test_a_window_that_no_hump_is_in_is_told():
    settings = PeakSettings(exclude=((1000.0, 1001.0),))
    table = extract_peaks(simulated().recording, settings=settings)
    assert any("1000:1001 s" in caution for caution in table.cautions)


def test_a_schedule_of_one_cycle_serves_a_recording_of_three():
    cycle = PushSchedule.planned(np.radians(40.0), np.radians([0.0, 45, 90]), repeats=1)
    made = simulated(cycle.repeated(3))
    table = extract_peaks(made.recording, cycle)
    assert table.frame["repeat"].tolist() == [1] * 3 + [2] * 3 + [3] * 3
    assert table.groups.tolist() == [0, 1, 2] * 3


def test_without_a_schedule_directions_are_the_recorded_ones():
    made = simulated()
    table = extract_peaks(made.recording)
    # The joints report whole degrees.
    half_degree = np.radians(0.5) + KEPT
    np.testing.assert_allclose(table.theta, made.theta, rtol=0, atol=half_degree)
    np.testing.assert_allclose(table.alpha, made.alpha, rtol=0, atol=half_degree)


def test_an_azimuth_around_180_degrees_and_tracker_spikes_do_no_harm():
    made = simulated()
    recording = made.recording
    rng = np.random.default_rng(5)
    alpha = np.pi + np.radians(JITTER) * rng.standard_normal(len(recording.time))
    alpha = np.angle(np.exp(1j * alpha))
    spikes = rng.random(len(alpha)) < SPIKES
    alpha[spikes] = 0.3
    theta = np.where(spikes, -1.2, 0.4)
    tracked = dataclasses.replace(recording, alpha=alpha, theta=theta)
    table = extract_peaks(tracked)
    off = np.degrees(np.angle(np.exp(1j * (table.alpha - np.pi)))) - SHIFT
    assert np.abs(off).max() < MAX_Z * OF_MEDIAN
    assert abs(off.mean()) < MAX_Z * OF_MEDIAN / np.sqrt(off.size)
    np.testing.assert_allclose(table.theta, 0.4, rtol=0, atol=KEPT)


def test_a_direction_that_turns_while_a_push_is_measured_is_said():
    """The third push swings by 30° about its direction, from its start to its end."""
    made = simulated()
    steady = extract_peaks(made.recording)
    assert not any("turn by" in caution for caution in steady.cautions)
    time, third = made.recording.time, steady.frame.iloc[2]
    share = (time - third["t_start_s"]) / (third["t_end_s"] - third["t_start_s"])
    is_inside = (share > 0) & (share < 1)
    swing = np.radians(30.0) * np.where(is_inside, 2 * share - 1, 0.0)
    turned = dataclasses.replace(made.recording, theta=made.recording.theta + swing)
    table = extract_peaks(turned)
    (said,) = [caution for caution in table.cautions if "turn by" in caution]
    assert "of 1 push (3) turn by up to" in said
    # At most the middle half counts, 90 % of which is within 13.5°.
    assert 5 < float(said.split("up to ")[1].split("°")[0]) <= 14


def test_a_push_cut_by_either_end_is_flagged():
    made = simulated()
    recording = made.recording
    inside = (recording.time > made.t_start[0] + 0.6) & (
        recording.time < made.t_start[-1] + 0.8
    )
    cut = dataclasses.replace(
        recording,
        time=recording.time[inside],
        channels={"pressure": recording.channels["pressure"][inside]},
        theta=recording.theta[inside],
        alpha=recording.alpha[inside],
    )
    table = extract_peaks(cut)
    assert table.n_pushes == 18
    clipped = ["clipped" in words for words in table.flags]
    assert clipped == [True] + [False] * 16 + [True]


def test_a_gap_at_the_top_is_flagged_and_one_at_rest_is_not():
    made = simulated()
    time = made.recording.time
    lost = np.abs(time - made.t_peak[4]) < 0.15
    lost |= np.abs(time - made.t_start[9] + 0.8) < 0.15
    table = extract_peaks(
        with_signal(made.recording, lambda y: np.where(lost, np.nan, y)), ALPHA_SWEEP
    )
    assert [k for k, words in enumerate(table.flags) if "gap" in words] == [4]


def test_uneven_steps_do_not_shift_heights():
    made = simulated(jitter=0.5)
    table = extract_peaks(made.recording, ALPHA_SWEEP)
    assert np.abs(pulls(table, made)).max() < MAX_PULL


def test_humps_within_a_push_do_not_split_it():
    """A valley to half of the height is within a push, one to a quarter is between."""
    time = np.arange(0.0, 12.0, 0.01)

    def n_found(valley):
        knots = [0, 2, 3, 4, 5, 6, 12]
        level = np.interp(time, knots, [0, 0, 1, valley, 1, 0, 0])
        noisy = level + 0.01 * np.random.default_rng(1).standard_normal(len(time))
        recording = Recording(time=time, channels={"f": noisy}, units={"f": "n"})
        return len(find_pushes(recording))

    assert (n_found(0.5), n_found(0.25)) == (1, 2)


def test_a_brush_far_smaller_than_the_pushes_is_left_out_with_a_note():
    made = simulated()
    time = made.recording.time
    touch = 12.0 * np.exp(-(((time - made.t_start[5] + 0.7) / 0.1) ** 2))
    table = extract_peaks(with_signal(made.recording, lambda y: y + touch), ALPHA_SWEEP)
    assert table.n_pushes == 18
    assert any("smaller" in note for note in table.cautions)


def mixed_recording(directions):
    """Pushes of height 100 that go up or down, and steady noise."""
    time = np.arange(0.0, 6.0 * len(directions), 0.01)
    level = sum(
        100.0 * sign * np.exp(-(((time - 6 * k - 3) / 0.4) ** 2))
        for k, sign in enumerate(directions)
    )
    noise = np.random.default_rng(4).standard_normal(time.size)
    return Recording(
        time=time,
        channels={"p": 1e5 + level + noise},
        units={"p": "au"},
        theta=np.full(time.size, 0.5),
        alpha=np.zeros(time.size),
    )


def test_returns_from_dips_are_no_pushes():
    """A cell beside the contact is stretched first: it falls before it ever rises."""
    table = extract_peaks(mixed_recording([-2, -1, -1.5, 1, 1.2, 0.8, 1, 1.1]))
    error = table.heights("height") - [100, 120, 80, 100, 110]
    assert np.abs(error / table.sd("height")).max() < MAX_PULL
    [note] = [note for note in table.notes if "`signed=True`" in note]
    told = re.search(r"falls below rest: at (\S+) s \((\S+) au\)", note)
    assert [float(number) for number in told.groups()] == pytest.approx(
        [3.0, 200.0], rel=TOLD
    )


@pytest.mark.parametrize(
    ("levels", "told"),
    [([-2, 1, 1.2, -1.5, 1], "its 3 pushes (2 dips below"), ([1, 1], "its 2 pushes;")],
)
def test_without_directions_pushes_and_dips_are_counted(levels, told):
    """A planner may count either: a schedule has to have a row for each push."""
    recording = dataclasses.replace(mixed_recording(levels), theta=None, alpha=None)
    with pytest.raises(DataError) as caught:
        extract_peaks(recording)
    assert told in str(caught.value)


def test_a_push_right_after_a_deeper_dip_keeps_its_own_foot():
    table = extract_peaks(mixed_recording([-2.5, 1, 1, -2.5, 0.9]))
    error = table.heights("height") - [100, 100, 90]
    assert np.abs(error / table.sd("height")).max() < MAX_PULL
    assert (table.frame["t_end_s"] - table.frame["t_start_s"]).max() < ABOVE_NOISE


def test_short_rests_between_long_plateaus_are_no_dips():
    """Most readings are those of the plateaus; the ends tell which way is up."""
    time = np.arange(0.0, 60.0, 0.01)
    level = 100.0 * ((time % 6.0) > 0.8)
    level[time > 59.5] = 0.0
    noisy = level + np.random.default_rng(6).standard_normal(time.size)
    recording = Recording(time=time, channels={"p": noisy}, units={"p": "au"})
    assert len(find_pushes(recording)) == 10


def test_with_signed_settings_dips_are_pushes():
    recording = mixed_recording([-2, -1, 1, 1.2, 0.8, 1])
    table = extract_peaks(recording, settings=PeakSettings(signed=True))
    signs = np.sign(table.heights("height"))
    assert signs.tolist() == [-1, -1, 1, 1, 1, 1]


@pytest.mark.parametrize("n_dips", [1, 2, 12])
def test_an_upside_down_signal_is_refused_with_the_way_out(n_dips):
    times = "1 time" if n_dips == 1 else f"{n_dips} times"
    with pytest.raises(DataError, match=rf"from rest {times} and.*`invert=True`"):
        extract_peaks(mixed_recording([-1] * n_dips))
    with pytest.raises(DataError, match=rf"{times} and.* go up \(leave out `invert`\)"):
        extract_peaks(mixed_recording([1] * n_dips), settings=PeakSettings(invert=True))


@pytest.mark.parametrize(
    "signal",
    [np.zeros(500), np.linspace(0.0, 30.0, 500), 1.0 + 0.01 * (np.arange(500) % 2)],
    ids=["constant", "drift", "flicker"],
)
def test_a_signal_without_pushes_is_refused(signal):
    recording = Recording(
        time=np.arange(500) / 100,
        channels={"pressure": signal},
        units={"pressure": "kpa"},
        sources=(Source(path="flat.csv", sha256="", dialect="native csv"),),
    )
    with pytest.raises(DataError, match=r"flat\.csv: no pushes found") as caught:
        extract_peaks(recording)
    assert caught.value.code == "no_pushes"


@pytest.mark.parametrize("named", ["channel", "normal"])
def test_a_channel_that_is_named_with_its_unit_is_offered_without(named):
    force = np.zeros(100)
    recording = Recording(
        time=np.arange(100) / 100,
        channels={"fx": force, "fz": force},
        units={"fx": "n", "fz": "n"},
    )
    settings = PeakSettings(**{named: "fz_n"})
    with pytest.raises(ConfigError, match=r"named without their units: fz$"):
        measure_pushes(recording, settings=settings)


def test_several_channels_need_a_choice():
    made = simulated(session=Session(forces=True, noise=0.01), grasp=Grasp(5e-3))
    with pytest.raises(ConfigError, match="fx, fy, fz") as caught:
        extract_peaks(made.recording, ALPHA_SWEEP)
    assert caught.value.code == "channel"


def test_a_recording_without_angles_needs_a_schedule():
    made = simulated()
    blind = dataclasses.replace(made.recording, theta=None, alpha=None)
    with pytest.raises(DataError) as caught:
        extract_peaks(blind)
    assert caught.value.code == "no_directions"


def test_settings_may_come_from_a_configuration():
    made = simulated()
    section = GraspConfig(peaks={"channel": "pressure", "height": "apex"}).peaks
    table = extract_peaks(made.recording, ALPHA_SWEEP, settings=section)
    assert any("apex" in note for note in table.notes)


@pytest.mark.parametrize(
    ("name", "column", "n_pushes"),
    [
        ("biotac_hand_pushes/trial2", "pdc", 10),
        ("biotac_hand_pushes/short_dropouts", "pdc", 5),
        ("biotac_hand_pushes/short_starts_mid_push", "pdc", 1),
        ("biotac_hand_pushes/no_push_constant", "pdc", 0),
        ("biotac_hand_pushes/no_push_gaps", "pdc", 0),
        ("fingertip_force/pressure_index_1_100Hz", "force_N", 12),
        ("soft_skin/grid_r0.20_0.5N_11-02-2025_14-22-29", "fz_N", 18),
        ("soft_skin/grid_r1.00_3.0N_11-02-2025_15-23-30", "fz_N", 18),
        ("soft_skin/test_18-02-2025_13-00-43", "fz_N", 8),
        ("barometer/zv05_zd6_t0_20230622_191542", "p0_Pa", 15),
        ("barometer/zv05_zd6_t0_20230622_191542", "p1_Pa", 6),
        ("barometer/zv05_zd6_t0_20230622_191542", "p2_Pa", 12),
        ("barometer/zv05_zd6_t0_20230622_191542", "p3_Pa", 11),
        ("barometer/testing_step_20230629_181126", "p2_Pa", 2),
    ],
)
def test_real_pushes_are_counted_without_any_setting(real_data, name, column, n_pushes):
    assert len(find_pushes(real(real_data, name, column))) == n_pushes


def real(folder, name, column):
    frame = pd.read_csv(folder / f"{name}.csv")
    angles = {
        key: np.radians(frame[f"{key}_deg"].to_numpy())
        for key in ("theta", "alpha")
        if f"{key}_deg" in frame
    }
    return Recording(
        time=frame["time_s"].to_numpy(dtype=float),
        channels={column: frame[column].to_numpy(dtype=float)},
        units={column: "counts" if column == "pdc" else "n"},
        **angles,
    )


def test_real_hand_pushes_have_the_heights_read_by_eye(real_data):
    table = extract_peaks(real(real_data, "biotac_hand_pushes/trial2", "pdc"))
    by_eye = pd.read_csv(real_data / "biotac_hand_pushes/trial2_presses_by_eye.csv")
    np.testing.assert_allclose(
        table.heights("height"), by_eye["height_counts"], rtol=ABOVE, atol=BY_EYE
    )


def test_cut_real_pushes_are_flagged(real_data):
    starts = real(real_data, "biotac_hand_pushes/short_starts_mid_push", "pdc")
    ends = real(real_data, "biotac_hand_pushes/short_dropouts", "pdc")
    assert "clipped" in extract_peaks(starts).flags[0]
    assert "clipped" in extract_peaks(ends).flags[4]


@pytest.mark.parametrize(
    ("push", "is_in_order"), [([1, 2, 5, 6], True), ([2, 4, 3, 1], False)]
)
def test_rows_sorted_by_anything_but_their_order_are_told_of(push, is_in_order):
    theta = np.radians([10.0, 30.0, 50.0, 70.0])
    schedule = dataclasses.replace(
        PushSchedule.planned(theta, 0 * theta), push=np.array(push)
    )
    table = extract_peaks(simulated(schedule).recording, schedule)
    told = [text for text in table.cautions if "push numbers" in text]
    assert bool(told) is not is_in_order
