"""Pushes found in real recordings, without any setting, against what is known of them.

The recordings are no part of the repository; name their folder on the command line or
by PUSHFIT_REAL_DATA.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from pushfit.data.heights import measure_heights
from pushfit.data.peak_settings import PeakSettings
from pushfit.data.peaks import find_pushes
from pushfit.data.records import Recording

# File, column, pushes known, table with known heights and its column.
GRID_LOW = "soft_skin/grid_r0.20_0.5N_11-02-2025_14-22-29"
GRID_HIGH = "soft_skin/grid_r1.00_3.0N_11-02-2025_15-23-30"
SKIN_TEST = "soft_skin/test_18-02-2025_13-00-43"
PRESSES = "barometer/zv05_zd6_t0_20230622_191542"
CASES = (
    ("biotac_hand_pushes/trial2", "pdc", "10", "presses_by_eye", "height_counts"),
    ("biotac_hand_pushes/short_dropouts", "pdc", "4 + 1 cut", "", ""),
    ("biotac_hand_pushes/short_starts_mid_push", "pdc", "1 cut", "", ""),
    ("biotac_hand_pushes/no_push_constant", "pdc", "0", "", ""),
    ("biotac_hand_pushes/no_push_gaps", "pdc", "0", "", ""),
    (
        "fingertip_force/pressure_index_1_100Hz",
        "force_N",
        "12",
        "commanded",
        "commanded_peak_N",
    ),
    (GRID_LOW, "fz_N", "18", "presses_fz_gate", "fz_N_plateau_height"),
    (GRID_HIGH, "fz_N", "18", "presses_fz_gate", "fz_N_plateau_height"),
    (SKIN_TEST, "fz_N", "8", "presses_fz_gate", "fz_N_plateau_height"),
    (PRESSES, "p0_Pa", "6-14", "", ""),
    (PRESSES, "p1_Pa", "6-14", "", ""),
    (PRESSES, "p2_Pa", "6-14", "", ""),
    (PRESSES, "p3_Pa", "6-14", "", ""),
    ("barometer/testing_step_20230629_181126", "p2_Pa", "2", "", ""),
)


def load(folder: Path, name: str, column: str) -> Recording:
    """Read two columns, whatever unit they are in."""
    frame = pd.read_csv(folder / f"{name}.csv")
    return Recording(
        time=frame["time_s"].to_numpy(dtype=float),
        channels={column: frame[column].to_numpy(dtype=float)},
        units={column: "au"},
    )


def known_heights(folder: Path, name: str, kind: str, column: str) -> np.ndarray | None:
    """Heights of the table beside a recording."""
    tables = [p for p in folder.glob(f"{name[:-5]}*{kind}*.csv")] if kind else []
    return pd.read_csv(tables[0])[column].to_numpy(dtype=float) if tables else None


def main() -> None:
    """Print one line per recording."""
    folder = Path(sys.argv[1] if sys.argv[1:] else os.environ["PUSHFIT_REAL_DATA"])
    print("recording, channel: known, found (flags), heights: error against known")
    for name, column, known, kind, heights_column in CASES:
        recording = load(folder, name, column)
        extents = find_pushes(recording)
        line = f"{name}, {column}: {known}, {len(extents)}"
        if extents:
            heights, definition = measure_heights(
                recording.time,
                recording.channels[column],
                extents,
                definition="auto",
                limit=PeakSettings().limit,
            )
            flagged = [",".join(sorted(h.flags)) for h in heights if h.flags]
            line += f" ({'; '.join(flagged) or 'none'}), {definition}"
            expected = known_heights(folder, name, kind, heights_column)
            if expected is not None and len(expected) == len(heights):
                error = np.array([h.height for h in heights]) - expected
                line += (
                    f": {error.min():+.3g} .. {error.max():+.3g} (worst "
                    f"{100 * np.abs(error / expected).max():.1f} %)"
                )
        print(line)


if __name__ == "__main__":
    main()
