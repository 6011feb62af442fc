"""How long one suggestion takes, and whether memory stays flat, by pushes made so far.

    python -m benchmarks.suggestion [--steps 100]

A step is what lies between a height and the next push: the push is told, the belief
weighed anew, the forecast made, all candidates surveyed and the best suggested. Steps
in which the engine draws anew stand by themselves: a finger retracts meanwhile.
Processor times of one process, its programs compiled before. Noise grows with the
pushes attached, so that as much is left to be found out after 300 as after 10.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np

from pushfit.cache import enable_compile_cache
from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.explore.belief.belief import ANGLES
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.model import Grasp, Parameters, Pushes, forward

CONFIG = parse_config("[push]\nlength_mm = 5.0\n", path="grasp.toml")
CHANNELS = ("height_normal", "height_tangential")
GRASP = Grasp(push_length=5e-3)
TRUTH = Parameters(
    K_sn=800, K_dn=2000, K_st=400, C_rr=0.3, C_d=0.5, L=0.04, e1=0.3, e2=0.2
)
THETA, ALPHA = np.arange(5.0, 90.0, 5.0), np.arange(0.0, 180.0, 15.0)
NOISE, N_WARM = 0.02, 3


def explored(ask: str, n: int, rng: np.random.Generator) -> Explorer:
    """An exploration that has n pushes behind it."""
    is_open = ask != "theta_c"
    table = simulate_table(
        TRUTH,
        GRASP,
        theta=np.radians(rng.choice(THETA, n)),
        alpha=np.radians(rng.choice(ALPHA, n)) if is_open else np.pi / 2,
        repeats=1,
        noise=NOISE * np.sqrt(n),
        rng=rng,
        channels=CHANNELS,
    )
    explorer = Explorer(
        CONFIG,
        ask=ask,
        width_deg=3.0,
        budget=400,
        sigma=NOISE * np.sqrt(n),
        channels=CHANNELS,
        limits=Limits(reference_every=0, max_pushes=800),
    )
    explorer.attach(table)
    return explorer


def step(explorer: Explorer, rng: np.random.Generator) -> tuple[float, bool]:
    """Processor time of one step [s], and whether the engine drew anew."""
    survey = explorer.survey()
    best = survey.ranks[0]
    theta, alpha = float(survey.theta[best]), float(survey.alpha[best])
    felt = forward(TRUTH, Pushes(np.array([theta]), np.array([alpha])), GRASP)
    sigma = explorer.question.sigma or 0.0
    heights = {
        name: float(getattr(felt, name)[0]) + sigma * rng.standard_normal()
        for name in CHANNELS
    }
    n_drawn = explorer.history.n_drawn
    start = time.process_time()
    explorer.tell(theta, alpha, heights)
    explorer.ask()
    return time.process_time() - start, explorer.history.n_drawn != n_drawn


def resident() -> float:
    """Memory that the process holds [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--asks", nargs="+", choices=ANGLES, default=list(ANGLES))
    args = parser.parse_args()
    enable_compile_cache()
    print("| ask | pushes | median | p99 | drawn anew, median (steps) | grown by |")
    print("|---|---|---|---|---|---|")
    for ask in args.asks:
        for n in (10, 60, 300):
            rng = np.random.default_rng(n)
            explorer = explored(ask, n, rng)
            for _ in range(N_WARM):
                step(explorer, rng)
            before = resident()
            steps = [step(explorer, rng) for _ in range(args.steps)]
            grown = resident() - before
            kept, anew = (
                1e3 * np.array([t for t, is_new in steps if is_new is wanted])
                for wanted in (False, True)
            )
            fresh = f"{np.median(anew):.0f} ms ({anew.size})" if anew.size else "- (0)"
            print(
                f"| {ask} | {n} | {np.median(kept):.0f} ms | "
                f"{np.quantile(kept, 0.99):.0f} ms | {fresh} | {grown:+.0f} MB |",
                flush=True,
            )


if __name__ == "__main__":
    main()
