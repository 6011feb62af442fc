"""Which files a batch is asked for, and which settings and schedule go with each.

Excluded: what the files hold (`pushfit.batch.items`).
"""

import glob
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pushfit.data.text.files import existing_files, is_bag

# What a folder is searched for; anything may be named.
SUFFIXES = frozenset(
    {".csv", ".tsv", ".txt", ".gz", ".parquet", ".pq", ".bag", ".db3", ".mcap"}
)
SCHEDULE, SETTINGS = "schedule.csv", "grasp.toml"
_WILD = frozenset("*?[")


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """Files to identify.

    Args:
        paths: Files and bag folders as the user named them, sorted, each once.
        left_out: Schedules, settings and files of other kinds among them, sorted.
    """

    paths: tuple[str, ...]
    left_out: tuple[str, ...]


def find_inputs(inputs: Sequence[str | Path], *, out: Path) -> Inputs:
    """Look through files, folders and patterns.

    Args:
        inputs: Files, folders (searched with all below them) and patterns, of which
            `**` stands for any folders.
        out: Folder of the results, which is never searched.

    Raises:
        ConfigError: Something named does not exist; all such are listed.
    """
    named = [path for given in inputs for path in _expanded(str(given))]
    existing_files(named)
    exact = {os.path.normpath(path) for path in named if not _is_searched(path)}
    below = {
        os.path.normpath(path)
        for folder in named
        if _is_searched(folder)
        for path in _below(folder, out)
    }
    kept = exact | {path for path in below if _is_data(path)}
    wanted = {path for path in kept if not _is_companion(path)}
    left_out = (exact | below) - wanted
    return Inputs(paths=tuple(sorted(wanted)), left_out=tuple(sorted(left_out)))


def settings_for(path: str, common: Path | None) -> Path | None:
    """Settings of a file: `NAME.toml` or `grasp.toml` beside it, or the common ones."""
    return _companion(path, f"{stem_of(path)}.toml", SETTINGS) or common


def schedule_for(path: str, common: Path | None) -> Path | None:
    """The same of its schedule: `NAME.schedule.csv`, `schedule.csv`, or the common."""
    return _companion(path, f"{stem_of(path)}.{SCHEDULE}", SCHEDULE) or common


def stem_of(path: str) -> str:
    """Name of a file without what says how it is stored.

    Args:
        path: File, for example `runs/foam.csv.gz`.

    Returns:
        For example `foam`.
    """
    name = Path(path).name
    while (suffix := Path(name).suffix) and suffix.lower() in SUFFIXES:
        name = name.removesuffix(suffix)
    return name


def _companion(path: str, *names: str) -> Path | None:
    beside = (Path(path).parent / name for name in names)
    return next((candidate for candidate in beside if candidate.is_file()), None)


def _expanded(given: str) -> list[str]:
    """Files that a pattern means; a name that exists is no pattern."""
    if os.path.exists(given) or not _WILD.intersection(given):
        return [given]
    return sorted(glob.glob(given, recursive=True)) or [given]


def _is_searched(path: str) -> bool:
    return os.path.isdir(path) and not is_bag(path)


def _below(folder: str, out: Path) -> Iterator[str]:
    """Files and bag folders under a folder, without hidden ones and the results."""
    for here, folders, files in os.walk(folder):
        bags = [name for name in folders if is_bag(os.path.join(here, name))]
        yield from (os.path.join(here, name) for name in bags)
        folders[:] = [
            name
            for name in folders
            if not name.startswith(".")
            and name not in bags
            and Path(here, name).resolve() != out.resolve()
        ]
        yield from (os.path.join(here, n) for n in files if not n.startswith("."))


def _is_data(path: str) -> bool:
    return os.path.isdir(path) or Path(path).suffix.lower() in SUFFIXES


def _is_companion(path: str) -> bool:
    """Whether a file, named by a shell's pattern perhaps, is a schedule or settings."""
    name = Path(path).name.lower()
    return name.endswith((SCHEDULE, ".toml"))
