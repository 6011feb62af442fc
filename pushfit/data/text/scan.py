"""Hold every line of a table against its layout, before anything is parsed.

Two passes share the rules. The fast one counts field borders and line ends as bytes,
block by block, and can only say that a file is regular. When it cannot, or when parsing
fails later, the slow one goes line by line and names everything that is wrong.
Excluded: the slow pass (`pushfit.data.text.explain`) and parsing
(`pushfit.data.text.csv_reader`).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Int

from pushfit.config.inputs import Tail
from pushfit.data.text.dialects import Layout
from pushfit.data.text.faults import refuse
from pushfit.data.text.textfile import TextFile
from pushfit.errors import stated

# A file without line ends is refused before it fills the memory.
_MAX_LINE = 1 << 26


@dataclass(frozen=True, slots=True, kw_only=True)
class Body:
    """The part of the clean text that holds the rows of a table.

    Args:
        text: The file.
        layout: How its rows are laid out.
        end: Byte where the last accepted row ends.
        has_quotes: Whether fields may be quoted.
        has_padding: Whether fields may begin with blanks.
        notes: What was left out, for the user.
    """

    text: TextFile
    layout: Layout
    end: int
    has_quotes: bool
    has_padding: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What the lines of a table amount to.

    Args:
        n_rows: Number of data rows.
        data_line: Line of the first data row, if no line is skipped before it.
        skips: Row before which each skipped line (blank, or inside a quoted field)
            lies, in order.
    """

    n_rows: int
    data_line: int
    skips: Int[np.ndarray, " n_skips"]

    def lines(self, rows: Int[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
        """Give the line, counted from 1, of each data row, counted from 0."""
        return self.data_line + rows + np.searchsorted(self.skips, rows, side="right")


def find_body(text: TextFile, layout: Layout, tail: Tail) -> Body:
    """Find where the rows end, and decide about a damaged end.

    Args:
        tail: What to do about a last line without a line end: `drop` it, `keep` it, or
            call it an `error`. `salvage` drops it and also zero bytes at the end.

    Raises:
        DataError: If there are zero bytes (`nul_bytes`), the end is damaged
            (`no_final_newline`), or there is no line end at all (`no_line_ends`).
    """
    position = last_end = layout.data_start
    has_quotes = has_padding = False
    padding = (layout.delimiter.encode() + b" ", b"\n ")
    notes: list[str] = []
    for block in text.blocks(position):
        zero = block.find(b"\0")
        if zero >= 0:
            _refuse_nul(text, position + zero, tail)
            notes.append(
                f"dropped zero bytes at the end, from byte {position + zero} on"
            )
            block = block[:zero]
        has_quotes = has_quotes or b'"' in block
        if not has_padding and b" " in block:
            has_padding = any(pad in block for pad in padding)
        last = block.rfind(b"\n") + 1
        last_end = position + last if last else last_end
        position += len(block)
        if position - last_end > _MAX_LINE:
            raise refuse(
                "no_line_ends",
                f"more than {_MAX_LINE} bytes without a line end; export the "
                "signals as a text table, one sample per line",
                path=text.path,
            )
        if zero >= 0:
            break
    end = last_end
    if b"".join(text.blocks(last_end, position)).strip():
        n_lines = sum(block.count(b"\n") for block in text.blocks(0, last_end))
        notes.append(_judge_last_line(text, n_lines + 1, tail))
        end = position if tail == "keep" else last_end
    return Body(
        text=text,
        layout=layout,
        end=end,
        has_quotes=has_quotes,
        has_padding=has_padding,
        notes=tuple(notes),
    )


def _refuse_nul(text: TextFile, first: int, tail: Tail) -> None:
    """Refuse zero bytes, unless they are the end of the file and may be dropped."""
    inside = any(block.strip(b"\0 \n") for block in text.blocks(first))
    if inside or tail != "salvage":
        remedy = (
            "data follow them, so the file is damaged: copy it again"
            if inside
            else f"nothing follows them: {stated(tail='salvage')} drops them"
        )
        raise refuse(
            "nul_bytes",
            f"zero bytes from byte {first} of the text on; {remedy}",
            path=text.path,
        )


def _judge_last_line(text: TextFile, line: int, tail: Tail) -> str:
    """Say what is done about a last line without a line end, or refuse it."""
    if tail == "error":
        raise refuse(
            "no_final_newline",
            "the last line has no line end, so the file may be cut inside a number; "
            "export it again, or add the line end if the line is whole",
            path=text.path,
            line=line,
        )
    if tail == "keep":
        return (
            f"line {line} has no line end: its last value is short if the file was cut"
        )
    return f"dropped line {line}: it has no line end, so it may be cut inside a number"


def fast_scan(body: Body) -> Scan | None:
    """Count rows and check that each has the layout's number of fields.

    Returns:
        The scan; None if some line is irregular or quoted, so that only the slow pass
        can tell what it means.
    """
    if body.has_quotes:
        return None
    n_rows, skips = 0, np.empty(0, dtype=np.int64)
    for lines in whole_lines(body):
        found = _blank(lines, body.layout)
        if found is None:
            return None
        n_lines, blank = found
        skips = np.append(skips, n_rows + blank - np.arange(blank.size))
        n_rows += n_lines - blank.size
    return Scan(n_rows=n_rows, data_line=body.layout.data_line, skips=skips)


def whole_lines(body: Body) -> Iterator[bytes]:
    """Give the rows in blocks that end with a line end."""
    rest = b""
    for block in body.text.blocks(body.layout.data_start, body.end):
        # The line across two blocks by itself, so that blocks are not copied twice.
        first, cut = block.find(b"\n") + 1, block.rfind(b"\n") + 1
        if not cut:
            rest += block
            continue
        yield rest + block[:first]
        if first < cut:
            yield block[first:cut]
        rest = block[cut:]
    if rest:
        yield rest + b"\n"


def _blank(data: bytes, layout: Layout) -> tuple[int, Int[np.ndarray, " b"]] | None:
    """Number of whole lines, and the blank ones; None if another is irregular."""
    # Field borders in order, True where the border is a line end: in a regular table
    # a pattern that repeats line by line.
    borders = _borders(data, layout.delimiter)
    period = layout.n_fields + (layout.delimiter == " ")
    n_lines = int(np.count_nonzero(borders))
    if layout.has_trailing:
        buffer = np.frombuffer(data, np.uint8)
        before = buffer[np.flatnonzero(buffer == 10) - 1]
        if np.any((before != ord(layout.delimiter)) & (before != 10)):
            return None
    if borders.size == n_lines * period and borders[period - 1 :: period].all():
        return n_lines, np.empty(0, dtype=np.int64)
    blank = _blank_lines(data, borders, period)
    return None if blank is None else (n_lines, blank)


def _borders(data: bytes, delimiter: str) -> Bool[np.ndarray, " m"]:
    """Tell line ends from delimiters; where blanks delimit, from starts of fields."""
    if delimiter != " ":
        # Faster by half than masks as long as the text.
        others = bytes(set(range(256)) - {10, ord(delimiter)})
        return np.frombuffer(data.translate(None, others), np.uint8) == 10
    buffer = np.frombuffer(data, np.uint8)
    is_end = buffer == 10
    is_gap = is_end | (buffer == 32) | (buffer == 9)
    starts = ~is_gap
    starts[1:] &= is_gap[:-1]
    return is_end[starts | is_end]


def _blank_lines(
    data: bytes, borders: Bool[np.ndarray, " m"], period: int
) -> Int[np.ndarray, " n_blank"] | None:
    """Give the irregular lines if they are all blank, else None."""
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == 10)
    starts = np.concatenate([[0], ends[:-1] + 1])
    n_borders = np.diff(np.flatnonzero(borders), prepend=-1)
    odd = np.flatnonzero(n_borders != period)
    filled = odd[ends[odd] > starts[odd]]
    if any(data[starts[i] : ends[i]].strip(b" \t") for i in filled):
        return None
    return odd
