"""NumPy files are read by the names of their arrays, or by those that are stated."""

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import ConfigError, DataError


def test_numpy_columns_are_read_by_name(tmp_path):
    time, force = np.arange(5) / 100, np.arange(5.0)
    np.savez(tmp_path / "log.npz", time_s=time, force_n=force)
    np.save(tmp_path / "log.npy", np.stack([time, force], axis=1))
    by_name = read_recording(tmp_path / "log.npz")
    by_order = read_recording(tmp_path / "log.npy", columns=("time_s", "force_n"))
    for recording in (by_name, by_order):
        np.testing.assert_array_equal(recording.channels["force"], force)
        np.testing.assert_array_equal(recording.time, time)
    with pytest.raises(DataError, match="2 columns without names"):
        read_recording(tmp_path / "log.npy")


# Whole nanoseconds of times since 1970 lie 256 ns apart as a float64.
SINCE_1970 = 256e-9


def test_seconds_and_nanoseconds_of_arrays_are_one_clock(tmp_path):
    whole, rest = np.divmod(1_700_000_000_900_000_000 + 10**7 * np.arange(50), 10**9)
    arrays = {"stamp_sec": whole, "stamp_nsec": rest, "force_n": np.arange(50.0)}
    np.savez(tmp_path / "log.npz", **arrays)
    recording = read_recording(tmp_path / "log.npz", mapping={"time": "stamp"})
    time = whole + rest / 1e9
    np.testing.assert_allclose(recording.time, time, rtol=0, atol=SINCE_1970)
    assert "time from stamp_sec and stamp_nsec" in recording.notes[0]


def test_arrays_of_other_lengths_are_left_aside_and_named(tmp_path):
    time, force = np.arange(50) / 100, np.arange(50.0)
    path = tmp_path / "log.npz"
    settings = {"gain": 0.5, "serial": "A12", "cal": np.eye(6), "meta": {"rig": 7}}
    np.savez(path, time_s=time, force_n=force, pac=np.zeros(99), **settings)
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.channels["force"], force)
    assert "left aside pac, gain, serial, cal, meta" in recording.notes[0]


def test_arrays_that_differ_by_a_sample_are_named_with_their_lengths(tmp_path):
    path = tmp_path / "log.npz"
    np.savez(path, time_s=np.arange(50) / 100, force_n=np.arange(49.0), gain=0.5)
    with pytest.raises(
        DataError, match=r"unequal length: time_s \(50\), force_n \(49\); save as many"
    ):
        read_recording(path)
    np.savez(path, force_n=np.arange(50.0), cal=np.arange(6.0))
    assert read_recording(path, rate=100.0).time.size == 50


TIME, FORCE = np.arange(5) / 100, np.arange(5.0)
ROWS = np.stack([TIME, FORCE], axis=1)
CALIBRATION = np.eye(6)


@pytest.mark.parametrize(
    ("arrays", "columns", "aside"),
    [
        ({"data": ROWS}, ("time_s", "force_n"), None),
        ({"data": ROWS, "gain": 0.5, "zero": 1.0}, ("time_s", "force_n"), "gain, zero"),
        ({"t_s": TIME, "data": ROWS[:, ::-1]}, ("force_n", "..."), None),
        (
            {"data": np.rec.fromarrays(ROWS.T, names="time_s,force_n")},
            (),
            None,
        ),
    ],
)
def test_the_only_table_of_an_archive_is_read_as_one_by_itself(
    arrays, columns, aside, tmp_path
):
    np.savez(tmp_path / "log.npz", **arrays)
    recording = read_recording(tmp_path / "log.npz", columns=columns)
    np.testing.assert_array_equal(recording.channels["force"], FORCE)
    np.testing.assert_array_equal(recording.time, TIME)
    assert (f"left aside {aside}" in recording.notes[0]) is (aside is not None)


@pytest.mark.parametrize(
    ("arrays", "columns", "said"),
    [
        ({"data": ROWS}, (), "array 'data' holds 2 columns without names; state them"),
        ({"data": ROWS}, ("a_s", "b_n", "c_n"), "array 'data' holds 2 columns without"),
        ({"data": ROWS}, ("force_n",), "2 columns without names; named were 1"),
        ({"data": ROWS.T}, ("time_s", "force_n"), "save it transposed, as table.T"),
        (
            {"left": ROWS, "right": ROWS},
            ("time_s", "force_n"),
            "there are: left (5 × 2), right (5 × 2); save it alone",
        ),
        ({"images": np.zeros((5, 3, 2))}, (), "there are: images (5 × 3 × 2); save it"),
    ],
)
def test_tables_without_names_are_refused_by_theirs(arrays, columns, said, tmp_path):
    np.savez(tmp_path / "log.npz", **arrays)
    with pytest.raises(DataError) as caught:
        read_recording(tmp_path / "log.npz", columns=columns)
    assert said in str(caught.value)


def test_tables_beside_columns_are_no_columns(tmp_path):
    """Of two calibrations each has more numbers than there are samples."""
    tables = {"left": CALIBRATION, "right": CALIBRATION}
    np.savez(tmp_path / "log.npz", time_s=TIME, force_n=FORCE, **tables)
    recording = read_recording(tmp_path / "log.npz")
    np.testing.assert_array_equal(recording.channels["force"], FORCE)
    assert "left aside left, right" in recording.notes[0]


@pytest.mark.parametrize("suffix", ["npy", "npz"])
def test_columns_that_have_names_are_not_named_without_a_word(suffix, tmp_path):
    path = tmp_path / f"log.{suffix}"
    if suffix == "npz":
        np.savez(path, time_s=TIME, force_n=FORCE)
    else:
        np.save(path, np.rec.fromarrays(ROWS.T, names="time_s,force_n"))
    with pytest.raises(ConfigError, match="have names: time_s, force_n; leave out"):
        read_recording(path, columns=("time_s", "force_mn"))
