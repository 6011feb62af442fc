"""An `Args:` section names everything that there is to give, and nothing else.

Excluded: whether what it says is true, and what has no such section at all.
"""

import ast
import importlib
import inspect
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "pushfit").rglob("*.py"))
SECTION = re.compile(r"^Args:\n((?: {4}.*\n?)+)", re.MULTILINE)
ENTRY = re.compile(r"^ {4}\**(\w+):", re.MULTILINE)
# Where a figure is drawn is said once, before all figures.
SHARED = {"fig"}
RECORDS = {"dataclass", "Module", "NamedTuple"}


def entries(doc: str | None) -> list[str] | None:
    """Names in the section of a docstring; None without a section."""
    found = SECTION.search(inspect.cleandoc(doc or ""))
    return None if found is None else ENTRY.findall(found[1])


def is_record(node: ast.AST) -> bool:
    """Whether a node is a dataclass, an `eqx.Module` or a named tuple."""
    if not isinstance(node, ast.ClassDef):
        return False
    words = map(ast.unparse, [*node.decorator_list, *node.bases])
    return any(word.split("(")[0].split(".")[-1] in RECORDS for word in words)


def fields_of(record: ast.ClassDef) -> list[str]:
    """Fields besides those inherited, or what an `__init__` of its own takes."""
    for part in record.body:
        if isinstance(part, ast.FunctionDef) and part.name == "__init__":
            return [one.arg for one in part.args.args[1:] + part.args.kwonlyargs]
    return [
        ast.unparse(part.target)
        for part in record.body
        if isinstance(part, ast.AnnAssign)
        and not re.search(r"ClassVar|init=False", ast.unparse(part))
    ]


def wrong_records(code: str) -> list[str]:
    """Records whose section is not their fields in order."""
    return [
        node.name
        for node in filter(is_record, ast.walk(ast.parse(code)))
        if entries(ast.get_docstring(node)) not in (None, fields_of(node))
    ]


def is_whole(function: object, *docs: str | None) -> bool:
    """Whether sections name all arguments of a function, or none is there."""
    named = [name for doc in docs for name in entries(doc) or ()]
    taken = set(inspect.signature(function).parameters) - {"self"}
    return not named or taken - SHARED <= set(named) <= taken


def public() -> dict[str, tuple[object, list[str | None]]]:
    """Functions and methods of the page of Python, with the docstrings on them."""
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    found = {}
    for place in re.findall(r"^::: (pushfit[\w.]*)$", page, re.MULTILINE):
        owner, _, name = place.rpartition(".")
        one = getattr(importlib.import_module(owner), name)
        members = vars(one) if inspect.ismodule(one) else {name: one}
        for label, member in members.items():
            if inspect.isfunction(member):
                found[label] = member, [member.__doc__]
            elif inspect.isclass(member):
                found |= methods(member)
    return found


def methods(kind: type) -> dict[str, tuple[object, list[str | None]]]:
    """Those that a class defines; its `__init__` is described by it and its bases."""
    bound = {name: getattr(kind, name) for name in vars(kind) if name[0] != "_"}
    found = {
        f"{kind.__name__}.{name}": (method, [method.__doc__])
        for name, method in bound.items()
        # What is made once and kept is a descriptor of its own, and takes nothing.
        if inspect.isroutine(method) and callable(method)
    }
    # What other records take are their fields.
    of_fields = hasattr(kind, "__dataclass_fields__") or hasattr(kind, "model_fields")
    if "__init__" in vars(kind) and not of_fields:
        own = [base for base in kind.__mro__ if base.__module__.startswith("pushfit")]
        found[kind.__name__] = kind.__init__, [base.__doc__ for base in own]
    return found


PUBLIC = public()


@pytest.mark.parametrize(
    "path", FILES, ids=lambda path: str(path.relative_to(ROOT).with_suffix(""))
)
def test_a_record_that_says_what_its_fields_are_says_it_of_all(path):
    assert wrong_records(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_function_names_all_of_its_arguments_or_none(name):
    function, docs = PUBLIC[name]
    assert is_whole(function, *docs)


RECORD = '''
@dataclass(frozen=True)
class Push:
    """A push.

    Args:
        {}

    Note: A word behind it: no field.
    """

    theta: float
    alpha: float = 0.0
    n: ClassVar[int] = 1
'''


@pytest.mark.parametrize(
    ("section", "is_wrong"),
    [
        ("theta: Elevation: up [rad].\n        alpha: Azimuth [rad].", False),
        ("theta: Elevation\n            alpha: [rad].", True),
        ("alpha: Azimuth [rad].\n        theta: Elevation [rad].", True),
        ("theta: Up.\n        alpha: Round.\n        n: Number.", True),
    ],
)
def test_a_field_that_is_missing_or_was_never_there_is_found(section, is_wrong):
    assert bool(wrong_records(RECORD.format(section))) is is_wrong


@pytest.mark.parametrize(
    ("doc", "is_good"),
    [
        ("A push.", True),
        ("A push.\n\n    Args:\n        theta: Up [rad].\n        more: Rest.\n", True),
        ("A push.\n\n    Args:\n        theta: Elevation [rad].\n", False),
        (
            "A push.\n\n    Args:\n        theta: Up.\n        more: x.\n        z: y.",
            False,
        ),
    ],
)
def test_an_argument_that_is_missing_or_was_never_there_is_found(doc, is_good):
    def push(self: object, theta: float, **more: float) -> None: ...

    assert is_whole(push, doc) is is_good
