"""The page: self-contained, runs nothing, and lets no user write into it."""

import base64
import hashlib
import html
import re
from html.parser import HTMLParser

import pytest

from pushfit.config import GraspConfig
from pushfit.parameters import ANGLES
from pushfit.report.figures import figure_bytes, main_figure
from pushfit.report.html import result as html_module
from pushfit.report.html.pages import indexed_html
from pushfit.report.html.result import render_html
from tests.report.makers import HOSTILE

ALLOWED = frozenset(
    "html head meta title style body header main section h1 h2 h3 p div span strong "
    "figure picture source img figcaption ul li code pre br sub dl dt dd table thead "
    "tbody tr th td abbr".split()
)


class Page(HTMLParser):
    """Tags and attributes of a page, as a browser would see them."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def drawn(make_identification):
    """The main figure of a result, in both formats."""
    figure = main_figure(make_identification())
    return {kind: figure_bytes(figure, kind) for kind in ("svg", "png")}


@pytest.fixture
def quick(monkeypatch, drawn):
    """One figure on every page: drawing has tests of its own."""
    files = {"main.svg": drawn["svg"]}
    monkeypatch.setattr(html_module, "figure_files", lambda *_, **__: files)
    monkeypatch.setattr(html_module, "main_figure", lambda *_, **__: None)
    monkeypatch.setattr(html_module, "figure_bytes", lambda _, kind: drawn[kind])


@pytest.mark.usefixtures("quick")
def test_a_page_holds_known_tags_only_and_no_handlers(any_identification):
    page = Page(render_html(any_identification))
    assert {tag for tag, _ in page.tags} <= ALLOWED
    for _, attributes in page.tags:
        assert not [name for name in attributes if name.startswith("on")]
        assert "style" not in attributes
        assert "href" not in attributes


@pytest.mark.usefixtures("quick")
def test_a_push_length_that_nobody_stated_is_said(make_identification):
    """A default is an assumption of the reader's as well."""
    page = Page(render_html(make_identification(config=GraspConfig())))
    assert '"length_mm": 5.0' in page.text


@pytest.mark.usefixtures("quick")
def test_every_image_is_inside(determined):
    page = Page(render_html(determined))
    addresses = [a.get("src") or a.get("srcset") for _, a in page.tags]
    addresses = [address for address in addresses if address]
    assert len(addresses) == 2
    for address in addresses:
        assert re.match(r"data:image/(svg\+xml|png);base64,", address)


@pytest.mark.usefixtures("quick")
def test_the_policy_allows_this_style_sheet_and_nothing_else(determined):
    text = render_html(determined)
    page = Page(text)
    policy = next(
        attributes["content"]
        for _, attributes in page.tags
        if attributes.get("http-equiv") == "Content-Security-Policy"
    )
    style = re.search(r"<style>(.*?)</style>", text, re.DOTALL).group(1)
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert policy.split("; ") == [
        "default-src 'none'",
        "img-src data:",
        f"style-src 'sha256-{digest}'",
        "base-uri 'none'",
        "form-action 'none'",
    ]


@pytest.mark.usefixtures("quick")
def test_hostile_text_is_shown_as_text_everywhere(hostile):
    text = render_html(hostile)
    assert "<script" not in text
    assert "<img src=x" not in text
    assert "{{" in Page(text).text  # printed, not run as a template
    shown = Page(text).text
    # Source path and dialect, sentence, outlier, warning, advice, note, version, and
    # the notes of every parameter.
    assert shown.count("<script>alert(1)</script>") >= 8 + len(hostile.parameters)
    assert not {"\x1b", "\u202e"} & set(text)
    assert HOSTILE.splitlines()[-1] in shown


@pytest.mark.usefixtures("quick")
def test_the_answers_come_first_then_the_figure_then_the_warnings(determined):
    text = render_html(determined)
    places = [
        text.index(part)
        for part in (
            "is 40.1° (90 % interval",
            "is 65.0° (90 % interval",
            "<picture>",
            "1 push was left out",
            "<h2>Parameters</h2>",
        )
    ]
    assert places == sorted(places)


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("inadequate", "The model does not describe these heights"),
        ("not_converged", "Do not use these numbers:"),
    ],
)
def test_bad_news_comes_before_the_answers(kind, words, request):
    text = render_html(request.getfixturevalue(kind))
    assert text.index(words) < text.index('class="answers"')


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("name", ANGLES)
def test_the_letter_of_an_angle_says_on_hover_what_it_is(determined, name):
    """Beside the answer, and in the list of angles, by the words of symbols.md."""
    title = html.escape(ANGLES[name].meaning)
    letter = ANGLES[name].prose.replace("_c", "<sub>c</sub>")
    mark = f'<abbr title="{title}">{letter}</abbr>'
    page = render_html(determined)
    assert f'class="symbol">{mark}</span>' in page
    assert f"<dt>{mark}</dt>" in page


def test_indices_are_set_low_only_after_escaping():
    assert indexed_html("θ_c <b> & C_rr_x K_sn") == (
        "θ<sub>c</sub> &lt;b&gt; &amp; C_rr_x K<sub>sn</sub>"
    )


@pytest.mark.slow
def test_a_page_of_all_figures_stays_small_enough_to_mail(theta_only):
    assert len(render_html(theta_only)) < 4_000_000
