"""Logs that are no tables are read by the rules of tables."""

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import DataError
from tests.tolerances import EXACT

# Times since 1970 keep a quarter of a microsecond of a step of 10 ms.
STAMPS = 1e-4

ECHO = """header:
  seq: {k}
  stamp:
    secs: 1600000000
    nsecs: {ns}
  frame_id: ''
wrench:
  force:
    x: {x}
    y: 0.5
---
"""


def test_what_rostopic_echo_prints_is_read(tmp_path):
    path = tmp_path / "echo.txt"
    path.write_text(
        "".join(ECHO.format(k=k, ns=10_000_000 * k, x=k / 4) for k in range(8))
    )
    recording = read_recording(
        path, mapping={"fx": "wrench.force.x"}, units={"fx": "n"}
    )
    np.testing.assert_array_equal(recording.channels["fx"], np.arange(8) / 4)
    np.testing.assert_allclose(np.diff(recording.time), 0.01, rtol=STAMPS)


def test_a_number_that_stands_for_a_missing_one_is_left_out_of_an_echo(tmp_path):
    path = tmp_path / "echo.txt"
    values = [-9999 if k == 5 else k / 4 for k in range(40)]
    messages = enumerate(values)
    path.write_text(
        "".join(ECHO.format(k=k, ns=10_000_000 * k, x=x) for k, x in messages)
    )
    given = {"mapping": {"fx": "wrench.force.x"}, "units": {"fx": "n"}}
    with pytest.raises(DataError, match=r"`missing=\['-9999'\]` and `gaps='split'`"):
        read_recording(path, **given)
    signal = read_recording(path, missing=["-9999", "lost"], gaps="split", **given)
    np.testing.assert_array_equal(
        signal.channels["fx"], [np.nan if k == 5 else k / 4 for k in range(40)]
    )


@pytest.mark.parametrize("name", [None, "force_n"])
def test_a_file_of_one_column_has_a_rate(tmp_path, name):
    path = tmp_path / "one.txt"
    path.write_text((f"{name}\n" if name else "") + "0.5\n1.5\n-2\n" * 4)
    columns = () if name else ("force_n",)
    recording = read_recording(path, columns=columns, rate=10.0)
    np.testing.assert_array_equal(recording.channels["force"], [0.5, 1.5, -2.0] * 4)
    np.testing.assert_allclose(recording.time, np.arange(12) / 10, rtol=EXACT)


def test_what_to_type_is_quoted_for_a_shell(tmp_path):
    path = tmp_path / "volts.csv"
    path.write_text("time_s,AI1 (V)\n" + "".join(f"{k / 10},{k}\n" for k in range(9)))
    with pytest.raises(
        DataError,
        match=r"`mapping={'force': 'AI1 \(V\)'}, units={'force': '500mN/V'}`, with the",
    ):
        read_recording(path)


DAMAGED = {
    "cut.npy": (lambda path: path.write_bytes(b"\x93NUMPY\x01\x00"), "copy it again"),
    "words.npz": (lambda path: np.savez(path, note=np.array("a")), "np.savez(NAME, "),
    "mute.txt": (lambda path: path.write_text("header:\n---\n"), "as a bag"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_file_without_numbers_is_refused_with_what_to_do(tmp_path, name):
    write, remedy = DAMAGED[name]
    write(tmp_path / name)
    with pytest.raises(DataError) as caught:
        read_recording(tmp_path / name)
    assert remedy in str(caught.value)


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("units", ["", "s{d}N\n"])
@pytest.mark.parametrize(
    "preamble",
    [
        "serial{d} A12\ngain{d} 6{d} 0.5\n",
        "serial{d} A12\ngain{d} 6\noperator{d} Ann\n",
        "rig\nserial{d} A12\ngain{d} 6{d} 0.5\nrange{d} 1{d} 2{d} 3{d} N\n\n",
        "session of Monday\n0.98{d} 1.02\n",
        "0.98{d} 1.02\n",
    ],
)
def test_pairs_of_metadata_are_no_names(tmp_path, preamble, units, delimiter):
    path = tmp_path / "log.txt"
    rows = "".join(f"{k / 10}{{d}}{k}.5\n" for k in range(40))
    names = "time_s{d}force_n\n"
    path.write_text((preamble + names + units + rows).format(d=delimiter))
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.channels["force"], np.arange(40) + 0.5)


def test_a_biotac_log_is_named_with_the_way_to_convert_it(tmp_path):
    path = tmp_path / "run.btd"
    path.write_bytes(b"\x01\x02" * 100)
    with pytest.raises(DataError, match=r"SynTouch BioTac log.*save it as text"):
        read_recording(path)


def test_a_table_without_names_and_time_has_columns_and_a_rate(tmp_path):
    path = tmp_path / "bare.txt"
    path.write_text("".join(f"{k},0.1,7,8,\n" for k in range(20)))
    recording = read_recording(path, columns=("fx_n", "fy_un", "..."), rate=50.0)
    assert list(recording.channels) == ["fx", "fy"]
    np.testing.assert_allclose(recording.channels["fy"], 1e-7, rtol=EXACT)
    np.testing.assert_allclose(recording.time, np.arange(20) / 50, rtol=EXACT)


def test_volts_are_newtons_by_a_stated_gain(tmp_path):
    path = tmp_path / "volts.csv"
    path.write_text("time_s,ai1\n" + "".join(f"{k / 10},{k}\n" for k in range(9)))
    recording = read_recording(path, mapping={"f": "ai1"}, units={"f": "500 mN/V"})
    np.testing.assert_allclose(recording.channels["f"], 0.5 * np.arange(9), rtol=EXACT)


def test_a_table_in_the_preamble_is_not_that_of_the_samples(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text(
        "Protocol\tvalue\ttext\n0.2\tRamp\t6, 0.5\n\ntime_s\tforce_n\n"
        + "".join(f"{k / 10}\t{k}.5\n" for k in range(40))
    )
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.channels["force"], np.arange(40) + 0.5)


# As the two generations of ROS print a list of messages.
FINGERS = {
    "ROS 1": (
        "header: \n  seq: {k}\n  stamp: \n    secs: 16\n    nsecs: {ns}\nbt_data: \n",
        "  - \n    bt_serial: '{i}'\n    pdc_data: {p}\n    pac_data: [{p}, 7]\n",
    ),
    "ROS 2": (
        "header:\n  seq: {k}\n  stamp:\n    secs: 16\n    nsecs: {ns}\nbt_data:\n",
        "- bt_serial: '{i}'\n  pdc_data: {p}\n  pac_data:\n  - {p}\n  - 7\n",
    ),
}


def hand(ros: str, n_fingers: int) -> str:
    """Eight messages of a hand; finger i reads i hundreds and the count of messages."""
    head, finger = FINGERS[ros]
    return "".join(
        head.format(k=k, ns=10_000_000 * k)
        + "".join(finger.format(i=i, p=100 * i + k) for i in range(n_fingers))
        + "hand: 3\n---\n"
        for k in range(8)
    )


@pytest.mark.parametrize("ros", FINGERS)
@pytest.mark.parametrize("finger", [0, 1, 2])
@pytest.mark.parametrize("name", ["pdc_data", "pac_data[0]"])
def test_each_element_of_a_printed_list_is_a_column(ros, finger, name, write):
    recording = read_recording(
        write(hand(ros, 3), "echo.txt"),
        mapping={"p": f"bt_data[{finger}].{name}", "hand": "hand"},
        units={"p": "counts", "hand": "au"},
    )
    assert recording.channels["p"].tolist() == [100 * finger + k for k in range(8)]
    assert set(recording.channels["hand"]) == {3.0}


@pytest.mark.parametrize("ros", FINGERS)
def test_a_name_without_index_is_refused_where_there_are_several(ros, write):
    path = write(hand(ros, 2), "echo.txt")
    with pytest.raises(
        DataError,
        match=r"names no column but the elements bt_data\[0\]\.pdc_data, "
        r"bt_data\[1\]\.pdc_data; state one of them",
    ):
        read_recording(path, mapping={"p": "bt_data.pdc_data"}, units={"p": "counts"})


@pytest.mark.parametrize("ros", FINGERS)
@pytest.mark.parametrize("unit", ["p", "bt_data.pdc_data"])
def test_the_index_of_a_list_of_one_goes_without_saying(ros, unit, write):
    recording = read_recording(
        write(hand(ros, 1), "echo.txt"),
        mapping={"p": "bt_data.pdc_data"},
        units={unit: "counts"},
    )
    assert recording.channels["p"].tolist() == list(range(8))


def forces(texts) -> str:
    """What `rostopic echo` prints of a wrench, with its force as these texts."""
    return "".join(
        ECHO.format(k=k, ns=10_000_000 * k, x=text) for k, text in enumerate(texts)
    )


WRENCH = {"mapping": {"f": "wrench.force.x"}, "units": {"f": "n"}}


@pytest.mark.parametrize("missing", ["nan", ".nan", "-nan", "NaN"])
def test_a_missing_number_of_a_message_is_a_missing_sample(missing, write):
    path = write(forces([0, 1, missing, 3, missing, 5]), "echo.txt")
    with pytest.raises(DataError, match=r"2 of 6 samples are missing \(lines 23, 45"):
        read_recording(path, **WRENCH)
    recording = read_recording(path, gaps="interpolate", **WRENCH)
    np.testing.assert_allclose(recording.channels["f"], np.arange(6), rtol=EXACT)


@pytest.mark.parametrize("word", ["12.3.4", "inf", "5,25", "true"])
def test_what_is_no_number_in_a_message_is_refused_where_it_is_needed(word, write):
    path = write(forces([0, 1, word, 3, 4, 5]), "echo.txt")
    with pytest.raises(
        DataError, match=f"line 31, column wrench.force.x: '{word}' is not "
    ):
        read_recording(path, **WRENCH)
    other = read_recording(path, mapping={"f": "wrench.force.y"}, units={"f": "n"})
    assert len(other.time) == 6


def test_a_list_keeps_its_indices_where_one_number_is_missing(write):
    path = write("".join(f"data: [nan, {k}]\n---\n" for k in range(6)), "echo.txt")
    recording = read_recording(
        path, mapping={"f": "data[1]"}, units={"f": "n"}, rate=10.0
    )
    assert recording.channels["f"].tolist() == list(range(6))


def test_a_message_that_was_cut_is_left_out_and_told(write):
    """The number of the last line, 5.25, was cut as well."""
    whole = forces([0, 1, 2, 3, 4, 5.25])
    path = write(whole[: whole.index("5.25") + 1], "echo.txt")
    recording = read_recording(path, **WRENCH)
    assert recording.channels["f"].tolist() == [0, 1, 2, 3, 4]
    assert recording.cautions == (
        "left out 1 of 6 records, which lack numbers of the others: that of line 56 "
        "has no wrench.force.x, wrench.force.y",
    )


@pytest.mark.parametrize(
    ("columns", "options"),
    [
        (("force_n",), {}),
        ((), {"mapping": {"force": "value"}, "units": {"force": "n"}}),
    ],
)
def test_a_field_that_is_printed_alone_has_a_rate(columns, options, write):
    path = write("".join(f"{k / 4}\n---\n" for k in range(6)), "echo.txt")
    recording = read_recording(path, columns=columns, rate=10.0, **options)
    assert recording.channels["force"].tolist() == [k / 4 for k in range(6)]


@pytest.mark.parametrize(
    "warning",
    [
        "WARNING: topic [/finger] does not appear to be published yet\n",
        "WARNING: no messages received and simulated time is active.\n"
        "Is /clock being published?\n",
    ],
)
def test_a_warning_before_the_messages_is_passed_over(warning, write):
    recording = read_recording(write(warning + forces(range(6)), "echo.txt"), **WRENCH)
    assert recording.channels["f"].tolist() == list(range(6))
    assert recording.cautions == ()


def test_the_stamp_of_ros_2_is_the_clock(write):
    text = "".join(
        f"header:\n  stamp:\n    sec: {16 + k // 4}\n"
        f"    nanosec: {k % 4 * 250_000_000}\n  frame_id: base\ndata: {k}\n---\n"
        for k in range(8)
    )
    recording = read_recording(
        write(text, "echo.txt"), mapping={"f": "data"}, units={"f": "n"}
    )
    np.testing.assert_allclose(recording.time, 16 + np.arange(8) / 4, rtol=EXACT)
