"""Which assumption of the model the residuals speak against, and the key to set.

Each alternative says where residuals exceed noise: with one sign around θ_c where the
transition is soft, and everywhere where the sensor's zero is off; where heights are
steep if angles err, where they are tall if noise is in proportion, repeat by repeat if
these differ, in the tails if it is heavy-tailed.
These are score tests: nothing is fitted again. Excluded: whether the model is adequate
(`model_checking`), mechanics that tilt (`tilt_check`), and soft transitions of these,
as they take seconds to compile.

References:
    Koenker (1981), doi:10.1016/0304-4076(81)90062-2, on scatter that follows a size.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.model_checking import QUIET_CHI_SQUARE
from pushfit.fit.problem.predictions import predict_points
from pushfit.fit.problem.repeats.effects import ARTICLES, repeat_effect
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.angle_errors import steepness
from pushfit.fit.results import FitResult, ResultWarning
from pushfit.parameters import TINY

ANGLE_ERRORS = "looks_like_angle_errors"
CONSTANT = "looks_like_a_constant"
HEAVY_TAILED, PROPORTIONAL = "looks_heavy_tailed", "looks_proportional"
# Chance of naming an assumption that holds, per alternative.
NAMING_LEVEL = 1e-3
# The same where the model is rejected, so that something does not hold.
LEVEL_IF_REJECTED = 0.05
# No joint errs by more; where heights scatter so, something else does not hold [deg].
LARGEST_DEG = 10.0
# Sharpness of the soft transition that residuals are compared with.
SOFT = 4.0
# Fewer residuals than this beyond the coordinates show no shape, and fewer than the
# second no tails.
MIN_FREEDOM, MIN_FOR_KURTOSIS = 3, 20
# What is smaller, against the whole, is rounding.
ROUNDING = 1e-9
# Decimals that heights may be stated to, beyond which they are not rounded.
MOST_DECIMALS = 6
# Errors of rounding have an rms of 0.29 of the last decimal; noise has more.
ROUNDED = 0.33


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """An assumption that the residuals speak against.

    Args:
        code: Stable snake_case word.
        p_value: Chance of as much of it where the assumption holds.
        text: What the residuals show and what to set, as a clause.
    """

    code: str
    p_value: float
    text: str


def violations(
    table: PeakTable,
    setup: Setup,
    fit: FitResult,
    *,
    slopes: Float[np.ndarray, "2 2 c m"],
) -> tuple[Violation, ...]:
    """Alternatives to the assumptions of a fit, the most telling first.

    Args:
        slopes: Of the heights in θ and α at the fit; see `angle_slopes`.

    Returns:
        All that were tested; none where hardly a residual is free, where the
        residuals are those of no normal noise, or of rounding.
    """
    problem = setup.problem
    is_quiet = fit.chi_square < QUIET_CHI_SQUARE * fit.degrees_of_freedom
    is_normal = problem.likelihood == "normal" and not is_quiet
    if fit.degrees_of_freedom < MIN_FREEDOM or not is_normal:
        return ()
    mask = np.asarray(problem.mask)
    heights = np.asarray(problem.observed)[mask]
    channel, _ = np.nonzero(mask)
    errors = heights - fit.predicted
    if all(
        _is_rounding(heights[channel == c], errors[channel == c]) for c in {*channel}
    ):
        return ()
    residuals = errors / fit.sigma
    # Rows of the Jacobian beyond the data are what is known beforehand.
    basis, _ = np.linalg.qr(fit.jacobian[: fit.n_data])
    free = residuals - basis @ (basis.T @ residuals)
    slope = steepness(slopes)[0][mask]
    found: list[Violation | None] = [
        _steep(free, slope / fit.sigma, any(setup.noise.angle_sd)),
        _tall(free, fit.predicted / fit.sigma, setup.noise.height_share != 0),
        None if setup.noise.shared else _repeat_by_repeat(table),
    ]
    # Noise of several sizes has heavy tails, too.
    if all(v is None or not v.p_value < NAMING_LEVEL for v in found):
        found.append(_heavy_tailed(free))
    if not setup.noise.shared:
        for index, name in enumerate(problem.channels):
            change = np.where(channel == index, 1 / fit.sigma, 0.0)
            column = f"{name}_{table.unit}"
            found.append(_constant(free, basis, change, column))
    is_hard = np.isinf(float(problem.grasp.sharpness)) and "p" not in problem.priors
    if is_hard and not problem.grasp.law.is_searched:
        soft = replace(problem, grasp=replace(problem.grasp, sharpness=SOFT))
        softened = predict_points(soft, fit.estimate[None], problem.angles).heights
        change = (softened[0, mask] - fit.predicted) / fit.sigma
        found.append(_soft(free, basis, change))
    kept = [v for v in found if v is not None and np.isfinite(v.p_value)]
    return tuple(sorted(kept, key=lambda v: v.p_value))


def _is_rounding(
    heights: Float[np.ndarray, " n"], errors: Float[np.ndarray, " n"]
) -> bool:
    """Whether errors are those of the decimal that all heights of a channel stop at."""
    for decimals in range(MOST_DECIMALS + 1):
        if np.allclose(heights, heights.round(decimals), rtol=ROUNDING, atol=0):
            rms = np.sqrt(np.mean(errors**2))
            return bool(rms < ROUNDED * 10.0**-decimals)
    return False


def violation_warnings(
    found: tuple[Violation, ...], *, is_adequate: bool
) -> tuple[ResultWarning, ...]:
    """What the most telling alternative is, if it tells enough.

    Args:
        found: Alternatives, the most telling first.
        is_adequate: Whether the model describes the heights; if not, something does not
            hold, and less is asked of an alternative.
    """
    level = NAMING_LEVEL if is_adequate else LEVEL_IF_REJECTED
    return tuple(
        ResultWarning(code=v.code, text=v.text) for v in found[:1] if v.p_value < level
    )


def _soft(
    free: Float[np.ndarray, " n"],
    basis: Float[np.ndarray, "n q"],
    change: Float[np.ndarray, " n"],
) -> Violation:
    """Residuals that follow what a soft transition would change, of one sign."""
    t, dof, _ = _follows(free, basis, change)
    return Violation(
        code="looks_soft",
        p_value=float(scipy.stats.t.sf(t, dof)),
        text="residuals around θ_c are those of a soft transition: set [transition] "
        'sharpness = "auto", which leaves it open, or compare by `pushfit compare`',
    )


def _constant(
    free: Float[np.ndarray, " n"],
    basis: Float[np.ndarray, "n q"],
    change: Float[np.ndarray, " n"],
    column: str,
) -> Violation:
    """Residuals that a constant in all heights of a channel would leave.

    Args:
        change: What one unit more changes, in standard deviations.
        column: Of the heights.
    """
    t, dof, size = _follows(free, basis, change)
    return Violation(
        code=CONSTANT,
        p_value=2 * float(scipy.stats.t.sf(abs(t), dof)),
        text=f"residuals are those of {size:+.2g} in all of {column}, whatever the "
        "direction: look at the zero of the sensor, and set [noise] offset_sd to how "
        "far it may be off; a wrong zero of the elevations, a drift and pushes that "
        "end short look much alike",
    )


def _follows(
    free: Float[np.ndarray, " n"],
    basis: Float[np.ndarray, "n q"],
    change: Float[np.ndarray, " n"],
) -> tuple[float, int, float]:
    """How residuals follow what one more coefficient would change, beside the others.

    Returns:
        Student's t of it, its degrees of freedom, and the coefficient; NaN where the
        others do all that it could.
    """
    seen = change - basis @ (basis.T @ change)
    norm = float(np.linalg.norm(seen))
    dof = free.size - basis.shape[1] - 1
    if dof < 1 or norm <= ROUNDING * float(np.linalg.norm(change)):
        return np.nan, 1, np.nan
    along = float(seen @ free) / norm
    rest = max(float(free @ free) - along**2, TINY)
    return along / np.sqrt(rest / dof), dof, along / norm


def _steep(
    free: Float[np.ndarray, " n"],
    slope: Float[np.ndarray, " n"],
    is_counted: bool = False,
) -> Violation | None:
    """Scatter where heights are steep in θ: angles err, if none of it counts."""
    p_value, excess = _scatter_follows(free, slope**2)
    size = np.degrees(np.sqrt(max(excess, 0.0)))
    if size > LARGEST_DEG:
        return None
    return Violation(
        code=ANGLE_ERRORS,
        p_value=p_value,
        text="heights scatter most where they are steep in θ, as if elevations erred "
        f"by about {float(f'{size:.1g}'):g}°"
        + (
            ", also beside what [noise] theta_sd_deg and alpha_sd_deg have of it: "
            "compare it with what the joints do"
            if is_counted
            else ": set [noise] theta_sd_deg"
        ),
    )


def _tall(
    free: Float[np.ndarray, " n"],
    predicted: Float[np.ndarray, " n"],
    is_counted: bool,
) -> Violation:
    """Scatter where heights are tall: noise in proportion to them, if none counts."""
    p_value, _ = _scatter_follows(free, predicted**2)
    return Violation(
        code=PROPORTIONAL,
        p_value=p_value,
        text="tall heights scatter more than low ones, also beside the part in "
        "proportion that [noise] height_share has: compare by `pushfit compare`"
        if is_counted
        else "tall heights scatter more than low ones: set [noise] height_share = "
        '"estimate", or compare by `pushfit compare`',
    )


def _repeat_by_repeat(table: PeakTable) -> Violation:
    """Repeats that differ as a whole, by an offset or by a gain."""
    kind, p_value = repeat_effect(table)
    return Violation(
        code=f"looks_like_{kind}s",
        p_value=p_value,
        text=f"whole repeats differ, as by {ARTICLES[kind]} {kind} of their own: set "
        f'[noise] repeats = "{kind}", or "auto", which asks them',
    )


def _heavy_tailed(free: Float[np.ndarray, " n"]) -> Violation | None:
    """Kurtosis beyond that of normal noise."""
    if free.size < MIN_FOR_KURTOSIS:
        return None
    statistic = scipy.stats.kurtosistest(free, alternative="greater")
    return Violation(
        code=HEAVY_TAILED,
        p_value=float(statistic.pvalue),
        text="a few residuals are far larger than the rest: set [noise] likelihood = "
        '"student_t", or "auto", which asks the evidence',
    )


def _scatter_follows(
    free: Float[np.ndarray, " n"], size: Float[np.ndarray, " n"]
) -> tuple[float, float]:
    """Chance that squared residuals rise with a size by so much, and their slope.

    Studentised, so that heavy tails are not taken for scatter that follows a size.
    """
    squares, centred = free**2, size - np.mean(size)
    spread = float(centred @ centred)
    if spread <= ROUNDING * float(size @ size):
        return np.nan, 0.0
    slope = float(centred @ squares) / spread
    deviation = squares - np.mean(squares)
    z = slope * np.sqrt(spread * free.size / float(deviation @ deviation))
    return float(scipy.stats.norm.sf(z)), slope
