"""The pages in a real browser: a silent console, and nothing of a user that runs."""

import re
import subprocess
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from pushfit.report.figures import figure_bytes, main_figure
from pushfit.report.html import result as html_module
from pushfit.report.html.batch import render_batch
from pushfit.report.html.result import render_html
from tests.cli.look.chromium import BROWSER, chromium
from tests.report.html.test_result import ALLOWED, Page
from tests.report.makers import make_trace

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no Chromium is installed here"),
]
# Scripts, handlers and addresses, each of which would change the title if it ran.
ATTACK = (
    "<script>document.title='owned'</script>"
    "<img src=x onerror=\"document.title='owned'\">"
    "<svg onload=\"document.title='owned'\"></svg>"
    "'\"><a href=\"javascript:document.title='owned'\">x</a>"
)
SIZES = {"desktop": (1280, 900), "phone": (390, 844)}
DRAWN = (
    "document.readyState == 'complete' && document.images.length > 0 && "
    "[...document.images].every(i => i.complete && i.naturalWidth > 0)"
)
# Where every picture is, and where text ends, on the page as a whole.
BOXES = """[...document.images].map(i => i.getBoundingClientRect()).map(
  b => [b.left, b.top, b.right, b.bottom].map(Math.round))"""
CHOSEN = """(() => {
  const main = document.querySelector('figure.main');
  return main.querySelector('img').currentSrc == main.querySelector('source').srcset;
})()"""


def browse(page, *options: str) -> tuple[str, str]:
    """What the browser prints, and what it says on its console."""
    profile = page.parent / "profile"
    command = [
        *(BROWSER, "--headless=new", "--no-sandbox", "--disable-gpu"),
        *("--hide-scrollbars", "--enable-logging=stderr", f"--user-data-dir={profile}"),
        *options,
        page.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return done.stdout, "\n".join(console)


@pytest.fixture
def attacked(make_identification, determined):
    """Every text that comes from a user is an attack."""
    (source,) = determined.table.sources
    source = replace(source, path=ATTACK, dialect=ATTACK, sha256=ATTACK)
    trace = replace(make_trace(determined.table), path=ATTACK, name=ATTACK, unit=ATTACK)
    table = replace(
        determined.table, sources=(source,), notes=(ATTACK,), traces=(trace,)
    )
    quality = replace(
        determined.goodness_of_fit, sentence=ATTACK, outliers=(ATTACK, ATTACK)
    )
    (warning,) = determined.warnings
    return make_identification(
        table=table,
        goodness_of_fit=quality,
        warnings=(replace(warning, code=ATTACK, text=ATTACK),),
        parameters=tuple(
            replace(q, note=ATTACK, unit=ATTACK) for q in determined.parameters
        ),
        identifiability=replace(determined.identifiability, advice=(ATTACK,)),
        versions={ATTACK: ATTACK},
    )


@pytest.fixture
def page(attacked, tmp_path, monkeypatch):
    """The page of an attacked result with one figure."""
    monkeypatch.setattr(
        html_module,
        "figure_files",
        lambda result, **_: {"main.svg": figure_bytes(main_figure(result), "svg")},
    )
    path = tmp_path / "report.html"
    path.write_text(render_html(attacked), encoding="utf-8")
    return path


def test_a_browser_runs_nothing_and_has_nothing_to_complain_about(page):
    tree, console = browse(page, "--dump-dom")
    assert console == ""
    title = re.search(r"<title>(.*?)</title>", tree, re.DOTALL)[1]
    assert title.startswith("pushfit: ")
    parsed = Page(tree)
    assert {tag for tag, _ in parsed.tags} <= ALLOWED
    assert not [a for _, attrs in parsed.tags for a in attrs if a.startswith("on")]
    assert parsed.text.count("document.title='owned'") > 40


def test_the_console_would_tell_if_the_policy_stopped_something(page):
    text = page.read_text("utf-8").replace("</main>", "<script>1</script></main>")
    page.write_text(text, encoding="utf-8")
    _, console = browse(page, "--dump-dom")
    assert "Content Security Policy" in console


@pytest.mark.parametrize("size", SIZES)
def test_the_first_screen_is_drawn(size, page):
    width, height = SIZES[size]
    picture = page.with_suffix(".png")
    browse(page, f"--window-size={width},{height}", f"--screenshot={picture}")
    pixels = imread(picture)[..., :3]
    assert pixels.shape[:2] == (height, width)
    # Nothing runs into the right border, as it would on a page that must be scrolled.
    assert pixels[:, -4:].std() < 0.01
    assert len({tuple(row) for row in pixels[::7, ::7].reshape(-1, 3).tolist()}) > 30


@pytest.fixture(scope="module")
def whole(make_identification, tmp_path_factory):
    """The page of a result with every figure."""
    path = tmp_path_factory.mktemp("whole") / "report.html"
    path.write_text(render_html(make_identification()), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    with chromium(tmp_path_factory.mktemp("profile")) as tab:
        yield tab


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_page_and_pictures_fit_the_screen_by_day_and_at_night(size, dark, whole, tab):
    """As a person sees them: paper and every picture in turn, none wider than it."""
    width = SIZES[size][0]
    tab.show(whole.as_uri(), width=width, height=SIZES[size][1], dark=dark)
    tab.until(DRAWN)
    assert tab.run("document.documentElement.scrollWidth") <= width
    assert tab.run(CHOSEN) == (size == "phone")
    height = tab.run("document.documentElement.scrollHeight")
    tab.show(whole.as_uri(), width=width, height=height, dark=dark)
    tab.until(DRAWN)
    picture = whole.with_name(f"{size}.png")
    tab.picture(picture)
    pixels = imread(picture)[..., :3]
    boxes = tab.run(BOXES)
    assert len(boxes) > 10
    for left, top, right, bottom in boxes:
        assert 0 <= left < right <= width
        shown = pixels[top:bottom, left:right]
        # Most of a picture is its paper, and something is drawn on it.
        assert (np.median(shown) < 0.3) == dark
        assert shown.std() > 0.02
    assert (np.median(pixels) < 0.3) == dark
    assert tab.complaints == []


def test_it_prints(page):
    printed = page.with_suffix(".pdf")
    browse(page, "--no-pdf-header-footer", f"--print-to-pdf={printed}")
    assert printed.read_bytes().startswith(b"%PDF")


def test_a_batch_is_sorted_by_a_click(tmp_path):
    """The unknown stays last, whichever way the known go."""
    frame = pd.DataFrame(
        {"item": ["a", "b", "c"], "theta_c_deg": [40.0, None, 9.0]}
    ).assign(status="ok")
    path = tmp_path / "batch.html"
    page = render_batch(frame)
    # What a click would do; allowed here by a policy of the test's own.
    page = re.sub(r"script-src '[^']*'", "script-src 'unsafe-inline'", page)
    clicks = "<script>document.querySelectorAll('.sortable th')[3].click()</script>"
    orders = []
    for n_clicks in (0, 1, 2):
        path.write_text(page.replace("</body>", n_clicks * clicks + "</body>"))
        tree, console = browse(path, "--dump-dom")
        assert console == ""
        orders.append(re.findall(r'class="item">(.)<', tree))
    assert orders == [list("abc"), list("cab"), list("acb")]


def test_the_script_of_a_batch_is_allowed_by_its_policy(tmp_path):
    path = tmp_path / "batch.html"
    path.write_text(render_batch(pd.DataFrame({"item": ["a"], "status": ["ok"]})))
    tree, console = browse(path, "--dump-dom")
    assert console == ""
    assert 'tabindex="0"' in tree
