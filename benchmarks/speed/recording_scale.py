"""What a long recording costs: time beside a bare pandas read, and memory by size.

Simulated is vibration-rate sampling of a BioTac, 2200 samples a second with one push
every 4.5 s; a full hour has 7.92 million rows. Times are processor times, the two
readers in turns, and given as ratios, because the machine may be busy; what disturbs a
round only ever adds to it, so the fastest ones count. Memory is the
largest resident size of a process of its own, less that of one that only imports; the
slope between two lengths is what a further row costs. Linux only, for its /proc.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.recording import read_recording

# Samples per second of a BioTac's fastest channel [Hz].
RATE = 2200
# Time from push to push: 800 in an hour [s].
PERIOD = 4.5
# Rows of an hour.
HOUR = 3600 * RATE

PROGRAM = """
import sys
from benchmarks.speed.recording_scale import READERS, largest_size
before = largest_size()
READERS[sys.argv[1]](sys.argv[2], int(sys.argv[3]))
print(largest_size() - before)
"""


def write(path: Path, n_rows: int, n_others: int = 0) -> int:
    """Write a recording with columns that nobody needs; give its pushes."""
    names = "".join(f",electrode_{k}" for k in range(n_others))
    others = ",3021" * n_others
    rng = np.random.default_rng(0)
    n_pushes = max(1, int(n_rows / RATE / PERIOD))
    with path.open("w") as file:
        file.write(f"time_s,pressure_counts{names}\n")
        for first in range(0, n_rows, 1 << 18):
            k = np.arange(first, min(first + (1 << 18), n_rows))
            phase = np.minimum(k / RATE, n_pushes * PERIOD - 1e-9) % PERIOD
            push = 500.0 * np.maximum(0.0, 1 - np.abs(phase - 2.25))
            counts = np.rint(2440 + push + 0.7 * rng.standard_normal(k.size))
            file.writelines(
                f"{t:.6f},{c:.0f}{others}\n"
                for t, c in zip((k / RATE).tolist(), counts.tolist(), strict=True)
            )
    return n_pushes


def read_bare(path: str | Path, n_pushes: int) -> None:
    """Read a table by pandas, and do nothing with it."""
    pd.read_csv(path)


def extract(path: str | Path, n_pushes: int) -> None:
    """Read a recording and measure its pushes."""
    plan = PushSchedule.planned(np.radians(45.0), np.radians(90.0), repeats=n_pushes)
    assert extract_peaks(read_recording(path), plan).n_pushes == n_pushes


READERS = {"pandas": read_bare, "pushfit": extract}


def largest_size() -> int:
    """Largest resident size of this process so far [bytes].

    Not `ru_maxrss`, which starts from the size of the process that called.
    """
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


def growth(reader: str, path: Path, n_pushes: int) -> int:
    """Memory that reading takes in a process of its own [bytes]."""
    arguments = [sys.executable, "-c", PROGRAM, reader, str(path), str(n_pushes)]
    ended = subprocess.run(arguments, check=True, capture_output=True, text=True)
    return int(ended.stdout)


def seconds(reader: str, path: Path, n_pushes: int) -> float:
    """Processor time of one call [s]."""
    begin = time.process_time()
    READERS[reader](path, n_pushes)
    return time.process_time() - begin


def main() -> None:
    """Print ratio and memory."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rows", type=int, default=HOUR)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--time", action="store_true", help="leave out the memory")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hour.csv"
        n_pushes = write(path, options.rows)
        size = path.stat().st_size
        print(f"{options.rows} rows, {size / 1e6:.0f} MB, {n_pushes} pushes")
        extract(path, n_pushes)  # loads what is loaded once
        pairs = np.array(
            [
                [seconds(reader, path, n_pushes) for reader in READERS]
                for _ in range(options.rounds)
            ]
        )
        bare, ours = pairs.min(axis=0)
        ratios = np.sort(pairs[:, 1] / pairs[:, 0])
        print(
            f"read and extract over bare pandas: {ours / bare:.2f} by the fastest "
            f"rounds, {np.median(ratios):.2f} by the median "
            f"({ratios[0]:.2f} to {ratios[-1]:.2f})"
        )
        if options.time:
            return
        half = Path(folder) / "half.csv"
        n_half = write(half, options.rows // 2)
        for reader in READERS:
            whole, part = growth(reader, path, n_pushes), growth(reader, half, n_half)
            per_row = (whole - part) / (options.rows - options.rows // 2)
            print(
                f"{reader}: {whole / 1e6:.0f} MB, {per_row:.1f} bytes for a further row"
            )
        n_pushes = write(path, options.rows // 4, n_others=43)
        size, used = path.stat().st_size, growth("pushfit", path, n_pushes)
        print(f"45 columns, {size / 1e6:.0f} MB: {used / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
