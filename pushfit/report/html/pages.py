"""What all HTML pages share: the style sheet, the policy, and letters with an index.

A page is one file that needs nothing else. Every value loses its control characters and
passes Jinja2's autoescape; the content security policy names each style sheet and
script by its hash. Excluded: what each page shows (`pushfit.report.html.result`,
`pushfit.report.html.batch`).
"""

import base64
import hashlib
import html
import re
from collections.abc import Mapping
from importlib import resources
from importlib.util import find_spec

from pushfit.errors import ConfigError, installed_by
from pushfit.parameters import NAMED, named
from pushfit.report.strings import printable, symbol

# Letters with an index, as they occur in prose: K_sn, θ_c, F_0.
INDEXED = re.compile(
    r"(?<!\w)("
    + "|".join(re.escape(q.prose) for q in NAMED.values() if "_" in q.prose)
    + r"|σ_\w+"
    + r")(?!\w)"
)


def render_page(
    template: str, content: Mapping[str, object], *, script: str = ""
) -> str:
    """A file of `templates` with its style sheet, and a script if it has one."""
    check_templates()
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def finalized(value: object) -> object:
        # What is marked up has been made safe before.
        if isinstance(value, str) and not isinstance(value, Markup):
            return printable(value)
        return value

    environment = Environment(
        loader=PackageLoader("pushfit.report.html"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        finalize=finalized,
    )
    environment.filters |= {
        "letters": lambda text: Markup(indexed_html(printable(text))),
        "named": lambda name: Markup(symbol_html(name)),
        "listed": lambda words: Markup(listed_html(words)),
    }
    style, code = _text("report.css"), _text(script) if script else ""
    page = environment.get_template(template).render(
        style=Markup(style),
        style_hash=_hash(style),
        script=Markup(code),
        script_hash=_hash(code),
        **content,
    )
    return page + "\n"


def check_templates() -> None:
    """Refuse a page where nothing can fill it in."""
    if find_spec("jinja2") is None:
        raise ConfigError(
            "the HTML report needs Jinja2, which is not installed; "
            f"{installed_by('report')}, or use the text report",
            code="html_unavailable",
        )


def listed_html(words: str) -> str:
    """Words between commas, in which every letter of a quantity says what it is."""
    names = {record.prose: name for name, record in NAMED.items()}
    parts = [symbol_html(names.get(word, word)) for word in words.split(", ")]
    return ", ".join(parts)


def symbol_html(name: str) -> str:
    """Symbol of a quantity that says on hover what it stands for."""
    shown, record = indexed_html(symbol(name)), named(name)
    if record is None:
        return shown
    return f'<abbr title="{html.escape(record.meaning)}">{shown}</abbr>'


def indexed_html(text: str) -> str:
    """Escaped text in which indices are set as such, θ_c as θ with a low c."""

    def lowered(match: re.Match[str]) -> str:
        letter, _, index = match.group().partition("_")
        return f"{letter}<sub>{index}</sub>"

    return INDEXED.sub(lowered, html.escape(text))


def _text(name: str) -> str:
    file = resources.files("pushfit.report.html").joinpath("templates", name)
    return file.read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """Digest by which a policy allows an inline text."""
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
