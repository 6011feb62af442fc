"""Which measurement would tell more: one sentence each.

The next push is chosen by the posterior itself: among candidate directions, the one
whose height, if it were measured, would explain most of the variance of the asked
quantity (linear Bayes).
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.bands import predicted_heights
from pushfit.fit.problem import Problem
from pushfit.fit.results import Verdict
from pushfit.model import Pushes

# A push that would remove less of the variance than this is not worth recommending.
WORTHWHILE = 0.1
ELEVATIONS_DEG = np.arange(-75.0, 86.0, 5.0)
AZIMUTH_STEP_DEG = 15.0


def next_push(
    problem: Problem,
    table: PeakTable,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    *,
    quantity: str,
    reference_alpha: float,
    reach: tuple[float, float],
) -> str | None:
    """The push that would tell most about a quantity.

        gain = cov(height, quantity)² / (var(height) + sigma²) / var(quantity)

    Args:
        problem: Problem.
        table: Its peak heights.
        samples: Posterior draws.
        quantity: "theta_c" or "alpha_star".
        reference_alpha: Azimuth at which θ_c is asked for [rad].
        reach: Reachable azimuths [rad].

    Returns:
        A sentence; None where no single push would help much.
    """
    candidates = _candidates(table, quantity, reference_alpha, reach)
    index, heights = predicted_heights(problem, samples, candidates)
    values = samples[quantity][index]
    if quantity == "alpha_star":
        # Of an axis the doubled sine about the circular mean behaves linearly.
        doubled = np.exp(2j * np.radians(values))
        values = np.imag(doubled * np.conj(doubled.mean()))
    is_finite = np.isfinite(values)
    if is_finite.sum() < 10 or np.ptp(values[is_finite]) == 0:
        return None
    values = values[is_finite] - values[is_finite].mean()
    centred = heights[is_finite] - heights[is_finite].mean(axis=0)
    mask = np.asarray(problem.mask)
    sigma = np.average(np.asarray(problem.reference_sigma), axis=1, weights=mask)
    covariance = np.einsum("m,mcg->cg", values, centred) / values.size
    scatter = centred.var(axis=0) + sigma[:, None] ** 2
    # The channel that tells most of the quantity speaks for the push.
    gain = np.max(covariance**2 / scatter, axis=0) / values.var()
    best = int(np.argmax(gain))
    if gain[best] < WORTHWHILE:
        return None
    theta, alpha = (
        np.degrees(candidates.theta[best]),
        np.degrees(candidates.alpha[best]),
    )
    symbol = {"theta_c": "θ_c", "alpha_star": "α*"}[quantity]
    return (
        f"One more push at θ = {theta:.0f}°, α = {alpha:.0f}° would remove about "
        f"{gain[best]:.0%} of the variance of {symbol}."
    )


def _candidates(
    table: PeakTable, quantity: str, reference_alpha: float, reach: tuple[float, float]
) -> Pushes:
    """Directions a finger could push in, given those it has pushed in."""
    if quantity == "alpha_star":
        n = int(np.ceil(np.degrees(reach[1] - reach[0]) / AZIMUTH_STEP_DEG)) + 1
        alpha = np.linspace(*reach, n)
        used = np.abs(table.theta[table.is_used])
        return Pushes(np.full(n, np.median(used)), alpha)
    lowest = 5.0 if np.min(table.theta) >= 0 else np.degrees(np.min(table.theta))
    theta = ELEVATIONS_DEG[ELEVATIONS_DEG >= lowest - 1e-9]
    return Pushes(np.radians(theta), np.full(theta.size, reference_alpha))


def measurements(
    problem: Problem,
    *,
    verdicts: Mapping[str, Verdict],
    is_calibrated: bool,
    has_direction: bool,
) -> tuple[str, ...]:
    """What other measurements would determine.

    Args:
        problem: Problem.
        verdicts: Verdict of each reported quantity.
        is_calibrated: Whether heights convert to newtons.
        has_direction: Whether several azimuths were pushed.

    Returns:
        Sentences, the most useful first.
    """
    free = set(problem.priors)
    sentences = []
    if not has_direction:
        sentences.append(
            "All pushes share one azimuth, so α* was not asked; push in at least three "
            "azimuths at one elevation."
        )
    unclear = verdicts.get("theta_c") is not Verdict.DETERMINED
    if unclear and problem.channels == ("height",):
        sentences.append(
            "A magnitude sees the tangential force only in quadrature; normal and "
            "tangential components (height_normal, height_tangential) determine θ_c "
            "far better."
        )
    if {"K_sn", "K_dn"} <= free:
        sentences.append(
            "The data fix A = K_sn K_dn/(K_sn + K_dn) only; with K_sn from the finger "
            "controller, K_dn = A K_sn/(K_sn - A) follows."
        )
    tangential = {"K_st", "C_d", "L"} & free
    if len(tangential) > 1:
        # Where the object tilts, forces tell K_st and C_d apart, if hardly.
        extent = "best" if problem.grasp.mechanics == "tilting" else "only"
        sentences.append(
            f"The data fix B = K_st C_d/(L² K_st + C_d) {extent}; with L by callipers "
            "and K_st from the finger controller, C_d follows."
        )
    if not is_calibrated:
        sentences.append(
            "A calibrated sensor ([sensor] counts_per_n, n_per_kpa, ...) would give "
            "stiffness in N/m; θ_c, α* and C_rr need no calibration."
        )
    return tuple(sentences)
