"""A look at the whole likelihood before any solver starts, so that no mode is missed.

With F_0 = 0 heights are linear in A once the ratio B / (A C_rr), C_rr and the shape of
the ellipse are given, by either mechanics; where the object tilts s and L are held at
what is known of them. A grid over those few numbers with A profiled in closed form sees
every basin; with a preload A joins the grid. Excluded: polishing.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy import ndimage

from pushfit.fit.problem import Problem
from pushfit.fit.programs import compiled
from pushfit.fit.pulls import held_values
from pushfit.model import contact

# Nodes of the grid. tan ψ = B / (A C_rr), so ψ is θ_c without preload; in C_rr and A
# the basins are decades wide.
PSI = np.radians(np.linspace(1.0, 89.0, 45))
LN_C_RR = np.linspace(np.log(0.005), np.log(20.0), 14)
LN_A_OFFSETS = np.linspace(-3.5, 1.5, 11)
LN_F_0_OFFSETS = np.linspace(-3.0, 2.0, 6)
ELLIPSE_RATIOS, ELLIPSE_AXES = (0.7, 1.8, 4.5), np.radians(np.arange(0.0, 180.0, 30.0))
# Cells evaluated at a time. Where the object tilts they wait for the slowest of them.
CHUNK = 64
N_STARTS = 16
# s = K_st L²/C_d of a start whose B leaves none.
SMALLEST_S = 0.02


def starting_points(problem: Problem) -> Float[np.ndarray, "k q"]:
    """Data coordinates of the best cell of every basin that the grid sees.

    Args:
        problem: Problem whose likelihood is scanned.

    Returns:
        `N_STARTS` points, best first; basins first, then the best cell of each band of
        ψ, so that a mode narrower than a cell is still approached from its side.
    """
    cells, shape = _cells(problem)
    points = _points(problem, cells)
    costs = np.asarray(_costs(problem, jnp.asarray(points)))
    costs = np.where(np.isfinite(costs), costs, np.inf).reshape(shape[0], shape[1], -1)
    best = np.argmin(costs, axis=2)
    surface = np.min(costs, axis=2)
    flat = np.arange(points.shape[0]).reshape(costs.shape)
    index = np.take_along_axis(flat, best[..., None], axis=2)[..., 0]
    is_basin = surface <= ndimage.minimum_filter(surface, size=3, mode="nearest")
    basins = index[is_basin][np.argsort(surface[is_basin])]
    per_band = index[np.arange(shape[0]), np.argmin(surface, axis=1)]
    by_cost = per_band[np.argsort(np.min(surface, axis=1))]
    spread = per_band[:: max(1, shape[0] // (N_STARTS // 2))]
    chosen = list(dict.fromkeys([*basins[: N_STARTS // 2], *spread, *by_cost, *basins]))
    # A problem with few cells repeats its best one: the shape of the batch is fixed.
    chosen = (chosen + chosen[:1] * N_STARTS)[:N_STARTS]
    return points[chosen]


def _cells(problem: Problem) -> tuple[dict[str, np.ndarray], tuple[int, ...]]:
    """Flat values of every grid axis, and the grid's shape with ψ and C_rr first."""
    names = problem.data_names
    ellipse = [(0.0, 0.0)]
    if "f1" in names:
        for ratio, axis in itertools.product(ELLIPSE_RATIOS, ELLIPSE_AXES):
            ellipse.append((ratio * np.cos(2 * axis), ratio * np.sin(2 * axis)))
    axes = [
        PSI if "ln_B" in names or "ln_A" in names else PSI[:1],
        LN_C_RR if "ln_C_rr" in names else [_fixed_log(problem, "C_rr")],
        range(len(ellipse)),
        LN_F_0_OFFSETS if "ln_F_0" in names else [0.0],
        LN_A_OFFSETS if "ln_A" in names and not _has_free_scale(problem) else [0.0],
    ]
    grid = [np.ravel(g) for g in np.meshgrid(*axes, indexing="ij")]
    shapes = np.asarray(ellipse)[grid[2].astype(int)]
    cells = {
        "psi": grid[0],
        "ln_C_rr": grid[1],
        "f1": shapes[:, 0],
        "f2": shapes[:, 1],
        "ln_F_0": grid[3],
        "ln_A": grid[4],
    }
    return cells, tuple(len(axis) for axis in axes)


def is_linear(problem: Problem) -> bool:
    """Whether heights are proportional to A at given ratios."""
    no_preload = (
        "ln_F_0" not in problem.data_names and float(problem.grasp.preload) == 0
    )
    return no_preload and float(problem.grasp.offset) == 0


def _has_free_scale(problem: Problem) -> bool:
    """Whether A need not be a grid axis.

    Where the object tilts all springs must scale together; with one of them fixed, s
    takes the place of ln B and no longer scales.
    """
    is_held = "ln_s" in problem.data_names and "ln_B" not in problem.data_names
    return is_linear(problem) and not is_held


def _points(problem: Problem, cells: dict[str, np.ndarray]) -> Float[np.ndarray, "k q"]:
    """Data coordinates of every cell, A in closed form where that exists."""
    force = np.max(np.abs(problem.observed)) / float(problem.grasp.gain)
    ln_ratio = cells["ln_C_rr"] + np.log(np.tan(cells["psi"]))
    values = {
        "ln_C_rr": cells["ln_C_rr"],
        "f1": cells["f1"],
        "f2": cells["f2"],
        "ln_F_0": np.log(force) + cells["ln_F_0"],
        "ln_L": np.full(ln_ratio.size, _prior_log(problem, "L")),
        "ln_s": np.zeros(ln_ratio.size),
    }
    if "ln_A" in problem.data_names:
        ln_scale = np.log(force / float(problem.grasp.push_length))
        values["ln_A"] = ln_scale + cells["ln_A"]
    else:
        state = problem.data_state(jnp.zeros(len(problem.data_names)))
        ln_A = float(jnp.log(contact(state.params).A))
        values["ln_A"] = np.full(ln_ratio.size, ln_A)
    values["ln_B"] = values["ln_A"] + ln_ratio
    if "ln_s" in problem.data_names and "ln_B" not in problem.data_names:
        values["ln_s"] = _log_s(problem, values)
    points = np.stack([values[name] for name in problem.data_names], axis=1)
    points = held_values(problem, points)
    if not is_linear(problem) or not {"ln_A", "ln_B"} <= set(problem.data_names):
        return points
    scale = np.asarray(_best_log_scale(problem, jnp.asarray(points)))
    for name in ("ln_A", "ln_B"):
        points[:, problem.data_names.index(name)] += scale
    return points


def _log_s(problem: Problem, values: dict[str, np.ndarray]) -> Float[np.ndarray, " k"]:
    """Ln s that gives B, with K_st or C_d fixed; at least a little of either spring."""
    B = np.exp(values["ln_B"])
    if "K_st" in problem.fixed:
        s = float(problem.fixed["K_st"]) / B - 1
    else:
        rotation = float(problem.fixed["C_d"]) / np.exp(2 * values["ln_L"])
        s = B / np.maximum(rotation - B, SMALLEST_S * B)
    return np.log(np.maximum(s, SMALLEST_S))


@compiled
def _best_log_scale(
    problem: Problem, points: Float[Array, "k q"]
) -> Float[Array, " k"]:
    """Log factor on A and B that fits each point's heights best."""

    def scale(y: Float[Array, " q"]) -> Float[Array, ""]:
        weight = jnp.where(problem.mask, problem.reference_sigma**-2, 0.0)
        predicted = problem.predict(problem.data_state(y))
        factor = jnp.sum(weight * predicted * problem.observed)
        norm = jnp.sum(weight * predicted**2)
        # Heights that are negative on balance want no stiffness at all: start small.
        return jnp.log(jnp.maximum(factor / norm, 1e-3))

    return jax.lax.map(scale, points, batch_size=CHUNK)


@compiled
def _costs(problem: Problem, points: Float[Array, "k q"]) -> Float[Array, " k"]:
    """Sum of squared residuals at each point."""

    def cost(y: Float[Array, " q"]) -> Float[Array, ""]:
        return jnp.sum(problem.data_residuals(y) ** 2)

    return jax.lax.map(cost, points, batch_size=CHUNK)


def _fixed_log(problem: Problem, name: str) -> float:
    return float(np.log(problem.fixed[name]))


def _prior_log(problem: Problem, name: str) -> float:
    """Log of the fixed value, or of a middling value of the prior."""
    if name in problem.fixed:
        return _fixed_log(problem, name)
    return float(np.median(problem.priors[name].sample(np.random.default_rng(0), 999)))
