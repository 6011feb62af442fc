"""A mixture that resembles a cloud of draws: a proposal for weights and for walkers.

Excluded: the moves of walkers by it (`pushfit.fit.sampler.moves`).
"""

import threading
import warnings
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float

# Acceptance hardly depends on either, but more components cover the bent corners that a
# walker would leave only slowly, and heavy tails the rest.
N_COMPONENTS = 16
DEGREES_OF_FREEDOM = 5.0
# Weight of one component as wide as all points together: no region is cut off.
WIDE_SHARE = 0.1
# Added to correlations before factorising: far below what heights can resolve.
RIDGE = 1e-10
# Steps of expectation maximisation after k-means: with its clusters alone fewer draws
# count.
N_STEPS = 10
# Least variance of a component, in units of all points together: a thousandth of their
# spread, which keeps repeated points from becoming a component of their own.
SMALLEST_VARIANCE = 1e-6
# Filters of warnings are those of all threads: one at a time may change them.
_FILTERS = threading.Lock()


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

    def beside(self, other: "Mixture") -> "Mixture":
        """Both as one, each with half of the weight."""
        return Mixture(
            weights=np.concatenate([self.weights, other.weights]) / 2,
            means=np.concatenate([self.means, other.means]),
            factors=np.concatenate([self.factors, other.factors]),
        )

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
        norm = scipy.special.gammaln((nu + dim) / 2) - scipy.special.gammaln(nu / 2)
        norm -= dim / 2 * np.log(nu * np.pi)
        log_shape = -(nu + dim) / 2 * np.log1p(self._squares(x) / nu)
        return norm + scipy.special.logsumexp(self._log_scales + log_shape, axis=0)

    def shares(self, x: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "c n"]:
        """Probability that a point belongs to each component, were these Gaussian."""
        return scipy.special.softmax(self._log_scales - self._squares(x) / 2, axis=0)

    @property
    def _log_scales(self) -> Float[np.ndarray, "c 1"]:
        """Logs of the weights over the volumes."""
        log_volume = np.sum(np.log(np.diagonal(self.factors, axis1=1, axis2=2)), axis=1)
        with np.errstate(divide="ignore"):  # of a component without points
            return (np.log(self.weights) - log_volume)[:, None]

    def _squares(self, x: Float[np.ndarray, "n p"]) -> Float[np.ndarray, "c n"]:
        """Squared distances from the centres, in units of the scale matrices."""
        dim, inverses = self.means.shape[1], np.linalg.inv(self.factors)
        # One product of matrices: (c p, p) against (p, n).
        offsets = np.einsum("cij,cj->ci", inverses, self.means)
        scaled = inverses.reshape(-1, dim) @ x.T - offsets.reshape(-1, 1)
        return np.sum(scaled.reshape(-1, dim, x.shape[0]) ** 2, axis=1)


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
    # Points that repeat are told apart, so that there are as many as clusters.
    apart = white + np.sqrt(SMALLEST_VARIANCE) * rng.standard_normal(white.shape)
    with _FILTERS, warnings.catch_warnings():
        # Of a cluster that lost its points: it has no weight.
        warnings.simplefilter("ignore", UserWarning)
        _, label = scipy.cluster.vq.kmeans2(apart, n_components, minit="++", rng=rng)
    found = _moments(white, np.eye(n_components)[label].T)
    for _ in range(N_STEPS):
        found = _moments(white, found.shares(white))
    return Mixture(
        weights=np.append((1 - WIDE_SHARE) * found.weights, WIDE_SHARE),
        means=centre + np.concatenate([found.means @ overall.T, np.zeros((1, dim))]),
        factors=np.concatenate([overall @ found.factors, overall[None]]),
    )


def _moments(
    points: Float[np.ndarray, "n p"], shares: Float[np.ndarray, "c n"]
) -> Mixture:
    """Weights, means and covariances of points that belong to components by shares."""
    n, dim = points.shape
    total = np.sum(shares, axis=1)
    parts = shares / np.maximum(total, 1.0)[:, None]
    means = parts @ points
    around = points - means[:, None]
    covariances = np.swapaxes(parts[..., None] * around, 1, 2) @ around
    covariances += SMALLEST_VARIANCE * np.eye(dim)
    return Mixture(
        weights=total / n, means=means, factors=np.linalg.cholesky(covariances)
    )
