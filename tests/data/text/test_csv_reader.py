"""Strict tables: what pandas alone gets wrong, line numbers, bounded memory."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.speed import recording_scale
from pushfit.data.recordings.recording import read_recording
from pushfit.data.tables.columns import read_rows
from pushfit.data.tables.rules import KNOWN
from pushfit.data.text import csv_reader as csv_reader
from pushfit.data.text import textfile
from pushfit.errors import DataError


@pytest.fixture
def write(tmp_path):
    def write(text, name="table.csv"):
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


def test_a_table_keeps_names_text_and_line_numbers(write):
    path = write(
        "# made by hand\n\npush,label,height_n\n1,NA,2.5\n\n2,007,\n3,None,1e-3"
    )
    rows = read_rows(path, KNOWN)
    frame = rows.frame
    assert list(frame.columns) == ["push", "label", "height_n"]
    assert frame["label"].tolist() == ["NA", "007", "None"]
    np.testing.assert_array_equal(frame["height_n"], [2.5, np.nan, 1e-3])
    assert rows.origin.lines.tolist() == [4, 6, 7]
    assert rows.sources[-1].dialect == "native csv: comma, header on line 3"
    assert rows.notes[-1].startswith("line 7 has no line end")


def test_lines_are_counted_through_quoted_line_ends(write):
    path = write('push,label,height_n\n1,"a\nb",2\n\n2,"c,d",3\n3,e,4\n')
    rows = read_rows(path, KNOWN)
    assert rows.origin.lines.tolist() == [2, 5, 6]
    assert rows.frame["label"].tolist() == ["a\nb", "c,d", "e"]


def test_text_where_a_number_is_needed_names_its_line(write):
    path = write("push,height_n\n1,2\n\n2,97x\n")
    with pytest.raises(DataError) as caught:
        read_rows(path, KNOWN)
    (problem,) = caught.value.problems
    assert (problem.line, problem.column, problem.value) == (4, "height_n", "97x")
    assert problem.message == (
        f"{path}, line 4, column height_n: '97x' is not a number; a decimal number is "
        "expected; mend the cell or remove the row"
    )


def test_a_long_text_is_kept_whole_and_shown_short(write):
    long = "x" * 5000
    rows = read_rows(write(f"push,label\n1,{long}\n"), KNOWN)
    assert rows.frame["label"].tolist() == [long]
    with pytest.raises(DataError, match=r"'x{37}\.\.\.' is not a number"):
        read_rows(write(f"push,repeat\n1,2\n1,{long}\n"), KNOWN)


# Rows that pandas reads into wrong numbers without a word.
PANDAS_TRAPS = {
    "shifted_columns": "time_s,force_n\n0,1,9\n1,2,9\n",
    "one_column": "time_s;force_n\n0,01;1,5\n0,02;1,6\n",
    "short_row": "time_s,force_n\n0,1\n0.01\n0.02,3\n",
    "renamed_copy": "time_s,force_n,force_n\n0,1,2\n1,2,3\n",
}


@pytest.mark.parametrize("trap", PANDAS_TRAPS)
def test_what_pandas_gets_wrong_silently_is_right_or_refused(trap, write):
    path = write(PANDAS_TRAPS[trap])
    naive = pd.read_csv(path)
    try:
        recording = read_recording(path)
    except DataError:
        return
    np.testing.assert_array_equal(recording.time, [0.01, 0.02])
    np.testing.assert_array_equal(recording.channels["force"], [1.5, 1.6])
    assert naive.shape != (2, 2)


@pytest.mark.parametrize("error", [-1, 1])
def test_a_parser_that_finds_other_rows_than_the_scan_is_not_believed(
    error, write, monkeypatch
):
    """The scan and pandas count rows independently; they must agree."""
    scan = csv_reader.fast_scan
    monkeypatch.setattr(
        csv_reader,
        "fast_scan",
        lambda *a: replace(s := scan(*a), n_rows=s.n_rows + error),
    )
    with pytest.raises(DataError) as caught:
        read_recording(write("time_s,force_n\n0,1\n0.01,2\n"))
    assert caught.value.code == "unreadable"


@pytest.mark.parametrize("block", [1, 2, 7, 64])
@pytest.mark.parametrize("delimiter", [",", " "])
def test_block_borders_leave_no_trace(block, delimiter, write, monkeypatch):
    """The file is scanned in blocks; where they end must not matter."""
    rng = np.random.default_rng(7)
    times, force = np.arange(200) / 100, rng.normal(size=200).round(6)
    rows = [
        f"{t:.2f}{delimiter}{f!r}" for t, f in zip(times, force.tolist(), strict=True)
    ]
    rows[50] += "\r\n"
    text = f"time_s{delimiter}force_n\n" + "\n".join(rows) + "\n"
    path = write(text)
    monkeypatch.setattr(textfile, "BLOCK", block)
    monkeypatch.setattr(csv_reader, "_CHUNK_CELLS", 26)
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.time, times)
    np.testing.assert_array_equal(recording.channels["force"], force)
    path.write_text(text.replace(rows[150], "1.50" + delimiter + "x"))
    with pytest.raises(DataError, match="line 153, column force_n: 'x'"):
        read_recording(path)


def test_memory_follows_the_needed_columns_not_the_file(write, monkeypatch):
    """A wide file costs the scan's blocks and 8 bytes per needed cell."""
    monkeypatch.setattr(textfile, "BLOCK", 1 << 16)
    monkeypatch.setattr(csv_reader, "_CHUNK_CELLS", 1 << 15)
    n_rows, wide = 40_000, ",1234567890" * 30
    names = "".join(f",x{k}" for k in range(30))
    rows = "".join(f"{k},{k % 7}{wide}\n" for k in range(n_rows))
    path = write(f"time_ms,force_n{names}\n{rows}")
    assert path.stat().st_size > 13e6
    read_recording(path)
    tracemalloc.start()
    read_recording(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # Two columns, as parsed, as checked (differences, masks) and as canonical: below
    # 16 copies of one column; the file itself would be 40.
    assert peak < 16 * 8 * n_rows


# What docs/recordings.md promises: two columns, as parsed and as kept, and their masks.
BYTES_PER_ROW = 32


@pytest.mark.slow
def test_a_long_recording_keeps_to_its_memory(tmp_path):
    """In processes of their own; what is loaded once cancels between two lengths."""
    used = {}
    for n_rows in (1_000_000, 3_000_000):
        path = tmp_path / f"{n_rows}.csv"
        n_pushes = recording_scale.write(path, n_rows)
        used[n_rows] = recording_scale.growth("pushfit", path, n_pushes)
    assert used[3_000_000] - used[1_000_000] < BYTES_PER_ROW * 2_000_000


@pytest.mark.slow
def test_columns_that_nobody_needs_cost_no_memory(tmp_path):
    """Beside 45 columns the blocks of the scan are all that is added."""
    path = tmp_path / "wide.csv"
    n_pushes = recording_scale.write(path, 1_000_000, n_others=43)
    assert path.stat().st_size > 230e6
    used = recording_scale.growth("pushfit", path, n_pushes)
    assert used < BYTES_PER_ROW * 1_000_000 + 100e6


def test_what_would_need_too_much_memory_is_refused_after_the_scan(write, monkeypatch):
    """As for a file of 10 GB: an estimate, at the cost of the blocks of the scan."""
    monkeypatch.setattr(textfile, "BLOCK", 1 << 16)
    peaks = []
    for n_rows in (50_000, 50_000, 400_000):
        rows = "".join(f"{k},1\n" for k in range(n_rows))
        path = write(f"time_ms,force_n\n{rows}")
        tracemalloc.start()
        with pytest.raises(DataError, match=rf"{n_rows} rows of 2 columns need 0\.00"):
            read_recording(path, max_bytes=1000)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    # The first one loads what is loaded once.
    assert peaks[2] < 1.2 * peaks[1]
