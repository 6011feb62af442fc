"""The exact posterior by quadrature, with a bound on its own error.

Linear forces see three numbers, so the posterior is a three-dimensional integral and
the rest of the parameters follow from their prior. Needs no starting point, no chain
and no convergence diagnostics. Excluded: all but magnitudes of one azimuth from rest,
the six parameters with priors of their own, and normal noise that is known.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import encode, prior_x_samples
from pushfit.fit.problem.priors.conditional_prior import (
    ConditionalPrior,
    make_conditional_prior,
)
from pushfit.fit.problem.priors.quadrature import draw_from_nodes
from pushfit.fit.problem.priors.tabulated_density import tabulate
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.setup import Setup
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import FitResult, FitStatus, PosteriorResult
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
N_PRIOR_DRAWS = 4000
# An evidence known to better than this moves no printed digit.
MAX_ERROR = 0.01


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


def exact_posterior(
    setup: Setup,
    fit: FitResult,
    *,
    n_draws: int,
    seed: int,
    reference_alpha: float,
    reach: tuple[float, float],
) -> PosteriorResult:
    """Independent draws from the posterior, and the evidence.

    Args:
        setup: Problem with its noise weights settled.
        fit: Least squares of it; its modes tell where to look closely.
        n_draws: Number of draws.
        seed: Seed of the draws.
        reference_alpha: Azimuth of θ_c [rad].
        reach: Lowest and highest azimuth for α* [rad].

    Returns:
        Posterior with engine "exact".
    """
    problem = setup.problem
    grid = exact_grid(setup, fit)
    rng = np.random.default_rng(seed)
    x = draw(grid, n_draws, rng)
    x_prior = prior_x_samples(problem, rng, N_PRIOR_DRAWS)
    error = grid.log_evidence_error
    is_settled = np.isfinite(grid.log_evidence) and error < MAX_ERROR
    return PosteriorResult(
        samples=samples_mapping(problem, x, reference_alpha, reach),
        prior_samples=samples_mapping(problem, x_prior, reference_alpha, reach),
        log_prob=np.asarray(_log_probs(problem, jnp.asarray(x))),
        chain=None,
        chain_names=(),
        thin=1,
        engine="exact",
        diagnostics=None,
        log_evidence=grid.log_evidence,
        log_evidence_error=error,
        seed=seed,
        status=FitStatus.OK if is_settled else FitStatus.MAX_STEPS,
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
        prior_A=tabulate(conditional.normal.density()),
        prior_B=tabulate(conditional.tangential.density()),
        prior_C=tabulate(conditional.C_rr),
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
    values, errors = [], []
    for part, rows in _chunks(nodes.size):
        inner = _over_C(integrand, jnp.asarray(nodes.ravel()[rows]))
        values.append(np.asarray(inner.log_integral)[part])
        errors.append(np.asarray(inner.error)[part])
    return Cells(
        lower=lower,
        upper=upper,
        log_values=np.concatenate(values).reshape(nodes.shape),
        inner_error=np.concatenate(errors).reshape(nodes.shape),
    )


def _chunks(n: int) -> Iterator[tuple[slice, np.ndarray]]:
    """Rows of each chunk, the last padded by repetition, and which of them count."""
    for first in range(0, n, CHUNK):
        rows = np.minimum(np.arange(first, first + CHUNK), n - 1)
        yield slice(0, min(CHUNK, n - first)), rows


def draw(
    grid: ExactGrid, n_draws: int, rng: np.random.Generator
) -> Float[np.ndarray, "n p"]:
    """Independent draws from an integrated posterior.

    Args:
        grid: The posterior on its nodes.
        n_draws: Number of draws.
        rng: Source of randomness.

    Returns:
        Sampling coordinates in the order of `Problem.names`.
    """
    u, c, a = _draw_points(grid, n_draws, rng)
    scores = rng.standard_normal((3, n_draws))
    logs = priors.drawn(grid.conditional, a, u + c + a, scores) | {"C_rr": c}
    problem = grid.integrand.problem
    return encode(problem, {name: np.exp(values) for name, values in logs.items()})


def _draw_points(
    grid: ExactGrid, n_draws: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draws of u, ln C_rr and ln A."""
    order = np.argsort(grid.cells.lower)
    nodes = grid.cells.nodes[order].ravel()
    log_values = grid.cells.log_values[order].ravel()
    n_nodes = -(-n_draws // DRAWS_PER_NODE)
    strata = (np.arange(n_nodes) + rng.uniform(size=n_nodes)) / n_nodes
    u = draw_from_nodes(nodes[None], log_values[None], strata[None])[0]
    over_C = _gathered(_over_C, grid.integrand, u)
    c = over_C.coordinates(rng.uniform(size=(n_nodes, DRAWS_PER_NODE)))
    # In random order, so that any part of the draws is a sample of the whole.
    chosen = rng.permutation(n_nodes * DRAWS_PER_NODE)[:n_draws]
    u, c = np.repeat(u, DRAWS_PER_NODE)[chosen], c.ravel()[chosen]
    over_A = _gathered(_over_A, grid.integrand, u, c)
    a = over_A.coordinates(rng.uniform(size=(n_draws, 1)))[:, 0]
    return u, c, a


@dataclass(frozen=True, slots=True, kw_only=True)
class InnerNodes:
    """Inner integrals of many outer nodes, on the host.

    Args:
        t: Nodes of each.
        centre: Coordinate at t = 0.
        scale: Stretch of sinh(t).
        log_density: Log of the density of t at the nodes.
    """

    t: Float[np.ndarray, "n m"]
    centre: Float[np.ndarray, " n"]
    scale: Float[np.ndarray, " n"]
    log_density: Float[np.ndarray, "n m"]

    def coordinates(
        self, uniform: Float[np.ndarray, "n d"]
    ) -> Float[np.ndarray, "n d"]:
        """Draws of the coordinate from numbers in (0, 1)."""
        t = draw_from_nodes(self.t, self.log_density, uniform)
        return self.centre[:, None] + self.scale[:, None] * np.sinh(t)


def _gathered(
    function: Callable[..., Inner], integrand: Integrand, *points: np.ndarray
) -> InnerNodes:
    """Inner integrals at points, chunk by chunk."""
    parts = []
    for part, rows in _chunks(points[0].size):
        inner = function(integrand, *(jnp.asarray(values[rows]) for values in points))
        fields = (inner.t, inner.centre, inner.scale, inner.log_density)
        parts.append([np.asarray(values)[part] for values in fields])
    t, centre, scale, log_density = (
        np.concatenate(values) for values in zip(*parts, strict=True)
    )
    return InnerNodes(t=t, centre=centre, scale=scale, log_density=log_density)


@compiled
def _over_C(integrand: Integrand, u: Float[Array, " n"]) -> Inner:
    return jax.lax.map(integrand.over_C, u, batch_size=BATCH)


@compiled
def _over_A(
    integrand: Integrand, u: Float[Array, " n"], c: Float[Array, " n"]
) -> Inner:
    return jax.vmap(integrand.over_A)(u, c)


@compiled
def _log_probs(problem: Problem, x: Float[Array, "n p"]) -> Float[Array, " n"]:
    return jax.vmap(problem.log_prob)(x)
