"""Noise that the errors of a fit tell: constant, and in proportion to some size.

Where sigma is sampled least squares take the one whose chi-square is n - p. Shares of
the height, or of slopes where angles err, are plug-ins: known noise of every row, by
the heights of the best fit, which is sought again under the new weights. Excluded:
noise that is known before a fit (`pushfit.fit.problem.noise`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy
from jaxtyping import Float, Int

from pushfit.fit.problem.noise import Noise
from pushfit.fit.problem.problem import STUDENT_DOF, STUDENT_SCALE, Problem
from pushfit.fit.profiles.angle_errors import COMMON_SD, angle_slopes, steepness
from pushfit.fit.results import FitResult, ResultWarning
from pushfit.model import as_float
from pushfit.parameters import TINY

# Largest variance of a component, in mean squares of the errors, and where it is sought
# from.
MOST, HALF = 10.0, 0.5
# Fewer residuals beyond the unknowns show no share: the fit takes most of what low
# heights scatter.
MIN_FREEDOM = 20
# Share of their mean square that no variance of errors falls below, and share of the
# largest height that no sampled sigma does: logs and weights stay finite where heights
# are met exactly, by noise too small to matter. Not tuned.
LEAST_VARIANCE, LEAST_SIGMA = 1e-9, 1e-9
# Of the share of the height and the errors of both angles, which is which.
IS_HEIGHT = np.array([True, False, False])


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


def uneven_noise(
    problem: Problem,
    noise: Noise,
    y: Float[np.ndarray, " q"],
    *,
    predicted: Float[np.ndarray, "c n"],
) -> tuple[Float[np.ndarray, "c n"], Float[np.ndarray, "3"]]:
    """Noise that differs from push to push, and what was open of it.

    Angles whose errors nobody states err alike.

    Args:
        problem: Problem without this noise.
        y: Data coordinates of a fit.
        predicted: Its heights [table unit].

    Returns:
        Standard deviations to add [table unit]; the share of the height, and the errors
        of θ and α [rad].
    """
    steep = np.zeros((2, *predicted.shape))
    if any(noise.angle_sd):
        errors = [COMMON_SD if np.isnan(sd) else sd for sd in noise.angle_sd]
        steep = steepness(angle_slopes(problem, y, errors))
    sizes = np.stack([predicted, *steep])
    shares = np.array([noise.height_share, *noise.angle_sd])
    is_open = np.isnan(shares)
    if np.any(is_open):
        mask = np.asarray(problem.mask)
        known = np.nan_to_num(shares)[:, None, None] * sizes
        even = with_known_noise(problem, _root_sum(known))
        wanted = [w & is_open for w in (IS_HEIGHT, ~IS_HEIGHT) if np.any(w & is_open)]
        found, _ = likeliest_shares(
            Errors.of_fit(even, predicted[mask]),
            np.stack([_root_sum(sizes[rows])[mask] for rows in wanted]),
            is_sampled=noise.kind == "sampled",
        )
        for rows, share in zip(wanted, found, strict=True):
            shares[rows] = share
    return _root_sum(shares[:, None, None] * sizes), shares


def _root_sum(parts: Float[np.ndarray, "k c n"]) -> Float[np.ndarray, "c n"]:
    """Root of the sum of squares over all parts."""
    return np.sqrt(np.sum(parts**2, axis=0))


def share_gain(
    problem: Problem, fit: FitResult, size: Float[np.ndarray, " m"]
) -> float:
    """How much likelier noise in proportion makes the residuals of a fit by even noise.

    Args:
        size: What noise may be in proportion to, row by row [table unit].

    Returns:
        Log ratio of the largest likelihoods at the same heights, with and without a
        share, each channel with a sigma beside its sd; 0 where hardly a residual is
        free.
    """
    if fit.degrees_of_freedom < MIN_FREEDOM:
        return 0.0
    return _gain(Errors.of_fit(problem, fit.predicted), size)


def repeat_gain(
    problem: Problem,
    size: Float[np.ndarray, "c n"],
    direction: Int[np.ndarray, " r"],
) -> float:
    """How much likelier noise in proportion makes what repeats of a direction scatter.

    No model is in it, so that a wrong one looks like no such noise.

    Args:
        size: What noise may be in proportion to [table unit].
        direction: Number of the direction of each push, padding left out.

    Returns:
        As `share_gain` has it; 0 where there are hardly any repeats.
    """
    n_repeats = np.bincount(direction) - 1
    if np.sum(n_repeats) < MIN_FREEDOM:
        return 0.0

    def mean(values: Float[np.ndarray, "c n"]) -> Float[np.ndarray, "c g"]:
        sums = [np.bincount(direction, row[: direction.size]) for row in values]
        return np.stack(sums) / (n_repeats + 1)

    observed, sd = np.asarray(problem.observed), np.asarray(problem.sd)
    deviations = observed[:, : direction.size] - mean(observed)[:, direction]
    squares = mean(deviations**2)
    is_repeated = np.tile(n_repeats > 0, (len(squares), 1))
    count = np.tile(n_repeats, (len(squares), 1))[is_repeated]
    errors = Errors(
        squares=squares[is_repeated] * (count + 1) / count,
        known=mean(sd**2)[is_repeated],
        channel=np.nonzero(is_repeated)[0],
        count=count.astype(float),
    )
    return _gain(errors, np.sqrt(mean(size**2))[is_repeated])


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Mean squares of errors, and what is known of their noise.

    Args:
        squares: Mean squares [table unit²].
        known: Variances that are stated [table unit²].
        channel: Number of the channel.
        count: Degrees of freedom of each mean.
    """

    squares: Float[np.ndarray, " m"]
    known: Float[np.ndarray, " m"]
    channel: Int[np.ndarray, " m"]
    count: Float[np.ndarray, " m"]

    @classmethod
    def of_fit(cls, problem: Problem, predicted: Float[np.ndarray, " m"]) -> "Errors":
        """Those of a fit, row by row, padding left out."""
        mask = np.asarray(problem.mask)
        errors = predicted - np.asarray(problem.observed)[mask]
        return cls(
            squares=errors**2 / _share_left(problem),
            known=np.asarray(problem.sd)[mask] ** 2,
            channel=np.nonzero(mask)[0],
            count=np.ones(errors.size),
        )


def _gain(errors: Errors, size: Float[np.ndarray, " m"]) -> float:
    """Log ratio of the largest likelihoods, with and without a share of a size."""
    _, with_share = likeliest_shares(errors, size[None], is_sampled=True)
    _, without = likeliest_shares(errors, size[None], is_sampled=True, most=0.0)
    return with_share - without


def likeliest_shares(
    errors: Errors,
    sizes: Float[np.ndarray, "k m"],
    *,
    is_sampled: bool,
    most: float = MOST,
) -> tuple[Float[np.ndarray, " k"], float]:
    """The most likely noise in proportion to sizes, as shares of them.

        variance = sd² + sigma² + Σ share² size²

    Each share is that of all channels; squared errors count n / (n - p)-fold for what
    the fit took of them.

    Args:
        sizes: What noise is in proportion to, such as the heights [table unit].
        is_sampled: Whether each channel has a sigma beside its sd.
        most: Largest variance in proportion, in mean squares of the errors.

    Returns:
        The shares, and the log likelihood up to a constant.
    """
    squares, count = errors.squares, errors.count
    columns = list(sizes**2)
    if is_sampled:
        columns += [
            (errors.channel == c).astype(float) for c in range(max(errors.channel) + 1)
        ]
    scale = max(float(np.mean(squares)), TINY)
    means = np.array([max(float(np.mean(column)), TINY) for column in columns])
    design = np.stack(columns, axis=1) / means
    floor = LEAST_VARIANCE * scale

    def cost(
        shares: Float[np.ndarray, " k"],
    ) -> tuple[float, Float[np.ndarray, " k"]]:
        variance = errors.known + scale * (design @ shares) + floor
        slope = count * (1 - squares / variance) / variance
        value = float(count @ (np.log(variance) + squares / variance))
        return value, scale * (design.T @ slope)

    k = len(sizes)
    bounds = [(0.0, most)] * k + [(0.0, MOST)] * (len(columns) - k)
    found = scipy.optimize.minimize(
        cost,
        np.minimum(HALF, [top for _, top in bounds]),
        jac=True,
        bounds=bounds,
        method="L-BFGS-B",
    )
    return np.sqrt(scale * found.x[:k] / means[:k]), -float(found.fun) / 2


def with_noise_of(problem: Problem, predicted: Float[np.ndarray, "c n"]) -> Problem:
    """The problem with sigma of each channel estimated from the errors of a fit.

    Args:
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
        floor = LEAST_SIGMA * np.max(np.abs(observed[c]))
        high = np.sqrt(np.sum(r**2) / target) + floor

        def excess(
            extra: float,
            r: Float[np.ndarray, " m"] = r,
            s: Float[np.ndarray, " m"] = s,
            target: float = target,
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
        kind: Of the noise; each channel has its likeliest sd unless it was given.

    Returns:
        Log ratio of the likelihoods at the same heights: what a fit by Student-t noise
        could gain beyond it is little, unless tails are heavy.
    """
    heights = np.asarray(problem.observed)[np.asarray(problem.mask)]
    residuals, channels = heights - fit.predicted, np.asarray(fit.channel)
    total = 0.0
    for c in dict.fromkeys(fit.channel):
        own = (residuals / fit.sigma)[channels == c]
        if not np.any(own):
            continue  # heights without noise have no tails
        wide, narrow = 1.0, STUDENT_SCALE
        if kind != "given":
            wide = np.sqrt(np.mean(own**2))
            narrow = likeliest_scale(own)
        student = scipy.stats.t.logpdf(own, STUDENT_DOF, scale=narrow)
        total += float(np.sum(student - scipy.stats.norm.logpdf(own, scale=wide)))
    return total


def likeliest_scale(residuals: Float[np.ndarray, " n"]) -> float:
    """The scale s of Student-t residuals with n = Σ (ν + 1) r² / (ν s² + r²)."""
    squares = residuals**2
    high = float(np.max(squares))
    low = LEAST_VARIANCE * high

    def excess(variance: float) -> float:
        terms = squares / (STUDENT_DOF * variance + squares)
        return float(np.sum((STUDENT_DOF + 1) * terms) - squares.size)

    variance = low if excess(low) <= 0 else scipy.optimize.brentq(excess, low, high)
    return float(np.sqrt(np.asarray(variance)))


def uneven_warnings(
    noise: Noise, shares: Float[np.ndarray, "3"]
) -> Iterator[ResultWarning]:
    """Say what residuals show of noise that was left to them.

    Args:
        shares: What it came to; see `uneven_noise`.
    """
    share, angle_sd = shares[0], np.degrees(shares[1])
    if np.isnan(noise.height_share):
        yield ResultWarning(
            code="height_share",
            text=f"beside a constant part heights scatter by {share:.2g} of their "
            f"size, as their residuals have it; [noise] height_share = {share:.2g} "
            "keeps it, and 0 has noise alone that is the same for all",
        )
    if np.isnan(noise.angle_sd[0]):
        keys = ("theta_sd_deg", "alpha_sd_deg")[: 1 + np.isnan(noise.angle_sd[1])]
        stated = " and ".join(f"{key} = {angle_sd:.2g}" for key in keys)
        yield ResultWarning(
            code="angle_errors",
            text="beside a constant part heights scatter where they are steep, as if "
            f"angles erred by {angle_sd:.2g}°; [noise] {stated} would state it, and 0 "
            "has angles that are exact",
        )


def _share_left(problem: Problem) -> float:
    """Share of the squared errors that a fit leaves, (n - p) / n."""
    n = np.asarray(problem.mask).sum()
    return max(1.0 - problem.n_free / n, 1.0 / n)
