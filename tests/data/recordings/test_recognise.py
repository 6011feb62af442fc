"""Units that a file and its user state of one column: equal ones agree."""

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import ConfigError, DataError
from tests.tolerances import ROUNDING

# As an indenter writes it, with its gain above the columns.
LOG = """DMCv5.3 Data File
Sample Frequency (Hz): 100
Calibration Data:
Channel\tAI0\tAI1
Units\tmm\tmN
Scale (units/V)\t1.000000\t500.000000

Test Data in Volts:

Sample\tAI0\tAI1
"""
VOLTS = [0.25, 0.5, -1.0]


@pytest.fixture
def log(write):
    """Three samples of a force in volts."""
    rows = [f"{k}\t0.1\t{volt}\n" for k, volt in enumerate(VOLTS)]
    return write(LOG + "".join(rows), "push.ddf")


@pytest.mark.parametrize("rate", ["", "x", "NaN", "inf", "0", "-100"])
def test_a_log_without_a_rate_asks_for_one(rate, log):
    log.write_text(log.read_text().replace("(Hz): 100", f"(Hz): {rate}"))
    with pytest.raises(DataError, match="no time column"):
        read_recording(log)
    time = read_recording(log, rate=100.0).time
    np.testing.assert_allclose(time, [0.0, 0.01, 0.02], rtol=ROUNDING)


@pytest.mark.parametrize("unit", ["mN", "lbf"])
def test_a_commanded_force_is_no_measured_one(unit, log):
    """Even where it is the only one in a known unit."""
    text = log.read_text().replace("\tmN\n", f"\t{unit}\n")
    for line, more in (
        ("Channel", "AO1"),
        ("Units", "mN"),
        ("Scale", "500.000000"),
        ("Sample\t", "AO1"),
        *((f"{k}\t", "0.0") for k in range(len(VOLTS))),
    ):
        first = text.index(f"\n{line}") + 1
        end = text.index("\n", first)
        text = f"{text[:end]}\t{more}{text[end:]}"
    log.write_text(text)
    if unit == "mN":
        assert list(read_recording(log).channels) == ["AI1"]
    else:
        with pytest.raises(DataError, match="no column states a signal unit"):
            read_recording(log)


@pytest.mark.parametrize("gain", ["500 mN/V", "500.0mN/V", "0.5 N/V", "5e5 uN/V"])
def test_a_unit_that_equals_that_of_the_file_may_be_stated(gain, log):
    recording = read_recording(log, units={"AI1": gain})
    np.testing.assert_allclose(
        recording.channels["AI1"], 0.5 * np.array(VOLTS), rtol=ROUNDING
    )


@pytest.mark.parametrize("gain", ["500.01 mN/V", "500 N/V", "500 kPa/V"])
def test_another_unit_than_that_of_the_file_is_refused_with_both_places(gain, log):
    with pytest.raises(ConfigError) as caught:
        read_recording(log, units={"AI1": gain})
    assert caught.value.code == "unit_conflict"
    assert (
        "column AI1: the unit is 500.000000 mn/v by the file itself, but "
        f"{gain.lower()} by `units={{'AI1': '{gain}'}}`; mend or leave out"
    ) in str(caught.value)


def test_units_that_two_names_state_are_named_with_them(write):
    path = write("time_s,force_n\n0,1\n0.01,2\n")
    with pytest.raises(
        ConfigError, match="n by its name, but mn by the name 'push_mn'"
    ):
        read_recording(path, mapping={"push_mn": "force_n"})


@pytest.mark.parametrize(
    ("names", "gain", "newtons"),
    [
        ("time_s,Force (V)", "500 mN/V", 500.0),
        ("time_s,Force (mV)", "500 mN/V", 0.5),
        ("time_s,force_mv", "0.5 mN/mV", 0.5),
        ("time_s,V out [mV] raw", "N/V", 1.0),
        ("time_s,force millivolts", "N/mV", 1000.0),
        ("time_s,force (µV)", "500 mN/V", 5e-4),
        ("time_s,force_kV", "2 mN/mV", 2e6),
        ("time,force\ns,mV", "500 mN/V", 0.5),
        ("time_s,force", "2 mN/mV", 2.0),
    ],
)
def test_a_gain_is_applied_to_the_volts_of_the_column(names, gain, newtons, write):
    """Thousand of what the column is in, which a note tells the newtons of."""
    path = write(names + "\n0,1000\n0.01,2000\n")
    column = names.split("\n")[0].split(",")[1]
    recording = read_recording(path, mapping={"push": column}, units={"push": gain})
    np.testing.assert_allclose(
        recording.channels["push"], [newtons, 2 * newtons], rtol=ROUNDING
    )
    told = next(note for note in recording.notes if note.startswith("push: 1 "))
    assert float(told.split()[-2]) == pytest.approx(newtons / 1000, rel=ROUNDING)


@pytest.mark.parametrize("column", ["AI1 (V)", "AI1 (µV)", "ai1_kv", "AI1 (mV) raw"])
def test_a_column_of_volts_is_offered_a_gain(column, write):
    with pytest.raises(DataError, match="'500mN/V'}`, with the gain of the sensor"):
        read_recording(write(f"time_s,{column}\n0,1\n0.01,2\n"))
