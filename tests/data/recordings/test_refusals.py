"""Recordings that are refused, and the sentence for each.

Excluded: what is read, if need be with a note (`test_recording`).
"""

import gzip

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.data.text import csv_reader
from pushfit.errors import ConfigError, DataError
from tests.data.recordings.makers import GOOD, refusal


def test_a_clock_is_no_example_of_a_signal(write):
    error = refusal(write("t,force\n0,1\n1,2\n2,1\n"))
    assert "`mapping={'force': 'force'}, units={'force': 'n'}`" in "".join(
        p.message for p in error.problems
    )


REFUSED = {
    # what the file is
    "empty": ("", {}, "empty_file", ["0 data rows"]),
    "blank_lines_only": (
        "\n \n\n",
        {},
        "empty_file",
        ["blank lines only", "export it"],
    ),
    "header_only": ("time_s,force_n\n", {}, "no_rows", ["0 data rows", "export it"]),
    "spreadsheet": (
        b"PK\x03\x04xl/",
        {},
        "not_csv",
        ["xlsx", "export the sheet as CSV"],
    ),
    "web_page": ("<!DOCTYPE html><p>404", {}, "not_csv", ["web page", "download"]),
    "lfs_pointer": (
        "version https://git-lfs.github.com/spec/v1\noid sha256:1\n",
        {},
        "not_csv",
        ["Git LFS pointer", "git lfs pull"],
    ),
    "journal": (
        '{"event": "start", "ask": ["theta_c"]}',
        {},
        "not_csv",
        ["journal of an exploration", "peaks.csv"],
    ),
    "json": ('{"time": [0, 1]}', {}, "not_csv", ["JSON", "export"]),
    "cut_gzip": (gzip.compress(GOOD.encode())[:-12], {}, "bad_gzip", ["copy the file"]),
    "latin_1": (
        GOOD.encode() + "0.03,1.2µ\n".encode("latin-1"),
        {},
        "bad_encoding",
        [f"byte {len(GOOD) + 8}", "encoding="],
    ),
    "utf_16_without_mark": (
        GOOD.encode("utf-16-le"),
        {},
        "bad_encoding",
        ["UTF-16", "encoding='utf-16-le'"],
    ),
    # zero bytes
    "zero_bytes_at_the_end": (
        GOOD.encode() + bytes(100),
        {},
        "nul_bytes",
        [f"byte {len(GOOD)}", "tail='salvage'"],
    ),
    "zero_bytes_inside": (
        GOOD.replace("1.25", "1\0").encode(),
        {"tail": "salvage"},
        "nul_bytes",
        ["damaged", "copy it again"],
    ),
    # fields
    "decimal_comma_between_commas": (
        "t_s,p_kpa\n0,01,1,5\n0,02,1,6\n",
        {},
        "field_count",
        ["line 2", "4 fields", "2 columns", "semicolons"],
    ),
    "mixed_decimal_marks": (
        "t_s;p_kpa\n0,01;1.5\n0,02;1.6\n",
        {},
        "ambiguous_decimal",
        ["line 2", "mixed", "decimal points"],
    ),
    "words_where_readings_belong": (
        "time_s,force_n\nearly,low\nlate,high\n",
        {},
        "no_table",
        ["line 2", "no number", "'early', 'low'"],
    ),
    "an_extra_field_that_is_not_empty": (
        "time_s,force_n\n0,1,\n0.01,2,5\n",
        {},
        "field_count",
        ["line 3", "3 fields", "2 columns"],
    ),
    "a_name_too_many_by_a_leading_tab": (
        "\ttime_s\tforce_n\n0\t1\n0.01\t2\n",
        {},
        "field_count",
        ["line 2", "2 fields", "names 3 columns"],
    ),
    "ragged_row": (
        GOOD + "0.03\n0.04,1\n",
        {},
        "field_count",
        ["line 5", "1 fields", "2 columns", "mend or remove the row"],
    ),
    "quote_without_end": (GOOD + '0.03,"1\n0.04,1\n', {}, "bad_quotes", ["line 5"]),
    # The end, case 10
    "no_line_end_when_strict": (
        GOOD[:-1],
        {"tail": "error"},
        "no_final_newline",
        ["line 4", "cut inside a number"],
    ),
    # names
    "doubled_name": (
        "time_s,force_n,Force_N\n0,1,2\n1,2,3\n",
        {},
        "duplicate_column",
        ["'force_n'", "'Force_N'", "rename one"],
    ),
    "pandas_copy_of_a_name": (
        "time_s,force_n,force_n.1\n0,1,2\n1,2,3\n",
        {},
        "duplicate_column",
        ["'force_n.1'"],
    ),
    "two_columns_for_one_channel": (
        "time_s,p_kpa,p_counts\n0,1,2\n1,2,3\n",
        {},
        "duplicate_channel",
        ["p_kpa and p_counts", "'p'"],
    ),
    "mapped_column_is_missing": (
        "time_s,pdc_data\n0,1\n1,2\n",
        {"mapping": {"pressure": "pdc_dat"}, "units": {"pressure": "counts"}},
        "missing_column",
        ["did you mean 'pdc_data'?"],
    ),
    "no_unit_on_any_signal": (
        "time_s,pdc\n0,2400\n1,2500\n",
        {},
        "no_channel",
        ["time_s, pdc", "`mapping={'pressure': 'pdc'}, units={'pressure': 'counts'}`"],
    ),
    "no_unit_on_a_mapped_signal": (
        "time_s,pdc\n0,2400\n1,2500\n",
        {"mapping": {"pressure": "pdc"}},
        "missing_unit",
        ["column pdc", "rename it to pdc_counts", "`units={'pressure': 'counts'}`"],
    ),
    "no_unit_on_time": (
        "timestamp,force_n\n0,1\n1,2\n",
        {},
        "missing_unit",
        ["column timestamp", "timestamp_s", "`units={'time': 's'}`"],
    ),
    "clock_that_is_coarser_than_the_samples": (
        "time_s,force_n\n0,1\n0,1\n0,2\n1,1\n1,2\n1,3\n",
        {},
        "coarse_clock",
        ["line 3", "4 of 6 times", "`rate=100`"],
    ),
    "milliseconds_since_1970_taken_for_seconds": (
        "time_s,force_n\n1746266400000,1\n1746266400010,2\n1746266400020,1\n",
        {},
        "implausible_time",
        ["1.75e+12 s", "perhaps ms"],
    ),
    "date_of_another_form": (
        "timestamp,force_n\n03.05.2025 10:00:00.0,1\n03.05.2025 10:00:00.1,2\n",
        {},
        "other_date",
        ["column timestamp", "'03.05.2025 10:00:00.0'", "ISO 8601"],
    ),
    "time_of_day": (
        "time_s,force_n\n10:00:00.0,1\n10:00:00.1,2\n",
        {},
        "other_date",
        ["column time_s", "'10:00:00.0'", "or as seconds"],
    ),
    "no_unit_on_an_angle": (
        "time_s,force_n,theta\n0,1,30\n1,2,30\n",
        {},
        "missing_unit",
        ["column theta", "theta_deg"],
    ),
    "no_time": ("a,force_n\n0,1\n1,2\n", {}, "no_time", ["a, force_n", "time_s"]),
    "two_times": (
        "t_s,time_s,force_n\n0,0,1\n1,1,2\n",
        {},
        "ambiguous_time",
        ["t_s, time_s", "`mapping={'time': 't_s'}`"],
    ),
    "appended_log": (
        GOOD + GOOD,
        {},
        "repeated_header",
        ["line 5", "header of line 1", "split the file"],
    ),
    "no_names": (
        "0,1.5\n0.01,1.6\n",
        {},
        "no_header",
        ["line 1", "`columns=['time_s'"],
    ),
    # cells
    "word": (
        GOOD + "0.03,abc\n",
        {},
        "not_a_number",
        ["line 5", "pressure_kpa", "'abc'"],
    ),
    "truth_value": ("time_s,p_n\n0,True\n1,False\n", {}, "not_a_number", ["'True'"]),
    "thousands": (GOOD + '0.03,"1,500.2"\n', {}, "not_a_number", ["'1,500.2'"]),
    "hexadecimal": (GOOD + "0.03,0x1F\n", {}, "not_a_number", ["'0x1F'"]),
    "dash": (GOOD + "0.03,-\n", {}, "not_a_number", ["'-'"]),
    "excel_error": (GOOD + "0.03,#N/A\n", {}, "not_a_number", ["'#N/A'"]),
    "not_available": (GOOD + "0.03,NA\n", {}, "not_a_number", ["'NA'"]),
    "underscore": (GOOD + "0.03,1_0\n", {}, "not_a_number", ["'1_0'"]),
    "no_break_space": (GOOD + "0.03,\xa01\n", {}, "not_a_number", [r"'\xa01'"]),
    "arabic_digit": (GOOD + "0.03,\u0663\n", {}, "not_a_number", ["'\u0663'"]),
    "too_large": (
        GOOD,
        {"max_bytes": 40},
        "too_large",
        ["3 rows of 2 columns", "4.8e-08 GB", "max_bytes"],
    ),
    # values
    "missing_sample": (
        GOOD + "0.03,\n0.04,nan\n",
        {},
        "missing_samples",
        ["line 5", "2 of 5 samples", "lines 5, 6", "gaps='split'", "interpolate"],
    ),
    "all_samples_missing": ("t_s,p_n\n0,\n1,\n", {}, "no_samples", ["column p"]),
    "infinite": (GOOD + "0.03,-inf\n", {}, "not_finite", ["line 5", "'-inf'"]),
    "overflow": (GOOD + "0.03,1e999\n", {}, "not_finite", ["'1e999'"]),
    "large_exponent": (GOOD + "0.03,4e492493924924\n", {}, "not_finite", ["4e4924"]),
    "missing_time": (GOOD + ",1\n", {}, "missing_time", ["line 5", "1 of 4 times"]),
    "time_twice": (
        GOOD + "0.02,1\n",
        {},
        "time_not_increasing",
        ["line 5", "0.02 s comes twice"],
    ),
    "time_goes_back": (
        GOOD + "0.01,1\n",
        {},
        "time_not_increasing",
        ["line 5", "from 0.02 to 0.01", "split the file"],
    ),
    "nanoseconds_as_seconds": (
        "time_s,p_n\n" + "".join(f"{k}0000000,1\n" for k in range(1, 6)),
        {},
        "implausible_time",
        ["step of 1e+07 s", "perhaps ns"],
    ),
    "seconds_as_nanoseconds": (
        "time_ns,p_n\n1,1\n2,1\n3,1\n",
        {},
        "implausible_time",
        ["step of 1e-09 s", "perhaps s"],
    ),
    "counts_as_kilopascals": (
        "time_s,p_kpa\n0,2440\n1,2441\n2,2450\n",
        {},
        "implausible_unit",
        ["column p", "median 2441", "24.1 times", "counts"],
    ),
    "pascals_as_kilopascals": (
        "time_s,p_kpa\n0,98447.75\n1,98448.5\n",
        {},
        "implausible_unit",
        ["972 times atmospheric", "unit pa"],
    ),
    "radians_as_degrees": (
        "time_s,p_n,theta_deg,alpha_deg\n0,1,0.5,3.1\n1,1,1.2,0\n",
        {},
        "implausible_unit",
        ["|theta| <= 1.2", "radians", "rad"],
    ),
    "degrees_as_radians": (
        "time_s,p_n,theta_rad\n0,1,45\n1,1,30\n",
        {},
        "implausible_unit",
        ["45 rad", "deg"],
    ),
    "more_than_a_turn": (
        "time_s,p_n,alpha_deg\n0,1,400\n1,1,30\n",
        {},
        "implausible_unit",
        ["400 degrees", "full turn"],
    ),
    "elevation_beyond_a_right_angle": (
        "time_s,p_n,theta_deg\n0,1,45\n1,1,97\n",
        {},
        "angle_out_of_range",
        ["line 3", "97°", "[-90°, 90°]", "theta_from='normal'"],
    ),
    "sentinel": (
        GOOD + "0.03,-3.697314E28\n",
        {},
        "sentinel",
        ["line 5", "-3.697314e+28", "missing=["],
    ),
}
PRESSED = [round(abs(k % 40 - 20) * 0.371, 3) for k in range(200)]


def coded(code, rows, *, pressed=PRESSED):
    """A recording of forces, with a code in some rows."""
    cells = {k: code for k in rows}
    lines = (f"{k / 100:g},{cells.get(k, force)}\n" for k, force in enumerate(pressed))
    return "time_s,force_n\n" + "".join(lines)


@pytest.mark.parametrize(
    ("code", "found"),
    [("-999", "-999"), ("9999.00", "9999"), ("-32768", "-32768"), ("1e30", "1e+30")],
)
def test_a_code_for_missing_samples_is_refused_and_how_to_have_it_missing(
    code, found, write
):
    path = write(coded(code, [17, 18, 90]))
    (problem,) = refusal(path).problems
    assert (problem.code, problem.column, problem.line) == ("sentinel", "force", 19)
    assert f"3 samples of {found} (lines 19, 20, 92)" in problem.message
    assert f"`missing=['{found}']` and `gaps='split'`" in problem.message
    assert "gaps=" not in str(refusal(path, gaps="interpolate"))
    signal = read_recording(path, missing=[found], gaps="split").channels["force"]
    assert np.flatnonzero(np.isnan(signal)).tolist() == [17, 18, 90]


def test_a_code_is_a_reading_if_told_but_not_beyond_any_unit(write):
    told = read_recording(write(coded("-999", [17])), trust_units=True)
    assert any("taken as readings as told" in note for note in told.notes)
    assert told.channels["force"].min() == -999
    error = refusal(write(coded("1e30", [17])), trust_units=True)
    assert "trust_units" not in str(error)


def test_a_number_far_from_all_others_is_a_code_only_if_it_comes_again(write):
    assert refusal(write(coded("-12345", [3, 4]))).code == "sentinel"
    assert read_recording(write(coded("-12345", [3]))).time.size == len(PRESSED)
    # Of many samples a few are looked at first.
    error = refusal(write(coded("-12345", [3, 8001], pressed=PRESSED * 100)))
    assert "2 samples of -12345 (lines 5, 8003)" in str(error)


@pytest.mark.parametrize(
    ("name", "step", "told"),
    [("s", 10, "time_ms"), ("s", 1, "time_ms"), ("ms", 0.01, "time_s"), ("s", 0.1, "")],
)
def test_times_in_another_unit_are_told_of(name, step, told, write):
    """Samples at 100 Hz and 1 kHz in milliseconds, and in seconds; those at 10 Hz."""
    rows = (f"{k * step:g},{force}\n" for k, force in enumerate(PRESSED))
    cautions = read_recording(write(f"time_{name},force_n\n" + "".join(rows))).cautions
    assert len(cautions) == (told != "")
    assert all(f"as {told}" in caution for caution in cautions)


@pytest.mark.parametrize("top", [999, 4095, 9999, 32767])
def test_the_end_of_a_sensor_is_no_code(top, write):
    """Readings pile up there, and lie on the way as well."""
    counts = [min(round(top / 5 * force), top) for force in PRESSED]
    text = coded(str(top), [], pressed=counts).replace("force_n", "pdc_counts")
    assert read_recording(write(text)).channels["pdc"].max() == top


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_trusted_is_refused_with_place_and_remedy(case, write):
    """Every fault names the file, the place, the value and the next step."""
    content, options, code, fragments = REFUSED[case]
    path = write(content)
    error = refusal(path, **options)
    assert isinstance(error, DataError), error
    assert error.code == code, error
    assert str(error).startswith(str(path))
    assert [f for f in fragments if f not in str(error)] == [], error
    assert error.problems
    assert error.problems[0].message in str(error)


USAGE = {
    "mapping_for_nothing": (
        {"units": {"presure": "kpa"}},
        "unit_for_nothing",
        "pressure",
    ),
    "contradicted_suffix": (
        {"units": {"pressure": "counts"}},
        "unit_conflict",
        "kpa by its name, but counts by `units={'pressure': 'counts'}`",
    ),
    "unknown_unit": (
        {"units": {"pressure": "kp"}},
        "unknown_unit",
        "did you mean 'kpa'",
    ),
    "wrong_format": ({"format": "rostopic"}, "format_mismatch", "time_s, pressure_kpa"),
    "unknown_encoding": ({"encoding": "utf-9"}, "unknown_encoding", "try utf-8"),
}


@pytest.mark.parametrize("case", USAGE)
def test_options_that_do_not_fit_are_the_users_error(case, write):
    options, code, fragment = USAGE[case]
    error = refusal(write(GOOD), **options)
    assert isinstance(error, ConfigError)
    assert error.code == code
    assert fragment in str(error)


def test_a_missing_path_names_the_nearest_one(write):
    path = write(GOOD)
    error = refusal(path.with_name("pusch.csv"))
    assert error.code == "file_not_found"
    assert f"did you mean {path}?" in str(error)


def test_a_hyphen_names_no_file():
    assert "save what comes from it as a file" in str(refusal("-"))


def test_a_missing_path_names_no_other_that_only_ends_alike(write):
    error = refusal(write(GOOD, "strval.toml").with_name("truth.toml"))
    assert "did you mean" not in str(error)


def test_a_folder_is_not_a_recording(tmp_path, write):
    assert refusal(tmp_path).code == "is_a_folder"
    path = write(GOOD)
    assert str(refusal(path.parent)).endswith(f"name the files in it, such as {path}")


def test_a_bag_that_is_still_recorded_is_refused(write):
    error = refusal(write(b"#ROSBAG V2.0\n", "push.bag.active"))
    assert error.code == "bag_active"
    assert "rosbag reindex" in str(error)


def test_a_small_zip_that_grows_without_end_is_refused(write):
    blanks = gzip.compress(GOOD.encode() + b"\n" * (70 << 20), compresslevel=9)
    assert refusal(write(blanks)).code == "zip_bomb"


def test_all_problems_of_a_file_are_listed_at_once(write):
    path = write("time,p_kpa,p_n\n0,1,2\n1,2\n2,3,4,5\n")
    problems = refusal(path).problems
    assert [(p.code, p.line) for p in problems] == [
        ("missing_unit", 1),
        ("duplicate_channel", 1),
        ("field_count", 3),
        ("field_count", 4),
    ]


def test_bad_cells_are_listed_up_to_ten_and_counted(write):
    rows = "".join(f"{0.03 + k / 100:.2f},x{k}\n" for k in range(25))
    problems = refusal(write(GOOD + rows)).problems
    assert [p.line for p in problems[:-1]] == list(range(5, 15))
    assert problems[-1].message.endswith(
        "15 more of 25 problems 'not_a_number' are not listed"
    )


def test_a_file_that_changes_while_it_is_read_is_refused(write, monkeypatch):
    path = write(GOOD)
    real_scan = csv_reader.fast_scan

    def append_meanwhile(*args):
        with path.open("a") as file:
            file.write("0.03,1\n")
        return real_scan(*args)

    monkeypatch.setattr(csv_reader, "fast_scan", append_meanwhile)
    error = refusal(path)
    assert error.code == "file_changed"
    assert "read it again" in str(error)
