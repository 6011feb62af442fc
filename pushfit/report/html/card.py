"""A result in a notebook, in a paper and on a page: the same rows, three notations.

Excluded: the whole page of a result (`pushfit.report.html.result`).
"""

import base64
import html
from collections.abc import Sequence

from pushfit.errors import counted
from pushfit.fit.results import FitStatus, Identification
from pushfit.parameters import named
from pushfit.report.answers import AnswerText, alpha_star_answer, theta_c_answer
from pushfit.report.fact_rows import quantity_cells
from pushfit.report.html.pages import indexed_html, symbol_html
from pushfit.report.strings import printable, symbol

# A notebook brings its own fonts and colours, light or dark; the card adds none that
# would fight them. Styles stand in the elements, because notebooks strip style sheets.
CARD = "border:1px solid #8886;border-radius:6px;padding:.6em 1em;max-width:56em"
CELL = "padding:.1em .8em .1em 0;text-align:left;vertical-align:top"
ALARM = "border-left:4px solid #D55E00;padding-left:.6em"
LATEX = {"θ": r"$\theta$", "α": r"$\alpha$", "σ": r"$\sigma$", "°": r"$^\circ$"}
LATEX |= {"·": r"$\cdot$", "²": r"$^2$", "√": r"$\sqrt{}$", "∞": r"$\infty$"}
LATEX |= {char: f"\\{char}" for char in "_%&#${}"}
LATEX |= {"\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\^{}"}


def header_of(identification: Identification) -> tuple[str, ...]:
    """Titles of the columns of `quantity_rows`."""
    interval = f"{100 * identification.theta_c.prob:g} % interval"
    return ("", "value", interval, "unit", "verdict")


def quantity_rows(identification: Identification) -> list[tuple[str, ...]]:
    """Name, value, interval, unit and verdict of all numbers, angles first."""
    quantities = (
        identification.theta_c,
        identification.alpha_star,
        *identification.parameters,
        *identification.combinations,
    )
    return [(q.name, *quantity_cells(q)[:-1]) for q in quantities]


def markdown_table(identification: Identification) -> str:
    """All numbers as a table in Markdown."""

    def line(cells: Sequence[str]) -> str:
        safe = [printable(cell).replace("|", r"\|") for cell in cells]
        return f"| {' | '.join(safe)} |"

    rows = [(f"`{name}`", *rest) for name, *rest in quantity_rows(identification)]
    header = header_of(identification)
    return "\n".join([line(header), line(["---"] * len(header)), *map(line, rows)])


def latex_table(identification: Identification) -> str:
    """All numbers as a LaTeX table in the style of booktabs."""
    lines = [r"\begin{tabular}{lrlll}", r"\toprule"]
    lines += [_latex_line(map(_latex, header_of(identification))), r"\midrule"]
    for name, *rest in quantity_rows(identification):
        record = named(name)
        letter = record.math if record else _latex(name)
        lines.append(_latex_line([letter, *map(_latex, rest)]))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"])


def _latex_line(cells: "Sequence[str] | map[str]") -> str:
    return " & ".join(cells) + r" \\"


def _latex(text: str) -> str:
    """Text in which nothing is a command."""
    return "".join(LATEX.get(char, char) for char in printable(text))


def card_html(identification: Identification) -> str:
    """Answers, warnings, main figure and all numbers, as one element for a notebook."""
    status, quality = identification.status, identification.goodness_of_fit
    answers = (theta_c_answer(identification), alpha_star_answer(identification))
    parts = []
    if status is not FitStatus.OK:
        parts.append(_text("p", f"Do not use these numbers: {status.value}.", ALARM))
    if not quality.is_adequate:
        parts.append(_text("p", quality.sentence, ALARM))
    parts += [_answer(answer) for answer in answers]
    parts.append(_picture(identification))
    if identification.warnings:
        n = len(identification.warnings)
        items = [_text("li", warning.text) for warning in identification.warnings]
        title = counted(n, "warning")
        parts.append(_details(title, f"<ul>{''.join(items)}</ul>"))
    parts.append(_details("All numbers", _table(identification)))
    return f'<div style="{CARD}">{"".join(parts)}</div>'


def _answer(answer: AnswerText) -> str:
    title = f"{symbol(answer.name)} {answer.short}"
    big = f'<div style="font-size:1.25em">{indexed_html(title)}</div>'
    return big + _text("div", answer.sentence, "margin-bottom:.5em")


def _text(tag: str, text: str, style: str = "") -> str:
    attribute = f' style="{style}"' if style else ""
    return f"<{tag}{attribute}>{indexed_html(printable(text))}</{tag}>"


def _details(title: str, body: str) -> str:
    return f"<details><summary>{html.escape(title)}</summary>{body}</details>"


def _picture(identification: Identification) -> str:
    from pushfit.report.figures.main import main_figure
    from pushfit.report.figures.style import figure_bytes

    content = figure_bytes(main_figure(identification), "png")
    data = base64.b64encode(content).decode("ascii")
    style = "max-width:100%;background:white"
    source = f"data:image/png;base64,{data}"
    return f'<img alt="Heights and fit" style="{style}" src="{source}">'


def _table(identification: Identification) -> str:
    def row(tag: str, cells: Sequence[str]) -> str:
        inside = (f'<{tag} style="{CELL}">{cell}</{tag}>' for cell in cells)
        return f"<tr>{''.join(inside)}</tr>"

    rows = [
        row("td", (symbol_html(name), *map(indexed_html, rest)))
        for name, *rest in quantity_rows(identification)
    ]
    return f"<table>{row('th', header_of(identification))}{''.join(rows)}</table>"
