"""The least sum of squares for every value of a quantity: its profile likelihood.

One program serves every quantity of a problem, however it is imposed. Excluded: the set
at a level (`pushfit.fit.profiles.profile_sets`).
"""

from dataclasses import replace

import jax
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import critical_angles
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.repeats.pooling import pool_repeats
from pushfit.fit.profiles.conditional_likelihood import Likelihood, imposable
from pushfit.fit.profiles.curve_search import (
    N_FIRST,
    N_OTHERS,
    N_TOGETHER,
    Fits,
    best_fits,
)
from pushfit.fit.profiles.guesses import guesses
from pushfit.fit.results.fits_along import Curve, FitsAlong
from pushfit.fit.sweep.target import IMPOSSIBLE
from pushfit.model import as_float

# Ends of the range of θ_c, without and with a preload, and of the soft axis [deg].
THETA_ENDS, PRELOADED_ENDS, AXIS_ENDS = (0.05, 89.95), (-89.0, 89.95), (-90.0, 90.0)
# Distances from where a log is expected at which it is tried; the last is a factor 3000
# and stands for the end of the range.
LOG_OFFSETS = np.geomspace(0.003, 8.0, 13)
# Distance of an imposed θ_c from another crossing, where only a search tells [rad].
SAME_ANGLE = 1e-6
# Points that fits along a quantity begin from, with an ellipse and without: ways of
# `N_TOGETHER`.
N_POOL, N_PLAIN_POOL = 8 * N_TOGETHER, 3 * N_TOGETHER
# Δχ² that a search resolves best, that of 90 %.
DELTA_CHI_SQUARE = 2.7
# The curve sees no fit that has no θ_c, and on the hard switch a node may halt above
# one that has: from some of its points, and from guesses or the valleys of a search
# before, so many steps lead down with nothing held. The lowest so many ends are kept,
# unless they are one valley: of the same sum of squares, and near each other [logs].
N_DOWN, N_VALLEYS = 12, 8
SAME_COST, SAME_VALLEY = 0.01, 1.0


def search_curve(
    problem: Problem,
    reference_alpha: float | None = None,
    before: FitsAlong | None = None,
) -> FitsAlong:
    """Look at the whole likelihood before any solver starts, so that no mode is missed.

    Args:
        reference_alpha: Azimuth of θ_c [rad]; None for that of the first push, since
            any will do to tell valleys apart.
        before: Search under other weights, to begin with; None for guesses.
    """
    if reference_alpha is None:
        reference_alpha = float(np.asarray(problem.pushes.alpha)[0])
    quantities, guessed = imposable(problem), guesses(problem)
    name = "theta_c" if "theta_c" in quantities else quantities[0]
    curve, ends = fits_along(
        problem,
        quantities.index(name),
        first_values(problem, name, guessed[:, 0]),
        along=guessed if before is None else before.curve.points,
        down=guessed if before is None else before.valleys,
        reference_alpha=reference_alpha,
        level=DELTA_CHI_SQUARE,
    )
    return FitsAlong(
        observed=np.asarray(problem.observed),
        quantity=name,
        reference_alpha=reference_alpha,
        is_thorough=before is not None or "f1" not in problem.data_names,
        curve=curve,
        valleys=_valleys(ends),
    )


def first_values(
    problem: Problem, name: str, near: Float[np.ndarray, " m"]
) -> Float[np.ndarray, " g"]:
    """Values that a profile begins with, from end to end.

    Args:
        near: Where a log is expected.
    """
    if name == "theta_c":
        is_preloaded = (
            "ln_F_0" in problem.data_names or float(problem.grasp.preload) > 0
        )
        low, high = np.radians(PRELOADED_ENDS if is_preloaded else THETA_ENDS)
    elif name == "alpha_star":
        low, high = np.radians(AXIS_ENDS)
    else:
        low, high = np.min(near), np.max(near)
        between = np.linspace(low, high, N_FIRST - 2 * LOG_OFFSETS.size)
        return np.r_[low - LOG_OFFSETS[::-1], between, high + LOG_OFFSETS]
    return np.linspace(low, high, N_FIRST)


def fits_along(
    problem: Problem,
    index: int,
    values: Float[np.ndarray, " g"],
    *,
    along: Float[np.ndarray, "p q"],
    down: Float[np.ndarray, "k q"] | None = None,
    reference_alpha: float,
    level: float,
) -> tuple[Curve, Fits]:
    """Best fits along a quantity, dense where they matter, and those with nothing held.

    Args:
        index: Which of the imposable quantities.
        values: Range to begin with, `N_FIRST` of them, ascending.
        along: Data coordinates that the first begin from, of every basin.
        down: Those of the second beside the curve itself; None where none are wanted.
        reference_alpha: Azimuth of θ_c [rad].
        level: Δχ² at the ends of the set that is wanted.
    """
    means, scatter = _of_means(problem)
    n_pool = N_POOL if "f1" in problem.data_names else N_PLAIN_POOL
    target = Likelihood(
        means,
        jax.device_put(np.asarray(index)),
        as_float(reference_alpha),
        as_float(np.nan),
    )
    others = along if down is None else down
    found, ends = jax.tree.map(
        np.asarray,
        best_fits(
            target,
            as_float(values),
            along=_spread(along, n_pool),
            down=_spread(others, N_OTHERS),
            level=as_float(level),
            n_down=jax.device_put(np.asarray(0 if down is None else N_DOWN)),
        ),
    )
    chi_square = np.where(found.costs < IMPOSSIBLE, 2 * found.costs + scatter, np.inf)
    if imposable(problem)[index] == "theta_c" and problem.grasp.law.is_tie is None:
        angles = critical_angles(problem, found.points, reference_alpha)
        is_other = ~(np.abs(angles - found.values) < SAME_ANGLE)
        chi_square = np.where(is_other, np.inf, chi_square)
    curve = Curve(values=found.values, points=found.points, chi_square=chi_square)
    return curve, ends


def _spread(points: Float[np.ndarray, "k q"], n: int) -> Float[Array, "n q"]:
    """So many of the points, from the first to the last."""
    return as_float(points[np.linspace(0, len(points) - 1, n).round().astype(int)])


def _of_means(problem: Problem) -> tuple[Problem, float]:
    """The problem of the means of repeats, at data coordinates, and what they scatter.

    No fit changes that.
    """
    pooled = pool_repeats(problem)
    means = pooled.problem
    mask, sigma = np.asarray(means.mask), np.array(means.reference_sigma)
    scatter = float(np.sum((np.asarray(pooled.sum_of_squares) / sigma**2)[mask]))
    sigma[mask] /= np.sqrt(np.asarray(pooled.count)[mask])
    return replace(means.of_data, reference_sigma=as_float(sigma)), scatter


def _valleys(found: Fits) -> Float[np.ndarray, "k q"]:
    """The lowest fits that are not alike; always as many, repeated if need be."""
    ends, costs = np.asarray(found.points), np.asarray(found.costs)
    kept: list[int] = []
    for i in np.argsort(costs, kind="stable"):
        is_other = np.abs(costs[kept] - costs[i]) > SAME_COST
        is_other |= np.max(np.abs(ends[kept] - ends[i]), axis=1) > SAME_VALLEY
        if np.all(is_other):
            kept.append(int(i))
        if len(kept) == N_VALLEYS:
            break
    return ends[np.resize(kept, N_VALLEYS)]
