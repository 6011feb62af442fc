"""From files and settings to recordings and tables, as every command reads them.

Excluded: the readers themselves, of recordings (`pushfit.data.recordings.recording`)
and of tables (`pushfit.data.tables.peak_table`).
"""

from pathlib import Path
from typing import Any

from pushfit.config import GraspConfig
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.plans.schedule import read_schedule
from pushfit.data.recordings.recording import read_recording
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.units import stated_calibration
from pushfit.errors import placed_in

# Where `[recording]` and `read_recording` have different words.
READER_NAMES = {"map": "mapping", "unit": "units"}


def reader_options(config: GraspConfig) -> dict[str, Any]:
    """Keywords of `read_recording` that a configuration asks for."""
    layout = config.recording.model_dump()
    calibration = config.recording.calibration
    layout["calibration"] = {
        channel: stated_calibration(section) for channel, section in calibration.items()
    }
    return {READER_NAMES.get(key, key): value for key, value in layout.items()}


def configured_recording(path: str | Path, config: GraspConfig) -> Recording:
    """Read a recording as the settings say."""
    with placed_in(str(path)):
        return read_recording(path, **reader_options(config))


def configured_peaks(
    recording: Recording, schedule: str | Path | None, config: GraspConfig
) -> PeakTable:
    """Extract the peaks of a recording as the settings say.

    Args:
        schedule: File with the directions of its pushes; None if the recording has
            angles.
    """
    plan = None if schedule is None else read_schedule(schedule)
    return extract_peaks(recording, plan, settings=config.peaks)
