"""Layers import one way only, and starting up loads nothing heavy."""

import ast
import functools
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from importlib import metadata
from pathlib import Path

import pytest

import pushfit

PACKAGE = Path(pushfit.__file__).parent
LAYERS = (
    *("errors", "model", "config", "data", "fit"),
    *("explore", "report", "batch", "cli"),
)
# What stands at the top level besides.
MEMBERS = {
    "arguments": "errors",
    "atomic": "errors",
    "parameters": "errors",
    "mechanics": "model",
    "workflow": "batch",
    "__main__": "cli",
}
# What a layer, or a folder of it, must know nothing of, however deep in a function.
FORBIDDEN = {
    "errors": {"numpy", "jax", "pandas", "pydantic"},
    "config": {"numpy", "jax", "pandas"},
    "model": {"pandas", "pathlib", "emcee", "matplotlib"},
    "data": {"emcee", "optimistix", "matplotlib", "typer", "rich"},
    "fit": {"matplotlib", "typer", "rich", "jinja2"},
    "explore": {"emcee", "optimistix", "matplotlib", "typer", "rich"},
    "report": {"optimistix", "typer"},
    "batch": {"jax", "scipy", "emcee", "optimistix", "matplotlib", "typer", "rich"},
    "cli.look": {"jax", "scipy", "emcee", "optimistix", "matplotlib", "typer", "rich"},
    "cli": {"jax", "numpy", "scipy", "emcee", "optimistix", "matplotlib"},
}
# Parts of declared libraries that are imported under their own name, or all of one.
VENDORED = {"pydantic_core", "markupsafe", "dask", "PIL"}
HEAVY = (
    "jax",
    "pandas",
    "matplotlib",
    "scipy",
    "emcee",
    "numpy",
    "optimistix",
)
# What only some identifications need, and none before its first number.
SELDOM = (
    *("emcee", "optimistix", "blackjax", "arviz_stats", "xarray", "matplotlib"),
    *("pandera", "scipy.stats", "scipy.optimize", "scipy.interpolate", "scipy.ndimage"),
    *("scipy.spatial", "dask"),
)
# What the package itself defines, apart from its lazy names.
# Of a function without its docstring.
MAX_LINES = 60
FACADE = {"pushfit.__version__"}
FILES = [path for path in sorted(PACKAGE.rglob("*.py")) if path.parent != PACKAGE]
FILES += [path for path in sorted(PACKAGE.glob("*.py")) if path.stem != "__init__"]
FOLDERS = sorted({path.parent for path in FILES})


def layer(module: str) -> str:
    """Layer of a dotted module name inside the package; what has none is refused."""
    name = module.split(".")[1]
    return name if name in LAYERS else MEMBERS[name]


@functools.cache
def imported_modules(path: Path) -> list[str]:
    """Absolute names of all modules that a file imports, at any depth."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def module_name(path: Path) -> str:
    """Dotted name of a file of the package."""
    return ".".join(("pushfit", *path.relative_to(PACKAGE).with_suffix("").parts))


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_imports_run_one_way(path):
    own = layer(module_name(path))
    for name in imported_modules(path):
        if name.startswith("pushfit.") and name not in FACADE:
            assert LAYERS.index(layer(name)) <= LAYERS.index(own), name


@functools.cache
def needs() -> dict[str, set[str]]:
    """Modules that each module imports, at any depth."""
    paths = {module_name(path).removesuffix(".__init__"): path for path in FILES}
    found = {}
    for module, path in paths.items():
        # A name is that of a module, or of something in one.
        names = [(name, name.rpartition(".")[0]) for name in imported_modules(path)]
        known = {next((n for n in pair if n in paths), module) for pair in names}
        found[module] = known - {module}
    return found


def test_no_module_needs_itself_by_way_of_others():
    # It raises CycleError, which names the modules.
    assert [*TopologicalSorter(needs()).static_order()]


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda path: path.name)
def test_no_folder_needs_itself_by_way_of_others(folder):
    """What stands side by side in a folder is in an order."""
    parent = module_name(folder / "__init__").removesuffix(".__init__") + "."
    inside = {m: ms for m, ms in needs().items() if m.startswith(parent)}
    children = {}
    for module, others in inside.items():
        child = module.removeprefix(parent).split(".")[0]
        near = {o.removeprefix(parent).split(".")[0] for o in others if o in inside}
        children.setdefault(child, set()).update(near - {child})
    assert {*TopologicalSorter(children).static_order()} >= {*children}


def test_text_is_written_without_figures():
    """Figures may quote sentences; sentences that drew figures would be a circle."""
    paths = [p for p in FILES if p.parent == PACKAGE / "report" / "text"]
    names = [name for path in paths for name in imported_modules(path)]
    assert paths
    assert not [name for name in names if name.startswith("pushfit.report.figures")]


@pytest.mark.parametrize("path", FILES, ids=module_name)
def test_a_layer_does_not_know_what_is_none_of_its_business(path):
    own = module_name(path)
    folder = ".".join(own.split(".")[1:3])
    roots = {name.split(".")[0] for name in imported_modules(path)}
    assert not roots & FORBIDDEN.get(folder, FORBIDDEN[layer(own)])


def test_every_library_that_is_imported_is_declared():
    files = [*FILES, *Path(__file__).parents[1].rglob("*.py")]
    used = {name.split(".")[0] for path in files for name in imported_modules(path)}
    requirements = metadata.requires("pushfit") or []
    declared = {re.split(r"[^\w.-]", r, maxsplit=1)[0] for r in requirements}
    modules = {name.replace("-", "_").lower() for name in declared}
    assert (
        used
        - modules
        - set(sys.stdlib_module_names)
        - {
            "pushfit",
            "tests",
            "benchmarks",
        }
        <= VENDORED
    )


def run_python(code: str) -> str:
    """Standard output of a fresh interpreter."""
    return subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout


@pytest.mark.parametrize(
    "start",
    [
        "import pushfit",
        "import pushfit.cli",
        "from pushfit.cli import main; main(['--help'])",
        "from pushfit.cli import main; main(['identify', '--help'])",
    ],
)
def test_starting_up_loads_nothing_heavy(start):
    code = f"import sys; {start}; print(set({HEAVY}) & set(sys.modules))"
    assert run_python(code).endswith("set()\n")


def test_the_inference_loads_what_only_some_tables_need_when_they_do():
    modules = "pushfit.fit.identify.identify_table, pushfit.fit.identify.identify_many"
    modules += ", pushfit.explore.explorer"
    code = f"import sys, {modules}; print(set({SELDOM}) & set(sys.modules))"
    assert run_python(code) == "set()\n"


def test_every_public_name_can_be_imported():
    code = "import pushfit; [getattr(pushfit, name) for name in pushfit.__all__]"
    assert run_python(code) == ""


def test_the_public_names_are_listed_once():
    assert len(pushfit.__all__) == len(set(pushfit.__all__)) > 0


def defined_names(node: ast.stmt) -> list[str]:
    """Public names of functions, classes and aliases that a statement defines.

    Constants and type variables of one letter are in capitals, and each file's own.
    """
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        names = [node.name]
    elif isinstance(node, ast.Assign | ast.AnnAssign):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [target.id for target in targets if isinstance(target, ast.Name)]
    else:
        names = []
    return [n for n in names if not n.startswith("_") and not n.isupper()]


def test_no_function_class_or_alias_has_the_name_of_another():
    """A name means one thing, whichever module a reader meets it in."""
    places = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        is_command = path.parent == PACKAGE / "cli" / "commands"
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            # Functions of commands are called as users call these.
            if is_command and isinstance(node, ast.FunctionDef):
                continue
            for name in defined_names(node):
                places.setdefault(name, []).append(str(path.relative_to(PACKAGE)))
    assert places.pop("main")
    assert {k: where for k, where in places.items() if len(where) > 1} == {}


def constants(path: Path) -> set[str]:
    """Public names in capitals that a module assigns, type variables left out."""
    parts = ast.parse(path.read_text(encoding="utf-8")).body
    assigned = [
        name.id
        for part in parts
        if isinstance(part, ast.Assign | ast.AnnAssign)
        for name in ast.walk(part)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    ]
    return {name for name in assigned if name.isupper() and len(name) > 1}


def test_no_constant_that_others_import_has_the_name_of_another_such():
    """One name, one value, wherever a reader meets it; others are each file's own."""
    used = {
        tuple(name.rsplit(".", 1))
        for path in FILES
        for name in imported_modules(path)
        if name.startswith("pushfit.")
    }
    places = {}
    for path in FILES:
        module = module_name(path).removesuffix(".__init__")
        for name in constants(path):
            if not name.startswith("_") and (module, name) in used:
                places.setdefault(name, []).append(module)
    assert len(places) > 1
    assert {k: where for k, where in places.items() if len(where) > 1} == {}


def public_functions(path: Path) -> list[ast.FunctionDef]:
    """Functions and methods without an underscore that are not inside of another."""
    parts = ast.parse(path.read_text()).body
    classes = [part for part in parts if isinstance(part, ast.ClassDef)]
    parts += [part for one in classes for part in one.body]
    found = [part for part in parts if isinstance(part, ast.FunctionDef)]
    return [one for one in found if not one.name.startswith("_")]


def test_public_functions_take_at_most_three_arguments_without_their_names():
    many = {
        f"{module_name(path)}.{function.name}"
        for path in FILES
        for function in public_functions(path)
        if len([a for a in function.args.args if a.arg not in ("self", "cls")]) > 3
    }
    assert many == set()


def body_length(function: ast.FunctionDef) -> int:
    """Lines after its docstring."""
    has_doc = ast.get_docstring(function) is not None
    body = function.body[has_doc:] or function.body
    return (body[-1].end_lineno or 0) - body[0].lineno + 1


def test_no_function_is_longer_than_its_idea():
    long = {
        f"{module_name(path)}.{node.name}: {body_length(node)}"
        for path in FILES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef) and body_length(node) > MAX_LINES
    }
    assert long == set()
