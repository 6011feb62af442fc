"""Every writer's CSV, with the options its user would give, holds the same samples."""

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.data.text.dialects import find_layout
from pushfit.data.text.layout_guess import split_line
from pushfit.data.text.textfile import open_text
from pushfit.errors import ConfigError, DataError

NS = 1_581_073_084_690_542_596
PDC = [2400.0, 2410.0, 2455.0]
# Epoch seconds have 10 digits before the point, so float64 resolves 0.24 µs.
EPOCH_RESOLUTION = 2.5e-7


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "log.csv"
        path.write_text(text)
        return path

    return write


ROSTOPIC = (
    "%time,field.header.seq,field.header.stamp,field.hand_id,field.bt_data0.pdc_data\n"
    + "".join(
        f"{NS + 10_000_000 * k + 777},{k},{NS + 10_000_000 * k},left,{pdc:g}\n"
        for k, pdc in enumerate(PDC)
    )
)
PDC_OPTIONS = {
    "mapping": {"pressure": "field.bt_data0.pdc_data"},
    "units": {"pressure": "counts"},
}


def test_rostopic_echo_gives_counts_at_the_stamps_of_the_sensor(write):
    recording = read_recording(write(ROSTOPIC), **PDC_OPTIONS)
    np.testing.assert_array_equal(recording.channels["pressure"], PDC)
    expected = NS / 1e9 + 0.01 * np.arange(3)
    np.testing.assert_allclose(recording.time, expected, rtol=0, atol=EPOCH_RESOLUTION)
    assert recording.sources[0].dialect.startswith("rostopic echo -p")
    assert "time from field.header.stamp" in recording.notes[0]


def test_stamps_that_nobody_filled_in_give_way_to_the_time_of_receipt(write):
    lines = ROSTOPIC.splitlines(keepends=True)
    for k in range(1, 4):
        cells = lines[k].split(",")
        lines[k] = ",".join([*cells[:2], "0", *cells[3:]])
    recording = read_recording(write("".join(lines)), **PDC_OPTIONS)
    assert "time from %time" in recording.notes[0]
    np.testing.assert_allclose(np.diff(recording.time), 0.01, atol=2 * EPOCH_RESOLUTION)


def test_nanoseconds_keep_digits_that_a_float_would_lose(write):
    """19 digits do not fit a float64: rounded first, 2 µs steps would be uneven."""
    path = write("time_ns,p_n\n" + "".join(f"{NS + 2000 * k},1\n" for k in range(50)))
    # Seconds of ten digits resolve 0.24 µs; nanoseconds as float64 only 0.26 µs more.
    expected = NS // 10**9 + (NS % 10**9 + 2000 * np.arange(50)) / 1e9
    np.testing.assert_array_equal(read_recording(path).time, expected)


def test_a_blank_stamp_is_not_read_as_a_number(write):
    lines = ROSTOPIC.replace(f"{NS},left", ",left")
    with pytest.raises(DataError, match=r"line 2, column field\.header\.stamp: ''"):
        read_recording(write(lines), **PDC_OPTIONS)


@pytest.mark.parametrize("clock", ["time", "__time"])
def test_plotjuggler_rows_of_other_topics_are_dropped(clock, write):
    text = (
        f"{clock},/biotac/pdc,/arm/effort\n"
        "0.000000,2400,\n0.004000,,1.5\n0.010000,2410,\n0.020000,2455,\n"
    )
    options = {"mapping": {"pressure": "/biotac/pdc"}, "units": {"pressure": "counts"}}
    recording = read_recording(write(text), **options)
    np.testing.assert_array_equal(recording.channels["pressure"], PDC)
    np.testing.assert_array_equal(recording.time, [0, 0.01, 0.02])
    assert recording.sources[0].dialect.startswith("PlotJuggler")
    assert any("dropped 1 of 4 rows" in note for note in recording.notes)


def test_plotjuggler_channels_on_two_clocks_need_a_gap_policy(write):
    text = "__time,/a_n,/b_n\n0,1,\n0.01,,5\n0.02,3,\n0.03,,7\n"
    path = write(text)
    with pytest.raises(DataError, match="column /a: 2 of 4 samples are missing"):
        read_recording(path)
    recording = read_recording(path, gaps="interpolate")
    np.testing.assert_array_equal(recording.channels["/a"], [1, 2, 3, np.nan])
    np.testing.assert_array_equal(recording.channels["/b"], [np.nan, 5, 6, 7])


def test_mcap_cat_times_are_read_to_the_nanosecond(write):
    text = "log_time,publish_time,sequence,bt_data.0.pdc_data\n" + "".join(
        f"2020-02-07T10:58:{4 + k // 100:02d}.{690542596 + k:09d}Z,,{k},{pdc:g}\n"
        for k, pdc in zip((0, 2000, 4000), PDC, strict=True)
    )
    options = {
        "mapping": {"pressure": "bt_data.0.pdc_data"},
        "units": {"pressure": "counts"},
    }
    recording = read_recording(write(text), **options)
    np.testing.assert_array_equal(recording.channels["pressure"], PDC)
    assert recording.sources[0].dialect.startswith("mcap cat")
    # date -d 2020-02-07T10:58:04Z +%s
    seconds = recording.time[0] - 0.690542596
    np.testing.assert_allclose(seconds, 1581073084, rtol=0, atol=EPOCH_RESOLUTION)


@pytest.mark.parametrize(
    ("cell", "value"),
    [("2020-02-07", "'2020-02-07'"), ("2020-02-07T10:58:04", "'2020-02-07T10:58:04'")],
)
def test_a_time_without_clock_or_zone_is_refused(cell, value, write):
    text = f"log_time,publish_time,p_n\n2020-02-07T10:58:04Z,,1\n{cell},,2\n"
    with pytest.raises(
        DataError, match=f"line 3, column log_time: {value} is not a time"
    ):
        read_recording(write(text))


ROS2 = "".join(
    f"{NS // 10**9},{NS % 10**9 + 10_000_000 * k},finger,{pdc:g}\n"
    for k, pdc in enumerate(PDC)
)
ROS2_COLUMNS = ["header.stamp.sec", "header.stamp.nanosec", "frame_id", "pdc_counts"]


def test_ros2_echo_joins_seconds_and_nanoseconds(write):
    recording = read_recording(write(ROS2), columns=ROS2_COLUMNS)
    np.testing.assert_array_equal(recording.channels["pdc"], PDC)
    expected = NS / 1e9 + 0.01 * np.arange(3)
    np.testing.assert_allclose(recording.time, expected, rtol=0, atol=EPOCH_RESOLUTION)
    assert (
        recording.sources[0].dialect == "ros2 topic echo --csv: comma, columns as given"
    )


def test_a_file_without_names_is_read_with_names_from_the_user(write):
    recording = read_recording(write("0,1.5\n0.01,1.6\n"), columns=["time_s", "p_n"])
    np.testing.assert_array_equal(recording.channels["p"], [1.5, 1.6])


def test_names_from_the_user_must_name_every_field(write):
    said = "lines 1–2: 2 fields, but 3 columns were named"
    with pytest.raises(DataError, match=said):
        read_recording(write("0,1.5\n0.01,1.6\n"), columns=["time_s", "p_n", "q_n"])


def test_names_from_the_user_do_not_replace_a_header(write):
    with pytest.raises(ConfigError, match="line 1 seems to hold names"):
        read_recording(write("a,b\n0,1.5\n0.01,1.6\n"), columns=["time_s", "p_n"])


def test_the_skipped_preamble_is_told(write):
    text = "Rig,7\nOperator,Anna,x\n\ntime_s,p_n\n0,1\n0.01,2\n"
    layout = find_layout(open_text(write(text)))
    assert layout.header_line == 4
    assert layout.data_line == 5
    assert layout.notes == ("skipped 2 lines before line 4",)


def test_a_semicolon_inside_some_cells_is_no_delimiter(write):
    text = "push,height_n,flags\n1,2.5,gap;outlier\n2,2.6,\n"
    assert find_layout(open_text(write(text))).delimiter == ","


def test_split_line_honours_quotes_and_runs_of_blanks():
    assert split_line('1, "a,b" ,2', ",") == ["1", "a,b", "2"]
    assert split_line("  1\t 2  3 ", " ") == ["1", "2", "3"]
