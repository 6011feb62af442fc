"""The report on a terminal: what was fitted, how well, what it means, what is missing.

It reads like the report of lmfit, from the statistics of the fit to the correlations,
and ends with one plain sentence on θ_c and one on α*. If the model does not describe
the data, that comes first. Excluded: what its rows say (`pushfit.report.fact_rows`).
"""

import io
import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from pushfit.fit.results import FitStatus, Identification, Quantity
from pushfit.report.answers import ANSWERS
from pushfit.report.fact_rows import (
    SEE_SET,
    UNQUOTED,
    angle_rows,
    cannot_say,
    correlation_rows,
    fit_rows,
    quantity_cells,
)
from pushfit.report.strings import printable, symbol

# The narrowest terminal, and the narrowest last column of a table; a table that leaves
# less to its notes becomes paragraphs.
MIN_WIDTH = 20
# Spaces between two columns.
COLUMN_GAP = 2


def render_text(identification: Identification, *, width: int = 80) -> str:
    """The whole report as plain text.

    Args:
        width: Columns of the terminal; fewer than `MIN_WIDTH` count as so many.

    Returns:
        Lines no longer than the width, without colours or control characters.
    """
    width = max(width, MIN_WIDTH)
    bodies = {
        "Fit": _pairs(fit_rows(identification), width),
        "Parameters": _quantities(identification.parameters, width),
        "Combinations that the heights depend on": _quantities(
            identification.combinations, width
        ),
        "Correlations of the posterior": _pairs(
            correlation_rows(identification), width
        ),
        "Angles": _pairs(angle_rows(identification), width),
        "What these data cannot say": _bullets(cannot_say(identification), width),
        "Warnings": _bullets(
            (f"{n.text} [{n.code}]" for n in identification.warnings), width
        ),
    }
    sections = [
        _heading(identification, width),
        *(_section(title, body, width) for title, body in bodies.items() if body),
        *(_wrap(answer(identification).sentence, width) for answer in ANSWERS.values()),
    ]
    return "\n\n".join(sections) + "\n"


def _heading(identification: Identification, width: int) -> str:
    """What was analysed, and first of all whether the answer may be used."""
    quality, status = identification.goodness_of_fit, identification.status
    lines = []
    if status is not FitStatus.OK:
        lines.append(f"Do not use these numbers: {status.value}.")
    if not quality.is_adequate:
        lines.append(quality.sentence)
    n_used = int(np.sum(identification.used))
    files = ", ".join(source.path for source in identification.table.sources)
    version = identification.versions.get("pushfit", "")
    pushes = f"pushfit {version}: {identification.table.n_pushes} pushes, {n_used} used"
    lines.append(pushes + (f", from {files}" if files else ""))
    if quality.is_adequate:
        lines.append(quality.sentence)
    return "\n\n".join(_wrap(line, width) for line in lines)


def _quantities(quantities: Sequence[Quantity], width: int) -> str:
    """Quantities as a table, or as paragraphs on a narrow terminal."""
    if not quantities:
        return ""
    rows = [(symbol(q.name), *quantity_cells(q)) for q in quantities]
    prob = f"{100 * quantities[0].prob:g} % interval"
    header = ("", "value", prob, "unit", "verdict", "note")
    columns = list(zip(header, *rows, strict=True))[:-1]
    taken = sum(max(map(len, column)) + COLUMN_GAP for column in columns)
    if width - taken >= MIN_WIDTH:
        return _table(header, rows, width)
    lines = []
    for name, value, interval, unit, verdict, note in rows:
        if value == SEE_SET:
            text = f"{name}: {interval} {unit}".rstrip()
        elif value == UNQUOTED:
            text, note = f"{name}: {value}", note.removeprefix(f"{value}: ")
        else:
            text = f"{name} = {value} {unit}".rstrip()
            text += f" ({interval})" if interval else ""
        lines.append(_wrap("; ".join(filter(None, [text, verdict, note])), width, "  "))
    return "\n".join(lines)


def _table(header: Sequence[str], rows: Iterable[Sequence[str]], width: int) -> str:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, padding=(0, COLUMN_GAP, 0, 0), pad_edge=False)
    for index, title in enumerate(header):
        table.add_column(
            Text(title),
            justify="right" if title == "value" else "left",
            no_wrap=index < len(header) - 1,
            overflow="fold",
        )
    for row in rows:
        table.add_row(*(Text(cell) for cell in row))
    stream = io.StringIO()
    console = Console(file=stream, width=width, color_system=None, force_terminal=False)
    console.print(table)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def _pairs(rows: Sequence[tuple[str, str]], width: int) -> str:
    """Words on the left, text on the right, wrapped under itself."""
    if not rows:
        return ""
    # Long names would squeeze the text on a narrow terminal.
    column = min(max(len(name) for name, _ in rows) + 2, width // 3)
    return "\n".join(
        _wrap(f"{name:<{column}}{text}", width, " " * column) for name, text in rows
    )


def _bullets(sentences: Iterable[str], width: int) -> str:
    return "\n".join(_wrap(f"- {printable(text)}", width, "  ") for text in sentences)


def _section(title: str, body: str, width: int) -> str:
    return f"{_wrap(title, width)}\n{'-' * min(len(title), width)}\n{body}"


def _wrap(text: str, width: int, indent: str = "") -> str:
    """Text broken at blanks, continuation lines indented."""
    return textwrap.fill(
        printable(text), width, subsequent_indent=indent, break_on_hyphens=False
    )
