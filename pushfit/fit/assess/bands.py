"""Predicted heights along the sweeps of a table, for pictures.

The band is that of the noise-free height over the posterior draws: where the model
believes the curve lies, not where the next height will fall.
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.problem import OF_GRASP, Problem, grasp_with
from pushfit.fit.programs import compiled
from pushfit.fit.results import Band, FitResult
from pushfit.model import Parameters, Pushes, as_float, forward

MIN_ANGLES = 3
MAX_BANDS = 16
N_GRID = 121
N_DRAWS = 400
# A sweep is drawn this far past its ends [deg].
MARGIN_DEG = 5.0


def prediction_bands(
    table: PeakTable,
    problem: Problem,
    fit: FitResult,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    *,
    prob: float,
) -> tuple[Band, ...]:
    """Predictions along every sweep with at least three angles, richest first.

    Args:
        table: Peak heights.
        problem: Their problem.
        fit: Best fit.
        samples: Posterior draws by name.
        prob: Probability of the bands.

    Returns:
        At most sixteen bands per channel.
    """
    bands = []
    for swept, fixed_deg, rows in _sweeps(table):
        angles = table.frame[f"{swept}_deg"].to_numpy(float)[list(rows)]
        low, high = angles.min() - MARGIN_DEG, angles.max() + MARGIN_DEG
        if swept == "theta":
            low, high = max(low, -90.0), min(high, 90.0)
        grid = np.linspace(low, high, N_GRID)
        other = np.full(N_GRID, fixed_deg)
        theta, alpha = (grid, other) if swept == "theta" else (other, grid)
        pushes = Pushes(np.radians(theta), np.radians(alpha))
        _, curves = predicted_heights(problem, samples, pushes)
        best = np.asarray(_best_curve(problem, as_float(fit.estimate), pushes))
        quantiles = np.quantile(curves, [(1 - prob) / 2, 0.5, (1 + prob) / 2], axis=0)
        for c, channel in enumerate(problem.channels):
            lower, median, upper = quantiles[:, c]
            bands.append(
                Band(
                    channel=channel,
                    swept=swept,
                    fixed_deg=fixed_deg,
                    angle_deg=grid,
                    lower=lower,
                    median=median,
                    upper=upper,
                    best_fit=best[c],
                    prob=prob,
                    rows=rows,
                )
            )
    return tuple(bands)


def _sweeps(table: PeakTable) -> list[tuple[str, float, tuple[int, ...]]]:
    """(swept angle, value of the other, rows), those with most angles first."""
    found = []
    used = np.flatnonzero(table.is_used)
    for swept, fixed in (("theta", "alpha"), ("alpha", "theta")):
        values = table.frame[f"{fixed}_deg"].to_numpy(float)[used].round(3)
        angles = table.frame[f"{swept}_deg"].to_numpy(float)[used].round(3)
        for value in np.unique(values):
            same = values == value
            n_angles = np.unique(angles[same]).size
            if n_angles >= MIN_ANGLES:
                rows = tuple(int(i) for i in used[same])
                found.append((n_angles, swept, float(value), rows))
    found.sort(key=lambda sweep: (-sweep[0], sweep[1], sweep[2]))
    kept = found[:MAX_BANDS]
    return [(swept, value, rows) for _, swept, value, rows in kept]


def predicted_heights(
    problem: Problem, samples: Mapping[str, Float[np.ndarray, " n"]], pushes: Pushes
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m c g"]]:
    """Noise-free heights of given pushes for evenly spaced posterior draws.

    Args:
        problem: Problem.
        samples: Posterior draws by name.
        pushes: Directions to predict.

    Returns:
        Index of each draw used, and its heights by channel and push [table unit].
    """
    n = samples["A"].size
    index = np.unique(np.linspace(0, n - 1, min(n, N_DRAWS)).astype(int))
    names = (*Parameters.__dataclass_fields__, *OF_GRASP)
    draws = {k: as_float(samples[k][index]) for k in names if k in samples}
    return index, np.asarray(_curves(problem, draws, pushes))


@compiled
def _curves(
    problem: Problem, draws: Mapping[str, Float[Array, " m"]], pushes: Pushes
) -> Float[Array, "m c g"]:
    def curve(draw: Mapping[str, Float[Array, ""]]) -> Float[Array, "c g"]:
        shape = {k: v for k, v in draw.items() if k not in OF_GRASP}
        for name in ("e1", "e2"):
            shape.setdefault(name, problem.fixed.get(name, jnp.zeros(())))
        grasp = grasp_with(problem.grasp, draw)
        channels = forward(Parameters(**shape), pushes, grasp)
        return jnp.stack([getattr(channels, name) for name in problem.channels])

    return jax.vmap(curve)(draws)


@compiled
def _best_curve(
    problem: Problem, y: Float[Array, " q"], pushes: Pushes
) -> Float[Array, "c g"]:
    state = problem.data_state(y)
    grasp = problem.grasp_at(state)
    channels = forward(state.params, pushes, grasp)
    return jnp.stack([getattr(channels, name) for name in problem.channels])
