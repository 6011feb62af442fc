"""Tolerances have names, and reasons beside them.

Excluded: the names that tests share (`tests.tolerances`).
"""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CALLS = {"approx", "assert_allclose", "isclose", "allclose"}
KEYWORDS = {"rtol", "atol", "rel", "abs"}
FILES = sorted(TESTS.rglob("*.py"))


def called(node: ast.Call) -> str:
    """Name of a function without that of its module."""
    return node.func.attr if isinstance(node.func, ast.Attribute) else node.func.id


def is_literal(tolerance: ast.expr) -> bool:
    """Whether it is a number, or made of numbers, other than 0."""
    is_zero = isinstance(tolerance, ast.Constant) and tolerance.value == 0
    return not is_zero and not any(
        isinstance(part, ast.Name | ast.Attribute) for part in ast.walk(tolerance)
    )


def unnamed(code: str) -> list[str]:
    """Comparisons whose tolerance is a number, or that of the library."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if not isinstance(node, ast.Call) or not isinstance(
            node.func, ast.Name | ast.Attribute
        ):
            continue
        if called(node) not in CALLS:
            continue
        stated = [one.value for one in node.keywords if one.arg in KEYWORDS]
        stated += node.args[1 if called(node) == "approx" else 2 :]
        if not stated or any(map(is_literal, stated)):
            found.append(ast.unparse(node))
    return found


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: str(path.relative_to(TESTS).with_suffix(""))
)
def test_no_tolerance_is_a_number_in_a_call(path):
    assert unnamed(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    ("code", "is_found"),
    [
        ("np.testing.assert_allclose(a, b, rtol=1e-9)", True),
        ("np.testing.assert_allclose(a, b, rtol=0, atol=-3.0)", True),
        ("np.testing.assert_allclose(a, b, rtol=2 / 4096)", True),
        ("np.testing.assert_allclose(a, b)", True),
        ("approx(a, 1e-6)", True),
        ("pytest.approx(a)", True),
        ("math.isclose(a, b, rel_tol=EXACT, abs=1e-3)", True),
        ("np.testing.assert_allclose(a, b, rtol=0, atol=EXACT)", False),
        ("np.testing.assert_allclose(a, 0, atol=1e-3 * scale)", False),
        ("pytest.approx(a, abs=TOL[1])", False),
        ("np.testing.assert_array_equal(a, b)", False),
    ],
)
def test_a_number_and_none_at_all_are_found(code, is_found):
    assert bool(unnamed(code)) is is_found
