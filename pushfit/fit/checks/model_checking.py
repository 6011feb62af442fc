"""Whether the model describes the data at all, said before any parameter is quoted.

Three questions that fail apart: is the scatter about the fit larger than the noise, do
residuals follow their neighbours in direction, and does the fit explain the heights.
The same is asked of heights simulated from the posterior (`predictive`). Excluded:
which assumption fails (`pushfit.fit.checks.violations`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float, Int, Shaped

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.leave_one_out import LeftOut
from pushfit.fit.problem.derived import equal_tailed_interval
from pushfit.fit.problem.noise import Noise
from pushfit.fit.problem.problem import STUDENT_DOF
from pushfit.fit.profiles.profile_sets import profile_set
from pushfit.fit.results import (
    OUTLIER_SIGMA,
    FitResult,
    GoodnessOfFit,
    LikelihoodProfile,
    PredictiveCheck,
)
from pushfit.parameters import NAMED

# Chance of faulting a model that is right, per test.
LEVEL = 1e-3
# A fit that explains less of the heights' variance than this describes them badly
# whatever sigma is assumed.
MIN_R_SQUARED = 0.8
# Quantities that posterior and likelihood are compared by.
CONTRADICTABLE = ("theta_c", "A", "B", "C_rr")
# Chances come in steps of 1/5000, a fifth of the level.
N_PERMUTATIONS = 4999
# With fewer directions a pattern cannot be told from chance.
MIN_DIRECTIONS = 8
# With fewer residuals beyond the unknowns a scatter of twice the noise passes the test
# of chi-square more often than not.
MIN_TESTED = 7
# Residuals of less than a tenth of the noise may follow whom they like: those of
# rounding do, and no interval minds.
QUIET_CHI_SQUARE = 0.01
# Of a height, relative.
ROUNDING = 1e-6
# What simulated heights lack, by the feature of a predictive check.
MISSED = {
    "scatter": "as much scatter",
    "largest": "as large a residual",
    "pattern": "residuals that follow their neighbours as much",
}


def goodness_of_fit(
    table: PeakTable,
    fit: FitResult,
    noise: Noise,
    *,
    seed: int,
    predictive: tuple[PredictiveCheck, ...] = (),
    contradicted: Sequence[str] = (),
    left_out: Sequence[LeftOut] = (),
    is_scattered: bool = False,
    likelihood: str = "normal",
) -> GoodnessOfFit:
    """Compare the residuals of a fit with noise, with repeats and with each other.

    Args:
        contradicted: Letters of the quantities of which priors and heights disagree.
        left_out: Pushes that the others do not predict.
        is_scattered: Whether noise is taken from the residuals because that stated does
            not explain them.
        likelihood: Of the noise, "normal" or "student_t".
    """
    rows = np.asarray(fit.row)
    heights = {name: table.heights(name) for name in table.channels}
    observed = np.array(
        [heights[c][r] for c, r in zip(fit.channel, fit.row, strict=True)]
    )
    residuals = (fit.predicted - observed) / fit.sigma
    r_squared = share_explained(observed, fit.predicted, np.asarray(fit.channel))
    p_value = _chi_square_p_value(fit, noise, likelihood)
    lack_of_fit = _lack_of_fit_p_value(table, fit, residuals)
    is_quiet = fit.chi_square < QUIET_CHI_SQUARE * fit.degrees_of_freedom
    pattern = None if is_quiet else _pattern_p_value(table, fit, residuals, seed=seed)
    if is_quiet:
        predictive = tuple(c for c in predictive if c.feature != "pattern")
    far = rows[np.abs(residuals) > OUTLIER_SIGMA]
    outliers = np.union1d(far, [one.row for one in left_out[:1]]).astype(int)
    failed = _failed(
        p_value, lack_of_fit=lack_of_fit, pattern=pattern, predictive=predictive
    )
    if contradicted:
        names = " and ".join(contradicted)
        failed.append(
            f"what is known beforehand keeps {names} from where the heights have them"
        )
    # Repeats or given standard deviations judge a fit better than its share of the
    # variation, which is small for noisy heights of a perfect model too.
    little = explains_little(r_squared, table, rows, n_free=fit.n_free)
    if little is not None and p_value is None and lack_of_fit is None:
        failed.insert(0, little)
    return GoodnessOfFit(
        chi_square=fit.chi_square,
        degrees_of_freedom=fit.degrees_of_freedom,
        p_value=p_value,
        r_squared=r_squared,
        lack_of_fit_p_value=lack_of_fit,
        pattern_p_value=pattern,
        outliers=tuple(label(table, row) for row in outliers.tolist()),
        is_adequate=not failed,
        sentence=_sentence(
            failed, r_squared, fit.degrees_of_freedom, is_scattered=is_scattered
        ),
        predictive=predictive,
    )


def explains_little(
    r_squared: float, table: PeakTable, rows: Int[np.ndarray, " n"], *, n_free: int
) -> str | None:
    """That a fit explains too little, as a clause; None where it explains enough.

    Also where there are no more directions than unknowns, which any model goes through.

    Args:
        rows: Of the table, those fitted.
    """
    n_directions = np.unique(table.groups[rows]).size
    if r_squared >= MIN_R_SQUARED or n_directions <= n_free:
        return None
    return f"it explains only {max(r_squared, 0):.0%} of the variation"


def contradicted_quantities(
    samples: Mapping[str, Float[np.ndarray, " d"]],
    profiles: Mapping[str, LikelihoodProfile],
    *,
    prob: float,
) -> tuple[str, ...]:
    """Letters of the quantities that priors keep from where the heights have them.

    The interval of the posterior then lies beside the likelihood set, even beside that
    which a right model leaves once in 1 / LEVEL.

    Args:
        samples: Draws of the posterior.
        prob: Probability of its interval.
    """
    found = []
    for name in CONTRADICTABLE:
        draws = samples.get(name, np.empty(0))
        if name not in profiles or not np.mean(np.isfinite(draws)) > prob:
            continue
        low, high = equal_tailed_interval(draws, prob)
        pieces = profile_set(profiles[name], 1 - LEVEL)
        is_beside = [
            (end is not None and high < end) or (top is not None and low > top)
            for end, top in pieces
        ]
        if pieces and all(is_beside):
            found.append(NAMED[name].prose)
    return tuple(found)


def _failed(
    p_value: float | None,
    *,
    lack_of_fit: float | None,
    pattern: float | None,
    predictive: tuple[PredictiveCheck, ...],
) -> list[str]:
    """Sentences of the tests whose p-value is below the level."""
    tests = {
        "the scatter about the fit exceeds the noise": p_value,
        "the fit misses the means of repeated pushes": lack_of_fit,
        "residuals follow their neighbours in direction": pattern,
    }
    failed = [name for name, p in tests.items() if p is not None and p < LEVEL]
    missed = missed_features(predictive)
    return failed if missed is None else [*failed, missed]


def missed_features(predictive: Sequence[PredictiveCheck]) -> str | None:
    """What heights have and those simulated from the model lack, as a clause."""
    missed = [MISSED[check.feature] for check in predictive if check.p_value < LEVEL]
    if not missed:
        return None
    return f"heights simulated from it almost never show {' or '.join(missed)}"


def label(table: PeakTable, row: int) -> str:
    """Name of a push by its number and direction."""
    push = table.frame["push"].iloc[row]
    theta, alpha = np.degrees(table.theta[row]), np.degrees(table.alpha[row])
    return f"push {push} (θ = {theta:g}°, α = {alpha:g}°)"


def _sentence(
    failed: list[str], r_squared: float, degrees_of_freedom: int, *, is_scattered: bool
) -> str:
    if not failed and degrees_of_freedom < MIN_TESTED:
        more = "hardly" if degrees_of_freedom > 0 else "no"
        return (
            f"The heights do not speak against the model, but are {more} more than its "
            "unknowns, and would not show that it is wrong."
        )
    if not failed and is_scattered:
        return (
            "The model describes the heights within a noise that is taken from what it "
            "misses, since the stated one does not explain that."
        )
    if not failed:
        return "The model describes the heights within their noise."
    reasons = "; ".join(failed)
    if r_squared < MIN_R_SQUARED:
        return f"The model does not describe these heights: {reasons}."
    return (
        f"The model does not describe these heights within their noise: {reasons}. "
        f"It still explains {r_squared:.1%} of their variation."
    )


def share_explained(
    observed: Float[np.ndarray, " n"],
    predicted: Float[np.ndarray, " n"],
    channel: Shaped[np.ndarray, " n"],
) -> float:
    """1 - SSE / SST about each channel's mean.

    Of heights that do not vary it is 1 where they are met, else 0.
    """
    total = 0.0
    for name in np.unique(channel):
        values = observed[channel == name]
        total += float(np.sum((values - values.mean()) ** 2))
    errors = float(np.sum((observed - predicted) ** 2))
    rounded = ROUNDING**2 * float(np.sum(observed**2))
    return 1.0 - errors / total if total > rounded else float(errors <= rounded)


def _chi_square_p_value(fit: FitResult, noise: Noise, likelihood: str) -> float | None:
    """Chance of a larger chi-square; None where sigma was made to fit it."""
    if noise.kind != "given" or fit.degrees_of_freedom < 1:
        return None
    return chance_of_more(fit.chi_square, fit.degrees_of_freedom, likelihood)


def chance_of_more(
    chi_square: float, degrees_of_freedom: int, likelihood: str
) -> float:
    """Chance of a larger sum of squares where noise is as stated.

    Squares of Student-t residuals are deviances, (ν + 1) ln(1 + t²/ν): logs of a beta
    variable. Their sum has nearly the gamma distribution of its mean and variance, as
    chi-square is one.

    Args:
        likelihood: Of the noise, "normal" or "student_t".
    """
    mean, variance = 1.0, 2.0
    if likelihood == "student_t":
        ends = np.array([STUDENT_DOF + 1, STUDENT_DOF]) / 2
        mean = -(STUDENT_DOF + 1) * np.diff(scipy.special.digamma(ends))[0]
        trigamma = scipy.special.polygamma(1, ends)
        variance = (STUDENT_DOF + 1) ** 2 * np.diff(trigamma)[0]
    shape, scale = degrees_of_freedom * mean**2 / variance, variance / mean
    return float(scipy.special.gammaincc(shape, chi_square / scale))


def _lack_of_fit_p_value(
    table: PeakTable, fit: FitResult, residuals: Float[np.ndarray, " n"]
) -> float | None:
    """F test of the group means of repeated pushes against their own scatter."""
    group = table.groups[np.asarray(fit.row)]
    keys = np.unique(np.asarray(fit.channel), return_inverse=True)[1]
    _, inverse, counts = np.unique(
        np.stack([keys, group]), axis=1, return_inverse=True, return_counts=True
    )
    means = np.bincount(inverse.ravel(), residuals) / counts
    pure = float(np.sum((residuals - means[inverse.ravel()]) ** 2))
    pure_dof = residuals.size - counts.size
    lack_dof = counts.size - fit.n_free
    if pure_dof < 1 or lack_dof < 1 or pure == 0:
        return None
    lack = float(np.sum(counts * means**2))
    return float(
        scipy.special.fdtrc(lack_dof, pure_dof, lack / lack_dof / (pure / pure_dof))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Directions:
    """Directions that were pushed, each with the nearest other one on the sphere.

    Args:
        order: Pushes sorted by direction.
        first: Where each direction begins in this order.
        counts: Number of pushes of each direction.
        nearest: Nearest other direction of each.
    """

    order: Int[np.ndarray, " n"]
    first: Int[np.ndarray, " g"]
    counts: Int[np.ndarray, " g"]
    nearest: Int[np.ndarray, " g"]

    def pooled(self, residuals: Float[np.ndarray, "*m n"]) -> Float[np.ndarray, "*m g"]:
        """Residuals summed by direction over the root of their number, as variable."""
        sums = np.add.reduceat(residuals[..., self.order], self.first, axis=-1)
        return sums / np.sqrt(self.counts)


def pushed_directions(
    table: PeakTable, rows: Int[np.ndarray, " n"]
) -> Directions | None:
    """Directions of some pushes; None where they are too few to show a pattern."""
    group, inverse = np.unique(table.groups[rows], return_inverse=True)
    if group.size < MIN_DIRECTIONS:
        return None
    counts = np.bincount(inverse)
    theta, alpha = table.theta[rows], table.alpha[rows]
    vectors = np.stack(
        [np.cos(theta) * np.cos(alpha), np.cos(theta) * np.sin(alpha), np.sin(theta)]
    )
    points = np.stack([np.bincount(inverse, v) / counts for v in vectors], axis=1)
    _, nearest = scipy.spatial.KDTree(points).query(points, k=2)
    return Directions(
        order=np.argsort(inverse, kind="stable"),
        first=np.cumsum(counts) - counts,
        counts=counts,
        nearest=np.asarray(nearest)[:, 1],
    )


def _pattern_p_value(
    table: PeakTable, fit: FitResult, residuals: Float[np.ndarray, " n"], *, seed: int
) -> float | None:
    """Permutation test of residuals against the nearest other direction.

    The mean residual of each direction is multiplied by that of its nearest neighbour
    on the sphere; a model that misses a trend makes the products positive.
    """
    channel = np.asarray(fit.channel)
    is_first = channel == channel[0]
    directions = pushed_directions(table, np.asarray(fit.row)[is_first])
    if directions is None:
        return None
    means = directions.pooled(residuals[is_first])
    neighbour = directions.nearest
    rng = np.random.default_rng(seed)

    observed = float(means @ means[neighbour])
    # In blocks: all permutations of a large table at once would fill the memory.
    block = max(1, 2_000_000 // means.size)
    n_larger, n_done = 0, 0
    while n_done < N_PERMUTATIONS:
        n = min(block, N_PERMUTATIONS - n_done)
        shuffled = rng.permuted(np.tile(means, (n, 1)), axis=1)
        products = np.sum(shuffled * shuffled[:, neighbour], axis=1)
        n_larger += int(np.sum(products >= observed))
        n_done += n
    return (n_larger + 1) / (N_PERMUTATIONS + 1)
