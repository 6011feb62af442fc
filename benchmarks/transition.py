"""Coverage and width of θ_c where the transition is hard, and where it is soft.

    python -m benchmarks.transition [--tables 320] [--noise 0.01] [--pushes 51 or 6]

Truths are drawn from the default priors and pushed at 17 elevations with three repeats,
or at six elevations once. Heights scatter by a share of the tallest; without repeats
their sd is stated. The same tables are identified with each `[transition] sharpness`; a
90 % interval that means it holds the truth in 90 % of them. Interrupted, the run prints
what it has.
"""

import argparse
import math
import sys
from dataclasses import dataclass

import numpy as np

from benchmarks.angle_errors import PROB, PUSH_LENGTH, Answer, line, truths
from pushfit.cache import enable_compile_cache
from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.identify import identify_table
from pushfit.fit.problem.derived import equal_tailed_interval
from pushfit.fit.results import FitStatus
from pushfit.model import Grasp, Parameters

# Elevations and repeats by the number of pushes.
PLANS = {51: (np.arange(5.0, 86.0, 5.0), 3), 6: (np.arange(10.0, 86.0, 15.0), 1)}
SHARPNESS = (math.inf, 4.0)
SETTINGS = ('"hard"', '"auto"')
WARNING = "looks_soft"


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """What one table is answered by one setting; None where it has no answer.

    Args:
        answer: Of θ_c.
        is_warned: Whether a soft transition is named.
    """

    answer: Answer | None
    is_warned: bool


def heights(
    params: Parameters, sharpness: float, noise: float, *, n_pushes: int, seed: int
) -> PeakTable:
    """A table of one grasp."""
    theta_deg, repeats = PLANS[n_pushes]
    grasp = Grasp(push_length=PUSH_LENGTH, sharpness=sharpness)
    words = {"theta": np.radians(theta_deg), "alpha": 0.0, "repeats": repeats}
    rng = np.random.default_rng(seed)
    clean = simulate_table(params, grasp, noise=0.0, rng=rng, **words)
    sd = noise * float(np.max(clean.heights("height")))
    is_stated = repeats == 1
    return simulate_table(params, grasp, noise=sd, rng=rng, state_sd=is_stated, **words)


def said(table: PeakTable, setting: str, truth: float) -> Said:
    """What one setting makes of one table."""
    text = f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"
    text += f"[transition]\nsharpness = {setting}\n"
    config = parse_config(text, path="grasp.toml")
    try:
        found = identify_table(table, config, seed=0, engine="sweep", is_brief=True)
    except PushfitError:
        return Said(answer=None, is_warned=False)
    is_warned = WARNING in [notice.code for notice in found.warnings]
    if found.status is not FitStatus.OK:
        return Said(answer=None, is_warned=is_warned)
    low, high = equal_tailed_interval(found.posterior.samples["theta_c"], PROB)
    answer = Answer(
        holds=low <= truth <= high,
        is_quoted=found.theta_c.interval is not None,
        width=high - low,
    )
    return Said(answer=answer, is_warned=is_warned)


def report(found: dict[tuple[float, str], list[Said]]) -> str:
    """Coverage, widths and warnings of every truth and setting."""
    lines = []
    for (sharpness, setting), answers in found.items():
        kept = [s.answer for s in answers if s.answer is not None]
        name = "hard" if math.isinf(sharpness) else f"p = {sharpness:g}"
        lines.append(
            f"truth {name}, sharpness = {setting}: {len(answers)} tables, "
            f"{len(answers) - len(kept)} without an answer, "
            f"{sum(s.is_warned for s in answers)} warned of a soft transition"
        )
        lines.append(line("  all posteriors", kept))
        lines.append(line("  intervals quoted", [a for a in kept if a.is_quoted]))
    for sharpness in SHARPNESS:
        pairs = zip(*(found[sharpness, s] for s in SETTINGS), strict=False)
        ratios = [
            b.answer.width / a.answer.width for a, b in pairs if a.answer and b.answer
        ]
        name = "hard" if math.isinf(sharpness) else f"p = {sharpness:g}"
        low, middle, high = np.quantile(ratios, [0.25, 0.5, 0.75])
        lines.append(
            f"truth {name}: width with {SETTINGS[1]} over width with {SETTINGS[0]}, "
            f"table by table: median {middle:.2f}, quartiles {low:.2f} and {high:.2f}"
        )
    return "\n".join(lines)


def main() -> None:
    """Print coverage and widths."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tables", type=int, default=320)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pushes", type=int, choices=PLANS, default=51)
    options = parser.parse_args()
    enable_compile_cache()
    rng = np.random.default_rng(options.seed)
    found = {(p, setting): [] for p in SHARPNESS for setting in SETTINGS}
    try:
        for index, (params, truth) in enumerate(truths(options.tables, rng)):
            for sharpness in SHARPNESS:
                table = heights(
                    params,
                    sharpness,
                    options.noise,
                    n_pushes=options.pushes,
                    seed=options.seed + index,
                )
                for setting in SETTINGS:
                    found[sharpness, setting].append(said(table, setting, truth))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    print(report(found))


if __name__ == "__main__":
    main()
