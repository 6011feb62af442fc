"""Whether standard errors of differences in elpd are as large as differences scatter.

    python -m benchmarks.inference.elpd_errors [--tables 60] [--pushes 20]

Tables are one sweep of the tests' case `paper`, which rolls by a hard switch, each with
other noise. A hard and a soft transition, which predict them nearly alike, are compared
push by push. A ratio above 1 says that standard errors are too small.
"""

import argparse

import numpy as np

from pushfit.config.rivals import rival_configs
from pushfit.fit.checks.push_densities import push_densities
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import draw_posterior
from pushfit.fit.programs.folder import enable_compile_cache
from tests.fit.tables import case_table, config
from tests.problems import CASES

NOISE, ENDS_DEG = 0.05, (4.0, 86.0)


def difference(seed: int, n_pushes: int) -> tuple[float, float]:
    """Soft less hard, and its standard error."""
    theta_deg = np.linspace(*ENDS_DEG, n_pushes)
    table = case_table(
        CASES["paper"], noise=NOISE, theta_deg=theta_deg, repeats=1, seed=seed
    )
    elpd = {}
    for name in ("soft", "hard"):
        fitted = fit_table(table, rival_configs(config())[name])
        posterior = draw_posterior(fitted, seed=0, engine="sweep")
        elpd[name] = push_densities(
            fitted.setup.problem, posterior.samples, n_pushes=n_pushes
        ).elpd
    by_push = elpd["soft"] - elpd["hard"]
    return float(np.sum(by_push)), float(np.sqrt(n_pushes) * np.std(by_push, ddof=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--tables", type=int, default=60)
    parser.add_argument("--pushes", type=int, default=20)
    options = parser.parse_args()
    enable_compile_cache()
    found = [difference(seed, options.pushes) for seed in range(options.tables)]
    sums, errors = np.array(found).T
    scatter, stated = np.std(sums, ddof=1), np.sqrt(np.mean(errors**2))
    print("| tables | pushes | mean difference | its sd | as stated | ratio |")
    print("| --- | --- | --- | --- | --- | --- |")
    print(
        f"| {options.tables} | {options.pushes} | {np.mean(sums):.3f} "
        f"| {scatter:.3f} | {stated:.3f} | {scatter / stated:.2f} |"
    )


if __name__ == "__main__":
    main()
