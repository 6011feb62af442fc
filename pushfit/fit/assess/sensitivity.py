"""What errors of the push angles would change, where nothing is said of them.

A height off by δ moves the posterior mean of a quantity q, to first order, by

    Cov(q, h) δ / σ²,

and an elevation off by its own error moves a height by the slope ∂h/∂θ. An arm misses
all repeats of a command alike, and directions add up in squares. The scatter of repeats
does not show such errors, nor does that of few heights about a fit; how much θ_c and α*
hang on them can be said all the same. Excluded: errors that a key states
(`pushfit.fit.profiles.angle_errors`).

References:
    Giordano, Broderick & Jordan (2018), J. Mach. Learn. Res. 19 (51), 1: covariances
    of a posterior are the derivatives of its means.
"""

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from pushfit.fit.problem.derived import unwrapped
from pushfit.fit.problem.predictions import predict_draws
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.angle_errors import COMMON_SD
from pushfit.fit.results import FitStatus, Identification, ResultWarning

# An error of this share of the posterior's own deviation beside it leaves intervals of
# 90 % that hold the truth 88 times in 100.
MATTERS = 1 / 3
# Draws that covariances are taken over.
N_SENSITIVITY_DRAWS = 1024


def angle_error_warnings(
    setup: Setup, found: Identification, slopes: Float[np.ndarray, "2 2 c m"]
) -> Iterator[ResultWarning]:
    """Say which quoted angles hang on joints that are as exact as no key says.

    Not where sigma is sampled: scatter about the fit holds what joints add.

    Args:
        slopes: Of the heights in θ and α at the best fit; see `angle_slopes`.
    """
    noise = found.config.noise
    stated = [noise.theta_sd_deg, noise.alpha_sd_deg]
    if np.isnan(noise.angle_sd[1]):
        stated[1] = stated[0]
    quoted = {"θ_c": found.theta_c, "α*": found.alpha_star}
    quoted = {s: q.name for s, q in quoted.items() if q.interval is not None}
    is_told = setup.noise.kind == "sampled" or None not in stated
    if is_told or not quoted or found.posterior.status is not FitStatus.OK:
        return
    draws = {name: found.posterior.samples[name] for name in quoted.values()}
    own = [float(np.std(_about_middle(values))) for values in draws.values()]
    shifts = angle_error_shifts(setup, found, slopes, names=tuple(quoted.values()))
    words = (("elevation", "theta_sd_deg"), ("azimuth", "alpha_sd_deg"))
    for (word, key), sd, by in zip(words, stated, shifts, strict=True):
        parts = [
            f"{symbol} by about {float(f'{shift:.1g}'):g}°"
            for symbol, shift, deviation in zip(quoted, by, own, strict=True)
            if shift > MATTERS * deviation
        ]
        if sd is None and parts:
            yield ResultWarning(
                code=f"{word}s_taken_as_exact",
                text=f"{word}s are taken as exact; errors of "
                f"{np.degrees(COMMON_SD):g}° would move {' and '.join(parts)}, which "
                f"intervals leave out: set [noise] {key}, with angle_errors = "
                '"shared" if repeats miss alike, or 0 if they are exact',
            )


def angle_error_shifts(
    setup: Setup,
    found: Identification,
    slopes: Float[np.ndarray, "2 2 c m"],
    *,
    names: tuple[str, ...],
) -> Float[np.ndarray, "2 q"]:
    """Standard deviations by which errors of θ, and of α, move posterior means [deg].

    Errors of a direction are those of all its repeats and channels.

    Args:
        slopes: As for `angle_error_warnings`.
        names: Of the quantities.
    """
    problem, n = setup.problem, found.posterior.log_prob.size
    rows = np.linspace(0, n - 1, min(n, N_SENSITIVITY_DRAWS)).astype(int)
    draws = {name: values[rows] for name, values in found.posterior.samples.items()}
    predicted = predict_draws(problem, draws, problem.angles).heights
    covariances = []
    for name in names:
        # A contact that never rolls has no θ_c.
        is_known = np.isfinite(draws[name])
        off = _about_middle(draws[name])
        covariances.append(np.tensordot(off, predicted[is_known], axes=1) / off.size)
    weight = np.where(problem.mask, np.asarray(problem.reference_sigma) ** -2.0, 0.0)
    mean_slopes = np.mean(slopes, axis=1)
    shifts = np.einsum("qcn,cn,acn->aqn", np.stack(covariances), weight, mean_slopes)
    _, direction = np.unique(problem.angles, axis=1, return_inverse=True)
    by_direction = shifts @ np.eye(direction.max() + 1)[direction]
    return COMMON_SD * np.sqrt(np.sum(by_direction**2, axis=2))


def _about_middle(degrees: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Angles of the draws that have one, about their mean [deg]."""
    _, off = unwrapped(degrees[np.isfinite(degrees)])
    return off - np.mean(off)
