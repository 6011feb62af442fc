"""A mixture that resembles a cloud of draws: a proposal for weights and for walkers."""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import lazy_loader
import numpy as np
import scipy
from jaxtyping import Float
from threadpoolctl import threadpool_limits

if TYPE_CHECKING:
    import sklearn.exceptions
    import sklearn.mixture
else:
    # Half a second to load, and most tables do without.
    sklearn = lazy_loader.load("sklearn")

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
        norm = scipy.special.gammaln((nu + dim) / 2) - scipy.special.gammaln(nu / 2)
        norm -= dim / 2 * np.log(nu * np.pi)
        log_weight = (np.log(self.weights) - log_volume)[:, None]
        log_shape = -(nu + dim) / 2 * np.log1p(squares / nu)
        return norm + scipy.special.logsumexp(log_weight + log_shape, axis=0)


def fit_mixture(
    points: Float[np.ndarray, "n p"],
    rng: np.random.Generator,
    *,
    n_components: int = N_COMPONENTS,
) -> Mixture:
    """Mixture that resembles a cloud of points, modes and bends included.

    Args:
        points: Points, more than twice as many as components.
        n_components: Components beside the one as wide as all.

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
        n_components,
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
