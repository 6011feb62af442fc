r"""From the bytes of a file to clean text: what it is, how it is encoded, its lines.

Clean text is UTF-8 without a byte-order mark, with `\n` as the only line end. It is
produced in blocks, so memory does not grow with the file. What a column means is the
business of `pushfit.data.dialects`.
"""

import codecs
import difflib
import gzip
import hashlib
import os
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pushfit.errors import ConfigError, DataError, Problem

BLOCK = 1 << 23
# A constant signal deflates some 100 times; a bomb of zeros 1030 times.
_MAX_EXPANSION = 300
_ALWAYS_EXPANDED = 1 << 26

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
_BAG_MAGIC = (b"#ROSBAG V", b"SQLite format 3\x00", b"\x89MCAP0\r\n")
_BOMS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def problem(
    code: str,
    text: str,
    *,
    path: str,
    line: int | None = None,
    column: str | None = None,
    value: str | None = None,
) -> Problem:
    """Put the place in front of what is wrong there.

    Args:
        code: Stable snake_case word.
        text: Value, rule and next step.
        path: File as the user named it.
        line: Line, counted from 1.
        column: Column name.
        value: Text found.

    Returns:
        The problem with its whole sentence.
    """
    place = [path]
    if line is not None:
        place.append(f"line {line}")
    if column is not None:
        place.append(f"column {column}")
    message = f"{', '.join(place)}: {text}"
    return Problem(
        code=code, message=message, path=path, line=line, column=column, value=value
    )


def data_error(problems: Sequence[Problem]) -> DataError:
    """Make the error that reports all of several problems."""
    first, n_more = problems[0], len(problems) - 1
    more = f" (and {n_more} more problem{'s'[: n_more > 1]})" if n_more else ""
    return DataError(first.message + more, code=first.code, problems=tuple(problems))


def refuse(code: str, text: str, *, path: str, line: int | None = None) -> DataError:
    """Make the error for the one thing that is wrong with a file."""
    return data_error([problem(code, text, path=path, line=line)])


@dataclass(frozen=True, slots=True, kw_only=True)
class FileStamp:
    """What tells that a file changed: its size and time of change."""

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


def existing_file(path: str | Path) -> str:
    """Check that a path can be read.

    Args:
        path: File as the user named it.

    Returns:
        The path as text.

    Raises:
        ConfigError: If there is no such file (`file_not_found`) or it may not be read
            (`file_not_readable`).
        DataError: If a recorder still has the file open (`bag_active`).
    """
    given = Path(path)
    if not given.exists():
        folder = given.parent
        siblings = [p.name for p in folder.iterdir()] if folder.is_dir() else []
        near = difflib.get_close_matches(given.name, siblings, n=1)
        hint = f"; did you mean {folder / near[0]}?" if near else ""
        raise ConfigError(f"{path}: no such file{hint}", code="file_not_found")
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


def is_bag(path: str) -> bool:
    """Tell whether a file, or a ROS 2 bag folder, is a bag by its first bytes."""
    if Path(path).is_dir():
        return (Path(path) / "metadata.yaml").is_file()
    with open(path, "rb") as file:
        return file.read(16).startswith(_BAG_MAGIC)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextFile:
    """A file that holds text, as far as its first bytes can tell.

    Args:
        stamp: Path, size and time of change when it was opened.
        sha256: Digest of the bytes as stored, hexadecimal.
        encoding: How the text is encoded.
        is_gzip: Whether the text is compressed.
    """

    stamp: FileStamp
    sha256: str
    encoding: str
    is_gzip: bool

    @property
    def path(self) -> str:
        """The file as the user named it."""
        return self.stamp.path

    def blocks(self, start: int = 0, end: int | None = None) -> Iterator[bytes]:
        """Give the clean text between two of its byte offsets, block by block.

        Args:
            start: First byte of clean text wanted.
            end: Byte of clean text to stop before; the end of the file if None.

        Yields:
            Non-empty blocks of clean text.

        Raises:
            DataError: If the text cannot be decoded (`bad_encoding`), or compressed
                data are damaged (`bad_gzip`) or expand suspiciously (`zip_bomb`).
        """
        position = 0
        for block in _unified_line_ends(self._decoded()):
            begin = max(start - position, 0)
            stop = len(block) if end is None else min(end - position, len(block))
            if begin < stop:
                yield block[begin:stop]
            position += len(block)
            if end is not None and position >= end:
                return

    def head(self, size: int) -> bytes:
        """Give the first bytes of the clean text."""
        return b"".join(self.blocks(end=size))

    def _decoded(self) -> Iterator[bytes]:
        """Give the text as UTF-8 without a byte-order mark."""
        decoder = codecs.getincrementaldecoder(self.encoding)()
        passes_through = self.encoding == "utf-8"
        position = pending = 0
        try:
            with open(self.path, "rb") as file:
                for raw in self._expanded(file):
                    pending = len(decoder.getstate()[0])
                    plain = passes_through and not pending and raw.isascii()
                    text = raw if plain else decoder.decode(raw).encode()
                    if text:
                        yield text
                    position += len(raw)
            pending = len(decoder.getstate()[0])
            decoder.decode(b"", final=True)
        except UnicodeDecodeError as error:
            raise refuse(
                "bad_encoding",
                f"byte {position - pending + error.start} is not {self.encoding}; "
                'name the encoding, such as encoding="latin-1", or save it as UTF-8',
                path=self.path,
            ) from error

    def _expanded(self, file: BinaryIO) -> Iterator[bytes]:
        """Give the stored bytes, decompressed."""
        if not self.is_gzip:
            while raw := file.read(BLOCK):
                yield raw
            return
        n_out = 0
        limit = max(_ALWAYS_EXPANDED, _MAX_EXPANSION * self.stamp.size)
        try:
            with gzip.GzipFile(fileobj=file) as unzipped:
                while raw := unzipped.read(BLOCK):
                    n_out += len(raw)
                    if n_out > limit:
                        raise refuse(
                            "zip_bomb",
                            f"expands to more than {_MAX_EXPANSION} times its size; "
                            "decompress it yourself if you trust it",
                            path=self.path,
                        )
                    yield raw
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise refuse(
                "bad_gzip",
                f"the compressed data are damaged or cut short ({error}); "
                "copy the file again",
                path=self.path,
            ) from error


class BlockReader:
    """Blocks of clean text as a file of bytes.

    Not an `io` class on purpose: pandas decodes and encodes again what those give it.
    """

    def __init__(self, blocks: Iterator[bytes]) -> None:
        """Read from the blocks in turn."""
        self._blocks = blocks
        self._rest = memoryview(b"")

    def __iter__(self) -> Iterator[bytes]:
        """Give what is left, block by block."""
        return iter(lambda: self.read(BLOCK), b"")

    def read(self, size: int) -> bytes:
        """Give the next bytes, at most `size` of them; none at the end."""
        if not self._rest:
            self._rest = memoryview(next(self._blocks, b""))
        taken, self._rest = self._rest[:size], self._rest[size:]
        return taken.tobytes()


def _unified_line_ends(blocks: Iterator[bytes]) -> Iterator[bytes]:
    r"""Turn `\r\n` and `\r` into `\n`, also across block borders."""
    held = b""
    for block in blocks:
        text = held + block if held else block
        held = b""
        if b"\r" in text:
            if text.endswith(b"\r"):
                text, held = text[:-1], b"\r"
            text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        if text:
            yield text
    if held:
        yield b"\n"


def open_text(path: str | Path, *, encoding: str | None = None) -> TextFile:
    """Recognise a text file and refuse everything else.

    Args:
        path: File as the user named it.
        encoding: Text encoding; None to judge by the byte-order mark, else UTF-8.

    Returns:
        The file, not yet read beyond its first bytes except for the digest.

    Raises:
        ConfigError: If the path cannot be read or the encoding is unknown.
        DataError: If the file is empty or is no text.
    """
    given = existing_file(path)
    if Path(given).is_dir():
        raise ConfigError(
            f"{given}: is a folder; name the files in it", code="is_a_folder"
        )
    stamp = FileStamp.of(given)
    with open(given, "rb") as file:
        start = file.read(4096)
        file.seek(0)
        is_gzip = start.startswith(b"\x1f\x8b")
        if is_gzip:
            start = _gzip_start(file, given)
            file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if not start:
        raise refuse("empty_file", "the file is empty: 0 data rows", path=given)
    found = _checked_encoding(encoding) if encoding else _encoding_of(start, given)
    _refuse_other_types(start, given)
    return TextFile(stamp=stamp, sha256=digest, encoding=found, is_gzip=is_gzip)


def _gzip_start(file: BinaryIO, path: str) -> bytes:
    try:
        return gzip.GzipFile(fileobj=file).read(4096)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise refuse(
            "bad_gzip",
            f"the compressed data are damaged ({error}); copy the file again",
            path=path,
        ) from error


def _checked_encoding(encoding: str) -> str:
    try:
        return codecs.lookup(encoding).name
    except LookupError as error:
        raise ConfigError(
            f"encoding {encoding!r} is not known; try utf-8, utf-16 or latin-1",
            code="unknown_encoding",
        ) from error


def _encoding_of(start: bytes, path: str) -> str:
    for bom, name in _BOMS:
        if start.startswith(bom):
            return name
    sample = start[:512]
    if len(sample) > 3 and min(sample[::2].count(0), sample[1::2].count(0)) == 0:
        n_zero = sample.count(0)
        if n_zero > len(sample) // 3:
            name = "utf-16-le" if sample[1::2].count(0) else "utf-16-be"
            raise refuse(
                "bad_encoding",
                f"looks like UTF-16 without a byte-order mark; state encoding={name!r}",
                path=path,
            )
    return "utf-8"


def _refuse_other_types(start: bytes, path: str) -> None:
    """Refuse what is recognisably something else than a table of text."""
    for magic, what, remedy in _MAGIC:
        if start.startswith(magic):
            raise refuse("not_csv", f"is {what}; {remedy}", path=path)
    text = start.lstrip(codecs.BOM_UTF8).lstrip().lower()
    if text.startswith((b"<!doctype", b"<html", b"<?xml", b"<head")):
        raise refuse(
            "not_csv",
            "is a web page, perhaps an error page saved under this name; "
            "download the data again",
            path=path,
        )
    if text.startswith((b"{", b"[{", b"[[")):
        raise refuse("not_csv", "is JSON; export the signals as CSV", path=path)
