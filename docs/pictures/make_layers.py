"""Draw the layers of the package and the way of the data, from the code's own imports.

Run from the root of the repository: `python -m docs.pictures.make_layers`.
"""

import ast
import textwrap
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from tests.project.test_imports import (
    FILES,
    LAYERS,
    PACKAGE,
    imported_modules,
    layer,
    module_name,
)

# Records that are handed from layer to layer.
RECORDS = ("GraspConfig", "Recording", "PeakTable", "Problem", "Identification")
COLOURS = ("#6E6E6E", "#0072B2", "#009E73", "#D55E00", "#CC79A7")


def names_in(own: str) -> str:
    """Folders and modules of a layer."""
    folder = PACKAGE / own
    inside = [folder] if folder.is_dir() else []
    beside = [
        path.stem
        for path in PACKAGE.glob("*.py")
        if not path.stem.startswith("__") and layer(f"pushfit.{path.stem}") == own
    ]
    beside += [
        f"{path.name}/"
        for path in PACKAGE.iterdir()
        if path.name not in LAYERS
        and (path / "__init__.py").exists()
        and layer(f"pushfit.{path.name}") == own
    ]
    for path in inside:
        folders = sorted(p.parent.name for p in path.glob("*/__init__.py"))
        beside += [f"{name}/" for name in folders]
        alone = [p for p in path.glob("*.py") if p.stem != "__init__"]
        if alone:
            beside.append(f"{len(alone)} modules")
    names = sorted(beside, key=lambda name: (name.endswith("modules"), name))
    return textwrap.fill(", ".join(names), 76)


def home(record: str) -> str:
    """Module that defines a record."""
    for path in FILES:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        own = module_name(path)
        # Problems of input files are another thing.
        if layer(own) != "errors" and any(
            isinstance(n, ast.ClassDef) and n.name == record for n in tree.body
        ):
            return own
    raise LookupError(record)


def users(record: str) -> set[str]:
    """Layers that import a record."""
    own = layer(home(record))
    return {
        layer(module_name(path))
        for path in FILES
        for name in imported_modules(path)
        # By its module, or by the package that exports it.
        if name.startswith(f"pushfit.{own}.") and name.endswith(f".{record}")
    }


def draw() -> Figure:
    """Layers as shelves, each record as a line from its maker to its users."""
    figure = Figure(figsize=(7.2, 4.6), layout="constrained")
    axes = figure.subplots()
    heights = {name: index for index, name in enumerate(LAYERS)}
    for name, y in heights.items():
        style = "round,pad=0,rounding_size=0.1"
        box = FancyBboxPatch(
            (0, y - 0.38), 6.1, 0.76, boxstyle=style, fc="#EEEEEE", ec="#6E6E6E"
        )
        axes.add_patch(box)
        axes.text(0.12, y, name, va="center", weight="bold", fontsize=10)
        axes.text(1.1, y, names_in(name), va="center", fontsize=7)
    for index, (record, colour) in enumerate(zip(RECORDS, COLOURS, strict=True)):
        x = 6.6 + 0.62 * index
        start = heights[layer(home(record))]
        ends = sorted(heights[name] for name in users(record))
        top = max(ends)
        arrow = {"arrowstyle": "->", "color": colour}
        if top > start:
            axes.annotate("", (x, top + 0.3), (x, start), arrowprops=arrow)
        axes.plot([x] * len(ends), ends, "o", color=colour, ms=4, mfc="white")
        axes.plot([x], [start], "o", color=colour, ms=7)
        axes.text(
            x, -0.6, record, rotation=35, ha="right", va="top", color=colour, fontsize=8
        )
    axes.text(0, -0.75, "a layer imports from those below it only", fontsize=8)
    axes.text(0, -1.1, "full dot: defines the record; open dots: take it", fontsize=8)
    axes.set(xlim=(-0.1, 9.6), ylim=(-1.7, len(LAYERS) - 0.4))
    axes.set_axis_off()
    return figure


if __name__ == "__main__":
    draw().savefig(Path(__file__).with_name("layers.png"), dpi=120)
