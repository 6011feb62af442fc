"""What one batch is made of: items, each with all that decides its result.

Whether a result is still valid is judged by the key of its item, a digest of contents;
names and times of files decide nothing. Excluded: which files are found
(`pushfit.batch.inputs`).
"""

import functools
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pushfit.batch.inputs import schedule_for, settings_for
from pushfit.config import GraspConfig, read_config
from pushfit.data.recordings.bags.repair import definition_files
from pushfit.data.tables.grasps import GraspRows, is_long_table, read_grasps
from pushfit.data.text.files import FileStamp, existing_file, is_bag, sha256_of
from pushfit.errors import PushfitError
from pushfit.fit.results.environment import environment
from pushfit.mechanics.registry import source_of

# Results of another form are computed again.
FORM = 19


@dataclass(frozen=True, slots=True, kw_only=True)
class ItemFailure:
    """Why an item has no result.

    Args:
        item: Name of the item, or the file that none could be made of.
        stage: "input", "read", "peaks", "fit", "folder" or "worker".
        code: Stable snake_case word for the kind of failure.
        message: Sentence for the user.
    """

    item: str
    stage: str
    code: str
    message: str

    @classmethod
    def of(cls, item: str, stage: str, error: Exception) -> "ItemFailure":
        """What an error means for an item."""
        if isinstance(error, PushfitError):
            # The item is named beside it, and a duplicate has another name.
            text = str(error).replace(f"{item}, ", "").removeprefix(f"{item}: ")
            return cls(item=item, stage=stage, code=error.code, message=text)
        if isinstance(error, OSError):
            place = f"{error.filename}: " if error.filename not in (None, item) else ""
            message = f"{place}{error.strerror or error}"
            return cls(item=item, stage=stage, code="file_error", message=message)
        message = f"this is a bug ({type(error).__name__}: {error})"
        return cls(item=item, stage=stage, code="bug", message=message)


@dataclass(frozen=True, slots=True, kw_only=True)
class Item:
    """One recording, one table, or one grasp of a long table.

    Args:
        name: Path as named, and behind "#" the grasp in a long table.
        path: File or bag folder that holds it.
        sha256: Digest of its content, or of the rows of the grasp.
        size: Size of the content in bytes; alike in size is alike in shape.
        rows: Rows of the grasp; None where the file is the item.
        schedule: Schedule, used if the file is a recording.
        schedule_sha256: Digest of its bytes.
        config: Settings that it is identified with.
        config_from: File that they are from, or "defaults".
        seed: Seed of its randomness, from the user's seed and the content.
        key: Digest of all that its result depends on.
    """

    name: str
    path: str
    sha256: str
    size: int
    rows: GraspRows | None
    schedule: str | None
    schedule_sha256: str | None
    config: GraspConfig
    config_from: str
    seed: int
    key: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Everything that a batch is to identify.

    Args:
        items: What to identify, sorted by name.
        failures: Files that no item could be made of.
    """

    items: tuple[Item, ...]
    failures: tuple[ItemFailure, ...]


class Planner:
    """Makes items; settings and digests that files share are read once.

    What it is given is asked of every item, as of `identify_batch`.

    Raises:
        ConfigError: The common settings or schedule cannot be read.
    """

    def __init__(
        self,
        *,
        config: Path | None,
        profile: Path | None,
        schedule: Path | None,
        seed: int,
        engine: str,
    ) -> None:
        """Read what is common; a mistake there concerns the whole batch."""
        self._config, self._schedule, self._seed = config, schedule, seed
        read = functools.partial(read_config, profile=profile)
        self._settings = functools.cache(read)
        self._digest = functools.cache(sha256_of)
        self._definitions = functools.cache(_definitions_digest)
        self._settings(config)
        if schedule is not None:
            self._digest(existing_file(schedule))
        self._common = {"form": FORM, "engine": engine, "versions": environment()}

    def plan(self, paths: tuple[str, ...]) -> Plan:
        """Look at every file as far as needed to know its items."""
        items: list[Item] = []
        failures: list[ItemFailure] = []
        for path in paths:
            try:
                items += self.items_of(path)
            except Exception as error:
                failures.append(ItemFailure.of(path, "input", error))
        return Plan(
            items=tuple(sorted(items, key=lambda item: item.name)),
            failures=tuple(failures),
        )

    def items_of(self, path: str) -> Iterator[Item]:
        """Items of one file."""
        source = settings_for(path, self._config)
        shared = {
            "path": path,
            "config": self._settings(source),
            "config_from": "defaults" if source is None else str(source),
        }
        if is_long_table(path):
            for rows in read_grasps(path):
                yield self._item(
                    rows.sha256,
                    name=f"{path}#{rows.grasp}",
                    size=rows.frame.size,
                    rows=rows,
                    **shared,
                )
            return
        yield self._item(
            content_digest(path),
            schedule=schedule_for(path, self._schedule),
            name=path,
            size=content_size(path),
            rows=None,
            **shared,
        )

    def _item(
        self,
        sha256: str,
        *,
        config: GraspConfig,
        schedule: Path | None = None,
        **about: Any,
    ) -> Item:
        schedule_sha256 = None if schedule is None else self._digest(str(schedule))
        # By the content alone, from 0 to 2³¹ - 1.
        drawn = digest_of({"seed": self._seed, "content": sha256})
        seed = int(drawn[:8], 16) >> 1
        parts = {
            "content": sha256,
            "schedule": schedule_sha256,
            "config": config.digest(),
            "seed": seed,
        }
        own = source_of(config.grasp.mechanics)
        if own is not None:
            parts["mechanics"] = self._digest(own)
        folder = config.recording.definitions
        if folder is not None and is_bag(about["path"]):
            parts["definitions"] = self._definitions(folder)
        key = digest_of(self._common | parts)
        return Item(
            sha256=sha256,
            schedule=None if schedule is None else str(schedule),
            schedule_sha256=schedule_sha256,
            config=config,
            seed=seed,
            key=key,
            **about,
        )


def digest_of(content: Mapping[str, object]) -> str:
    """Sha256 of a document in canonical JSON, hexadecimal."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def content_digest(path: str) -> str:
    """Sha256 of a file, or of the names and digests of the files in a bag folder."""
    if not os.path.isdir(path):
        return sha256_of(path)
    return digest_of({p.name: sha256_of(p) for p in _files_in(path)})


def content_size(path: str) -> int:
    """Size of a file, or of all files in a bag folder [bytes]."""
    files = _files_in(path) if os.path.isdir(path) else [Path(path)]
    return sum(FileStamp.of(str(file)).size for file in files)


def _definitions_digest(folder: str) -> str:
    return digest_of({n: sha256_of(file) for n, file in definition_files(folder)})


def _files_in(folder: str) -> list[Path]:
    return sorted(path for path in Path(folder).iterdir() if path.is_file())
