"""A module opens with what it is for, and with what it leaves out.

Excluded: whether that is true.
"""

import ast
import re
from pathlib import Path

import pytest

import pushfit

PACKAGE = Path(pushfit.__file__).parent
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.stem != "__init__"]
# A sentence of its own: at the beginning, or after the end of another.
LEFT_OUT = re.compile(r"(?:^|[.?!]\s+)Excluded:\s+\w")


def says_what_it_leaves_out(code: str) -> bool:
    """Whether the docstring of a module has a sentence for that."""
    preamble = ast.get_docstring(ast.parse(code)) or ""
    return LEFT_OUT.search(preamble) is not None


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: str(path.relative_to(PACKAGE).with_suffix(""))
)
def test_a_module_says_what_it_leaves_out(path):
    assert says_what_it_leaves_out(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("code", "is_said"),
    [
        ('"""Read files.\n\nExcluded: writing them (`write`)."""', True),
        ('"""Read files.\n\nAll of them. Excluded:\nwriting."""', True),
        ('"""Read files."""', False),
        ('"""Read files that are not\nexcluded: all."""', False),
        ('"""Read files.\n\nExcluded:\n"""', False),
        ('"""Read."""\n\n\ndef read():\n    """Read.\n\n    Excluded: all."""', False),
        ("# Excluded: writing.\nimport os", False),
        ("", False),
    ],
)
def test_a_module_that_does_not_say_it_is_found(code, is_said):
    assert says_what_it_leaves_out(code) is is_said
