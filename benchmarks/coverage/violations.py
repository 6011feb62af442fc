"""Coverage of θ_c where one assumption does not hold, by default and with its remedy.

    python -m benchmarks.coverage.violations
        [--tables 1000] [--cells nothing soft] [--plan 51]

Truths are drawn from the default priors and pushed at 17 elevations with three repeats
(51), at these and 12 azimuths (87), or at six elevations once, with heights that
scatter by a share of the tallest; without repeats their sd is stated. Each cell breaks
one assumption. A 90 % interval that means it holds the truth in 90 % of the tables; of
those that miss it, a warning or a withheld interval should tell. Widths are compared
table by table with those under the first setting.
Interrupted or told to end, the run prints what it has.
"""

import argparse
import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from benchmarks.tables import FIRM
from pushfit.config import GraspConfig, parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.coverage import simulate_tables
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.derived import equal_tailed_interval
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.fit.results import FitStatus
from pushfit.model import Grasp, Parameters
from pushfit.parameters import SIX

# The paper's [m]; that of the intervals; that of the limits of right counts.
PUSH_LENGTH, PROB, LIMITS_PROB = 0.005, 0.9, 0.99

# Elevations and azimuths [deg], and repeats, by the number of pushes.
_SWEEP, _TURN = np.arange(5.0, 86.0, 5.0), np.arange(0.0, 180.0, 15.0)
PLANS = {
    6: (np.arange(10.0, 86.0, 15.0), np.zeros(6), 1),
    51: (_SWEEP, np.zeros(17), 3),
    87: (np.r_[_SWEEP, np.full(12, 15.0)], np.r_[np.zeros(17), _TURN], 3),
}
# What each cell breaks, and the section of grasp.toml that answers it.
REMEDIES = {
    "nothing": "",
    "soft": "",
    "joints": "[noise]\ntheta_sd_deg = 1.0\n",
    "commands": '[noise]\ntheta_sd_deg = 1.0\nangle_errors = "shared"\n',
    "heavy": '[noise]\nlikelihood = "student_t"\n',
    "proportional": '[noise]\nheight_share = "estimate"\n',
    "offset": '[noise]\nrepeats = "offset"\n',
    "gain": '[noise]\nrepeats = "gain"\n',
}
# Those that need repeats.
REPEATED = ("commands", "offset", "gain")
# Other settings for every cell: what the default leaves open, switched off, and whole
# degrees as the resolution of the angles, anew for each push or alike in repeats.
_ROUNDED = f"[noise]\ntheta_sd_deg = {1 / np.sqrt(12):.4f}\n"
SWITCHES = {
    "hard": '[transition]\nsharpness = "hard"\n',
    "normal": '[noise]\nlikelihood = "normal"\n',
    "resolution": _ROUNDED,
    "resolution_alike": f'{_ROUNDED}angle_errors = "shared"\n',
}
# What a table may be fitted with.
SETTINGS = ("default", "remedy", *SWITCHES)
# Of the worlds: sharpness of the soft one, sd of joints, which the paper's resolve
# [deg], tails whose variance just exists, noise as a share of each height, gains of
# repeats.
SHARPNESS, JOINT_SD_DEG, TAILS_DOF, SHARE, GAIN_SD = 4.0, 1.0, 2.5, 0.05, 0.03
HEADER = (
    "| violated | setting | hold the truth | of those quoted | misses told of | "
    "median width | over default, table by table |\n" + 7 * "| --- " + "|"
)
# Words that tell a reader not to rely on an interval.
TOLD = (
    "looks_",
    "model_inadequate",
    "model_untested",
    "sd_contradicted",
    "scatter_exceeds_sd",
)
# The same in worlds of one kind alone.
_EXACT = ("elevations_taken_as_exact",)
TOLD_OF = {"joints": _EXACT, "commands": _EXACT}


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What one table tells of θ_c.

    Args:
        holds: Whether the interval of the posterior holds the truth.
        is_quoted: Whether an interval is quoted.
        is_told: Whether a warning names a violation, or none is quoted.
        width: Of the interval [deg].
    """

    holds: bool
    is_quoted: bool
    is_told: bool
    width: float


def heights(
    params: Parameters,
    broken: str,
    plan: int,
    noise: float,
    channels: tuple[str, ...],
    rng: np.random.Generator,
) -> PeakTable:
    """A table of one grasp in a world that breaks one assumption."""
    theta_deg, alpha_deg, n_repeats = PLANS[plan]
    stated = np.radians(np.repeat(theta_deg, n_repeats))
    alpha = np.radians(np.repeat(alpha_deg, n_repeats))
    repeat = np.tile(np.arange(n_repeats), theta_deg.size)
    off = np.radians(JOINT_SD_DEG) * rng.standard_normal(stated.size)
    grasp = Grasp(push_length=PUSH_LENGTH)
    if broken == "soft":
        grasp = replace(grasp, sharpness=SHARPNESS)
    words = {"alpha": alpha, "repeats": 1, "noise": 0.0, "rng": rng}
    if broken == "commands":
        # An arm that misses each command alike.
        off = off[np.repeat(np.arange(theta_deg.size), n_repeats) * n_repeats]
    real = stated + off if broken in ("joints", "commands") else stated
    made = simulate_table(params, grasp, theta=real, channels=channels, **words)
    found, sds = {}, {}
    for channel in channels:
        clean = made.heights(channel)
        sd = noise * float(np.max(np.abs(clean)))
        scatter = sd * rng.standard_normal(clean.size)
        if broken == "heavy":
            scatter = sd * rng.standard_t(TAILS_DOF, clean.size)
        if broken == "proportional":
            scatter = SHARE * clean * rng.standard_normal(clean.size)
        if broken == "offset":
            scatter = scatter + 2 * sd * rng.standard_normal(n_repeats)[repeat]
        if broken == "gain":
            scatter = scatter + GAIN_SD * clean * rng.standard_normal(n_repeats)[repeat]
        found[channel], sds[channel] = clean + scatter, np.full(clean.size, sd)
    return PeakTable.from_arrays(
        theta=stated,
        alpha=alpha,
        heights=found,
        sd=sds if n_repeats == 1 else None,
        repeat=repeat + 1,
        unit="n",
    )


def answer(
    table: PeakTable, config: GraspConfig, truth: float, told: tuple[str, ...]
) -> Answer | None:
    """What is said of one table; None where it is refused or the numerics stop."""
    try:
        found = identify_table(table, config, seed=0, engine="sweep", is_brief=True)
    except PushfitError:
        return None
    if found.status is not FitStatus.OK:
        return None
    low, high = equal_tailed_interval(found.posterior.samples["theta_c"], PROB)
    is_quoted = found.theta_c.interval is not None
    is_named = any(n.code.startswith(told) for n in found.warnings)
    return Answer(
        holds=low <= truth <= high,
        is_quoted=is_quoted,
        is_told=is_named or not is_quoted,
        width=high - low,
    )


def settings(broken: str, asked: Sequence[str]) -> dict[str, GraspConfig]:
    """Configurations to answer a cell by."""
    push = f"[push]\nlength_mm = {1000 * PUSH_LENGTH}\n"
    sections = {"default": "", "remedy": REMEDIES[broken], **SWITCHES}
    return {
        name: parse_config(push + sections[name], path="grasp.toml")
        for name in asked
        if name == "default" or sections[name]
    }


def truths(
    n: int, plan: int, rng: np.random.Generator
) -> list[tuple[Parameters, float]]:
    """Grasps from the default priors, and their critical angles [deg]."""
    own = np.random.default_rng(0)
    table = heights(FIRM, "nothing", plan, 0.01, ("height",), own)
    hard = settings("nothing", ["hard"])["hard"]
    drawn = simulate_tables(fit_table(table, hard), n, rng).truths
    names = [name for name in (*SIX, "e1", "e2") if name in drawn]
    return [
        (
            Parameters(**{name: drawn[name][i] for name in names}),
            float(drawn["theta_c"][i]),
        )
        for i in range(n)
    ]


def line(found: list[Answer | None], first: list[Answer | None]) -> str:
    """How often intervals hold the truth, what is told, and how wide they are."""
    kept = [a for a in found if a is not None]
    quoted = [a for a in kept if a.is_quoted]
    misses = [a for a in kept if not a.holds]
    pairs = zip(found, first, strict=False)
    ratios = [a.width / b.width for a, b in pairs if a is not None and b is not None]
    return (
        f"{_share(kept)} | {_share(quoted)} | "
        f"{sum(a.is_told for a in misses)} of {len(misses)} | "
        f"{np.median([a.width for a in kept]):.1f}° | {np.median(ratios):.2f}"
    )


def _share(answers: list[Answer]) -> str:
    hits, n = sum(a.holds for a in answers), len(answers)
    if not n:
        return "none"
    low, high = stats.binom.interval(LIMITS_PROB, n, PROB)
    return f"{hits} of {n} ({hits / n:.3f}; {low:.0f} to {high:.0f})"


def main() -> None:
    """Print one row for each cell and setting."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tables", type=int, default=1000)
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--plan", type=int, choices=PLANS, default=51)
    parser.add_argument("--components", action="store_true")
    parser.add_argument("--settings", nargs="*", choices=SETTINGS, default=SETTINGS)
    parser.add_argument("--cells", nargs="*", choices=REMEDIES, default=list(REMEDIES))
    options = parser.parse_args()
    enable_compile_cache()
    # In the background a run is not told of interrupts unless it asks.
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, signal.default_int_handler)
    channels = ("height_normal", "height_tangential") if options.components else ()
    cells = [c for c in options.cells if options.plan != 6 or c not in REPEATED]
    configs = {cell: settings(cell, options.settings) for cell in cells}
    found: dict[tuple[str, str], list[Answer | None]] = {
        (cell, name): [] for cell in cells for name in configs[cell]
    }
    rng = np.random.default_rng(options.seed)
    drawn = truths(options.tables, options.plan, rng)
    try:
        for index, (params, truth) in enumerate(drawn):
            for cell in cells:
                own = np.random.default_rng([options.seed, index])
                table = heights(
                    params,
                    cell,
                    options.plan,
                    options.noise,
                    channels or ("height",),
                    own,
                )
                told = TOLD + TOLD_OF.get(cell, ())
                for name, config in configs[cell].items():
                    found[cell, name].append(answer(table, config, truth, told))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
    print(HEADER)
    for (cell, name), answers in found.items():
        first = found[cell, next(iter(configs[cell]))]
        print(f"| {cell} | {name} | {line(answers, first)} |")


if __name__ == "__main__":
    main()
