"""The exact posterior by quadrature, with a bound on its own error.

Linear forces see three numbers, so the posterior is a three-dimensional integral and
the rest of the parameters follow from their prior. Needs no starting point, no chain
and no convergence diagnostics. Excluded: all but magnitudes of one azimuth from rest,
the six parameters with priors of their own, and normal noise that is known.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import encode
from pushfit.fit.problem.priors.conditional_prior import (
    ConditionalPrior,
    make_conditional_prior,
)
from pushfit.fit.problem.priors.quadrature import draw_from_nodes
from pushfit.fit.problem.setup import Setup
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import FitResult
from tests.oracle import priors
from tests.oracle.cells import Cells, cell_nodes
from tests.oracle.integrand import Inner, Integrand
from tests.oracle.outer import first_edges

# Relative error of the evidence that stops refinement: far below what 10^6 draws show.
RTOL = 1e-6
MAX_CELLS = 4000
MAX_ROUNDS = 60
# Outer nodes per compiled call, and how many of them share the processor's cache.
CHUNK, BATCH = 64, 8
# Draws that share one outer node: nodes are stratified, so few draws of each suffice.
DRAWS_PER_NODE = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactGrid:
    """The posterior on its quadrature nodes.

    Args:
        integrand: What was integrated.
        conditional: Prior of the parameters given A and B.
        cells: Outer integral.
        log_evidence: Log marginal likelihood.
        log_evidence_error: Bound on its error.
    """

    integrand: Integrand
    conditional: ConditionalPrior
    cells: Cells
    log_evidence: float
    log_evidence_error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactPosterior:
    """Independent draws by name, the evidence, and a bound on its error."""

    samples: Mapping[str, Float[np.ndarray, " n"]]
    log_evidence: float
    log_evidence_error: float


def exact_posterior(
    setup: Setup,
    fit: FitResult,
    *,
    n_draws: int,
    seed: int,
    reference_alpha: float,
    reach: tuple[float, float],
) -> ExactPosterior:
    """Independent draws from the posterior, and the evidence.

    Args:
        setup: Problem with its noise weights settled.
        fit: Least squares of it; its modes tell where to look closely.
        reference_alpha: Azimuth of θ_c [rad].
        reach: Lowest and highest azimuth for α* [rad].
    """
    grid = exact_grid(setup, fit)
    x = draw(grid, n_draws, np.random.default_rng(seed))
    return ExactPosterior(
        samples=samples_mapping(setup.problem, x, reference_alpha, reach=reach),
        log_evidence=grid.log_evidence,
        log_evidence_error=grid.log_evidence_error,
    )


def exact_grid(setup: Setup, fit: FitResult, *, rtol: float = RTOL) -> ExactGrid:
    """Integrate the posterior to a tolerance.

    Args:
        setup: Problem with its noise weights settled.
        fit: Least squares of it.
        rtol: Relative error of the evidence at which refinement stops.

    Returns:
        Nodes, evidence and error bound.
    """
    problem = setup.problem
    conditional = make_conditional_prior(problem.priors, problem.fixed)
    state = problem.data_state(jnp.zeros(len(problem.data_names)))
    deviance = jnp.sum(problem.residuals(state) ** 2)
    integrand = Integrand(
        problem=problem,
        constant=problem.log_likelihood(state) + deviance / 2,
        prior_A=priors.density_table(conditional.normal.density()),
        prior_B=priors.density_table(conditional.tangential.density()),
        prior_C=priors.density_table(conditional.C_rr),
    )
    cells = _adaptive(integrand, first_edges(integrand, fit), rtol)
    error = min(cells.relative_error, 1 - 1e-12)
    return ExactGrid(
        integrand=integrand,
        conditional=conditional,
        cells=cells,
        log_evidence=cells.log_integral,
        log_evidence_error=float(-np.log1p(-error)),
    )


def _adaptive(
    integrand: Integrand, edges: Float[np.ndarray, " e"], rtol: float
) -> Cells:
    """Halve the worst cells until the sum of their errors meets the tolerance."""
    cells = _cells(integrand, edges[:-1], edges[1:])
    for _ in range(MAX_ROUNDS):
        total, errors = np.sum(cells.integrals), cells.errors
        order = np.argsort(errors)
        # The many small errors may stay as long as they sum to half the tolerance.
        is_small = np.cumsum(errors[order]) <= rtol * total / 2
        worst = order[~is_small]
        resolution = 1e-13 * np.abs(cells.upper + cells.lower)[worst]
        worst = worst[(cells.upper - cells.lower)[worst] > resolution]
        settled = np.sum(errors) <= rtol * total
        if settled or worst.size == 0 or cells.lower.size > MAX_CELLS:
            break
        low, high = cells.lower[worst], cells.upper[worst]
        middle = (low + high) / 2
        halves = _cells(integrand, np.r_[low, middle], np.r_[middle, high])
        cells = cells.replaced(worst, halves)
    return cells


def _cells(
    integrand: Integrand,
    lower: Float[np.ndarray, " k"],
    upper: Float[np.ndarray, " k"],
) -> Cells:
    """Cells with the integrand at their nodes."""
    nodes = cell_nodes(lower, upper)
    inner = _gathered(_over_C, integrand, nodes.ravel())
    return Cells(
        lower=lower,
        upper=upper,
        log_values=inner.log_integral.reshape(nodes.shape),
        inner_error=inner.error.reshape(nodes.shape),
    )


def draw(
    grid: ExactGrid, n_draws: int, rng: np.random.Generator
) -> Float[np.ndarray, "n p"]:
    """Independent draws of the sampling coordinates, as `Problem.names` has them."""
    order = np.argsort(grid.cells.lower)
    nodes = grid.cells.nodes[order].ravel()
    log_values = grid.cells.log_values[order].ravel()
    n_nodes = -(-n_draws // DRAWS_PER_NODE)
    strata = (np.arange(n_nodes) + rng.uniform(size=n_nodes)) / n_nodes
    u = draw_from_nodes(nodes[None], log_values[None], strata[None])[0]
    over_C = _gathered(_over_C, grid.integrand, u)
    c = _coordinates(over_C, rng.uniform(size=(n_nodes, DRAWS_PER_NODE)))
    # In random order, so that any part of the draws is a sample of the whole.
    chosen = rng.permutation(n_nodes * DRAWS_PER_NODE)[:n_draws]
    u, c = np.repeat(u, DRAWS_PER_NODE)[chosen], c.ravel()[chosen]
    over_A = _gathered(_over_A, grid.integrand, u, c)
    a = _coordinates(over_A, rng.uniform(size=(n_draws, 1)))[:, 0]
    scores = rng.standard_normal((3, n_draws))
    logs = priors.drawn(grid.conditional, a, u + c + a, scores) | {"C_rr": c}
    problem = grid.integrand.problem
    return encode(problem, {name: np.exp(values) for name, values in logs.items()})


def _coordinates(
    inner: Inner, uniform: Float[np.ndarray, "n d"]
) -> Float[np.ndarray, "n d"]:
    """Draws of the inner coordinate from numbers in (0, 1)."""
    t = draw_from_nodes(inner.t, inner.log_density, uniform)
    return inner.centre[:, None] + inner.scale[:, None] * np.sinh(t)


def _gathered(
    function: Callable[..., Inner], integrand: Integrand, *points: np.ndarray
) -> Inner:
    """Inner integrals at points, chunk by chunk, the last padded by repetition."""
    n, parts = points[0].size, []
    for first in range(0, n, CHUNK):
        rows = np.minimum(np.arange(first, first + CHUNK), n - 1)
        inner = function(integrand, *(jnp.asarray(values[rows]) for values in points))
        parts.append(jax.tree.map(lambda a, k=n - first: np.asarray(a)[:k], inner))
    return jax.tree.map(lambda *several: np.concatenate(several), *parts)


@compiled
def _over_C(integrand: Integrand, u: Float[Array, " n"]) -> Inner:
    return jax.lax.map(integrand.over_C, u, batch_size=BATCH)


@compiled
def _over_A(
    integrand: Integrand, u: Float[Array, " n"], c: Float[Array, " n"]
) -> Inner:
    return jax.vmap(integrand.over_A)(u, c)
