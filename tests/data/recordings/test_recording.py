"""Reading recordings: what is accepted, and the sentence for what is not."""

import codecs
import gzip

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.data.text import csv_reader as csv_reader
from pushfit.data.units import BIOTAC_PDC
from pushfit.errors import ConfigError, DataError, PushfitError

# Equal on paper: one multiplication and one division in float64.
EXACT = 1e-15

GOOD = "time_s,pressure_kpa\n0.00,1.5\n0.01,1.25\n0.02,-3e-1\n"
TIME = [0.00, 0.01, 0.02]
PRESSURE = [1.5, 1.25, -0.3]
SEMICOLON_DIGEST = "cd36887d9b357ac5f4c9d2486671f18b1e543caab20376282e6d2e6c17eba513"


@pytest.fixture
def write(tmp_path):
    """Write text or bytes to a file and give its path."""

    def write(content, name="push.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def assert_good(recording):
    np.testing.assert_array_equal(recording.time, TIME)
    np.testing.assert_array_equal(recording.channels["pressure"], PRESSURE)
    assert recording.units == {"pressure": "kpa"}


def refusal(path, **options):
    with pytest.raises(PushfitError) as caught:
        read_recording(path, **options)
    return caught.value


SAME_NUMBERS = {
    "plain": GOOD,
    "windows_line_ends": GOOD.replace("\n", "\r\n"),
    "old_mac_line_ends": GOOD.replace("\n", "\r"),
    "mixed_line_ends": GOOD.replace("\n", "\r\n", 1).replace("1.5\n", "1.5\r"),
    "blank_lines_and_trailing_blanks": GOOD.replace("1.5\n", "1.5  \n\n   \n"),
    "blanks_after_commas": GOOD.replace(",", ",  "),
    "semicolons": GOOD.replace(",", ";"),
    "semicolons_and_decimal_commas": GOOD.replace(",", ";").replace(".", ","),
    "tabs": GOOD.replace(",", "\t"),
    "tabs_and_decimal_commas": GOOD.replace(",", "\t").replace(".", ","),
    "blanks": GOOD.replace(",", "    "),
    "indented_blanks": GOOD.replace(",", " ").replace("\n", "\n  ").rstrip(" "),
    "byte_order_mark": codecs.BOM_UTF8 + GOOD.encode(),
    "utf_16_little_endian": codecs.BOM_UTF16_LE + GOOD.encode("utf-16-le"),
    "utf_16_big_endian": codecs.BOM_UTF16_BE + GOOD.encode("utf-16-be"),
    "gzip": gzip.compress(GOOD.encode()),
    "gzip_of_utf_16": gzip.compress(GOOD.encode("utf-16")),
    "quoted_names_and_cells": GOOD.replace("time_s", '"time_s"').replace(
        "1.5", '"1.5"'
    ),
    "preamble": "Rig 7, Lab 2, 2024-05-01\nOperator: Anna\nRate,100\n\n" + GOOD,
    "hash_before_names": "# " + GOOD,
    "row_of_units": GOOD.replace("_s", "").replace("_kpa\n", "\ns,kPa\n"),
    "units_in_brackets": GOOD.replace("_s", " [s]").replace("_kpa", " (kPa)"),
    "capital_units": GOOD.replace("_kpa", "_kPa").replace("time", "Time"),
    "trailing_comma_in_all_rows": GOOD.replace("\n", ",\n").replace("kpa,", "kpa"),
    "trailing_comma_also_in_header": GOOD.replace("\n", ",\n"),
    "time_in_another_column": "pressure_kpa,time_s\n1.5,0\n1.25,0.01\n-0.3,0.02\n",
    "pascals": "time_ms,pressure_pa\n0,1500\n10,1250\n20,-300\n",
    "rfc_3339": "time,pressure_kpa\n1970-01-01T00:00:00Z,1.5\n"
    "1970-01-01T00:00:00.01Z,1.25\n1970-01-01T01:00:00.020+01:00,-0.3\n",
    "stamps_of_pandas": "time,pressure_kpa\n1970-01-01 00:00:00,1.5\n"
    "1970-01-01 00:00:00.010000,1.25\n1970-01-01 00:00:00.020000,-0.3\n",
    "stamps_of_a_log": "time;pressure_kpa\n1970-01-01 00:00:00,000;1.5\n"
    "1970-01-01 00:00:00,010;1.25\n1970-01-01 00:00:00,020;-0.3\n",
    "control_byte_in_a_name": GOOD.replace("time_s", "time_s\x07"),
    "text_that_is_not_needed": "time_s,label,pressure_kpa\n0,NA,1.5\n0.01,007,1.25\n"
    '0.02,"grün, ""x""\nnext",-0.3\n',
}


@pytest.mark.parametrize("form", SAME_NUMBERS)
def test_the_same_numbers_come_from_every_form(form, write):
    """The forms of one table met in the wild hold the same samples."""
    assert_good(read_recording(write(SAME_NUMBERS[form])))


def test_a_row_of_units_may_hold_every_unit_that_a_name_may(write):
    path = write("time,force\nms,[µN]\n0,1500000\n10,1250000\n20,-300000\n")
    recording = read_recording(path, mapping={"force": "force"})
    assert recording.units == {"force": "n"}
    np.testing.assert_array_equal(recording.channels["force"], PRESSURE)


def test_a_rate_beside_a_time_is_said_to_be_of_no_use(write):
    recording = read_recording(write(GOOD), rate=1000.0)
    assert_good(recording)
    assert "time from time_s, not from the rate of 1000" in recording.notes[0]


def test_a_clock_is_no_example_of_a_signal(write):
    error = refusal(write("t,force\n0,1\n1,2\n2,1\n"))
    assert "`mapping={'pressure': 'force'}, " in "".join(
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
        [f"byte {len(GOOD)}", 'tail="salvage"'],
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
        ["line 5", "2 of 5 samples", "lines 5, 6", 'gaps="split"', "interpolate"],
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
        ["line 3", "97°", "[-90°, 90°]", 'theta_from="normal"'],
    ),
    "sentinel": (
        GOOD + "0.03,-3.697314E28\n",
        {},
        "sentinel",
        ["line 5", "-3.69731e+28", "missing=["],
    ),
}


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
        "kpa and",
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


def test_a_missing_path_names_no_other_that_only_ends_alike(write):
    error = refusal(write(GOOD, "strval.toml").with_name("truth.toml"))
    assert "did you mean" not in str(error)


def test_a_folder_is_not_a_recording(tmp_path):
    assert refusal(tmp_path).code == "is_a_folder"


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


def test_a_cut_last_line_is_dropped_with_a_note(write):
    recording = read_recording(write(GOOD + "0.03,1"))
    assert_good(recording)
    assert any("dropped line 5" in note for note in recording.notes)


def test_a_last_line_without_line_end_can_be_kept(write):
    recording = read_recording(write(GOOD + "0.03,1"), tail="keep")
    assert recording.time[-1] == 0.03
    assert any("line 5 has no line end" in note for note in recording.notes)


def test_zero_bytes_at_the_end_are_dropped_when_asked(write):
    recording = read_recording(
        write(GOOD.encode() + b"0.03," + bytes(9)), tail="salvage"
    )
    assert_good(recording)
    assert any("dropped zero bytes" in note for note in recording.notes)


def test_gaps_stay_missing_when_split(write):
    recording = read_recording(write(GOOD + "0.03,\n0.04,1\n"), gaps="split")
    np.testing.assert_array_equal(
        recording.channels["pressure"], [*PRESSURE, np.nan, 1]
    )
    assert any("1 of 5 samples are missing (lines 5)" in n for n in recording.notes)


@pytest.mark.parametrize("cell", ["", " ", "   ", ' ""', "nan", " NaN"])
def test_a_cell_of_blanks_is_a_missing_sample(cell, write):
    recording = read_recording(write(GOOD + f"0.03,{cell}\n"), gaps="split")
    np.testing.assert_array_equal(recording.channels["pressure"], [*PRESSURE, np.nan])


def test_short_gaps_are_filled_on_the_straight_line(write):
    recording = read_recording(write(GOOD + "0.03,\n0.05,0.3\n"), gaps="interpolate")
    # A third of the way from -0.3 at 0.02 s to 0.3 at 0.05 s.
    np.testing.assert_allclose(recording.channels["pressure"][3], -0.1, atol=1e-15)
    assert any("filled 1 by interpolation, left 0" in n for n in recording.notes)


def test_long_gaps_are_not_filled(write):
    recording = read_recording(write(GOOD + "1.0,\n2.0,0.3\n"), gaps="interpolate")
    assert np.isnan(recording.channels["pressure"][3])


def test_a_missing_azimuth_is_filled_the_shorter_way_round(write):
    rows = "time_s,p_n,alpha_deg\n0,1,170\n0.01,1,\n0.02,1,-170\n0.03,1,-165\n"
    recording = read_recording(write(rows), gaps="interpolate")
    np.testing.assert_allclose(abs(recording.alpha[1]), np.pi, rtol=1e-14)


def test_a_declared_sentinel_is_a_missing_sample(write):
    path = write(GOOD + "0.03,-3.697314E28\n")
    recording = read_recording(path, missing=["-3.697314E28"], gaps="split")
    assert np.isnan(recording.channels["pressure"][3])


def test_units_that_look_wrong_can_be_vouched_for(write):
    path = write("time_s,p_kpa\n0,2440\n1,2441\n2,2450\n")
    recording = read_recording(path, trust_units=True)
    assert recording.channels["p"][0] == 2440
    assert any("raw counts" in note for note in recording.notes)


def test_angles_become_radians_of_elevation_and_azimuth(write):
    rows = "time_s,force_mn,theta_deg,alpha_rad\n0,1500,30,1.5\n0.01,1,45,-0.5\n"
    recording = read_recording(write(rows))
    np.testing.assert_allclose(recording.theta, [np.pi / 6, np.pi / 4], rtol=EXACT)
    np.testing.assert_array_equal(recording.alpha, [1.5, -0.5])
    np.testing.assert_array_equal(recording.channels["force"], [1.5, 0.001])
    assert recording.units == {"force": "n"}


def test_an_angle_from_the_normal_becomes_an_elevation(write):
    rows = "time_s,force_n,theta_deg\n0,1,30\n0.01,1,100\n"
    recording = read_recording(write(rows), theta_from="normal")
    np.testing.assert_allclose(np.rad2deg(recording.theta), [60, -10], rtol=1e-14)
    assert any("from the contact normal" in note for note in recording.notes)


def test_columns_without_unit_are_left_alone_with_a_note(write):
    rows = "time_s,pdc,nx,ny,nz\n0,2400,0,0,1\n0.01,2410,0,0,1\n"
    recording = read_recording(write(rows), units={"pdc": "counts"})
    assert list(recording.channels) == ["pdc"]
    assert any("nx, ny, nz" in note for note in recording.notes)


def test_irregular_sampling_is_a_note_not_an_error(write):
    rows = "time_s,p_n\n" + "".join(
        f"{t},1.5\n" for t in (0, 0.01, 0.02, 0.1, 0.11, 0.12, 0.13, 0.77, 0.78)
    )
    notes = " ".join(read_recording(write(rows)).notes)
    assert "irregular sampling: usual step 10 ms" in notes
    assert "the longest 0.64 s at 0.13 s" in notes
    assert "p does not vary: always 1.5" in notes


def test_the_source_tells_path_digest_and_dialect(write):
    path = write(GOOD.replace(",", ";").replace(".", ","))
    (source,) = read_recording(path).sources
    assert source.path == str(path)
    # printf 'time_s;pressure_kpa\\n0,00;1,5\\n0,01;1,25\\n0,02;-3e-1\\n' | sha256sum
    assert source.sha256 == SEMICOLON_DIGEST
    assert source.dialect == "native csv: semicolon, decimal comma, header on line 1"


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


def test_a_calibration_is_applied_only_on_demand_and_leaves_a_note(write):
    path = write("time_s,pdc_counts\n0,2400\n0.01,2550\n")
    raw = read_recording(path)
    assert raw.units == {"pdc": "counts"}
    recording = raw.calibrated("pdc", BIOTAC_PDC)
    # A push of 150 counts is about 5.5 kPa.
    np.testing.assert_allclose(np.diff(recording.channels["pdc"]), 5.475, rtol=1e-13)
    assert recording.units == {"pdc": "kpa"}
    assert (
        "0.0365 kpa per counts (SynTouch BioTac Product Manual" in recording.notes[-1]
    )


def test_a_calibration_of_another_unit_or_channel_is_refused(write):
    recording = read_recording(write(GOOD))
    with pytest.raises(ConfigError, match="in kpa, but the calibration takes counts"):
        recording.calibrated("pressure", BIOTAC_PDC)
    with pytest.raises(ConfigError, match="name one that is there: pressure"):
        recording.calibrated("pdc", BIOTAC_PDC)
