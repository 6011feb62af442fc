"""The folder of a batch, and in it the folders of single items.

Excluded: what is kept of the items in one file (`pushfit.batch.store`).
"""

import hashlib
import re
import shutil
from collections.abc import Mapping
from pathlib import Path

from pushfit.atomic import followed
from pushfit.data.text.files import sha256_of
from pushfit.errors import ConfigError
from pushfit.report.store.output_folder import check_place

STORE = "batch.sqlite"
RESULTS, FAILURES, PARQUET = "results.csv", "failures.csv", "results.parquet"
POPULATION, REPORT = "population.csv", "report.html"
OUTPUTS = (RESULTS, FAILURES, PARQUET, POPULATION, REPORT)
FOLDER, SUMMARY = "items", "summary.json"
# Long enough to be told apart, short enough for every file system.
_LONGEST = 60


def folder_name(item: str) -> str:
    """Name of the folder of an item, harmless whatever the item is called.

    Returns:
        Letters, digits, ".", "-" and "_" of the name, and a digest that keeps names
        apart which differ in other characters or in case.
    """
    clean = re.sub(r"[^A-Za-z0-9.-]+", "_", item).strip("._-")
    digest = hashlib.sha256(item.encode("utf-8", "backslashreplace")).hexdigest()
    return f"{clean[-_LONGEST:].lstrip('._-') or 'item'}-{digest[:8]}"


def is_current(folder: Path, key: str, written: Mapping[str, tuple[str, str]]) -> bool:
    """Whether a folder still holds an item's result, by key and digest as written."""
    summary = folder / SUMMARY
    return summary.is_file() and written.get(folder.name) == (key, sha256_of(summary))


def begin_folder(folder: Path) -> None:
    """Make the folder of a batch, or check that it is one."""
    check_place(folder)
    if folder.exists() and not folder.is_dir():
        raise ConfigError(
            f"{folder}: is a file; name a folder for the batch", code="output_exists"
        )
    followed(folder).mkdir(exist_ok=True)
    check_place(folder / FOLDER)
    entries = {entry.name for entry in folder.iterdir()}
    strange = min((name for name in entries if not _is_ours(name)), default="")
    if strange and STORE not in entries:
        raise ConfigError(
            f"{folder}: holds {strange}, which is no part of a batch; name another "
            "folder",
            code="output_not_a_batch",
        )


def remove_leftovers(folder: Path) -> None:
    """Remove what killed runs left half written; call it under the store's lock."""
    for name in OUTPUTS:
        for path in folder.glob(f".{name}.*.tmp"):
            path.unlink(missing_ok=True)
    for pattern in (".*.partial", ".*.old"):
        for path in (folder / FOLDER).glob(pattern):
            shutil.rmtree(path, ignore_errors=True)


def _is_ours(name: str) -> bool:
    """Whether a batch makes files of this name."""
    mine = (STORE, *OUTPUTS)
    return name == FOLDER or name.lstrip(".").startswith(mine)
