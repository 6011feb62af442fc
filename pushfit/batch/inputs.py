"""Which files a batch is asked for, and which settings and schedule go with each.

Excluded: what the files hold (`pushfit.batch.items`).
"""

import glob
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pushfit.batch.folders import STORE
from pushfit.data.text.files import SEARCHED, existing_files, is_bag
from pushfit.report.store.output_folder import RESULT

SCHEDULE, SETTINGS = "schedule.csv", "grasp.toml"
_WILD = frozenset("*?[")


@dataclass(frozen=True, slots=True, kw_only=True)
class Inputs:
    """Files to identify.

    Args:
        paths: Files and bag folders as the user named them, sorted, each once.
        left_out: Files of other kinds, folders of results, and schedules and settings
            that go with none of the paths, among them, sorted.
    """

    paths: tuple[str, ...]
    left_out: tuple[str, ...]


def find_inputs(
    inputs: Sequence[str | Path], *, out: Path, common: Iterable[Path | None] = ()
) -> Inputs:
    """Look through files, folders and patterns.

    Folders of results are searched only where they are named themselves: what was made
    of a grasp is not a second one.

    Args:
        inputs: Files, folders (searched with all below them, for `SEARCHED`) and
            patterns, of which `**` stands for any folders.
        out: Folder of the results, which is never searched.
        common: Settings and schedules that go with all of them.

    Raises:
        ConfigError: Something named does not exist; all such are listed.
    """
    matched = {str(given): _matches(str(given)) for given in inputs}
    named = [given for given, found in matched.items() if not found]
    existing_files(named)
    results = {path for found in matched.values() for path in _results(found, out)}
    matches = [
        path
        for found in matched.values()
        for path in found
        if results.isdisjoint((path, *map(str, Path(path).parents)))
    ]
    exact = {*named, *matches}
    searched = {path for path in exact if os.path.isdir(path) and not is_bag(path)}
    below = {path for folder in searched for path in _below(folder, out)}
    kept = (exact - searched) | {path for path in below if _is_data(path)}
    wanted = {os.path.normpath(path) for path in kept if not _is_companion(path)}
    others = {os.path.normpath(path) for path in (exact - searched) | below | results}
    beside = {
        goes_with(p, None) for p in wanted for goes_with in (settings_for, schedule_for)
    }
    used = {os.path.normpath(path) for path in {*beside, *common} if path is not None}
    own = out.resolve()
    left_out = {
        path
        for path in others - wanted - used
        if own not in (place := Path(path).resolve(), *place.parents)
    }
    return Inputs(paths=tuple(sorted(wanted)), left_out=tuple(sorted(left_out)))


def settings_for(path: str, common: Path | None) -> Path | None:
    """Settings of a file: `NAME.toml` or `grasp.toml` beside it, or the common ones."""
    return _companion(path, f"{stem_of(path)}.toml", SETTINGS) or common


def schedule_for(path: str, common: Path | None) -> Path | None:
    """The same of its schedule: `NAME.schedule.csv`, `schedule.csv`, or the common."""
    return _companion(path, f"{stem_of(path)}.{SCHEDULE}", SCHEDULE) or common


def stem_of(path: str) -> str:
    """Name of a file without what says how it is stored: foam of `runs/foam.csv.gz`."""
    name = Path(path).name
    while (suffix := Path(name).suffix) and suffix.lower() in SEARCHED:
        name = name.removesuffix(suffix)
    return name


def _companion(path: str, *names: str) -> Path | None:
    beside = (Path(path).parent / name for name in names)
    return next((candidate for candidate in beside if candidate.is_file()), None)


def _matches(given: str) -> list[str]:
    """Files that a pattern means; a name that exists is no pattern."""
    if os.path.exists(given) or not _WILD.intersection(given):
        return []
    return sorted(glob.glob(given, recursive=True))


def _results(paths: Sequence[str], out: Path) -> set[str]:
    """Folders of results that some paths are in, or are themselves."""
    folders = {str(folder) for path in paths for folder in (path, *Path(path).parents)}
    found = {folder for folder in folders if _is_result(folder, out)}
    return {
        folder for folder in found if found.isdisjoint(map(str, Path(folder).parents))
    }


def _is_result(folder: str, out: Path) -> bool:
    """Whether a folder is that of the results, or holds others."""
    place = Path(folder)
    is_batch = (place / STORE).is_file()
    is_one = all((place / name).is_file() for name in RESULT)
    return is_batch or is_one or place.resolve() == out.resolve()


def _below(folder: str, out: Path) -> Iterator[str]:
    """Files, bags and folders of results under a folder, but for hidden ones."""
    seen = set()
    for here, folders, files in os.walk(folder, followlinks=True):
        place = os.path.realpath(here)
        if place in seen:  # links may go in circles
            folders.clear()
            continue
        seen.add(place)
        shown = sorted(name for name in folders if not name.startswith("."))
        whole = [
            name
            for name in shown
            if is_bag(path := os.path.join(here, name)) or _is_result(path, out)
        ]
        folders[:] = [name for name in shown if name not in whole]
        own = [name for name in files if not name.startswith(".")]
        yield from (os.path.join(here, name) for name in (*whole, *own))


def _is_data(path: str) -> bool:
    if os.path.isdir(path):
        return is_bag(path)
    return Path(path).suffix.lower() in SEARCHED


def _is_companion(path: str) -> bool:
    """Whether a file, named by a shell's pattern perhaps, is a schedule or settings."""
    name = Path(path).name.lower()
    return name.endswith((SCHEDULE, ".toml"))
