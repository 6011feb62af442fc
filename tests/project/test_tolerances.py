"""Tolerances have names, and reasons beside them.

Excluded: the names that tests share (`tests.tolerances`).
"""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
CALLS = {"approx", "assert_allclose", "isclose", "allclose"}
KEYWORDS = {"rtol", "atol", "rel", "abs"}
SIZES = {"abs", "absolute", "fabs"}
FILES = sorted(TESTS.rglob("*.py"))


def called(node: ast.AST) -> str:
    """Name of a function without that of its module, or nothing if none is called."""
    match node:
        case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name)):
            return name
    return ""


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
        if called(node) not in CALLS:
            continue
        stated = [one.value for one in node.keywords if one.arg in KEYWORDS]
        stated += node.args[1 if called(node) == "approx" else 2 :]
        if not stated or any(map(is_literal, stated)):
            found.append(ast.unparse(node))
    return found


def pairs(node: ast.Compare) -> list[tuple[ast.expr, ast.expr]]:
    """What is asked to be less, and than what."""
    sides = [node.left, *node.comparators]
    found = []
    for left, sign, right in zip(sides, node.ops, sides[1:], strict=False):
        if isinstance(sign, ast.Lt | ast.LtE):
            found.append((left, right))
        if isinstance(sign, ast.Gt | ast.GtE):
            found.append((right, left))
    return found


def unnamed_bounds(code: str) -> list[str]:
    """Asserted comparisons of the size of an error with a number of no name."""
    asserts = [n for n in ast.walk(ast.parse(code)) if isinstance(n, ast.Assert)]
    return [
        ast.unparse(node)
        for one in asserts
        for node in ast.walk(one.test)
        if isinstance(node, ast.Compare)
        for less, bound in pairs(node)
        if is_literal(bound) and {called(n) for n in ast.walk(less)} & SIZES
    ]


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: str(path.relative_to(TESTS).with_suffix(""))
)
def test_no_tolerance_is_a_number_in_a_call(path):
    assert unnamed(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: str(path.relative_to(TESTS).with_suffix(""))
)
def test_no_bound_of_an_error_is_a_number(path):
    assert unnamed_bounds(path.read_text(encoding="utf-8")) == []


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


@pytest.mark.parametrize(
    ("code", "is_found"),
    [
        ("assert abs(a - b) < 0.02", True),
        ("assert 1e-6 >= np.abs(a - b).max(), name", True),
        ("assert np.max(np.abs(a - b)) <= 2 / 4096", True),
        ("assert all(abs(a - b) < 0.1 for a in c)", True),
        ("assert 0.3 < np.abs(a).max() <= 0.5", True),
        ("assert abs(a - b) < NEAR", False),
        ("assert abs(a - b) < 4 * sd < 1.0", False),
        ("assert abs(a - b) > 0.5", False),
        ("assert a < 0.02", False),
        ("is_near = abs(a - b) < 0.02", False),
    ],
)
def test_a_bound_without_a_name_is_found(code, is_found):
    assert bool(unnamed_bounds(code)) is is_found
