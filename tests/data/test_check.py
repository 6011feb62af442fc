"""All problems of all files at once, by the readers that would read them."""

import os

import numpy as np
import pytest

from pushfit.batch.outputs import REASON
from pushfit.batch.population import COLUMNS
from pushfit.batch.rows import ABOUT
from pushfit.data.check import check_files, expect_kind, file_kind
from pushfit.data.recordings.recording import read_recording
from pushfit.errors import DataError

# Angles are recorded to 0.001°, and components of the normal to 1e-6, which near it
# (90°) resolves sqrt(2e-6) rad.
ANGLE = 1.5e-3
RECORDING = "time_s,force_n\n0,1\n0.01,2\n"
SCHEDULE = "push,theta_deg,alpha_deg,repeat\n1,30,0,1\n2,45,90,1\n"
TABLE = "push,theta_deg,alpha_deg,repeat,height_n\n1,30,0,1,2.5\n2,45,90,1,2.75\n"


@pytest.fixture
def write(tmp_path):
    def write(name, text):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (RECORDING, "recording"),
        (SCHEDULE, "schedule"),
        (SCHEDULE.replace("repeat", "time_s"), "schedule"),
        (SCHEDULE.replace("alpha_deg", "pdc"), "recording"),
        ("push,theta_deg,repeat\n1,30,1\n2,45,1\n", "schedule"),
        (TABLE, "table"),
        ("time_s,force_n,theta_deg,alpha_deg\n0,1,30,0\n1,2,30,0\n", "recording"),
    ],
)
def test_the_columns_tell_what_a_file_is(text, kind, write):
    assert file_kind(write("file.csv", text)) == kind


@pytest.mark.parametrize(
    ("columns", "what"),
    [
        (ABOUT, "the results of a batch"),
        (REASON, "the failures of a batch"),
        (COLUMNS, "what the items of a batch have in common"),
    ],
)
def test_what_a_batch_wrote_is_called_so(columns, what, write):
    path = write("file.csv", f"{','.join(columns)}\n{','.join('x' * len(columns))}\n")
    (problem,) = check_files([path])
    assert problem.message.startswith(f"{path}: holds {what}")
    assert "no command reads it; open it in a spreadsheet" in problem.message
    with pytest.raises(DataError, match=what):
        expect_kind(path, "table")


@pytest.mark.parametrize(
    ("text", "said"), [("[push]\nlength_mm = 5\n", []), ("[push]\nx = 5\n", ["push.x"])]
)
def test_settings_are_checked_as_settings(text, said, write):
    path = write("grasp.toml", text)
    assert file_kind(path) == "settings"
    assert [problem.column for problem in check_files([path])] == said
    for kind in ("recording", "table"):
        with pytest.raises(DataError, match="is a file of settings"):
            expect_kind(path, kind)


def test_a_pipe_is_named_and_not_read(tmp_path):
    """It would be read by the first look at it."""
    path = tmp_path / "pipe"
    os.mkfifo(path)
    (problem,) = check_files([path])
    assert "is a pipe or a device" in problem.message


def test_samples_in_time_are_no_plan_even_where_no_unit_is_said(write):
    """The reader of recordings then says what is missing: the unit."""
    path = write("file.csv", "time_s,pdc,theta_deg,alpha_deg\n0,1,30,0\n1,2,30,0\n")
    assert file_kind(path) == "recording"
    (problem,) = check_files([path])
    assert "units={" in problem.message


def test_a_mapped_signal_makes_a_recording_of_what_looks_like_a_plan(write):
    path = write("file.csv", "pdc,theta_deg,alpha_deg\n1,30,0\n2,30,0\n")
    assert file_kind(path) == "schedule"
    assert file_kind(path, units={"pdc": "counts"}) == "recording"


def test_good_files_have_no_problems(write):
    paths = [
        write("recording.csv", RECORDING),
        write("schedule.csv", SCHEDULE),
        write("table.csv", TABLE),
    ]
    assert check_files(paths) == ()


def test_every_problem_of_every_file_is_found(write, tmp_path):
    paths = [
        write("ragged.csv", RECORDING + "0.02\n0.03,1,2\n0.04,x\n"),
        tmp_path / "nowhere.csv",
        write("good.csv", RECORDING),
        write("clock.csv", RECORDING + "0.01,3\n0.00,4\n"),
        write("table.csv", TABLE.replace("2.5", "2.5x")),
    ]
    problems = check_files(paths)
    found = [(p.path.rsplit("/")[-1], p.code, p.line) for p in problems]
    assert found[:6] == [
        ("ragged.csv", "field_count", 4),
        ("ragged.csv", "field_count", 5),
        ("ragged.csv", "not_a_number", 6),
        ("nowhere.csv", "file_not_found", None),
        ("clock.csv", "time_not_increasing", 4),
        ("clock.csv", "time_not_increasing", 5),
    ]
    assert {path for path, _, _ in found[6:]} == {"table.csv"}


def test_the_check_says_what_the_reader_says(write):
    path = write("bad.csv", RECORDING + "0.01,3\n")
    with pytest.raises(DataError) as caught:
        read_recording(path)
    assert check_files([path]) == caught.value.problems


def test_options_reach_the_reader(write):
    path = write("pdc.csv", "time_s,pdc\n0,2400\n1,2410\n")
    assert [p.code for p in check_files([path])] == ["no_channel"]
    assert check_files([path], units={"pdc": "counts"}) == ()


# What a user would state about each of the real recordings.
HAND = {"units": {"pdc": "counts"}, "theta_from": "normal"}
SKIN = {"units": dict.fromkeys(("s0", "s1", "s2", "s3"), "au")}
REAL = {
    "biotac_hand_pushes/trial2.csv": (HAND, 6470),
    "biotac_hand_pushes/short_dropouts.csv": (HAND, 165),
    "biotac_hand_pushes/short_starts_mid_push.csv": (HAND, 95),
    "biotac_hand_pushes/no_push_constant.csv": (HAND, 500),
    "biotac_hand_pushes/no_push_gaps.csv": (HAND, 209),
    "fingertip_force/pressure_index_1_100Hz.csv": ({}, 35898),
    "soft_skin/test_18-02-2025_13-00-43.csv": (SKIN, 3001),
    "soft_skin/grid_r0.20_0.5N_11-02-2025_14-22-29.csv": (SKIN, 9501),
    "soft_skin/grid_r1.00_3.0N_11-02-2025_15-23-30.csv": (SKIN, 9501),
    "barometer/zv05_zd6_t0_20230622_191542.csv": ({}, 3020),
    "barometer/testing_step_20230629_181126.csv": ({}, 4963),
    "format_samples/mat1_10_bio_ORIGINAL.csv": (
        {"units": {"timestamp": "s", "pdc": "counts"}},
        600,
    ),
}


@pytest.mark.parametrize("name", REAL)
def test_real_recordings_read_to_the_numbers_that_numpy_finds(name, real_data):
    """numpy.genfromtxt is the second route: it knows nothing of our layout."""
    options, n_rows = REAL[name]
    recording = read_recording(real_data / name, **options)
    assert recording.time.size == n_rows
    raw = np.genfromtxt(
        real_data / name, delimiter=",", skip_header=1, encoding="utf-8-sig"
    )
    np.testing.assert_array_equal(recording.time, raw[:, 0])
    header = (real_data / name).read_text("utf-8-sig").partition("\n")[0].split(",")
    pascal = 1e3 if any(c.endswith("_Pa") for c in header) else 1.0
    for channel, values in recording.channels.items():
        (at,) = [i for i, c in enumerate(header) if c.strip().split("_")[0] == channel]
        np.testing.assert_array_equal(values, raw[:, at] / pascal)


def test_every_real_file_is_read_or_refused_by_a_sentence(real_data):
    files = sorted(real_data.glob("*/*.csv"))
    assert files
    for file in files:
        for problem in check_files([file]):
            assert str(file) in problem.message
            assert problem.code


def test_a_real_file_without_time_says_so(real_data):
    path = real_data / "format_samples/Cali_BOM_header_ORIGINAL.csv"
    with pytest.raises(DataError, match="no time column among Sensor_0, Sensor_1"):
        read_recording(path, units=dict.fromkeys(("Sensor_0", "Sensor_1"), "pa"))


def test_the_recorded_angle_of_the_hand_pushes_is_from_the_normal(real_data):
    """Its normal vector is recorded too: elevation = arcsin of its third component."""
    path = real_data / "biotac_hand_pushes/trial2.csv"
    recording = read_recording(path, **HAND)
    normal = np.genfromtxt(path, delimiter=",", skip_header=1)[:, 4]
    np.testing.assert_allclose(recording.theta, np.arcsin(normal), rtol=0, atol=ANGLE)


def test_heights_in_an_unknown_unit_are_no_schedule(tmp_path):
    path = tmp_path / "grams.csv"
    path.write_text("theta_deg,alpha_deg,height_g\n10,90,3\n20,90,4\n")
    assert file_kind(path) == "table"
    (problem,) = check_files([path])
    assert "height_g" in problem.message
