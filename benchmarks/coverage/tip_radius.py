"""What round fingertips do to θ_c, and whether `[grasp] tip_radius_mm` undoes it.

    python -m benchmarks.coverage.tip_radius [--tables 20] [--seed 0] [--components]

Heights of 5 mm pushes on a slab between round tips, by statics that know nothing of the
model (`tests/mechanics/statics.py`), with noise. Each table is identified by tilting
mechanics whose tips are points, and with the radius stated. Intervals are those of 90 %
of the posterior.
"""

import argparse
import functools
import itertools
import sys
from collections import defaultdict

import numpy as np
import pandas as pd

from benchmarks.tables import HARD
from pushfit.config import GraspConfig, parse_config
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.identify.identify_table import identify_table
from tests.mechanics.statics import Slab

# Elevations that are pushed at [deg].
THETA_DEG = np.arange(10.0, 90.0, 5.0)
# Repeats and push length [m] are the paper's; noise of a height, and preload [N].
REPEATS, NOISE, PUSH_LENGTH, PRELOAD = 3, 0.02, 5e-3, 0.0
# Of a tip that is nearly a point, and of the example in CHANGELOG.md [m].
RADII = (0.001, 0.008)
# A = 520 and B = 150 N/m, C_rr = 0.5.
SPRINGS = {"A": 520.0, "K": 450.0, "C_d": 0.36, "C_rr": 0.5, "L": 0.04}


def slab(radius: float) -> Slab:
    """The grasp that is pushed."""
    return Slab(**SPRINGS, F_0=PRELOAD, radius=radius)


def config(radius: float | None) -> GraspConfig:
    """Everything at its default but L, the preload and the radius."""
    tip = "" if radius is None else f"tip_radius_mm = {1000 * radius}\n"
    return parse_config(
        f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"
        f'[grasp]\nmechanics = "tilting"\npreload_n = {PRELOAD}\n{tip}'
        f"[parameters.L]\nfixed = {SPRINGS['L']}\n{HARD}",
        path="grasp.toml",
    )


@functools.cache
def exact(radius: float) -> tuple[np.ndarray, np.ndarray, float]:
    """F_n and F_t of every push of a sweep [N], and θ_c [deg]."""
    pushed = [slab(radius).pushed(t, PUSH_LENGTH) for t in np.radians(THETA_DEG)]
    normal, tangential, _ = np.repeat(np.array(pushed), REPEATS, axis=0).T
    return normal, tangential, np.degrees(slab(radius).critical_angle(PUSH_LENGTH))


def table(radius: float, *, is_components: bool, seed: int) -> PeakTable:
    """One sweep of θ with noise."""
    normal, tangential, _ = exact(radius)
    heights = {"height": np.hypot(normal, tangential) - PRELOAD}
    if is_components:
        heights = {
            "height_normal": normal - PRELOAD,
            "height_tangential": tangential,
        }
    rng = np.random.default_rng([seed, round(1e6 * radius)])
    theta = np.repeat(np.radians(THETA_DEG), REPEATS)
    return PeakTable.from_arrays(
        theta=theta,
        alpha=np.zeros_like(theta),
        heights={n: h + rng.normal(0.0, NOISE, h.size) for n, h in heights.items()},
        unit="n",
        sd={name: np.full(theta.size, NOISE) for name in heights},
    )


def run(n_tables: int, seed: int, *, is_components: bool) -> pd.DataFrame:
    """One row for each table and fit."""
    rows: list[dict[str, object]] = []
    try:
        for radius, index in itertools.product(RADII, range(n_tables)):
            pushes = table(radius, is_components=is_components, seed=seed + index)
            theta_c = exact(radius)[2]
            for tips, stated in (("points", None), ("stated", radius)):
                found = identify_table(
                    pushes, config(stated), seed=seed + index, is_brief=True
                ).theta_c
                row = {"radius [mm]": 1000 * radius, "tips": tips}
                if found.estimate is not None and found.interval is not None:
                    low, high = found.interval
                    row["error"] = found.estimate - theta_c
                    # A float, since the sum of NumPy's booleans is a boolean.
                    holds = float(low <= theta_c <= high)
                    row |= {"width": high - low, "holds": holds}
                rows.append(row)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame) -> str:
    """Bias, scatter and coverage of θ_c by radius and fit."""
    cells = defaultdict(dict)
    for (radius, tips), part in rows.groupby(["radius [mm]", "tips"]):
        row = cells[f"{radius:g} mm, {tips}"]
        row["tables"], row["with interval"] = len(part), part["width"].count()
        row["median error [deg]"] = f"{part['error'].median():+.2f}"
        row["largest error [deg]"] = f"{part['error'].abs().max():.2f}"
        row["width [deg]"] = f"{part['width'].median():.2f}"
        row["holds"] = int(part["holds"].sum())
    return pd.DataFrame.from_dict(cells, orient="index").to_string()


def main() -> None:
    """Print what θ_c is off by with and without the radius."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tables", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--components", action="store_true")
    options = parser.parse_args()
    print("θ_c [deg]:", *(f"{exact(radius)[2]:.2f}" for radius in RADII))
    print(summary(run(options.tables, options.seed, is_components=options.components)))


if __name__ == "__main__":
    main()
