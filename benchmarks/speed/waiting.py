"""What a person waits for: every command of the README, and the notebook.

Processor seconds first, since other work on the machine changes them least; seconds by
the clock; and both up to the first number of θ_c on either stream. The cold run has
nothing compiled, the warm ones find what it kept.

    nice python -m benchmarks.speed.waiting [--warm 3] [--only fit next] [--notebook]
"""

import argparse
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "foam_box"
NOTEBOOK = ROOT / "examples" / "notebooks" / "tutorial.ipynb"
CONFIG = str(EXAMPLE / "grasp.toml")
SWEEP = [str(EXAMPLE / f"{what}.csv") for what in ("theta_sweep", "theta_schedule")]
ALPHA = [str(EXAMPLE / f"{what}.csv") for what in ("alpha_sweep", "alpha_schedule")]
BOTH = [SWEEP[0], ALPHA[0], "-s", SWEEP[1], "-s", ALPHA[1], "--config", CONFIG]
# In the order of the README; each writes what the next one reads.
COMMANDS = {
    "validate": ["validate", SWEEP[0]],
    "peaks": ["peaks", SWEEP[0], "-s", SWEEP[1], "-o", "peaks.csv", "--force"],
    "fit": ["fit", "peaks.csv", "--config", CONFIG],
    "identify": ["identify", *BOTH, "--seed", "1"],
    "identify --out": [
        *("identify", *BOTH, "--seed", "1", "--out", "result", "--force"),
    ],
    "report": ["report", "result", "-o", "report.html", "--force"],
    "init": ["init", "grasp.toml", "--force"],
    "doctor": ["doctor"],
    "verify": ["verify", "result"],
    "next": ["next", "peaks.csv", "--config", CONFIG],
    "compare": ["compare", "peaks.csv", "--config", CONFIG],
    "coverage": ["coverage", "peaks.csv", "--config", CONFIG, "--tables", "4"],
}
# What has no θ_c to say before it is done, or none at all.
SILENT = {"validate", "peaks", "report", "init", "doctor"}
EXECUTE = """
import sys, nbclient, nbformat
notebook = nbformat.read(sys.argv[1], as_version=4)
nbclient.NotebookClient(notebook, timeout=None).execute(cwd=sys.argv[2])
"""
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """One run of one command [s].

    Args:
        processor: Of all cores.
        wall: By the clock.
        first: By the clock, up to the first number.
        first_processor: Of all cores, up to the first number.
    """

    processor: float
    wall: float
    first: float
    first_processor: float


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--warm", type=int, default=3)
    parser.add_argument("--only", nargs="*", default=list(COMMANDS))
    parser.add_argument("--notebook", action="store_true")
    options = parser.parse_args()
    print("| command | | processor | clock | first number, processor | by the clock |")
    print("| --- | --- | --- | --- | --- | --- |", flush=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = {what: ["-m", "pushfit", *COMMANDS[what]] for what in options.only}
        if options.notebook:
            # It writes where it runs.
            shutil.copytree(EXAMPLE, folder / EXAMPLE.relative_to(ROOT))
            runs["the notebook"] = ["-c", EXECUTE, str(NOTEBOOK), str(folder)]
        needs_peaks = any("peaks.csv" in words for words in runs.values())
        if needs_peaks and "peaks" not in runs:
            run(folder, ["-m", "pushfit", *COMMANDS["peaks"]])
        for what, words in runs.items():
            # Commands share programs: each begins with none, and none of the others.
            place = folder / "caches" / what.replace(" ", "_")
            place.mkdir(mode=0o700, parents=True)
            cold, _ = run(folder, words, cache=place)
            print_row(what, "cold", cold)
            again = [run(folder, words, cache=place)[0] for _ in range(options.warm)]
            names = ("processor", "wall", "first", "first_processor")
            middle = {
                name: statistics.median(getattr(wait, name) for wait in again)
                for name in names
            }
            print_row(what, "warm", Wait(**middle))


def print_row(what: str, when: str, wait: Wait) -> None:
    """One line of the table, as soon as it is known."""
    numbers = f"{wait.processor:.1f} s | {wait.wall:.1f} s"
    first = f"{wait.first_processor:.1f} s | {wait.first:.1f} s"
    if what in SILENT or not wait.first > 0:
        first = "– | –"
    print(f"| `{what}` | {when} | {numbers} | {first} |", flush=True)


def run(
    folder: Path, words: list[str], *, cache: Path | None = None
) -> tuple[Wait, list[str]]:
    """A process of its own with both streams read as they come."""
    environment = os.environ | {"XDG_CACHE_HOME": str(cache or folder / "cache")}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    environment["PYTHONPATH"] = os.pathsep.join(
        [str(ROOT), *environment.get("PYTHONPATH", "").split(os.pathsep)]
    ).rstrip(os.pathsep)
    before, start = used(), time.perf_counter()
    first, first_processor, said = float("nan"), float("nan"), []
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
                first_processor = used_by(process.pid)
            said.append(line)
    assert process.returncode == 0, "".join(said)
    wait = Wait(
        processor=used() - before,
        wall=time.perf_counter() - start,
        first=first,
        first_processor=first_processor,
    )
    return wait, said


def used() -> float:
    """Processor seconds of all children so far."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def used_by(pid: int) -> float:
    """Processor seconds of a process that runs; unknown where the system tells none."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text("ascii").rsplit(")", 1)[1].split()
    except OSError:
        return float("nan")
    return (int(fields[11]) + int(fields[12])) / TICKS


if __name__ == "__main__":
    main()
