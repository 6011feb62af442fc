"""What a person waits for: every command of the README, cold and warm.

Processor and wall seconds of a process, seconds to the first number of θ_c on either
stream, and programs that JAX compiled or loaded. The cold run compiles all of them.

    python -m benchmarks.waiting [--warm 3] [--only fit next]
"""

import argparse
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

EXAMPLE = Path(__file__).parents[1] / "examples" / "foam_box"
CONFIG = str(EXAMPLE / "grasp.toml")
SWEEP = [str(EXAMPLE / f"{what}.csv") for what in ("theta_sweep", "theta_schedule")]
COMMANDS = {
    "fit": ["fit", "peaks.csv", "--config", CONFIG],
    "identify": ["identify", SWEEP[0], "-s", SWEEP[1], "--config", CONFIG],
    "identify --out": [
        *("identify", SWEEP[0], "-s", SWEEP[1], "--config", CONFIG),
        *("--out", "result", "--force"),
    ],
    "next": ["next", "peaks.csv", "--config", CONFIG],
    "compare": ["compare", "peaks.csv", "--config", CONFIG],
}
# Every program that is compiled, or loaded from the cache, is one event.
COUNTED = """
import sys
from pushfit.cache import enable_compile_cache
enable_compile_cache()
import jax
n = [0]
def note(event, seconds, **_):
    n[0] += event == "/jax/core/compile/backend_compile_duration"
jax.monitoring.register_event_duration_secs_listener(note)
from pushfit.cli import main
code = main(sys.argv[1:])
print(f"{n[0]} programs", file=sys.stderr)
sys.exit(code)
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """One run of one command [s]."""

    processor: float
    wall: float
    first: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--warm", type=int, default=3)
    parser.add_argument("--only", nargs="*", default=list(COMMANDS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cache").mkdir(mode=0o700)
        peaks = ["peaks", SWEEP[0], "-s", SWEEP[1], "--config", CONFIG]
        run(folder, ["-m", "pushfit", *peaks, "-o", "peaks.csv"])
        print("| command | | processor | wall | first number | programs |")
        print("| --- | --- | --- | --- | --- | --- |")
        for what in options.only:
            words = ["-m", "pushfit", *COMMANDS[what]]
            cold, _ = run(folder, words)
            print_row(what, "cold", cold, "")
            warm = [run(folder, words)[0] for _ in range(options.warm)]
            middle = Wait(
                processor=statistics.median(one.processor for one in warm),
                wall=statistics.median(one.wall for one in warm),
                first=statistics.median(one.first for one in warm),
            )
            _, said = run(folder, ["-c", COUNTED, *COMMANDS[what]])
            count = next(line for line in reversed(said) if "programs" in line)
            print_row(what, "warm", middle, count.split()[0])


def print_row(what: str, when: str, wait: Wait, programs: str) -> None:
    numbers = f"{wait.processor:.1f} | {wait.wall:.1f} | {wait.first:.1f}"
    print(f"| `{what}` | {when} | {numbers} | {programs} |", flush=True)


def run(folder: Path, words: list[str]) -> tuple[Wait, list[str]]:
    """A process of its own with both streams read as they come."""
    environment = os.environ | {"XDG_CACHE_HOME": str(folder / "cache")}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    environment["PYTHONPATH"] = str(Path(__file__).parents[1])
    before, start = used(), time.perf_counter()
    first, said = float("nan"), []
    with subprocess.Popen(
        [sys.executable, *words],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if not first > 0 and "°" in line:
                first = time.perf_counter() - start
            said.append(line)
    assert process.returncode == 0, "".join(said)
    wall = time.perf_counter() - start
    return Wait(processor=used() - before, wall=wall, first=first), said


def used() -> float:
    """Processor seconds of all children so far."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


if __name__ == "__main__":
    main()
