"""From the files that a command names to settings and tables, with a word on each."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pushfit.cli.session import Session
from pushfit.errors import ConfigError

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.table import PeakTable

# Where `[recording]` and `read_recording` have different words.
READER_NAMES = {"map": "mapping", "unit": "units"}


def reader_options(config: "GraspConfig") -> dict[str, Any]:
    """Keywords of `read_recording` that a configuration asks for.

    Args:
        config: Settings in force.

    Returns:
        Keywords.
    """
    layout = config.recording.model_dump()
    return {READER_NAMES.get(key, key): value for key, value in layout.items()}


def load_peaks(
    session: Session,
    recordings: Sequence[Path],
    schedules: Sequence[Path],
    config: "GraspConfig",
) -> "PeakTable":
    """Peak heights of one or several recordings of one grasp.

    Args:
        session: Where notes go.
        recordings: Files.
        schedules: Their schedules, in the same order; none if the recordings have
            angle columns.
        config: Settings in force.

    Returns:
        One table.

    Raises:
        ConfigError: The schedules do not go with the recordings.
    """
    from pushfit.data.merge import merge_tables
    from pushfit.data.peaks import extract_peaks
    from pushfit.data.recording import read_recording
    from pushfit.data.schedule import read_schedule

    if schedules and len(schedules) != len(recordings):
        raise ConfigError(
            f"{len(recordings)} recordings and {len(schedules)} schedules; give "
            "--schedule once for each recording, in the same order",
            code="schedule_count",
        )
    tables = []
    for index, path in enumerate(recordings):
        recording = read_recording(path, **reader_options(config))
        schedule = read_schedule(schedules[index]) if schedules else None
        table = extract_peaks(recording, schedule, settings=config.peaks)
        for note in table.notes:
            session.say_more(f"{path}: {note}")
        tables.append(table)
    return merge_tables(tables)
