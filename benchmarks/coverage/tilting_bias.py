"""What the paper's equations make of pushes that tilt the object: bias and coverage.

    python -m benchmarks.coverage.tilting_bias [--tables 200] [--seed 0] [--components]

Tables are simulated by tilting mechanics, with a push of 5 mm and L = 40 and 70 mm, and
fitted by linear and by tilting mechanics. The intervals are 90 % profile sets: θ_c is
imposed, everything else fitted, and the set holds the truth where chi-square grows by
less than its threshold. Sets, not posteriors by emcee, because 800 of those would take
hours. L is known. The last column is the share of tables whose best fits by the two
differ by a good part of the width of the linear set. Interrupted, the run prints what
it has.
"""

import argparse
import sys
from collections import defaultdict

import jax.numpy as jnp
import numpy as np
import pandas as pd

from benchmarks.tables import HARD
from pushfit.config import GraspConfig, parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.tilt_check import WORTH_OF_WIDTH
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp, Parameters

# Elevations that are pushed at [rad].
THETA = np.radians(np.arange(10.0, 90.0, 5.0))
# Repeats and push length [m] are the paper's; noise of a height [N].
REPEATS, NOISE, PUSH_LENGTH = 3, 0.02, 5e-3
# L of a low and of a tall object [m].
LENGTHS = (0.04, 0.07)
# Of the sets.
PROB = 0.9
# Range in which widths of sets count.
RANGE_DEG = (0.0, 90.0)


def truth(length: float) -> Parameters:
    """A = 520 and B = 150 N/m at 40 mm, C_rr = 0.5."""
    return Parameters(1300, 2600 / 3, 450, 0.5, 0.36, length)


def config(mechanics: str, length: float) -> GraspConfig:
    """Everything at its default but L."""
    return parse_config(
        f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"
        f'[grasp]\nmechanics = "{mechanics}"\n'
        f"[parameters.L]\nfixed = {length}\n{HARD}",
        path="grasp.toml",
    )


def table(length: float, channels: tuple[str, ...], seed: int) -> PeakTable:
    """One sweep of θ with noise."""
    return simulate_table(
        truth(length),
        Grasp(push_length=PUSH_LENGTH, mechanics="tilting"),
        theta=THETA,
        alpha=0.0,
        repeats=REPEATS,
        noise=NOISE,
        rng=np.random.default_rng([seed, round(1000 * length)]),
        channels=channels,
        state_sd=True,
    )


def answer(
    pushes: PeakTable, settings: GraspConfig, theta_c: float
) -> dict[str, float]:
    """Best θ_c, width of its set, and whether the set holds the truth."""
    fitted = fit_table(pushes, settings)
    profile = likelihood_profiles(
        fitted.setup,
        fitted.fit,
        reference_alpha=fitted.reference_alpha,
        prob=PROB,
        reach=(0.0, np.pi),
        wanted=("theta_c",),
    )["theta_c"]
    ends = np.clip(
        [
            (-np.inf if low is None else low, np.inf if high is None else high)
            for low, high in profile.pieces
        ],
        *RANGE_DEG,
    )
    holds = np.any((ends[:, 0] <= theta_c) & (theta_c <= ends[:, 1]))
    estimate = fitted.fit.modes[0].theta_c_deg
    return {
        "estimate": np.nan if estimate is None else estimate,
        "width": float(np.sum(ends[:, 1] - ends[:, 0])),
        "holds": float(holds),
        "chi_square": fitted.fit.chi_square,
    }


def run(n_tables: int, seed: int, channels: tuple[str, ...]) -> pd.DataFrame:
    """One row for each table and mechanics."""
    rows: list[dict[str, object]] = []
    try:
        for index in range(n_tables):
            for length in LENGTHS:
                grasp = Grasp(push_length=PUSH_LENGTH, mechanics="tilting")
                theta_c = float(critical_angle(truth(length), grasp, jnp.asarray(0.0)))
                pushes = table(length, channels, seed + index)
                both = {
                    name: answer(pushes, config(name, length), np.degrees(theta_c))
                    for name in ("linear", "tilting")
                }
                gap = abs(both["linear"]["estimate"] - both["tilting"]["estimate"])
                differs = gap >= WORTH_OF_WIDTH * both["linear"]["width"]
                for name, found in both.items():
                    error = found["estimate"] - np.degrees(theta_c)
                    row = {"L [mm]": 1000 * length, "mechanics": name}
                    rows.append(row | found | {"error": error, "differs": differs})
            if index % 10 == 9:
                print(f"{index + 1} tables", file=sys.stderr, flush=True)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame) -> str:
    """Bias, scatter and coverage of θ_c by length and mechanics."""
    cells = defaultdict(dict)
    for (length, name), part in rows.groupby(["L [mm]", "mechanics"]):
        row = cells[f"L = {length:g} mm, {name}"]
        row["tables"] = len(part)
        row["bias [deg]"] = f"{part['error'].median():+.2f}"
        row["sd [deg]"] = f"{part['error'].std():.2f}"
        row["width of set [deg]"] = f"{part['width'].median():.1f}"
        row["coverage of 90%"] = f"{part['holds'].mean():.3f}"
        row["chi-square"] = f"{part['chi_square'].median():.0f}"
        row["differs"] = f"{part['differs'].mean():.2f}"
    return pd.DataFrame.from_dict(cells, orient="index").to_string()


def main() -> None:
    """Print bias and coverage of both mechanics."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--components", action="store_true")
    options = parser.parse_args()
    channels = ("height",)
    if options.components:
        channels = ("height_normal", "height_tangential")
    print(summary(run(options.tables, options.seed, channels)))


if __name__ == "__main__":
    main()
