"""How often intervals hold the truth where either mechanics may lead, by push length.

    python -m benchmarks.coverage.leading [--length-mm 1 5] [--tables 100] [--seed 0]

Truths are drawn from the default priors, with L = 40 mm measured to 1 mm, and heights
from mechanics that tilt: 17 elevations with three repeats, noise of 1 % of the height
of a push straight down. Every table is identified by both mechanics (`[grasp]
mechanics = "auto"`). Prints how often the interval of 90 % for θ_c holds the truth, by
the mechanics that lead and by the paper's equations alone, and how many tilting ones
lead. A table of which either is not to be trusted counts for neither.
"""

import argparse

import numpy as np
from jaxtyping import Float
from scipy import stats

from benchmarks.tables import HARD, NAMES
from pushfit.config import GraspConfig, parse_config
from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.priors.distributions import default_priors
from pushfit.fit.programs.folder import enable_compile_cache
from pushfit.fit.results import FitStatus
from pushfit.mechanics.directions import critical_angle
from pushfit.model import Grasp, Parameters, Pushes, forward

THETA = np.radians(np.linspace(5.0, 85.0, 17))
REPEATS, NOISE = 3, 0.01
# Of the object, and how well it is measured [m].
LENGTH, LENGTH_SD = 0.04, 0.001
PROB = 0.9
# Chance that right intervals leave the limits.
ALARM = 0.01


def settings(length_mm: float) -> GraspConfig:
    """Everything at its default but L, a preload of 0, and the kind of noise."""
    return parse_config(
        f"[push]\nlength_mm = {length_mm:g}\n[grasp]\npreload_n = 0\n"
        f"[parameters.L]\nnormal = {{ mean = {LENGTH}, sd = {LENGTH_SD} }}\n"
        f'[noise]\nlikelihood = "normal"\n{HARD}',
        path="grasp.toml",
    )


def tilted(length_mm: float, rng: np.random.Generator) -> tuple[PeakTable, float]:
    """A table of one truth, and its θ_c [deg]."""
    priors = default_priors(None)
    logs = {name: float(priors[name].sample(rng, 1)[0]) for name in NAMES}
    values = {name: np.exp(value) for name, value in logs.items()}
    values["L"] = LENGTH + LENGTH_SD * rng.standard_normal()
    params = Parameters(**values)
    grasp = Grasp(push_length=length_mm / 1000, mechanics="tilting")
    straight = forward(params, Pushes(np.pi / 2, 0.0), grasp).height
    table = simulate_table(
        params,
        grasp,
        theta=THETA,
        alpha=0.0,
        repeats=REPEATS,
        noise=NOISE * float(straight),
        rng=rng,
        state_sd=True,
    )
    return table, float(np.degrees(critical_angle(params, grasp, 0.0)))


def is_held(draws: Float[np.ndarray, " n"], truth: float) -> bool:
    """Whether an interval holds a truth; a contact that never rolls is beyond all."""
    tail = (1 - PROB) / 2
    low, high = np.quantile(np.nan_to_num(draws, nan=180.0), [tail, 1 - tail])
    return bool(low <= np.nan_to_num(truth, nan=180.0) <= high)


def main() -> None:
    """Print one row for each push length."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--length-mm", type=float, nargs="*", default=[1.0, 5.0])
    parser.add_argument("--tables", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print("| push | leading | limits | quoted | linear alone | tilting ones lead |")
    print("|---|---|---|---|---|---|", flush=True)
    for length_mm in options.length_mm:
        config = settings(length_mm)
        alone = config.with_keys("grasp", mechanics="linear")
        held, quoted, linear, leading = [], [], [], []
        for k in range(options.tables):
            rng = np.random.default_rng([options.seed, k, round(1000 * length_mm)])
            table, truth = tilted(length_mm, rng)
            both, one = (
                identify_table(table, of, seed=k, engine="sweep", is_brief=True)
                for of in (config, alone)
            )
            if not both.status is one.status is FitStatus.OK:
                continue
            held.append(is_held(both.posterior.samples["theta_c"], truth))
            linear.append(is_held(one.posterior.samples["theta_c"], truth))
            leading.append(both.mechanics == "tilting")
            if both.theta_c.interval is not None:
                low, high = both.theta_c.interval
                quoted.append(low <= truth <= high)
        low, high = stats.binom.interval(1 - ALARM, len(held), PROB)
        print(
            f"| {length_mm:g} mm | {sum(held)} of {len(held)} | {low:g} to {high:g} | "
            f"{sum(quoted)} of {len(quoted)} | {sum(linear)} of {len(linear)} | "
            f"{sum(leading)} |",
            flush=True,
        )


if __name__ == "__main__":
    enable_compile_cache()
    main()
