"""Coverage of θ_c where joints are off by 1°: six pushes, the sd of heights stated.

    python -m benchmarks.angle_errors [--tables 1000] [--joint-sd-deg 1] [--seed 1]

Truths are drawn from the default priors. Every push is made at an elevation that is off
by normal noise, and its height scatters by 1 % of the tallest. The same tables are
identified without and with `[noise] theta_sd_deg`; a 90 % interval that means it holds
the truth in 90 % of them.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import stats

from pushfit.cache import enable_compile_cache
from pushfit.config import parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.coverage import simulate_tables
from pushfit.fit.fitted import fit_table
from pushfit.fit.identify import identify_table
from pushfit.fit.problem.derived import PARAMETERS, equal_tailed_interval
from pushfit.fit.results import FitStatus
from pushfit.model import Grasp, Parameters

THETA_DEG = np.arange(10.0, 86.0, 15.0)
PUSH_LENGTH, NOISE, PROB = 0.005, 0.01, 0.9
LIMITS_PROB = 0.99


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What one table tells of θ_c.

    Args:
        holds: Whether the interval of the posterior holds the truth.
        is_quoted: Whether an interval is quoted.
        width: Of the interval [deg].
    """

    holds: bool
    is_quoted: bool
    width: float


def pushes(
    params: Parameters, joint_sd_deg: float, rng: np.random.Generator
) -> PeakTable:
    """A table of pushes that were not made quite where it says."""
    real = np.radians(THETA_DEG + joint_sd_deg * rng.standard_normal(THETA_DEG.size))
    alpha = np.full(THETA_DEG.size, np.pi / 2)
    grasp = Grasp(push_length=PUSH_LENGTH)
    words = {"alpha": alpha, "repeats": 1, "noise": 0.0, "rng": rng}
    made = simulate_table(params, grasp, theta=real, channels=("height",), **words)
    clean = made.heights("height")
    sd = np.full(clean.size, NOISE * np.max(clean))
    return PeakTable.from_arrays(
        theta=np.radians(THETA_DEG),
        alpha=alpha,
        heights={"height": clean + sd * rng.standard_normal(clean.size)},
        sd={"height": sd},
        unit="n",
    )


def answer(table: PeakTable, theta_sd_deg: float, truth: float) -> Answer | None:
    """What is said of one table; None where it is refused or the numerics stop."""
    text = f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"
    text += f"[noise]\ntheta_sd_deg = {theta_sd_deg}\n"
    config = parse_config(text, path="grasp.toml")
    try:
        found = identify_table(table, config, seed=0, engine="sweep", is_brief=True)
    except PushfitError:
        return None
    if found.status is not FitStatus.OK:
        return None
    low, high = equal_tailed_interval(found.posterior.samples["theta_c"], PROB)
    return Answer(
        holds=low <= truth <= high,
        is_quoted=found.theta_c.interval is not None,
        width=high - low,
    )


def truths(n: int, rng: np.random.Generator) -> list[tuple[Parameters, float]]:
    """Grasps from the default priors, and their critical angles [deg]."""
    plain = Parameters(1300, 2600 / 3, 450, 0.5, 0.36, 0.04)
    table = pushes(plain, 0.0, np.random.default_rng(0))
    config = parse_config("[push]\nlength_mm = 5.0\n", path="grasp.toml")
    drawn = simulate_tables(fit_table(table, config), n, rng).truths
    columns: list[Float[np.ndarray, " n"]] = [drawn[name] for name in PARAMETERS]
    return [
        (Parameters(*values), float(angle))
        for *values, angle in zip(*columns, drawn["theta_c"], strict=True)
    ]


def line(name: str, answers: list[Answer]) -> str:
    """How often intervals hold the truth, and how wide they are."""
    if not answers:
        return f"{name:32} none"
    low, high = stats.binom.interval(LIMITS_PROB, len(answers), PROB)
    hits = sum(a.holds for a in answers)
    width = np.median([a.width for a in answers])
    return (
        f"{name:32} {hits} of {len(answers)} ({hits / len(answers):.3f}; 99 % limits "
        f"{low:.0f} to {high:.0f}), median width {width:.1f}°"
    )


def main() -> None:
    """Print coverage without and with the errors stated."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tables", type=int, default=1000)
    parser.add_argument("--joint-sd-deg", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    enable_compile_cache()
    rng = np.random.default_rng(options.seed)
    grasps = truths(options.tables, rng)
    tables = [pushes(params, options.joint_sd_deg, rng) for params, _ in grasps]
    for stated in (0.0, options.joint_sd_deg):
        found = [
            answer(table, stated, truth)
            for table, (_, truth) in zip(tables, grasps, strict=True)
        ]
        kept = [a for a in found if a is not None]
        print(f"theta_sd_deg = {stated:g}: {len(found) - len(kept)} without an answer")
        print(line("  all posteriors", kept))
        print(line("  intervals quoted", [a for a in kept if a.is_quoted]), flush=True)


if __name__ == "__main__":
    main()
