"""Predicted heights along the sweeps of a table, for pictures.

The band is that of the noise-free height over the posterior draws: where the model
believes the curve lies. Excluded: where the next height will fall.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.predictions import (
    predict_draws,
    predict_points,
)
from pushfit.fit.problem.problem import Problem
from pushfit.fit.results import Band, FitResult

# Two angles show no curve. The fullest sweeps are drawn; more fill pages with pictures.
MIN_ANGLES = 3
MAX_BANDS = 16
# Points of a curve, a degree apart where θ is swept; draws that make a band.
N_GRID = 96
N_BAND_DRAWS = 256
# A sweep is drawn this far past its ends [deg].
MARGIN_DEG = 5.0


def prediction_bands(
    table: PeakTable,
    problem: Problem,
    fit: FitResult,
    *,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    prob: float,
) -> tuple[Band, ...]:
    """Predictions along up to sixteen sweeps of three angles or more, richest first."""
    n = samples["A"].size
    index = np.unique(np.linspace(0, n - 1, min(n, N_BAND_DRAWS)).astype(int))
    draws = {name: values[index] for name, values in samples.items()}
    bands = []
    for swept, fixed_deg, rows in _sweeps(table):
        angles = table.frame[f"{swept}_deg"].to_numpy(float)[list(rows)]
        low, high = angles.min() - MARGIN_DEG, angles.max() + MARGIN_DEG
        if swept == "theta":
            low, high = max(low, -90.0), min(high, 90.0)
        grid = np.linspace(low, high, N_GRID)
        other = np.full(N_GRID, fixed_deg)
        theta, alpha = (grid, other) if swept == "theta" else (other, grid)
        swept_angles = np.radians([theta, alpha])
        curves = predict_draws(problem, draws, swept_angles).heights
        best = predict_points(problem, fit.estimate[None], swept_angles).heights[0]
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
