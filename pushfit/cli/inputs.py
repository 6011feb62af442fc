"""From the files that a command names to settings and tables, with a word on each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from pushfit.cli.session import Session
from pushfit.errors import ConfigError

_NOTHING: Mapping[str, object] = MappingProxyType({})

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.tables.peak_table import PeakTable


def read_settings(
    config: Path | None,
    *,
    profile: Path | None,
    format: str | None,
    map: Sequence[str] | None,
    unit: Sequence[str] | None,
    columns: str | None,
    rate: float | None = None,
    peaks: Mapping[str, object] = _NOTHING,
) -> "GraspConfig":
    """Settings of the files, and of the options that override them.

    Args:
        map: `channel=column` each.
        unit: `channel=unit` each.
        columns: Names of all columns, between commas.
        rate: Samples per second of recordings without a time.
        peaks: What options say of `[peaks]`; None where they do not.

    Raises:
        ConfigError: A file is wrong, or an option is no pair.
    """
    from pushfit.config import read_config

    stated: dict[str, object] = {}
    if format is not None:
        stated["format"] = format
    if map:
        stated["map"] = dict(_pair(text, "--map") for text in map)
    if unit:
        stated["unit"] = dict(_pair(text, "--unit") for text in unit)
    if columns is not None:
        stated["columns"] = [name.strip() for name in columns.split(",")]
    if rate is not None:
        stated["rate"] = rate
    changes: dict[str, Mapping[str, object]] = {"recording": stated} if stated else {}
    own = {key: value for key, value in peaks.items() if value not in (None, False, [])}
    for key in ("exclude", "include"):
        if key in own:
            own[key] = [_window(text, f"--{key}") for text in _texts(own[key])]
    if own:
        changes["peaks"] = own
    return read_config(config, profile=profile, changes=changes)


def _texts(given: object) -> list[str]:
    return [str(text) for text in given] if isinstance(given, list) else []


def _window(text: str, option: str) -> tuple[float, float]:
    first, _, last = text.partition(":")
    try:
        return float(first), float(last)
    except ValueError:
        raise ConfigError(
            f"{option} {text} is no window; write for example {option} 12.0:13.5",
            code="no_window",
        ) from None


def _pair(text: str, option: str) -> tuple[str, str]:
    key, sign, value = text.partition("=")
    if not (key and sign and value):
        example = "pressure=pdc" if option == "--map" else "pressure=counts"
        raise ConfigError(
            f"{option} {text} is no pair; write for example {option} {example}",
            code="no_pair",
        )
    return key, value


def load_peaks(
    session: Session,
    recordings: Sequence[Path],
    schedules: Sequence[Path],
    config: "GraspConfig",
) -> "PeakTable":
    """Peak heights of one or several recordings of one grasp.

    Args:
        schedules: Their schedules, in the same order; none if the recordings have
            angle columns.

    Raises:
        ConfigError: The schedules do not go with the recordings.
    """
    from pushfit.data.recordings.check import expect_kind
    from pushfit.data.recordings.load import (
        configured_peaks,
        configured_recording,
        reader_options,
    )
    from pushfit.data.tables.merge import merge_tables
    from pushfit.data.text.files import existing_files

    existing_files([*recordings, *schedules])
    if schedules and len(schedules) != len(recordings):
        raise ConfigError(
            f"{len(recordings)} recordings and {len(schedules)} schedules; give "
            "--schedule once for each recording, in the same order",
            code="schedule_count",
        )
    tables = []
    for index, path in enumerate(recordings):
        expect_kind(path, "recording", **reader_options(config))
        recording = configured_recording(path, config)
        schedule = schedules[index] if schedules else None
        table = configured_peaks(recording, schedule, config)
        for note in table.notes:
            tell = session.warn if note in table.cautions else session.say_more
            tell(f"{path}: {note}")
        tables.append(table)
    return merge_tables(tables)


def load_table(path: Path, config: "GraspConfig") -> "PeakTable":
    """Peak heights from a file that holds them.

    Raises:
        DataError: It is something else, or breaks a rule.
    """
    from pushfit.data.recordings.check import expect_kind
    from pushfit.data.recordings.load import reader_options
    from pushfit.data.tables.peak_table import read_table

    expect_kind(path, "table", **reader_options(config))
    return read_table(path)
