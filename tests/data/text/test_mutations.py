"""A damaged file is read to exactly its own numbers, or refused; nothing else.

A valid recording is mutated in its bytes. Damage to a digit cannot be seen, so what can
be asked is this: when the reader accepts the mutated file, every sample is the number
that an independent reading of the very same bytes finds in that row and column.
"""

import codecs
import csv
import gzip
import io
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import PushfitError
from tests.tolerances import ROUNDING

N_ROWS = 12
ROWS = [
    (f"{k / 100:.2f}", f"{2400 + k * k}", f"{30 + k}.5", f"{-k}.25e1")
    for k in range(N_ROWS)
]
NAMES = ("time_s", "pdc_counts", "theta_deg", "fz_n")
PLAIN = "\n".join(",".join(row) for row in (NAMES, *ROWS)) + "\n"
SEEDS = {
    "commas": PLAIN.encode(),
    "semicolons": PLAIN.replace(",", ";").replace(".", ",").encode(),
    "tabs": PLAIN.replace(",", "\t").encode(),
    "blanks": PLAIN.replace(",", "  ").encode(),
    "windows": PLAIN.replace("\n", "\r\n").encode(),
    "marked": codecs.BOM_UTF8 + PLAIN.encode(),
    "wide_characters": PLAIN.encode("utf-16"),
    "quoted": PLAIN.replace(",2400,", ',"2400",').encode(),
}

# Bytes that mean something to a reader of tables, and any others.
BYTES = st.one_of(
    st.sampled_from([b",", b";", b"\t", b" ", b"\n", b"\r", b".", b"-", b"e"]),
    st.sampled_from([b"\0", b"#", b"0", b"9", b"\xff", b"nan", b"inf", b"True", b"_"]),
    st.binary(min_size=1, max_size=3),
)


@st.composite
def mutated(draw):
    """Make one to three edits: replace, insert, delete, double or move some bytes."""
    data = SEEDS[draw(st.sampled_from(sorted(SEEDS)))]
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, len(data)))
        # Small edits often leave a readable file, large ones seldom.
        length = draw(st.one_of(st.integers(0, 2), st.integers(0, 40)))
        stretch = data[at : at + length]
        edit = draw(st.sampled_from(["replace", "insert", "delete", "double", "move"]))
        if edit == "replace":
            data = data[:at] + draw(BYTES) + data[at + 1 :]
        elif edit == "insert":
            data = data[:at] + draw(BYTES) + data[at:]
        elif edit == "delete":
            data = data[:at] + data[at + length :]
        elif edit == "double":
            data = data[:at] + stretch + data[at:]
        else:
            rest = data[:at] + data[at + length :]
            to = draw(st.integers(0, len(rest)))
            data = rest[:to] + stretch + rest[to:]
    return data


def independent_reading(data, source_note):
    """Read the columns by Python's csv and float, told only the layout reported."""
    encoding = (
        "utf-16"
        if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        else "utf-8-sig"
    )
    text = data.decode(encoding).replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    header = int(source_note.rsplit("line ", 1)[1])
    body = re.sub(r"^ *#+", "", "\n".join(lines[header - 1 :]))
    if "blanks" in source_note:
        lines = [re.sub(r"^ *#+", "", line) for line in body.split("\n")]
        rows = [re.findall(r"[^ \t]+", line) for line in lines]
    else:
        delimiter = {"comma": ",", "semicolon": ";", "tab": "\t"}[
            source_note.split(": ")[1].split(",")[0]
        ]
        rows = list(
            csv.reader(io.StringIO(body), delimiter=delimiter, skipinitialspace=True)
        )
    names = ["".join(c for c in n if c.isprintable()).strip() for n in rows[0]]
    cells = [row for row in rows[1:] if any(cell.strip() for cell in row)]
    if "decimal comma" in source_note:
        cells = [[cell.replace(",", ".") for cell in row] for row in cells]
    return names, cells


# Units that a few edits can make of those in the names.
SUFFIXES = {"n": "n", "mn": "n", "kpa": "kpa", "pa": "kpa", "counts": "counts"}
PER = {"s": 1.0, "ms": 1e3, "us": 1e6, "n": 1.0, "mn": 1e3, "kpa": 1.0, "pa": 1e3}
PER |= {"counts": 1.0}


def assert_read_exactly_or_refused(data, path):
    path.write_bytes(data)
    try:
        recording = read_recording(path)
    except PushfitError:
        return
    dialect = recording.sources[0].dialect
    names, cells = independent_reading(data, dialect)
    n_kept = len(recording.time)
    # Only a last line without a line end may be left out, and that is said.
    is_dropped = any("dropped line" in note for note in recording.notes)
    assert 0 <= len(cells) - n_kept <= is_dropped

    def column(name):
        at = [n.casefold() for n in names].index(name.casefold())
        return np.array([float(row[at].strip()) for row in cells[:n_kept]])

    clock = recording.notes[0].rpartition("time from ")[2]
    np.testing.assert_array_equal(
        recording.time, column(clock) / PER[clock.rpartition("_")[2].casefold()]
    )
    for channel, values in recording.channels.items():
        # An edit may make another unit of the one that the name states.
        (suffix,) = (
            suffix
            for suffix, canonical in SUFFIXES.items()
            if canonical == recording.units[channel]
            and f"{channel}_{suffix}".casefold() in map(str.casefold, names)
        )
        expected = column(f"{channel}_{suffix}") / PER[suffix]
        np.testing.assert_array_equal(values, expected)
    if recording.theta is not None:
        np.testing.assert_allclose(
            recording.theta, np.deg2rad(column("theta_deg")), rtol=ROUNDING
        )


ONE_FILE = [HealthCheck.function_scoped_fixture]


@given(data=mutated())
@settings(max_examples=100, suppress_health_check=ONE_FILE)
def test_a_damaged_file_gives_its_own_numbers_or_an_error(data, tmp_path):
    assert_read_exactly_or_refused(data, tmp_path / "damaged.csv")


@pytest.mark.slow
@given(data=mutated())
@settings(max_examples=2000, suppress_health_check=ONE_FILE)
def test_many_damaged_files_give_their_own_numbers_or_an_error(data, tmp_path):
    assert_read_exactly_or_refused(data, tmp_path / "damaged.csv")


@given(cut=st.integers(0, 400), form=st.sampled_from(sorted(SEEDS)))
@settings(max_examples=100, suppress_health_check=ONE_FILE)
def test_a_cut_file_gives_the_first_samples_or_an_error(cut, form, tmp_path):
    """However a file is cut, no sample differs from the one of the whole file."""
    path = tmp_path / "cut.csv"
    path.write_bytes(SEEDS[form])
    whole = read_recording(path)
    path.write_bytes(SEEDS[form][:cut])
    try:
        part = read_recording(path)
    except PushfitError:
        return
    n = len(part.time)
    np.testing.assert_array_equal(part.time, whole.time[:n])
    np.testing.assert_array_equal(part.channels["pdc"], whole.channels["pdc"][:n])
    np.testing.assert_array_equal(part.theta, whole.theta[:n])


@given(at=st.integers(0, 250), value=st.integers(0, 255))
@settings(max_examples=100, suppress_health_check=ONE_FILE)
def test_a_damaged_archive_is_refused(at, value, tmp_path):
    """The checksum of gzip guards the samples; its header may change without harm."""
    packed = bytearray(gzip.compress(PLAIN.encode(), mtime=0))
    packed[at % len(packed)] = value
    path = tmp_path / "packed.csv.gz"
    path.write_bytes(bytes(packed))
    try:
        recording = read_recording(path)
    except PushfitError:
        return
    np.testing.assert_array_equal(
        recording.channels["pdc"], [float(r[1]) for r in ROWS]
    )
