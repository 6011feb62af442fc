"""Find everything that is wrong with a set of input files, without stopping.

Each file goes through the very reader that would read it, so that what passes here
also reads, and what does not says the same here and there. Excluded: whether files go
together (`pushfit.workflow`).
"""

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from pushfit.config import read_config
from pushfit.data.plans.schedule import read_schedule
from pushfit.data.recordings.recognise import RecordingColumns
from pushfit.data.recordings.recording import read_recording
from pushfit.data.tables.columns import is_parquet
from pushfit.data.tables.grasps import read_tables
from pushfit.data.tables.rules import CHANNELS
from pushfit.data.text.dialects import find_layout
from pushfit.data.text.faults import refuse
from pushfit.data.text.files import existing_file, is_bag
from pushfit.data.text.foreign import foreign_table
from pushfit.data.text.textfile import TextFile, open_text
from pushfit.errors import InputProblem, PushfitError

FileKind = Literal["recording", "schedule", "table", "settings"]
_SETTINGS = "is a file of settings; give it as `config`, and the data beside it"
INSTEAD: dict[tuple[FileKind, FileKind], str] = {
    ("recording", "table"): (
        "is a table of peak heights, no recording; use `pushfit fit` for it"
    ),
    ("recording", "schedule"): (
        "is a schedule, no recording; name the recording, and this as its schedule"
    ),
    ("table", "recording"): (
        "is a recording, no table of peak heights; `pushfit peaks` makes one of it, "
        "and `pushfit identify` does everything"
    ),
    ("table", "schedule"): (
        "is a schedule, no table of peak heights; `pushfit peaks` makes one of a "
        "recording and this"
    ),
    ("recording", "settings"): _SETTINGS,
    ("table", "settings"): _SETTINGS,
}

# First columns of the tables that a batch writes, and what is in them.
OF_A_BATCH: dict[tuple[str, ...], str] = {
    ("item", "status"): "the results of a batch, one row for each item",
    ("item", "stage"): "the failures of a batch, one row for each of them",
    ("quantity", "unit"): "what the items of a batch have in common",
}
# Bytes of a file that show these.
_HEAD = 64
# Of an angle in degrees, beyond which rounding begins.
_DECIMALS = 6
_PLAN = frozenset({"push", "theta", "alpha", "repeat", "time"})


def file_kind(path: str | Path, **recording_options: Any) -> FileKind:
    """Recognise by its columns whether a file is a recording, schedule or peak table.

    Args:
        **recording_options: As for `pushfit.data.recordings.recording.read_recording`.

    Returns:
        `table` if there are heights, `schedule` if there are angles but neither signals
        nor samples in time (elevations alone, with nothing that a plan lacks, are one
        that is not complete), `settings` if the name ends in .toml, else `recording`.

    Raises:
        ConfigError: If the path cannot be read.
        DataError: If the file is no table of text, or one that a batch wrote.
    """
    given = existing_file(path)
    if Path(given).suffix.lower() == ".toml":
        return "settings"
    if is_parquet(given):
        return "table"
    if is_bag(given) or recording_options.get("format", "auto") != "auto":
        return "recording"
    if foreign_table(given, columns=recording_options.get("columns", ())):
        return "recording"
    text = open_text(given, encoding=recording_options.get("encoding"))
    _refuse_of_a_batch(text)
    names = find_layout(text, columns=recording_options.get("columns", ())).names
    columns = RecordingColumns(names)
    stems = {*columns.stems}
    if not stems.isdisjoint(CHANNELS):
        return "table"
    is_signal = bool(columns.measuring("signal"))
    stated = {*recording_options.get("mapping", {}).values()}
    stated |= {*recording_options.get("units", {})}
    # Samples of a log have a time and readings whose unit is not said; a plan has none.
    is_log = bool(columns.measuring("time")) and not stems <= _PLAN
    has_angles = {"theta", "alpha"} <= stems or ("theta" in stems and stems <= _PLAN)
    has_plan = has_angles and not is_signal and not is_log
    if has_plan and any(stem.startswith("height") for stem in stems):
        # Of a unit that is not known; the reader of tables says so.
        return "table"
    return "schedule" if has_plan and stated.isdisjoint(names) else "recording"


def _refuse_of_a_batch(text: TextFile) -> None:
    """Refuse what `pushfit batch` wrote, which may have no number in it."""
    first, *_ = text.head(_HEAD).decode(errors="replace").splitlines() or [""]
    written = OF_A_BATCH.get(tuple(first.split(",")[:2]))
    if written is not None:
        raise refuse(
            "batch_output",
            f"holds {written}, and no command reads it; open it in a spreadsheet, or "
            "report.html beside it in a browser. What was measured is in the files "
            "that `pushfit batch` was given",
            path=text.path,
        )


def expect_kind(
    path: str | Path, kind: Literal["recording", "table"], **recording_options: Any
) -> None:
    """Refuse a file of another kind before its reader misunderstands it.

    Args:
        **recording_options: As for `pushfit.data.recordings.recording.read_recording`.

    Raises:
        DataError: The file is something else (`wrong_kind`).
    """
    found = file_kind(path, **recording_options)
    if found != kind:
        raise refuse("wrong_kind", INSTEAD[kind, found], path=str(path))


def directions(
    theta: Float[np.ndarray, " n"], alpha: Float[np.ndarray, " n"]
) -> dict[str, object]:
    """Where pushes go: lowest and highest angle, and how many directions there are."""
    degrees = np.round(np.degrees([theta, alpha]), _DECIMALS)
    lowest, highest = degrees.min(axis=1).tolist(), degrees.max(axis=1).tolist()
    return {
        "directions": np.unique(degrees, axis=1).shape[1],
        "theta_deg": [lowest[0], highest[0]],
        "alpha_deg": [lowest[1], highest[1]],
    }


def check_files(
    paths: Iterable[str | Path], **recording_options: Any
) -> tuple[InputProblem, ...]:
    """Find all problems of all files.

    Args:
        paths: Recordings, schedules, peak tables and settings, in any mixture.
        **recording_options: As for `pushfit.data.recordings.recording.read_recording`;
            they apply to the recordings.

    Returns:
        The problems, file by file; empty if every file can be read.
    """
    return tuple(
        found for path in paths for found in _check_file(path, recording_options)
    )


def _check_file(
    path: str | Path, recording_options: dict[str, Any]
) -> tuple[InputProblem, ...]:
    readers = {
        "recording": partial(read_recording, **recording_options),
        "schedule": read_schedule,
        "table": read_tables,
        "settings": read_config,
    }
    try:
        readers[file_kind(path, **recording_options)](path)
    except PushfitError as error:
        whole = InputProblem(code=error.code, message=str(error), path=str(path))
        return error.problems or (whole,)
    return ()
