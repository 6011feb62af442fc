"""Pushes found in real recordings, without any setting, against what is known of them.

The recordings are no part of the repository; name their folder on the command line or
by PUSHFIT_REAL_DATA. Files are read by `read_recording`, which is told the column and
its unit and nothing else. Printed per channel: the pushes known and found, the flags of
their heights, how heights are defined, and the errors against known heights. Those are
the largest sample read by eye (trial2), the commanded force (fingertip_force) or the
median of the plateau (soft_skin). Of the 20 presses of the barometer each channel sees
those beside it: known are presses that raise it by 1000 Pa, and for p0, which sees all
from afar, 14 by more than 100 Pa and one by 72; five more lower it.
"""

import os
import sys
from collections import Counter
from pathlib import Path

import pandas as pd

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import measure_pushes
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError

# Files by folder, without `.csv`.
HAND = "biotac_hand_pushes"
GRID_LOW = "soft_skin/grid_r0.20_0.5N_11-02-2025_14-22-29"
GRID_HIGH = "soft_skin/grid_r1.00_3.0N_11-02-2025_15-23-30"
SKIN = "soft_skin/test_18-02-2025_13-00-43"
PRESSES = "barometer/zv05_zd6_t0_20230622_191542"
STAIRS = "barometer/testing_step_20230629_181126"
FORCE = "fingertip_force/pressure_index_1_100Hz"
# Tables of known heights, and the columns that have them.
BY_EYE = ("biotac_hand_pushes/trial2_presses_by_eye", "height_counts")
COMMANDED = (
    "fingertip_force/pressure_index_1_commanded_presses",
    "commanded_peak_N",
)
GATE = "fz_N_plateau_height"
CHANNEL = "pressure"
# File, column, unit, pushes known, and the table and column of known heights.
CASES = (
    (f"{HAND}/trial2", "pdc", "counts", 10, BY_EYE),
    (f"{HAND}/short_dropouts", "pdc", "counts", 5, None),
    (f"{HAND}/short_starts_mid_push", "pdc", "counts", 1, None),
    (f"{HAND}/no_push_constant", "pdc", "counts", 0, None),
    (f"{HAND}/no_push_gaps", "pdc", "counts", 0, None),
    (FORCE, "force_N", "n", 12, COMMANDED),
    (GRID_LOW, "fz_N", "n", 18, (f"{GRID_LOW}_presses_fz_gate", GATE)),
    (GRID_HIGH, "fz_N", "n", 18, (f"{GRID_HIGH}_presses_fz_gate", GATE)),
    (SKIN, "fz_N", "n", 8, (f"{SKIN}_presses_fz_gate", GATE)),
    (PRESSES, "p0_Pa", "pa", 15, None),
    (PRESSES, "p1_Pa", "pa", 6, None),
    (PRESSES, "p2_Pa", "pa", 12, None),
    (PRESSES, "p3_Pa", "pa", 11, None),
    (STAIRS, "p2_Pa", "pa", 2, None),
)


def load(folder: Path, name: str, column: str, unit: str) -> Recording:
    """One channel of a recording."""
    return read_recording(
        folder / f"{name}.csv", mapping={CHANNEL: column}, units={CHANNEL: unit}
    )


def measured(recording: Recording) -> pd.DataFrame:
    """Rows of the pushes of a recording; none where it has none."""
    try:
        return measure_pushes(recording, settings=PeakSettings(channel=CHANNEL)).frame
    except DataError as error:
        if error.code != "no_pushes":
            raise
        return pd.DataFrame(columns=["t_start_s", "t_peak_s", "t_end_s", "flags"])


def line(
    folder: Path,
    name: str,
    column: str,
    unit: str,
    known: int,
    heights: tuple[str, str] | None,
) -> str:
    """One row of the table."""
    recording = load(folder, name, column, unit)
    frame = measured(recording)
    cells = [name.partition("_20")[0], column, str(known), str(len(frame))]
    if frame.empty:
        return " | ".join([*cells, "-", "-", "-"])
    definition = ", ".join(
        f"{n} {word}" for word, n in Counter(frame["definition"]).items()
    )
    flags = Counter(flag for cell in frame["flags"] for flag in cell.split(";") if flag)
    counted = ", ".join(f"{n} {flag}" for flag, n in sorted(flags.items()))
    error = "-"
    if heights is not None:
        table, heights_column = heights
        expected = pd.read_csv(folder / f"{table}.csv")[heights_column].to_numpy()
        off = frame[f"height_{recording.units[CHANNEL]}"].to_numpy() - expected
        error = f"{off.min():+.3g} to {off.max():+.3g}"
    return " | ".join([*cells, counted or "-", definition, error])


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1] if sys.argv[1:] else os.environ["PUSHFIT_REAL_DATA"])
    print("recording | channel | known | found | flags | height | error of the height")
    print("|".join(["---"] * 7))
    for case in CASES:
        print(line(folder, *case))


if __name__ == "__main__":
    main()
