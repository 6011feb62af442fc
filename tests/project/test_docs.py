"""What the documents show is run, and what they repeat is compared."""

import importlib
import inspect
import itertools
import re
import shlex
import shutil
from pathlib import Path

import pytest

import pushfit
from pushfit.cli.app import app, main
from pushfit.config import template
from pushfit.parameters import NAMED

ROOT = Path(__file__).parents[2]
CONTRIBUTING = ROOT / "CONTRIBUTING.md"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# Commands that fit or sample; the rest take a second at most.
SLOW = {
    *("identify", "fit", "sample", "demo", "batch"),
    *("verify", "report", "coverage", "compare", "diff", "watch"),
    *("next", "explore"),
}


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of one language."""
    text = page.read_text(encoding="utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(page: Path) -> list[list[str]]:
    """Arguments of every `pushfit` command that a page shows."""
    shown = "".join(blocks(page, "console")).replace("\\\n", " ")
    lines = [line[2:] for line in shown.splitlines() if line.startswith("$ ")]
    words = [shlex.split(line, comments=True) for line in lines]
    return [w[1:] for w in words if Path(w[0]).name == "pushfit"]


def in_reading_order() -> list[Path]:
    """README first, then the pages as the navigation lists them."""
    listed = re.findall(r"(\w+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)
    return [PAGES[0], *(ROOT / "docs" / name for name in listed)]


def written(arguments: list[str]) -> list[str]:
    """What a command of the documents makes; a batch may go on in its folder."""
    if arguments[0] == "batch":
        return []
    marks = {"-o", "--out", "--plot", "--export"}
    named = [b for a, b in itertools.pairwise(arguments) if a in marks]
    return named + (arguments[1:2] if arguments[0] == "init" else [])


PAGES_WITH_COMMANDS = [page for page in PAGES if commands(page)]


@pytest.fixture
def workplace(own_mechanics, tmp_path, monkeypatch) -> Path:
    """A folder that looks like a checkout to the commands."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS, ids=lambda p: p.name)
def test_the_quick_commands_of_a_page_work(page, workplace, capsys):
    for arguments in commands(page):
        if arguments[0] not in SLOW:
            assert main(arguments) == 0, (arguments, capsys.readouterr().err)


def test_a_reader_of_all_pages_is_never_told_to_write_a_file_twice():
    # The README begins with make, whose folders are then there.
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    made = re.findall(r"^(?:DEMO|EXPLORED) := (\w+)$", makefile, re.MULTILINE)
    assert len(made) == 2
    made += [
        name
        for page in in_reading_order()
        for arguments in commands(page)
        for name in written(arguments)
    ]
    assert sorted(set(made)) == sorted(made)


def test_the_navigation_lists_every_page():
    assert set(in_reading_order()) == set(PAGES)


@pytest.mark.slow
def test_all_commands_of_all_pages_work_in_order_in_one_folder(workplace, capsys):
    for page in in_reading_order():
        for arguments in commands(page):
            code = main(arguments)
            assert code == 0, (page.name, arguments, capsys.readouterr().err)


@pytest.mark.slow
def test_the_tutorial_shows_the_answer_that_its_command_prints(workplace, capsys):
    page = ROOT / "docs" / "tutorial.md"
    (identify,) = [words for words in commands(page) if words[0] == "identify"]
    assert main(identify) == 0
    shown = " ".join(page.read_text(encoding="utf-8").split())
    for answer in capsys.readouterr().out.strip().split("\n\n")[-2:]:
        assert " ".join(answer.split()) in shown


@pytest.mark.slow
def test_the_commands_of_an_exploration_print_what_the_page_shows(workplace, capsys):
    """In a folder that has nothing but the examples."""
    page = ROOT / "docs" / "exploration.md"
    shown = "".join(blocks(page, "console"))
    _, *outputs = re.split(r"^\$ .*\n", shown, flags=re.MULTILINE)
    assert len(outputs) == len(commands(page)) == 3
    for arguments, output in zip(commands(page), outputs, strict=True):
        assert main(arguments) == 0
        assert capsys.readouterr().out == output


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_a_numbered_list_keeps_its_numbers(page):
    """After an empty line, Markdown takes less than four blanks for the list's end."""
    later = re.compile(r"^(?!\d+\.).*\n\n(?:[2-9])\. ", re.MULTILINE)
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"^```.*?^```$", "```", text, flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"\n\n {1,3}\S.*", text) == []
    assert [item for item in later.findall(text) if not item.startswith(" ")] == []


# What takes its time is marked with the shorter word.
@pytest.mark.parametrize("word", ["python", pytest.param("py", marks=pytest.mark.slow)])
@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.name)
def test_the_python_of_a_page_runs(page, word, workplace, capsys):
    for block in blocks(page, word):
        exec(compile(block, page.name, "exec"), {})


def test_every_place_that_contributors_are_sent_to_exists():
    places = re.findall(
        r"`((?:pushfit|tests)/[\w/.]+)`", CONTRIBUTING.read_text("utf-8")
    )
    assert len(places) > 20
    assert [place for place in places if not (ROOT / place).exists()] == []


@pytest.mark.parametrize("page", [*PAGES, CONTRIBUTING], ids=lambda p: p.name)
def test_every_file_that_a_page_links_to_exists(page):
    prose = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.S | re.M)
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", prose)
    missing = [target for target in targets if not (page.parent / target).exists()]
    assert missing == []


def test_whoever_is_told_to_install_something_can():
    """pushfit itself is in no index; its extras are installed from the checkout."""
    sources = [*PAGES, *(ROOT / "pushfit").rglob("*.py")]
    told = {
        name
        for path in sources
        for name in re.findall(
            r"pip install (?:-c \S+ )?(['\w].*)", path.read_text("utf-8")
        )
    }
    assert len(told) > 3
    assert [words for words in told if not words.startswith("'.[")] == []


def test_the_reference_of_the_config_is_the_template():
    page = ROOT / "docs" / "configuration.md"
    assert blocks(page, "toml")[0] == template()


@pytest.mark.parametrize("name", NAMED)
def test_the_page_of_symbols_says_what_every_quantity_is(name):
    """One record makes pages, tables and keys; this page is written by hand."""
    quantity = NAMED[name]
    page = (ROOT / "docs" / "symbols.md").read_text(encoding="utf-8")
    (row,) = [line for line in page.splitlines() if f"| `{name}` |" in line]
    cells = [cell.strip().replace("\\", "") for cell in row.strip("|").split("|")]
    assert cells == [quantity.prose, f"`{name}`", quantity.meaning, quantity.unit]


def test_every_public_name_has_its_place_on_the_page_of_python():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    places = re.findall(r"^::: (pushfit[\w.]*)$", page, re.MULTILINE)
    documented = {}
    for place in places:
        owner, _, name = place.rpartition(".")
        found = getattr(importlib.import_module(owner), name)
        # A module stands for all that it has.
        is_module = inspect.ismodule(found)
        documented |= vars(found) if is_module else {name: found}
    public = {name: getattr(pushfit, name) for name in pushfit.__all__}
    assert {n for n, one in public.items() if documented.get(n) is not one} == set()


def test_every_command_is_documented():
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", page, re.MULTILINE)
    documented = {name for heading in headings for name in heading.split(" and ")}
    commands = app.registered_commands
    assert {one.name or one.callback.__name__ for one in commands} == documented


def test_the_names_of_the_version_agree():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    code = (ROOT / "pushfit" / "__init__.py").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", citation, re.M)[1] in code
