"""Everything that one table told.

Excluded: how it is shown (`pushfit.report.result`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.results.checks import Band, GoodnessOfFit, IdentifiabilityResult
from pushfit.fit.results.estimates import FitResult, PosteriorResult
from pushfit.fit.results.quantities import (
    FitStatus,
    LikelihoodProfile,
    Quantity,
    ResultWarning,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MechanicsAnswer:
    """What one of the mechanics says, to stand beside the other.

    Args:
        mechanics: Name of the mechanics, as `[grasp] mechanics` has it.
        theta_c: Critical angle [deg].
        best_fit_deg: θ_c of the best fit; None where the contact never rolls [deg].
        chi_square: Of the best fit.
        log_evidence: Log marginal likelihood; None where it is not known, or is not of
            the same pushes and noise as that of the leading mechanics.
        log_evidence_error: Its standard error.
        rms_residual: Root mean square of heights less those of the best fit, whatever
            noise they have by it; None in results of earlier versions [height unit].
    """

    mechanics: str
    theta_c: Quantity
    best_fit_deg: float | None
    chi_square: float
    log_evidence: float | None
    log_evidence_error: float | None
    rms_residual: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe:
    """Which files became the table: with seed and engine, how to do it again.

    Args:
        config: The configuration as it was given, plain values by section and key.
        recordings: Recordings, as the user named them.
        schedules: Their schedules in the same order; none where recordings have angles.
        table: Table of peak heights, where there were no recordings.
    """

    config: Mapping[str, Any]
    recordings: tuple[str, ...] = ()
    schedules: tuple[str, ...] = ()
    table: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identification:
    """Everything one table told: the input of every report.

    Args:
        table: The peak heights.
        used: Rows that entered the fit.
        config: The configuration in force: what "auto" came to is in it.
        fit: Least squares.
        posterior: Posterior draws.
        by_mechanics: Answers by all mechanics that the table was identified by; the
            first one leads, and everything else here is by it.
        theta_c: Critical angle at `reference_alpha_deg` [deg].
        reference_alpha_deg: Azimuth at which θ_c is quoted [deg].
        alpha_star: Best push direction [deg].
        alpha_star_model_free: The same from a cosine fit to the heights; None without
            an azimuth sweep.
        parameters: The six parameters, e1, e2, F_0, p and sigma, as far as they exist.
        combinations: A, B and the other combinations that the data meet.
        profiles: Likelihood profiles by quantity name.
        identifiability: What the data can tell.
        goodness_of_fit: Whether the model describes the data.
        bands: Predictions along the sweeps in the table.
        warnings: Everything the user should know before quoting a number.
        status: Whether the numerics are to be trusted.
        seed: Seed of every random number.
        versions: Versions of pushfit, of Python and of the packages that computed, and
            the platform.
        recipe: Files behind the table; None where it was made in Python.
    """

    table: PeakTable
    used: Bool[np.ndarray, " n"]
    config: GraspConfig
    fit: FitResult
    posterior: PosteriorResult
    by_mechanics: tuple[MechanicsAnswer, ...]
    theta_c: Quantity
    reference_alpha_deg: float
    alpha_star: Quantity
    alpha_star_model_free: Quantity | None
    parameters: tuple[Quantity, ...]
    combinations: tuple[Quantity, ...]
    profiles: Mapping[str, LikelihoodProfile]
    identifiability: IdentifiabilityResult
    goodness_of_fit: GoodnessOfFit
    bands: tuple[Band, ...]
    warnings: tuple[ResultWarning, ...]
    status: FitStatus
    seed: int
    versions: Mapping[str, str]
    recipe: Recipe | None = None

    @property
    def mechanics(self) -> str:
        """The mechanics by which everything here was found."""
        return self.by_mechanics[0].mechanics
