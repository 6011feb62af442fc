"""Logs of ROS nodes are read whatever their words, where these cannot be misread."""

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import ConfigError, DataError
from tests.data.recordings.makers import refusal
from tests.tolerances import EXACT

# Times since 1970 keep a quarter of a microsecond of a step of 10 ms.
STAMPS = 1e-4
FORCE = np.arange(6) / 4


def test_a_rospy_log_with_values_below_their_names_is_read(tmp_path):
    path = tmp_path / "node.log"
    path.write_text(
        "".join(
            f"[INFO] [{1600000000 + k / 100:.2f}]: pdc:\n{2000 + k}\n" for k in range(6)
        )
    )
    recording = read_recording(path, mapping={"p": "pdc"}, units={"p": "counts"})
    assert recording.channels["p"].tolist() == [2000.0 + k for k in range(6)]


@pytest.mark.parametrize(
    "line",
    [
        "[rosout][INFO] 2020-09-13 12:26:4{s},{ms}0: {text}",
        "160000000{s}.{ms} INFO /bio [bio.py:12(run)] [topics: /rosout, /p] {text}",
        "[INFO] [160000000{s}.{ms}] [bio]: {text}",
        # As a node in C++ prints it, also in simulated time.
        "[ INFO] [160000000{s}.{ms}3456789]: {text}",
        "[ WARN] [160000000{s}.{ms}3456789, 23.400000000]: {text}",
    ],
)
def test_a_log_of_ros_is_read_past_what_is_no_reading(tmp_path, line):
    path = tmp_path / "node.log"
    texts = ["started, pid: 3", *(f"pdc: {2000 + k} tdc={k}" for k in range(8))]
    path.write_text(
        "".join(
            line.format(s=k // 4, ms=f"{25 * (k % 4):02}", text=text) + "\n"
            for k, text in enumerate(texts)
        )
    )
    recording = read_recording(path, mapping={"p": "pdc"}, units={"p": "counts"})
    assert recording.channels["p"].tolist() == [2000.0 + k for k in range(8)]
    np.testing.assert_allclose(np.diff(recording.time), 0.25, rtol=STAMPS)


@pytest.mark.parametrize(
    "line", ["f (N) {f}, state=3", "state=3, f {f} N;", "n: 7, f {f} N, state: 3"]
)
def test_numbers_in_words_beside_pairs_are_read_as_well(tmp_path, line):
    path = tmp_path / "node.log"
    rows = [f"[INFO] [160000000{k}.5]: {line.format(f=f)}" for k, f in enumerate(FORCE)]
    path.write_text("\n".join(rows))
    assert read_recording(path).channels["f"].tolist() == FORCE.tolist()


def test_a_number_in_words_with_a_decimal_comma_is_not_cut_at_it(tmp_path):
    path = tmp_path / "node.log"
    rows = [f"[INFO] [160000000{k}.5]: f {k},5, p={k}" for k in range(6)]
    path.write_text("\n".join(rows))
    recording = read_recording(path, mapping={"p": "p"}, units={"p": "n"})
    assert [*recording.channels] == ["p"]


def test_a_rospy_log_of_bare_numbers_has_one_column(tmp_path):
    path = tmp_path / "node.log"
    path.write_text(
        "".join(f"[INFO] [{1600000000 + k / 100:.2f}]: {k / 4}\n" for k in range(6))
    )
    recording = read_recording(path, mapping={"p": "value"}, units={"p": "kpa"})
    assert recording.channels["p"].tolist() == [k / 4 for k in range(6)]


def lines(form: str, start: int = 0) -> str:
    """What a node prints of a force, by a form with the place of its number."""
    return "".join(
        f"[INFO] [{1600000000 + start + k / 100:.2f}]: {form.format(x=x)}\n"
        for k, x in enumerate(FORCE)
    )


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("force {x}", "force"),
        ("force\t{x}", "force"),
        ("Force is {x}.", "Force"),
        ("[0.1, -2e-1, {x}]", "value[2]"),
        ("(0.1 {x})", "value[1]"),
        ("wrench: [0.1, {x}]", "wrench[1]"),
        (" [finger.ft]: [0.1 {x}]", "value[1]"),
    ],
)
def test_a_number_in_a_sentence_or_a_list_is_read(form, name, write):
    path = write(lines(form), "node.log")
    recording = read_recording(path, mapping={"f": name}, units={"f": "n"})
    np.testing.assert_array_equal(recording.channels["f"], FORCE)
    np.testing.assert_allclose(np.diff(recording.time), 0.01, rtol=STAMPS)


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("Force is {x} N", "Force"),
        ("force {x}N.", "force"),
        ("force (N): {x}", "force"),
        ("force [N]={x}, depth (mm): 0.5", "force"),
        ("force (N) {x}", "force"),
    ],
)
def test_the_unit_beside_a_number_is_that_of_the_channel(form, name, write):
    recording = read_recording(write(lines(form), "node.log"))
    assert recording.units == {name: "n"}
    np.testing.assert_array_equal(recording.channels[name], FORCE)


def test_colours_of_a_terminal_are_no_part_of_a_log(write):
    text = (
        lines("fz: {x}").replace("[INFO]", "\x1b[33m[WARN]").replace("\n", "\x1b[0m\n")
    )
    recording = read_recording(
        write(text, "node.log"), mapping={"f": "fz"}, units={"f": "n"}
    )
    np.testing.assert_array_equal(recording.channels["f"], FORCE)


def test_names_with_their_numbers_are_taken_before_sentences(write):
    """The second are three times as many, and are none of a sensor."""
    path = write(
        lines("fz: {x}") + "".join(lines("cycle {x}", 1 + k) for k in range(3)),
        "node.log",
    )
    recording = read_recording(path, mapping={"f": "fz"}, units={"f": "n"})
    np.testing.assert_array_equal(recording.channels["f"], FORCE)


def test_how_a_program_was_started_is_no_reading(write):
    """Words with a number once, beside two hundred lines of readings."""
    path = write(
        "[INFO] [1500000000.0]: node started, pid: 3\n"
        + "".join(lines("force {x}", k) for k in range(40)),
        "node.log",
    )
    recording = read_recording(path, mapping={"f": "force"}, units={"f": "n"})
    np.testing.assert_array_equal(recording.channels["f"], np.tile(FORCE, 40))


@pytest.mark.parametrize(
    "form",
    ["0.1 {x}", "F -> {x} N", "dropped {x} messages", "fx {x} fy 0.2", "F = <{x}>"],
)
def test_what_could_be_misread_is_shown_beside_what_is_understood(form, write):
    path = write("[INFO] [1500000000.0]: port 2 in use\n" + lines(form), "node.log")
    error = refusal(path)
    assert error.code == "no_rows"
    shown = form.format(x=FORCE[0])
    assert f"line 2: {shown!r} is no form of a reading that is underst" in str(error)
    assert "'force is 2.3 N'" in str(error)


def test_a_log_without_numbers_is_told_so(write):
    path = write("[INFO] [1500000000.0]: started\n[INFO] [1500000001.0]: ended\n")
    with pytest.raises(DataError, match="holds no record with a number; log the"):
        read_recording(path)


def test_the_columns_of_a_log_are_not_named_without_a_word(write):
    path = write(lines("fz: {x}"), "node.log")
    with pytest.raises(ConfigError, match="have names: time_s, fz; leave out columns"):
        read_recording(path, columns=("time_s", "force_n"))


@pytest.mark.parametrize(
    "form", ["force: {x} mN", "force = {x} [mN], n: 3", "n: 3 force: {x} mN."]
)
def test_the_unit_behind_a_number_is_that_of_the_channel(form, write):
    path = write(lines(form), "node.log")
    recording = read_recording(path, mapping={"f": "force"})
    np.testing.assert_allclose(recording.channels["f"], FORCE / 1000, rtol=EXACT)
    error = refusal(path, mapping={"f": "force"}, units={"f": "n"})
    assert error.code == "unit_conflict"
    assert "column force: the unit is mn by the file itself, but n by" in str(error)


def test_a_unit_that_changes_within_a_log_is_refused(write):
    path = write(lines("force: {x} mN") + lines("force: {x} N", 1), "node.log")
    error = refusal(path, mapping={"f": "force"})
    assert error.code == "unit_conflict"
    assert "line 7, column force: the unit is n here, but mn on the" in str(error)


def test_a_name_behind_a_number_is_no_unit(write):
    path = write(lines("fz: {x} n = 3 pa: 2"), "node.log")
    recording = read_recording(path, mapping={"f": "fz"}, units={"f": "counts"})
    np.testing.assert_array_equal(recording.channels["f"], FORCE)


@pytest.mark.parametrize("form", ["fz: {x}", "fz (N): {x}", "fz {x}", "[{x}, 2]"])
def test_a_missing_number_of_a_log_is_a_missing_sample(form, write):
    text = lines(form)
    path = write(text + lines(form, 1).replace("0.25", "nan"), "node.log")
    name = {"f": "value[0]" if "[" in form else form.split(":")[0].split(" {")[0]}
    error = refusal(path, mapping=name, units={"f": "n"})
    assert error.code == "missing_samples"
    assert "line 8, column f: 1 of 12 samples are missing (lines 8)" in str(error)


@pytest.mark.parametrize("word", ["12.3.4", "-inf", "5,25", "3x"])
def test_what_is_no_number_in_a_log_is_refused_where_it_is_needed(word, write):
    path = write(lines("fz: {x}, k: 2").replace("1.25", word), "node.log")
    error = refusal(path, mapping={"f": "fz"}, units={"f": "n"})
    assert f"line 6, column fz: '{word}' is not " in str(error)
    assert len(read_recording(path, mapping={"f": "k"}, units={"f": "n"}).time) == 6


def test_a_record_that_lacks_a_number_is_left_out_and_told(write):
    path = write(lines("fz: {x}, k: 2").replace("1.25, k: 2", "1.25"), "node.log")
    recording = read_recording(path, mapping={"f": "fz"}, units={"f": "n"})
    np.testing.assert_array_equal(recording.channels["f"], FORCE[:5])
    assert recording.cautions == (
        "left out 1 of 6 records, which lack numbers of the others: that of line 6 has "
        "no k",
    )


def test_numbers_before_the_first_line_of_a_log_have_no_time(write):
    path = write("args: a: 1 b: 2\n" + lines("fz: {x}"), "node.log")
    recording = read_recording(path, mapping={"f": "fz"}, units={"f": "n"})
    np.testing.assert_array_equal(recording.channels["f"], FORCE)
