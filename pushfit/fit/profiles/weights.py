"""Noise that the errors of a fit tell: constant, and in proportion to the height.

Where sigma is sampled least squares take the one whose chi-square is n - p. The share
of the height, like the errors of angles, is a plug-in: known noise of every row, by the
heights of the best fit, which is sought again under the new weights.
"""

from dataclasses import replace

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.fit.problem.problem import STUDENT_DOF, Problem
from pushfit.fit.results import FitResult, ResultWarning
from pushfit.model import as_float

# Largest variance of a component, in mean squares of the errors, and where it is sought
# from.
MOST, HALF = 10.0, 0.5
# Fewer residuals beyond the unknowns show no share: the fit takes most of what low
# heights scatter.
MIN_FREEDOM = 20


def with_known_noise(problem: Problem, added: Float[np.ndarray, "c n"]) -> Problem:
    """The problem with more known noise, and weights to go with it.

    Args:
        added: Standard deviations to add in quadrature [table unit].
    """
    added = np.where(problem.mask, added, 0.0)
    return replace(
        problem,
        sd=np.hypot(problem.sd, added),
        reference_sigma=np.hypot(problem.reference_sigma, added),
    )


def height_share(
    problem: Problem, predicted: Float[np.ndarray, "c n"], *, is_sampled: bool
) -> float:
    """The most likely noise in proportion to the height, as a share of it.

        variance = sd² + sigma² + share² height²

    One share for all channels; squared errors count n / (n - p)-fold for what the fit
    took of them.

    Args:
        predicted: Heights of the fit [table unit].
        is_sampled: Whether each channel has a sigma beside its sd.
    """
    heights = predicted[np.asarray(problem.mask)]
    return _likeliest_share(problem, heights, is_sampled=is_sampled)[0]


def share_gain(problem: Problem, fit: FitResult) -> float:
    """How much likelier noise in proportion makes the residuals of a fit by even noise.

    Returns:
        Log ratio of the largest likelihoods at the same heights, with and without a
        share, each channel with a sigma beside its sd; 0 where hardly a residual is
        free.
    """
    if fit.degrees_of_freedom < MIN_FREEDOM:
        return 0.0
    _, with_share = _likeliest_share(problem, fit.predicted, is_sampled=True)
    _, without = _likeliest_share(problem, fit.predicted, is_sampled=True, most=0.0)
    return with_share - without


def _likeliest_share(
    problem: Problem,
    heights: Float[np.ndarray, " m"],
    *,
    is_sampled: bool,
    most: float = MOST,
) -> tuple[float, float]:
    """The share of `height_share`, and the log likelihood with it up to a constant.

    Args:
        heights: Of the fit, those of padding left out [table unit].
        most: Largest variance in proportion, in mean squares of the errors.
    """
    mask = np.asarray(problem.mask)
    errors = heights - np.asarray(problem.observed)[mask]
    squares = errors**2 / _share_left(problem)
    known = np.asarray(problem.sd)[mask] ** 2
    channel = np.nonzero(mask)[0]
    columns = [heights**2]
    if is_sampled:
        columns += [(channel == c).astype(float) for c in range(mask.shape[0])]
    scale = max(float(np.mean(squares)), 1e-300)
    design = np.stack([column / np.mean(column) for column in columns], axis=1)
    # What no component may fall below: variances stay finite for perfect heights.
    floor = 1e-9 * scale

    def cost(shares: np.ndarray) -> tuple[float, np.ndarray]:
        variance = known + scale * (design @ shares) + floor
        slope = (1 - squares / variance) / variance
        value = float(np.sum(np.log(variance) + squares / variance))
        return value, scale * (design.T @ slope)

    bounds = [(0.0, most)] + [(0.0, MOST)] * (design.shape[1] - 1)
    found = scipy.optimize.minimize(
        cost,
        np.minimum(HALF, [top for _, top in bounds]),
        jac=True,
        bounds=bounds,
        method="L-BFGS-B",
    )
    share = float(np.sqrt(scale * found.x[0] / np.mean(columns[0])))
    return share, -float(found.fun) / 2


def with_noise_of(problem: Problem, predicted: Float[np.ndarray, "c n"]) -> Problem:
    """The problem with sigma of each channel estimated from the errors of a fit.

    Args:
        problem: Problem whose noise is sampled.
        predicted: Heights of the fit [table unit].
    """
    mask, sd = np.asarray(problem.mask), np.asarray(problem.sd)
    observed = np.asarray(problem.observed)
    errors = predicted - observed
    share = _share_left(problem)
    sigma = np.array(problem.reference_sigma)
    for c in range(len(problem.channels)):
        r, s = errors[c, mask[c]], sd[c, mask[c]]
        target = share * r.size
        # Noise-free heights: keep weights finite at a sigma too small to matter.
        floor = 1e-9 * np.max(np.abs(observed[c]))
        high = np.sqrt(np.sum(r**2) / target) + floor

        def excess(
            extra: float, r: np.ndarray = r, s: np.ndarray = s, target: float = target
        ) -> float:
            return float(np.sum(r**2 / (s**2 + extra**2)) - target)

        extra = high
        if excess(floor) <= 0:
            extra = floor
        elif excess(high) < 0:
            extra = float(np.asarray(scipy.optimize.brentq(excess, floor, high)))
        sigma[c, mask[c]] = np.hypot(s, extra)
    return replace(problem, reference_sigma=as_float(sigma))


def tail_gain(problem: Problem, fit: FitResult, kind: str) -> float:
    """How much likelier Student-t noise makes the residuals of a fit by normal noise.

    Args:
        kind: Of the noise; each channel has its likeliest scale unless it was given.

    Returns:
        Log ratio of the likelihoods at the same heights: what a fit by Student-t noise
        could gain beyond it is little, unless tails are heavy.
    """
    heights = np.asarray(problem.observed)[np.asarray(problem.mask)]
    scaled = (heights - fit.predicted) / fit.sigma
    channels = np.asarray(fit.channel)
    if kind == "given":
        return _tail_gain(scaled)
    return sum(_best_tail_gain(scaled[channels == c]) for c in set(fit.channel))


def _tail_gain(scaled: Float[np.ndarray, " n"]) -> float:
    """Log likelihood ratio at residuals of unit scale."""
    ratio = scipy.stats.t.logpdf(scaled, STUDENT_DOF) - scipy.stats.norm.logpdf(scaled)
    return float(np.sum(ratio))


def _best_tail_gain(residuals: Float[np.ndarray, " n"]) -> float:
    """The same, each distribution with the scale that it finds likeliest."""
    _, _, scale = scipy.stats.t.fit(residuals, fdf=STUDENT_DOF, floc=0.0)
    student = scipy.stats.t.logpdf(residuals, STUDENT_DOF, scale=scale)
    normal = scipy.stats.norm.logpdf(residuals, scale=np.sqrt(np.mean(residuals**2)))
    return float(np.sum(student - normal))


def share_warning(share: float) -> ResultWarning:
    """Say which noise in proportion to the height the residuals show.

    Args:
        share: It, as a share of the height.
    """
    return ResultWarning(
        code="height_share",
        text=f"beside a constant part heights scatter by {share:.2g} of their size, as "
        f"their residuals have it; [noise] height_share = {share:.2g} keeps it, and 0 "
        "has noise alone that is the same for all",
    )


def _share_left(problem: Problem) -> float:
    """Share of the squared errors that a fit leaves, (n - p) / n."""
    n = np.asarray(problem.mask).sum()
    n_free = len(problem.data_names) - problem.n_constraints
    return max(1.0 - n_free / n, 1.0 / n)
