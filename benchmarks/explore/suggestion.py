"""How long one suggestion takes, and whether memory stays flat, by pushes made so far.

    python -m benchmarks.explore.suggestion [--steps 100]

A step is what lies between a height and the next push: the push is told, the belief
weighed anew, the forecast made, all candidates surveyed and the best suggested. Steps
in which the engine draws anew stand by themselves, with the memory that they leave the
process with: a finger rests meanwhile, as it does before each push in any case.
Processor times of one process, its programs compiled before. Noise grows with the
pushes attached, so that as much is left to be found out after 300 as after 10.
"""

import argparse
import resource
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.explore.belief.belief import ASKABLE
from pushfit.explore.explorer import Explorer
from pushfit.explore.limits import Limits
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.model import Grasp, Parameters, Pushes, forward

CONFIG = parse_config("[push]\nlength_mm = 5.0\n", path="grasp.toml")
CHANNELS = ("height_normal", "height_tangential")
GRASP = Grasp(push_length=5e-3)
# θ_c near the middle of its range, and an ellipse.
TRUTH = Parameters(
    K_sn=800, K_dn=2000, K_st=400, C_rr=0.3, C_d=0.5, L=0.04, e1=0.3, e2=0.2
)
# Directions that may be pushed in [deg].
THETA, ALPHA = np.arange(5.0, 90.0, 5.0), np.arange(0.0, 180.0, 15.0)
# Noise of a height where one push is attached [N]; steps that compile what others use.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """What one step took.

    Args:
        seconds: Processor time [s].
        grown: Memory that the process holds more than before [MB].
        is_anew: Whether the engine drew anew.
    """

    seconds: float
    grown: float
    is_anew: bool


def step(explorer: Explorer, rng: np.random.Generator) -> Step:
    """Tell the best push and ask for the next."""
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
    before, start = resident(), time.process_time()
    explorer.tell(theta, alpha, heights)
    explorer.ask()
    return Step(
        seconds=time.process_time() - start,
        grown=resident() - before,
        is_anew=explorer.history.n_drawn != n_drawn,
    )


def summary(kind: str, steps: list[Step]) -> str:
    """Cells of a row on steps of one kind."""
    if not steps:
        return f"0 {kind} | - | - | - | -"
    times = 1e3 * np.array([one.seconds for one in steps])
    grown = sum(one.grown for one in steps)
    return (
        f"{times.size} {kind} | {np.median(times):.0f} ms | "
        f"{np.quantile(times, 0.99):.0f} ms | {times.max():.0f} ms | {grown:+.0f} MB"
    )


def resident() -> float:
    """Memory that the process holds [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--asks", nargs="+", choices=ASKABLE, default=list(ASKABLE))
    args = parser.parse_args()
    enable_compile_cache()
    print("| ask | pushes | steps | median | p99 | longest | grown by |")
    print("|---|---|---|---|---|---|---|")
    for ask in args.asks:
        for n in (10, 60, 300):
            rng = np.random.default_rng(n)
            explorer = explored(ask, n, rng)
            for _ in range(N_WARM):
                step(explorer, rng)
            steps = [step(explorer, rng) for _ in range(args.steps)]
            for kind, is_anew in (("kept", False), ("drawn anew", True)):
                own = [one for one in steps if one.is_anew is is_anew]
                print(f"| {ask} | {n} | {summary(kind, own)} |", flush=True)


if __name__ == "__main__":
    main()
