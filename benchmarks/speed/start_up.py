"""How long commands take from a cold start, beside a script with lmfit and pandas.

Commands take turns within each round, so that whatever else the machine does hits all
of them; trust the ratios, not the seconds.

    python -m benchmarks.speed.start_up [--rounds 5]
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.inference.side_by_side import FOLDER
from benchmarks.speed.waiting import run

# What pushfit is set beside.
LMFIT = "lmfit and pandas, one local fit"
BASES = ("import jax", LMFIT)
# What a user of lmfit would run instead of `pushfit fit`.
SCRIPT = """
import sys
import lmfit
import numpy as np
import pandas as pd
table = pd.read_csv(sys.argv[1])
theta, heights = np.radians(table["theta_deg"]), table["height_n"]
def residuals(params):
    A, B, C_rr = np.exp(list(params.valuesdict().values()))
    normal = A * np.sin(theta)
    predicted = np.hypot(normal, np.minimum(C_rr * normal, B * np.cos(theta)))
    return np.asarray((5e-3 * predicted - heights) / table["height_sd_n"])
params = lmfit.Parameters()
for name, start in (("ln_A", 6.3), ("ln_B", 5.0), ("ln_C_rr", -1.2)):
    params.add(name, value=start)
print(lmfit.fit_report(lmfit.minimize(residuals, params)))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print_table(measure(Path(folder), options.rounds))


def measure(folder: Path, n_rounds: int) -> dict[str, list[float]]:
    """Seconds of each command in each round."""
    pushfit, table = ["-m", "pushfit"], str(FOLDER / "heights.csv")
    commands = {
        BASES[0]: ["-c", "import jax"],
        LMFIT: ["-c", SCRIPT, table],
        "import pushfit": ["-c", "import pushfit"],
        "pushfit --help": [*pushfit, "--help"],
        "pushfit fit, nothing compiled": [*pushfit, "fit", table],
        "pushfit fit, compiled before": [*pushfit, "fit", table],
    }
    seconds: dict[str, list[float]] = {name: [] for name in commands}
    for number in range(n_rounds):
        # The second fit of a round finds what the first one compiled.
        cache = folder / f"cache{number}"
        cache.mkdir(mode=0o700)
        for name, command in commands.items():
            seconds[name].append(run(folder, command, cache=cache)[0].wall)
    return seconds


def print_table(seconds: dict[str, list[float]]) -> None:
    """Medians, and medians of the ratios within rounds."""
    print(f"| command | median | {' | '.join(f'ratio to: {b}' for b in BASES)} |")
    print("|---|---|---|---|")
    for name, values in seconds.items():
        ratios = [np.median(np.divide(values, seconds[base])) for base in BASES]
        cells = [f"{np.median(values):.2f} s", *(f"{ratio:.2f}" for ratio in ratios)]
        print(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
