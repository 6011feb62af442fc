"""What each stage of an analysis takes, for the table that the progress bar goes by.

Seconds by the clock of the stages of `pushfit identify --out` of the example by both
mechanics, of the first run with nothing compiled, and of later ones; then by linear
mechanics alone, and by emcee. What `pushfit.fit.identify.progress.SECONDS` states
stands beside.

    nice python -m benchmarks.speed.stages [--warm 3] [--emcee]
"""

import argparse
import itertools
import json
import statistics
import tempfile
from pathlib import Path

from benchmarks.speed.waiting import CONFIG, SWEEP, run
from pushfit.fit.identify.progress import SECONDS

# A process whose stages say when they begin.
TIMED = """
import json, sys, time
from pushfit.fit.identify.progress import Stages
began, begin = [], Stages.begin
def timed(self, name):
    began.append((name, time.perf_counter()))
    begin(self, name)
Stages.begin = timed
from pushfit.cli import main
code = main(sys.argv[1:])
began.append(("", time.perf_counter()))
print(json.dumps([code, began]))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--warm", type=int, default=3)
    parser.add_argument("--emcee", action="store_true")
    options = parser.parse_args()
    words = ["identify", SWEEP[0], "-s", SWEEP[1], "--out", "result", "--force"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cache").mkdir(mode=0o700)
        linear = '[grasp]\nmechanics = "linear"'
        text = Path(CONFIG).read_text("utf-8").replace("[grasp]", linear)
        (folder / "linear.toml").write_text(text, encoding="utf-8")
        words += ["--config", CONFIG]
        print_rows("by both mechanics", folder, words, options.warm)
        words[-1] = "linear.toml"
        print_rows("by linear mechanics", folder, words, options.warm)
        if options.emcee:
            print_rows("by emcee", folder, [*words, "--engine", "emcee"], options.warm)


def print_rows(what: str, folder: Path, words: list[str], n_warm: int) -> None:
    """One row a stage: cold, warm, and as stated."""
    cold = seconds(folder, words)
    warm = [seconds(folder, words) for _ in range(n_warm)]
    print(f"| {what} | cold | warm | stated, warm | stated, cold |")
    print("| --- | --- | --- | --- | --- |")
    for name in cold:
        middle = statistics.median(one[name] for one in warm)
        stated = " | ".join(f"{s:g}" for s in SECONDS[name])
        print(f"| {name} | {cold[name]:.1f} | {middle:.1f} | {stated} |", flush=True)


def seconds(folder: Path, words: list[str]) -> dict[str, float]:
    """Seconds of every stage of one run."""
    _, said = run(folder, ["-c", TIMED, *words, "--json"])
    code, began = json.loads(said[-1])
    assert code == 0
    pairs = itertools.pairwise(began)
    return {name: after - before for (name, before), (_, after) in pairs}


if __name__ == "__main__":
    main()
