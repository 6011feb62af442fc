"""The same small task by lmfit, by emcee with ArviZ, and by pushfit: lines and seconds.

From 51 heights to θ_c with a 90 % interval that may be believed. Each script of
examples/side_by_side is run as a process of its own, first once and then some times
more, in turns; a line counts that is neither empty nor a comment nor a docstring.

    nice python -m benchmarks.inference.side_by_side [--rounds 3]
"""

import argparse
import ast
import statistics
import tempfile
from pathlib import Path

from benchmarks.speed.waiting import Wait, run

FOLDER = Path(__file__).parents[2] / "examples" / "side_by_side"
SCRIPTS = ("with_lmfit.py", "with_arviz.py", "with_pushfit.py")


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cache").mkdir(mode=0o700)
        for file in [*SCRIPTS, "heights.csv"]:
            (folder / file).write_bytes((FOLDER / file).read_bytes())
        first = {script: run(folder, [script]) for script in SCRIPTS}
        again: dict[str, list[Wait]] = {script: [] for script in SCRIPTS}
        for _ in range(options.rounds):
            for script, waits in again.items():
                waits.append(run(folder, [script])[0])
    print("| script | lines | processor, first | processor | clock | answer |")
    print("| --- | --- | --- | --- | --- | --- |")
    for script, (cold, said) in first.items():
        processor = statistics.median(wait.processor for wait in again[script])
        clock = statistics.median(wait.wall for wait in again[script])
        times = f"{cold.processor:.1f} s | {processor:.1f} s | {clock:.1f} s"
        n = n_lines((FOLDER / script).read_text("utf-8"))
        print(f"| `{script}` | {n} | {times} | {said[-1].strip()} |")


def n_lines(source: str) -> int:
    """Lines of code, as `ast` prints them again without comments and docstrings."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef) and ast.get_docstring(node):
            del node.body[0]
    return sum(bool(line.strip()) for line in ast.unparse(tree).splitlines())


if __name__ == "__main__":
    main()
