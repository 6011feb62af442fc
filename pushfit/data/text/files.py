"""What a path leads to, before its content is read.

Excluded: its text, decompressed and decoded (`pushfit.data.text.textfile`).
"""

import codecs
import difflib
import hashlib
import os
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from pushfit.data.text.faults import ALIKE, refuse
from pushfit.errors import ConfigError, InputProblem

# First bytes, what they are, what to do about it.
_MAGIC: tuple[tuple[bytes, str, str], ...] = (
    (b"PK\x03\x04", "a zip or xlsx file", "export the sheet as CSV, or unpack it"),
    (b"\xd0\xcf\x11\xe0", "an old Excel file", "export the sheet as CSV"),
    (b"\x89HDF", "an HDF5 or MATLAB file", "export the signals as CSV"),
    (b"MATLAB 5.0", "a MATLAB file", "export the signals as CSV"),
    (b"PAR1", "a Parquet file", "export it as CSV"),
    (b"%PDF", "a PDF file", "give the data file itself"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard file", "decompress it, or use gzip"),
    (b"BZh", "a bzip2 file", "decompress it, or use gzip"),
    (b"\xfd7zXZ", "an xz file", "decompress it, or use gzip"),
    (
        b"version https://git-lfs",
        "a Git LFS pointer, not the data",
        "run `git lfs pull`",
    ),
)
# The same of text, in lower case, without blanks before it.
_OTHER_TEXTS: tuple[tuple[tuple[bytes, ...], str, str], ...] = (
    (
        (b"<!doctype", b"<html", b"<?xml", b"<head"),
        "a web page, perhaps an error page saved under this name",
        "download the data again",
    ),
    (
        (b'{"event"',),
        "the journal of an exploration, with which `pushfit explore` goes on",
        "its pushes are in peaks.csv of the result",
    ),
    ((b"{", b"[{", b"[["), "JSON", "export the signals as CSV"),
)
# Endings of files that are known by them, and of those that folders are searched for:
# not `.log`, as programs leave logs of their own beside recordings.
PARQUET_SUFFIXES = frozenset({".parquet", ".pq"})
NUMPY = frozenset({".npy", ".npz"})
GZIP = ".gz"
SEARCHED = frozenset(
    {
        ".csv",
        ".tsv",
        ".txt",
        GZIP,
        ".ddf",
        ".bag",
        ".db3",
        ".mcap",
        *PARQUET_SUFFIXES,
        *NUMPY,
    }
)
# What to do with a pipe.
ONCE = "save what comes from it as a file, and name that"
_BAG_MAGIC = (b"#ROSBAG V", b"SQLite format 3\x00", b"\x89MCAP0\r\n")


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where data came from.

    Args:
        path: File as the user named it.
        sha256: Digest of the file's bytes, hexadecimal.
        dialect: What the reader recognised.
    """

    path: str
    sha256: str
    dialect: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FileStamp:
    """What tells that a file changed.

    Args:
        path: File as the user named it.
        size: Its length [bytes].
        mtime_ns: Time of its last change [ns].
    """

    path: str
    size: int
    mtime_ns: int

    @classmethod
    def of(cls, path: str) -> "FileStamp":
        """Take the stamp of an existing file."""
        status = os.stat(path)
        return cls(path=path, size=status.st_size, mtime_ns=status.st_mtime_ns)

    def check(self) -> None:
        """Raise a `DataError` (`file_changed`) if the file is not as it was."""
        try:
            same = FileStamp.of(self.path) == self
        except OSError:
            same = False
        if not same:
            raise refuse(
                "file_changed",
                "the file changed while it was read; wait until its writer has closed "
                "it and read it again",
                path=self.path,
            )


def sha256_of(path: str | Path) -> str:
    """Digest the bytes of a file, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def existing_file(path: str | Path) -> str:
    """Check that a path can be read.

    Raises:
        ConfigError: If there is no such file (`file_not_found`), or it may not be read
            or is a pipe (`file_not_readable`).
        DataError: If a recorder still has the file open (`bag_active`).
    """
    given = Path(path)
    if str(path) == "-":
        raise ConfigError(f"-: is no name of a file; {ONCE}", code="file_not_found")
    if not given.exists():
        folder = given.parent
        siblings = [p.name for p in folder.iterdir()] if folder.is_dir() else []
        near = difflib.get_close_matches(given.name, siblings, n=1, cutoff=ALIKE)
        hint = f"; did you mean {folder / near[0]}?" if near else ""
        raise ConfigError(f"{path}: no such file{hint}", code="file_not_found")
    if not (given.is_file() or given.is_dir()):
        raise ConfigError(
            f"{path}: is a pipe or a device, which can be read only once; {ONCE}",
            code="file_not_readable",
        )
    if not os.access(given, os.R_OK):
        raise ConfigError(
            f"{path}: may not be read; check its permissions", code="file_not_readable"
        )
    if given.suffix == ".active":
        raise refuse(
            "bag_active",
            "the recorder still has this bag open; stop it, or run `rosbag reindex`",
            path=str(path),
        )
    return str(path)


def existing_files(paths: Iterable[str | Path]) -> None:
    """Check that all paths can be read, before any of them is.

    Raises:
        ConfigError: If some cannot; `.problems` lists all of them.
        DataError: If a recorder still has one of them open.
    """
    problems = []
    for path in paths:
        try:
            existing_file(path)
        except ConfigError as error:
            whole = InputProblem(code=error.code, message=str(error), path=str(path))
            problems.append(whole)
    if problems:
        message = "; ".join(found.message for found in problems)
        raise ConfigError(message, code=problems[0].code, problems=tuple(problems))


def is_bag(path: str) -> bool:
    """Tell whether a file, or a ROS 2 bag folder, is a bag by its first bytes."""
    if Path(path).is_dir():
        return (Path(path) / "metadata.yaml").is_file()
    with open(path, "rb") as file:
        return file.read(16).startswith(_BAG_MAGIC)


def refuse_other_types(start: bytes, path: str) -> None:
    """Refuse what its name or its first bytes show to be no table of text.

    Args:
        start: First bytes, decompressed.

    Raises:
        DataError: If it is something else (`not_csv`).
    """
    if Path(path).suffix.lower() == ".btd":
        raise refuse(
            "not_csv",
            "is a SynTouch BioTac log (.btd); open it with the BioTac program that "
            "recorded it and save it as text, then state the columns: "
            "`columns=['time_s', 'pdc_counts', '...']` and `rate` if none of them is a "
            "time",
            path=path,
        )
    text = start.lstrip(codecs.BOM_UTF8).lstrip().lower()
    for begin, known in ((start, _MAGIC), (text, _OTHER_TEXTS)):
        for magic, what, remedy in known:
            if begin.startswith(magic):
                raise refuse("not_csv", f"is {what}; {remedy}", path=path)


def check_csv_name(path: str | Path) -> None:
    """Refuse a name by which readers would take CSV for another format."""
    if (suffix := Path(path).suffix.lower()) in {*PARQUET_SUFFIXES, *NUMPY, GZIP}:
        raise ConfigError(
            f"{path}: is written as CSV, which no {suffix} file is; name a .csv file",
            code="output_name",
        )
