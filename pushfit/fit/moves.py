"""How walkers propose: along differences between walkers, or from a fitted mixture.

Both are moves of emcee that advance several independent ensembles in one vectorised
call: rows e W ... (e + 1) W - 1 of the walkers are ensemble e, and no proposal of one
ensemble ever looks at another. emcee's own moves know a single ensemble, and its
`DESnookerMove` (3.1.6) gives E r² = 4.0 instead of 6 on a standard normal in six
dimensions.
"""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np
from emcee.model import Model
from emcee.moves import Move
from emcee.state import State
from jaxtyping import Bool, Float, Int
from scipy import special
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    import sklearn.exceptions
    import sklearn.mixture
else:
    # Half a second to load, and quadrature does without.
    sklearn = lazy_loader.load("sklearn")

# Share of the difference moves that jump by the whole difference of two walkers: what
# carries a walker from one mode straight into another.
JUMP_SHARE = 0.1
# From 4 to 32 components and 4 to 10 degrees of freedom acceptance hardly changes (0.5
# to 0.6 in six dimensions, 0.4 in eight), but more components cover the bent corners
# that a walker would leave only slowly, and heavy tails the rest.
N_COMPONENTS = 16
DEGREES_OF_FREEDOM = 6.0
# Weight of one component as wide as all points together: no region is cut off.
WIDE_SHARE = 0.1
# Added to correlations before factorising: far below what heights can resolve.
RIDGE = 1e-10
# Least variance of a component, in units of all points together: a thousandth of their
# spread, which keeps repeated points from becoming a component of their own.
SMALLEST_VARIANCE = 1e-6


class DifferenceMove(Move):
    """Differential evolution within each ensemble.

        q_k = x_k + γ (x_i - x_j),   γ = 2.38 / sqrt(2 d) 10^-u, or 1 for a jump

    with u uniform in 0 to 1: the short steps are for walkers in narrow corners. Half
    of an ensemble moves along differences of the other half, then they swap.

    Args:
        n_ensembles: Number of independent ensembles among the walkers.

    References:
        ter Braak (2006), doi:10.1007/s11222-006-8769-1.
    """

    def __init__(self, n_ensembles: int) -> None:
        """Keep the number of ensembles."""
        self.n_ensembles = n_ensembles

    def propose(
        self, model: Model, state: State
    ) -> tuple[State, Bool[np.ndarray, " k"]]:
        """Advance every walker once.

        Args:
            model: Density and source of randomness.
            state: Walkers.

        Returns:
            The state, changed in place, and which walkers moved.
        """
        random = model.random
        n_total, n_dim = state.coords.shape
        n_walkers = n_total // self.n_ensembles
        first = n_walkers * np.arange(self.n_ensembles)[:, None]
        order = first + np.argsort(random.rand(self.n_ensembles, n_walkers), axis=1)
        halves = order[:, : n_walkers // 2], order[:, n_walkers // 2 :]
        accepted = np.zeros(n_total, dtype=bool)
        for moving, fixed in (halves, halves[::-1]):
            pair = _random_pairs(random, moving.shape, fixed)
            difference = state.coords[pair[0]] - state.coords[pair[1]]
            rows = moving.ravel()
            is_jump = random.rand(rows.size, 1) < JUMP_SHARE
            scale = 2.38 / np.sqrt(2 * n_dim) / 10 ** random.rand(rows.size, 1)
            gamma = np.where(is_jump, 1.0, scale)
            proposals = state.coords[rows] + gamma * difference.reshape(-1, n_dim)
            accepted |= _accept(model, state, rows, proposals, np.zeros(rows.size))
        return state, accepted


@dataclass(frozen=True, slots=True, kw_only=True)
class Mixture:
    """Mixture of multivariate Student-t distributions.

    Args:
        weights: Of the components, summing to 1.
        means: Centres.
        factors: Lower Cholesky factors of the scale matrices.
    """

    weights: Float[np.ndarray, " c"]
    means: Float[np.ndarray, "c p"]
    factors: Float[np.ndarray, "c p p"]

    def sample(
        self, random: np.random.RandomState, n: int
    ) -> Float[np.ndarray, "{n} p"]:
        """Independent draws."""
        which = random.choice(self.weights.size, size=n, p=self.weights)
        normal = random.randn(n, self.means.shape[1])
        shrink = np.sqrt(random.chisquare(DEGREES_OF_FREEDOM, (n, 1)))
        scaled = normal * np.sqrt(DEGREES_OF_FREEDOM) / shrink
        return self.means[which] + np.einsum("nij,nj->ni", self.factors[which], scaled)

    def log_density(self, x: Float[np.ndarray, "n p"]) -> Float[np.ndarray, " n"]:
        """Normalised log density."""
        nu, dim = DEGREES_OF_FREEDOM, self.means.shape[1]
        inverses = np.linalg.inv(self.factors)
        # One product of matrices: (c p, p) against (p, n).
        offsets = np.einsum("cij,cj->ci", inverses, self.means)
        scaled = inverses.reshape(-1, dim) @ x.T - offsets.reshape(-1, 1)
        squares = np.sum(scaled.reshape(-1, dim, x.shape[0]) ** 2, axis=1)
        log_volume = np.sum(np.log(np.diagonal(self.factors, axis1=1, axis2=2)), axis=1)
        norm = special.gammaln((nu + dim) / 2) - special.gammaln(nu / 2)
        norm -= dim / 2 * np.log(nu * np.pi)
        log_weight = (np.log(self.weights) - log_volume)[:, None]
        log_shape = -(nu + dim) / 2 * np.log1p(squares / nu)
        return norm + special.logsumexp(log_weight + log_shape, axis=0)


def fit_mixture(points: Float[np.ndarray, "n p"], rng: np.random.Generator) -> Mixture:
    """Mixture that resembles a cloud of points, modes and bends included.

    Args:
        points: Points, more than twice as many as components.
        rng: Source of randomness.

    Returns:
        Gaussian components found by expectation maximisation, with the tails of
        Student's t, and one as wide as all points together.
    """
    n, dim = points.shape
    centre, scale = points.mean(axis=0), points.std(axis=0)
    unit = (points - centre) / scale
    # Whitened, so that one small number regularises narrow and wide directions alike.
    overall = scale[:, None] * np.linalg.cholesky(
        unit.T @ unit / n + RIDGE * np.eye(dim)
    )
    white = np.linalg.solve(overall, (points - centre).T).T
    found = sklearn.mixture.GaussianMixture(
        N_COMPONENTS,
        init_params="k-means++",
        reg_covar=SMALLEST_VARIANCE,
        tol=0.01,
        random_state=int(rng.integers(2**31)),
    )
    # The same bits on any machine's number of cores.
    with threadpool_limits(1), warnings.catch_warnings():
        # A proposal need not be the best one.
        warnings.simplefilter("ignore", sklearn.exceptions.ConvergenceWarning)
        found.fit(white)
    means = np.asarray(found.means_) @ overall.T
    factors = overall @ np.linalg.cholesky(np.asarray(found.covariances_))
    return Mixture(
        weights=np.append((1 - WIDE_SHARE) * np.asarray(found.weights_), WIDE_SHARE),
        means=centre + np.concatenate([means, np.zeros((1, dim))]),
        factors=np.concatenate([factors, overall[None]]),
    )


class IndependenceMove(Move):
    """Proposals from a fixed distribution, wherever the walker is.

        accept with min(1, π(q) g(x) / (π(x) g(q)))

    Exact for any g that is nowhere 0; fast where g resembles π. It needs no walker in
    a mode to send another there, so rare modes keep their weight.

    Args:
        mixture: g, never changed while the chain runs.
    """

    def __init__(self, mixture: Mixture) -> None:
        """Keep the proposal distribution."""
        self.mixture = mixture

    def propose(
        self, model: Model, state: State
    ) -> tuple[State, Bool[np.ndarray, " k"]]:
        """Advance every walker once.

        Args:
            model: Density and source of randomness.
            state: Walkers.

        Returns:
            The state, changed in place, and which walkers moved.
        """
        rows = np.arange(len(state.coords))
        proposals = self.mixture.sample(model.random, rows.size)
        log_ratio = self.mixture.log_density(state.coords)
        log_ratio -= self.mixture.log_density(proposals)
        return state, _accept(model, state, rows, proposals, log_ratio)


def _random_pairs(
    random: np.random.RandomState, shape: tuple[int, int], rows: Int[np.ndarray, "e h"]
) -> Int[np.ndarray, "2 e m"]:
    """Two different rows of the same ensemble for each of `shape` walkers."""
    n = rows.shape[1]
    one = random.randint(n, size=shape)
    other = (one + random.randint(1, n, size=shape)) % n
    return np.stack([np.take_along_axis(rows, k, axis=1) for k in (one, other)])


def _accept(
    model: Model,
    state: State,
    rows: Int[np.ndarray, " m"],
    proposals: Float[np.ndarray, "m p"],
    log_ratio: Float[np.ndarray, " m"],
) -> Bool[np.ndarray, " k"]:
    """Metropolis-Hastings: move the accepted among `rows`, in place."""
    log_prob, _ = model.compute_log_prob_fn(proposals)
    threshold = np.log(model.random.rand(rows.size))
    current = np.asarray(state.log_prob)
    is_better = threshold < log_prob - current[rows] + log_ratio
    moved = rows[is_better]
    state.coords[moved] = proposals[is_better]
    current[moved] = log_prob[is_better]
    accepted = np.zeros(len(state.coords), dtype=bool)
    accepted[moved] = True
    return accepted
