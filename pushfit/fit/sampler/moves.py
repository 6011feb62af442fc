"""How walkers propose: along differences between walkers, or from a fitted mixture.

Both are moves of emcee that advance several independent ensembles in one vectorised
call: rows e W ... (e + 1) W - 1 of the walkers are ensemble e, and no proposal of one
ensemble ever looks at another. emcee's own moves know a single ensemble, and its
`DESnookerMove` (3.1.6) gives E r² = 4.0 instead of 6 on a standard normal in six
dimensions. Excluded: fitting the mixture (`pushfit.fit.sampler.mixture`).
"""

import numpy as np
from emcee.model import Model
from emcee.moves import MHMove, Move
from emcee.state import State
from jaxtyping import Bool, Float, Int

from pushfit.fit.sampler.mixture import Mixture

# Share of the difference moves that jump by the whole difference of two walkers: what
# carries a walker from one mode straight into another.
JUMP_SHARE = 0.1


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
        """Advance every walker once."""
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
            accepted |= _accept(model, state, rows=rows, proposals=proposals)
        return state, accepted


class IndependenceMove(MHMove):
    """Proposals from a fixed distribution, wherever the walker is.

        accept with min(1, π(q) g(x) / (π(x) g(q)))

    Exact for any g that is nowhere 0; fast where g resembles π. It needs no walker in
    a mode to send another there, so rare modes keep their weight.

    Args:
        mixture: g, never changed while the chain runs.
    """

    def __init__(self, mixture: Mixture) -> None:
        """Keep the proposal distribution."""
        super().__init__(self.proposed)
        self.mixture = mixture

    def proposed(
        self, x: Float[np.ndarray, "k p"], random: np.random.RandomState
    ) -> tuple[Float[np.ndarray, "k p"], Float[np.ndarray, " k"]]:
        """Points q drawn from g, and ln g(x) - ln g(q)."""
        q = self.mixture.sample(random, len(x))
        return q, self.mixture.log_density(x) - self.mixture.log_density(q)


def both_moves(
    n_ensembles: int, mixture: Mixture, share: float = 0.5
) -> list[tuple[Move, float]]:
    """Differences for a share of the steps, and the mixture for the others."""
    difference, independence = DifferenceMove(n_ensembles), IndependenceMove(mixture)
    return [(difference, share), (independence, 1 - share)]


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
    *,
    rows: Int[np.ndarray, " m"],
    proposals: Float[np.ndarray, "m p"],
) -> Bool[np.ndarray, " k"]:
    """Metropolis: move the accepted among `rows`, in place."""
    log_prob, _ = model.compute_log_prob_fn(proposals)
    threshold = np.log(model.random.rand(rows.size))
    current = np.asarray(state.log_prob)
    is_better = threshold < log_prob - current[rows]
    moved = rows[is_better]
    state.coords[moved] = proposals[is_better]
    current[moved] = log_prob[is_better]
    accepted = np.zeros(len(state.coords), dtype=bool)
    accepted[moved] = True
    return accepted
