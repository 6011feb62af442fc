"""From the files that a command names to settings and tables, with a word on each.

Excluded: the readers (`pushfit.data.load`).
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pushfit.cli.options import SettingsOptions
from pushfit.cli.session import CommandSession
from pushfit.errors import ConfigError, counted

if TYPE_CHECKING:
    from pushfit.config import GraspConfig
    from pushfit.data.tables.peak_table import PeakTable


def read_settings(layout: SettingsOptions, **peaks: Any) -> "GraspConfig":
    """Settings of the files, and of the options that override them.

    Args:
        peaks: What options say of `[peaks]`; None, False and [] say nothing.
    """
    from pushfit.config import read_config

    names = layout.columns
    stated = {
        "format": layout.format,
        "map": dict(_pair(text, "--map") for text in layout.map or ()) or None,
        "unit": dict(_pair(text, "--unit") for text in layout.unit or ()) or None,
        "columns": None if names is None else [n.strip() for n in names.split(",")],
        "rate": layout.rate,
    }
    # 0 is said, though Python takes it for False.
    silent = (type(None), bool, list)
    own = {k: v for k, v in peaks.items() if v or not isinstance(v, silent)}
    for key in ("exclude", "include"):
        if key in own:
            own[key] = [_window(text, f"--{key}") for text in own[key]]
    changes = {
        "recording": {k: value for k, value in stated.items() if value is not None},
        "peaks": own,
    }
    changes = {section: keys for section, keys in changes.items() if keys}
    return read_config(layout.config, profile=layout.profile, changes=changes)


def warn_of_unread(session: CommandSession, config: Path | None, *inputs: Path) -> None:
    """Say so where settings lie beside the inputs and no option names any."""
    if config is None:
        beside = [path.parent / "grasp.toml" for path in inputs]
        found = next((path for path in beside if path.is_file()), None)
        if found is not None:
            session.warn(
                f"{found} is not read; give --config {found} if it belongs here"
            )


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
    session: CommandSession,
    recordings: Sequence[Path],
    schedules: Sequence[Path],
    *,
    config: "GraspConfig",
) -> "PeakTable":
    """Peak heights of one or several recordings of one grasp.

    Args:
        schedules: Their schedules, in the same order; none if the recordings have
            angle columns.
    """
    from pushfit.data.check import expect_kind
    from pushfit.data.load import configured_peaks, configured_recording, reader_options
    from pushfit.data.tables.merge import merge_tables

    if schedules and len(schedules) != len(recordings):
        raise ConfigError(
            f"{counted(len(recordings), 'recording')} and "
            f"{counted(len(schedules), 'schedule')}; give --schedule once for "
            "each recording, in the same order",
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
    merged = merge_tables(tables)
    # Reports repeat them, and who reads one typed a command.
    return replace(merged, notes=tuple(map(session.worded, merged.notes)))


def load_table(path: Path, config: "GraspConfig") -> "PeakTable":
    """Peak heights from a file that holds them."""
    from pushfit.data.check import expect_kind
    from pushfit.data.load import reader_options
    from pushfit.data.tables.peak_table import read_table

    expect_kind(path, "table", **reader_options(config))
    return read_table(path)
