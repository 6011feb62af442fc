"""Reading recordings: which forms hold the same numbers, and what notes say.

Excluded: what is refused, and by which sentence (`test_refusals`).
"""

import codecs
import gzip
import re

import numpy as np
import pytest

from pushfit.config.inputs import PeakSettings
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.data.units import BIOTAC_PDC
from pushfit.errors import ConfigError, DataError
from tests.data.recordings.makers import GOOD
from tests.tolerances import ROUNDING

TIME = [0.00, 0.01, 0.02]
PRESSURE = [1.5, 1.25, -0.3]
SEMICOLON_DIGEST = "cd36887d9b357ac5f4c9d2486671f18b1e543caab20376282e6d2e6c17eba513"


def assert_good(recording):
    np.testing.assert_array_equal(recording.time, TIME)
    np.testing.assert_array_equal(recording.channels["pressure"], PRESSURE)
    assert recording.units == {"pressure": "kpa"}


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


def test_a_rate_takes_the_place_of_a_column_that_looks_like_the_time(write):
    coarse = write("time_s,force_n\n0,1\n0,1.5\n0,2\n1,2.5\n")
    recording = read_recording(coarse, rate=10.0)
    np.testing.assert_allclose(recording.time, [0.0, 0.1, 0.2, 0.3], rtol=ROUNDING)
    (caution,) = recording.cautions
    assert "10 samples a second, and not from time_s" in caution


def test_a_column_that_is_said_to_be_the_time_is_it_beside_a_rate(write):
    recording = read_recording(write(GOOD), rate=1000.0, mapping={"time": "time_s"})
    assert_good(recording)
    assert not recording.cautions


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
    np.testing.assert_allclose(
        recording.channels["pressure"][3], -0.1, rtol=0, atol=ROUNDING
    )
    assert any("filled 1 by interpolation, left 0" in n for n in recording.notes)


def test_long_gaps_are_not_filled(write):
    recording = read_recording(write(GOOD + "1.0,\n2.0,0.3\n"), gaps="interpolate")
    assert np.isnan(recording.channels["pressure"][3])


def test_a_missing_azimuth_is_filled_the_shorter_way_round(write):
    rows = "time_s,p_n,alpha_deg\n0,1,170\n0.01,1,\n0.02,1,-170\n0.03,1,-165\n"
    recording = read_recording(write(rows), gaps="interpolate")
    np.testing.assert_allclose(abs(recording.alpha[1]), np.pi, rtol=ROUNDING)


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
    np.testing.assert_allclose(recording.theta, [np.pi / 6, np.pi / 4], rtol=ROUNDING)
    np.testing.assert_array_equal(recording.alpha, [1.5, -0.5])
    np.testing.assert_array_equal(recording.channels["force"], [1.5, 0.001])
    assert recording.units == {"force": "n"}


def test_an_angle_from_the_normal_becomes_an_elevation(write):
    rows = "time_s,force_n,theta_deg\n0,1,30\n0.01,1,100\n"
    recording = read_recording(write(rows), theta_from="normal")
    np.testing.assert_allclose(np.rad2deg(recording.theta), [60, -10], rtol=ROUNDING)
    assert any("from the contact normal" in note for note in recording.notes)


def test_columns_without_unit_are_left_alone_with_a_note(write):
    rows = "time_s,pdc,nx,ny,nz\n0,2400,0,0,1\n0.01,2410,0,0,1\n"
    recording = read_recording(write(rows), units={"pdc": "counts"})
    assert list(recording.channels) == ["pdc"]
    assert any("nx, ny, nz" in note for note in recording.notes)


@pytest.mark.parametrize("clock", ["0.", "1663502488."])
def test_irregular_sampling_is_a_note_not_an_error(clock, write):
    rows = "time_s,p_n\n" + "".join(
        f"{clock}{t},1.5\n" for t in "00 01 02 10 11 12 13 77 78".split()
    )
    notes = " ".join(read_recording(write(rows)).notes)
    assert "irregular sampling: usual step 10 ms" in notes
    assert f"the longest 0.64 s at {clock}13 s" in notes
    assert "p does not vary: always 1.5" in notes


def test_the_source_tells_path_digest_and_dialect(write):
    path = write(GOOD.replace(",", ";").replace(".", ","))
    (source,) = read_recording(path).sources
    assert source.path == str(path)
    # printf 'time_s;pressure_kpa\\n0,00;1,5\\n0,01;1,25\\n0,02;-3e-1\\n' | sha256sum
    assert source.sha256 == SEMICOLON_DIGEST
    assert source.dialect == "native csv: semicolon, decimal comma, header on line 1"


def test_a_calibration_is_applied_only_on_demand_and_leaves_a_note(write):
    path = write("time_s,pdc_counts\n0,2400\n0.01,2550\n")
    raw = read_recording(path)
    assert raw.units == {"pdc": "counts"}
    recording = raw.calibrated("pdc", BIOTAC_PDC)
    # A push of 150 counts is about 5.5 kPa.
    np.testing.assert_allclose(np.diff(recording.channels["pdc"]), 5.475, rtol=ROUNDING)
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


@pytest.mark.parametrize("key", ["time", "timestamp"])
def test_the_unit_of_the_time_is_stated_for_it_or_for_its_column(write, key):
    path = write("timestamp,force_n\n0,1\n10,2\n20,1\n")
    recording = read_recording(path, units={key: "ms"})
    np.testing.assert_array_equal(recording.time, TIME)


def at_a_clock() -> Recording:
    """A minute of samples, stamped with the seconds since 1970."""
    time = 1663502488.25 + np.arange(0.0, 60.0, 0.5)
    return Recording(time=time, channels={"p": np.zeros(120)}, units={"p": "n"})


@pytest.mark.parametrize(
    ("begin", "end", "told"),
    [
        (15.0, None, ["`begin=15.0` leaves out nothing: the recording begins at 1663"]),
        (None, 2e9, ["`end=2000000000.0` leaves out nothing: the recording ends at"]),
        (1663502487.0, None, []),
        (1663502500.0, 1663502520.0, []),
    ],
)
def test_times_of_another_clock_are_told(begin, end, told):
    cautions = at_a_clock().between(begin, end).cautions
    assert len(cautions) == len(told)
    assert all(map(str.startswith, cautions, told))


def test_times_of_a_clock_are_told_with_all_digits():
    said = "from 1663502508.5 s to 1663502489 s: the recording runs from 1663502488.25 "
    with pytest.raises(DataError, match=re.escape(said)):
        at_a_clock().between(1663502508.5, 1663502489.0)
    with pytest.raises(ValueError, match=re.escape("[1663502502, 1663502501.5] ends")):
        PeakSettings(exclude=((1663502502.0, 1663502501.5),))
