"""Posterior predictive checks: do the data look like data of this model?

For every draw of the posterior heights are simulated with the noise model, and a
feature of their residuals is compared with the same feature of the observed ones,

    p = P( T(h_sim, x) >= T(h, x) | h ).

On data of the model p is near one half more often than a uniform number is, and below a
level a at most twice as often as a (Meng 1994). Excluded: the verdict
(`model_checking`).

References:
    Meng (1994), doi:10.1214/aos/1176325622; Gelman, Meng & Stern (1996), Statistica
    Sinica 6, 733.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.model_checking import Directions, pushed_directions
from pushfit.fit.problem.predictions import predict_draws
from pushfit.fit.problem.problem import STUDENT_DOF, STUDENT_SCALE, Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.results import FitStatus, PosteriorResult, PredictiveCheck

# Simulated tables: enough to see a share of 1e-3, fewer of large tables so that all
# their heights take 32 MB.
MOST_DRAWS, FEWEST_DRAWS, MAX_HEIGHTS = 4000, 400, 4_000_000


def predictive_checks(
    table: PeakTable, setup: Setup, posterior: PosteriorResult, *, seed: int
) -> tuple[PredictiveCheck, ...]:
    """Compare residuals of the heights with those of simulated heights.

    The features are the sum of squares (`scatter`), the largest residual (`largest`)
    and the correlation between neighbours in direction (`pattern`, of the first
    channel, where there are enough directions).

    Returns:
        Checks; none where the draws are not to be trusted.
    """
    if posterior.status is not FitStatus.OK:
        return ()
    problem, n_rows = setup.problem, len(setup.rows)
    n_values = len(problem.channels) * n_rows
    n_draws = int(np.clip(MAX_HEIGHTS // n_values, FEWEST_DRAWS, MOST_DRAWS))
    n = posterior.log_prob.size
    index = np.linspace(0, n - 1, min(n, n_draws)).astype(int)
    draws = {name: values[index] for name, values in posterior.samples.items()}
    predicted = predict_draws(problem, draws, problem.angles).heights
    residuals = problem.differences(predicted)
    residuals /= noise_at(problem, draws)
    observed = residuals[:, :, :n_rows]
    simulated = _noise(problem, observed.shape, np.random.default_rng([seed, 3]))
    directions = pushed_directions(table, np.array(setup.rows))
    features = zip(
        _features(observed, directions).items(),
        _features(simulated, directions).values(),
        strict=True,
    )
    return tuple(
        PredictiveCheck(feature=name, p_value=float(np.mean(of_simulated >= of_data)))
        for (name, of_data), of_simulated in features
    )


def _features(
    residuals: Float[np.ndarray, "m c n"], directions: Directions | None
) -> dict[str, Float[np.ndarray, " m"]]:
    """Every feature of the residuals of each draw."""
    features = {
        "scatter": np.einsum("mcn,mcn->m", residuals, residuals),
        "largest": np.max(np.abs(residuals), axis=(1, 2)),
    }
    if directions is not None:
        pooled = directions.pooled(residuals[:, 0])
        products = np.einsum("mg,mg->m", pooled, pooled[:, directions.nearest])
        features["pattern"] = products / np.einsum("mg,mg->m", pooled, pooled)
    return features


def _noise(
    problem: Problem, shape: tuple[int, ...], rng: np.random.Generator
) -> Float[np.ndarray, "m c n"]:
    """Residuals of simulated heights: noise of unit variance."""
    if problem.likelihood == "student_t":
        return STUDENT_SCALE * rng.standard_t(STUDENT_DOF, shape)
    return rng.standard_normal(shape)


def noise_at(
    problem: Problem, draws: Mapping[str, Float[np.ndarray, " m"]]
) -> Float[np.ndarray, "#m c n"]:
    """Standard deviations of heights at each draw, 1 for padding [table unit].

    Returns:
        One row for all draws where no noise is sampled.
    """
    sd, known = np.asarray(problem.sd), np.asarray(problem.reference_sigma)
    sampled = [draws.get(f"sigma_{channel}") for channel in problem.channels]
    scale = [
        known[None, c] if sigma is None else np.hypot(sd[c], sigma[:, None])
        for c, sigma in enumerate(sampled)
    ]
    stacked = np.stack(np.broadcast_arrays(*scale), axis=1)
    return np.where(problem.mask, stacked, 1.0)
