r"""From the bytes of a file to clean text: what it is, how it is encoded, its lines.

Clean text is UTF-8 without a byte-order mark, with `\n` as the only line end. It is
produced in blocks, so memory does not grow with the file. Excluded: its columns
(`pushfit.data.text.dialects`).
"""

import codecs
import gzip
import hashlib
import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from pushfit.data.text.faults import refuse
from pushfit.data.text.files import FileStamp, existing_file, refuse_other_types
from pushfit.errors import ConfigError, stated

# Bytes that are read at once: files may be larger than the memory.
BLOCK = 1 << 22
# Fewer are digested at once: they stay in a processor's cache.
_DIGESTED = 1 << 18
# A constant signal deflates some 100 times; a bomb of zeros 1030 times.
_MAX_EXPANSION = 300
# What any machine has room for is expanded whatever the ratio: 64 MB.
_ALWAYS_EXPANDED = 1 << 26

_BOMS = (
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class TextFile:
    """A file that holds text, as far as its first bytes can tell.

    Args:
        stamp: Path, size and time of change when it was opened.
        sha256: Digest of the bytes as stored, hexadecimal.
        encoding: Its text encoding.
        is_gzip: Whether the bytes are compressed.
        is_clean: Whether the bytes are clean text as they are stored.
    """

    stamp: FileStamp
    sha256: str
    encoding: str
    is_gzip: bool
    is_clean: bool

    @property
    def path(self) -> str:
        """The file as the user named it."""
        return self.stamp.path

    def blocks(self, start: int = 0, end: int | None = None) -> Iterator[bytes]:
        """Give the clean text between two of its byte offsets, block by block.

        Args:
            start: First byte of clean text wanted.
            end: Byte of clean text to stop before; the end of the file if None.

        Raises:
            DataError: If the text cannot be decoded (`bad_encoding`), or compressed
                data are damaged (`bad_gzip`) or expand suspiciously (`zip_bomb`).
        """
        position = start if self.is_clean else 0
        for block in self._decoded(position):
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

    def _decoded(self, first: int) -> Iterator[bytes]:
        r"""Give the text as UTF-8 without a byte-order mark, lines ended by `\n`.

        Args:
            first: Where to begin; 0 where the stored bytes are not clean.
        """
        inner = codecs.getincrementaldecoder(self.encoding)()
        decoder = io.IncrementalNewlineDecoder(inner, translate=True)
        passes_through = self.encoding == "utf-8"
        position = pending = 0
        try:
            with open(self.path, "rb") as file:
                file.seek(first)
                if self.is_clean:
                    yield from self._expanded(file)
                    return
                for raw in self._expanded(file):
                    held, state = decoder.getstate()
                    pending = len(held)
                    is_whole = not held and not state and b"\r" not in raw
                    plain = passes_through and is_whole and raw.isascii()
                    text = raw if plain else decoder.decode(raw).encode()
                    if text:
                        yield text
                    position += len(raw)
            pending = len(decoder.getstate()[0])
            if rest := decoder.decode(b"", final=True):
                yield rest.encode()
        except UnicodeDecodeError as error:
            raise refuse(
                "bad_encoding",
                f"byte {position - pending + error.start} is not {self.encoding}; "
                f"name the encoding, such as {stated(encoding='latin-1')}, or save it "
                "as UTF-8",
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
        with _gzip_errors(self.path), gzip.GzipFile(fileobj=file) as unzipped:
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


def open_text(path: str | Path, *, encoding: str | None = None) -> TextFile:
    """Recognise a text file and refuse everything else.

    Args:
        encoding: Text encoding; None to judge by the byte-order mark, else UTF-8.

    Returns:
        The file, not yet read beyond its first bytes except for the digest.

    Raises:
        ConfigError: If the path cannot be read or the encoding is unknown.
        DataError: If the file is empty or is no text.
    """
    given = existing_file(path)
    if Path(given).is_dir():
        inside = sorted(map(str, Path(given).glob("*.csv")))
        such = f", such as {inside[0]}" if inside else ""
        raise ConfigError(
            f"{given}: is a folder; name the files in it{such}", code="is_a_folder"
        )
    stamp = FileStamp.of(given)
    with open(given, "rb") as file:
        start = file.read(4096)
        file.seek(0)
        is_gzip = start.startswith(b"\x1f\x8b")
        if is_gzip:
            with _gzip_errors(given):
                start = gzip.GzipFile(fileobj=file).read(4096)
    refuse_other_types(start, given)
    if not start:
        raise refuse(
            "empty_file",
            "the file is empty: 0 data rows; record or copy it again",
            path=given,
        )
    found = (
        _checked_encoding(encoding, given) if encoding else _encoding_of(start, given)
    )
    digest, is_clean = hashlib.sha256(), found == "utf-8" and not is_gzip
    with open(given, "rb") as file:
        while raw := file.read(_DIGESTED):
            digest.update(raw)
            is_clean = is_clean and raw.isascii() and b"\r" not in raw
    return TextFile(
        stamp=stamp,
        sha256=digest.hexdigest(),
        encoding=found,
        is_gzip=is_gzip,
        is_clean=is_clean,
    )


@contextmanager
def _gzip_errors(path: str) -> Iterator[None]:
    """Turn what a damaged file raises when it is expanded into a `DataError`."""
    try:
        yield
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise refuse(
            "bad_gzip",
            f"the compressed data are damaged or cut short ({error}); "
            "copy the file again",
            path=path,
        ) from error


def _checked_encoding(encoding: str, path: str) -> str:
    try:
        return codecs.lookup(encoding).name
    except LookupError as error:
        raise ConfigError(
            f"{path}: encoding {encoding!r} is not known; try utf-8, utf-16 or latin-1",
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
                "looks like UTF-16 without a byte-order mark; state "
                f"{stated(encoding=name)}",
                path=path,
            )
    return "utf-8"
