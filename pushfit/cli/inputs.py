"""From the files that a command names to settings and tables, with a word on each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pushfit.cli.session import Session
from pushfit.errors import ConfigError

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.table import PeakTable


def read_settings(
    config: Path | None,
    *,
    profile: Path | None,
    format: str | None,
    map: Sequence[str] | None,
    unit: Sequence[str] | None,
    columns: str | None,
    invert: bool = False,
) -> "GraspConfig":
    """Settings of the files, and of the options that override them.

    Args:
        config: Configuration file.
        profile: File with what a laboratory always states.
        format: Dialect.
        map: `channel=column` each.
        unit: `channel=unit` each.
        columns: Names of all columns, between commas.
        invert: Whether pushes go downwards.

    Returns:
        The settings.

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
    changes: dict[str, Mapping[str, object]] = {"recording": stated} if stated else {}
    if invert:
        changes["peaks"] = {"invert": True}
    return read_config(config, profile=profile, changes=changes)


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
    from pushfit.data.check import expect_kind
    from pushfit.data.files import existing_files
    from pushfit.data.load import (
        configured_peaks,
        configured_recording,
        reader_options,
    )
    from pushfit.data.merge import merge_tables

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
            session.say_more(f"{path}: {note}")
        tables.append(table)
    return merge_tables(tables)


def load_table(path: Path, config: "GraspConfig") -> "PeakTable":
    """Peak heights from a file that holds them.

    Args:
        path: Table.
        config: Settings in force.

    Returns:
        The table.

    Raises:
        DataError: It is something else, or breaks a rule.
    """
    from pushfit.data.check import expect_kind
    from pushfit.data.load import reader_options
    from pushfit.data.table import read_table

    expect_kind(path, "table", **reader_options(config))
    return read_table(path)
