"""Tables per second of the lanes, by device and number of lanes in a call.

    python -m benchmarks.gpu_throughput [--lanes 32 128 512 2048] [--rounds 3]

Every device that JAX sees takes its turn with the same program, the processor always
among them; for a GPU install JAX with CUDA. Tables are 32 different ones, repeated.
"""

import argparse
import time

import jax
import numpy as np
from pushfit.fit.lane_draws import draw_lanes
from pushfit.fit.lane_posterior import integrate_lanes

from benchmarks import tables
from pushfit.fit.lane_fit import fit_lanes
from pushfit.fit.lane_results import N_DRAWS, N_LANES
from pushfit.fit.lanes import Lane


def devices() -> list[jax.Device]:
    """One device of each kind."""
    found = [*jax.devices("cpu")[:1], *jax.devices()[:1]]
    return list(dict.fromkeys(found))


def seconds(lanes: Lane, uniform: jax.Array) -> tuple[float, float]:
    """Durations of least squares, and of posterior and draws [s]."""
    start = time.perf_counter()
    fits = jax.block_until_ready(fit_lanes(lanes))
    middle = time.perf_counter()
    jax.block_until_ready(draw_lanes(lanes, integrate_lanes(lanes, fits), uniform))
    return middle - start, time.perf_counter() - middle


def main() -> None:
    """Print one line for each device and number of lanes."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lanes", type=int, nargs="+", default=[32, 128, 512, 2048])
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    lanes = tables.stacked(tables.in_lanes(tables.prior_tables(N_LANES)))
    rng = np.random.default_rng(0)
    print("| device | lanes | fits per second | posteriors with draws per second |")
    print("|---|---|---|---|")
    for n in options.lanes:
        rows = np.arange(n) % N_LANES
        uniform = rng.uniform(size=(n, N_DRAWS, 4))
        for device in devices():
            repeated = jax.tree.map(lambda leaf, rows=rows: leaf[rows], lanes)
            placed = jax.device_put((repeated, uniform), device)
            with jax.default_device(device):
                seconds(*placed)  # compiles
                times = [seconds(*placed) for _ in range(options.rounds)]
            fit, rest = n / np.min(times, axis=0)
            print(
                f"| {device.device_kind} | {n} | {fit:.0f} | {rest:.0f} |", flush=True
            )


if __name__ == "__main__":
    main()
