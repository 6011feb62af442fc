"""What was computed: least squares, and draws from the posterior.

Excluded: how (`pushfit.fit.profiles`, `pushfit.fit.sweep`, `pushfit.fit.sampler`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from pushfit.fit.results.quantities import FitStatus


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """One local optimum of the likelihood.

    Args:
        coordinates: Names and values of the data coordinates (logs of A, B, C_rr ...).
        theta_c_deg: Critical angle there, at the reference azimuth; None: never rolls.
        chi_square: Sum of squared weighted residuals there.
    """

    coordinates: Mapping[str, float]
    theta_c_deg: float | None
    chi_square: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FitResult:
    """A least-squares estimate, all modes kept.

    Args:
        names: Names of the data coordinates, in the order of the arrays below.
        estimate: Best fit in these coordinates.
        covariance: (JᵀJ)⁻¹ of the weighted residuals at the best fit; NaN where the
            Jacobian does not determine every coordinate, and where θ_c sits on a pushed
            elevation: on that kink of a hard transition χ² is no parabola.
        jacobian: Weighted residuals against coordinates at the best fit; by tilting
            mechanics with a row each for what is known beforehand of s and L.
        singular_values: Of the Jacobian, descending: as many as data or coordinates.
        modes: Every local optimum found, best first.
        chi_square: Sum of squared weighted residuals at the best fit.
        n_data: Number of data.
        n_free: Number of data coordinates that only the data hold.
        sigma: Noise standard deviation assumed for each residual [table unit].
        predicted: Best-fit value of each residual's datum, with what it has in common
            with others [table unit].
        channel: Channel of each residual.
        row: Row of the peak table of each residual.
        status: Why the estimate ended.
    """

    names: tuple[str, ...]
    estimate: Float[np.ndarray, " p"]
    covariance: Float[np.ndarray, "p p"]
    jacobian: Float[np.ndarray, "m p"]
    singular_values: Float[np.ndarray, " k"]
    modes: tuple[Mode, ...]
    chi_square: float
    n_data: int
    n_free: int
    sigma: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, " n"]
    channel: tuple[str, ...]
    row: tuple[int, ...]
    status: FitStatus

    @property
    def standard_error(self) -> Float[np.ndarray, " p"]:
        """One-sigma uncertainty of each coordinate, the others left free."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def degrees_of_freedom(self) -> int:
        """Data minus data coordinates that only they hold."""
        return self.n_data - self.n_free


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """Whether a chain may be believed.

    Args:
        autocorr_time: Integrated autocorrelation time of each name [steps].
        ess: Effective sample size of each name, over all ensembles.
        rhat: Nested R-hat of each name across independent ensembles.
        acceptance_fraction: Per ensemble and walker.
        n_steps: Steps kept per walker.
        n_ensembles: Independent ensembles.
        n_walkers: Walkers per ensemble.
        problems: Sentences, one per failed check; empty means converged.
    """

    autocorr_time: Mapping[str, float]
    ess: Mapping[str, float]
    rhat: Mapping[str, float]
    acceptance_fraction: Float[np.ndarray, "e w"]
    n_steps: int
    n_ensembles: int
    n_walkers: int
    problems: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class PosteriorResult:
    """Draws from the posterior and how far they may be trusted.

    They are put in order once, when quantiles are first asked for, so it has no slots.

    Args:
        samples: Draws by name: the six parameters, e1, e2, F_0, p, sigma_<channel>, A,
            B, f1, f2, theta_c [deg], alpha_star [deg].
        prior_samples: Draws from the prior, same names.
        log_prob: Unnormalised log posterior of each draw.
        chain: Sampling coordinates (n_ensembles, n_steps, n_walkers, n_coordinates) of
            an emcee run, thinned; None for the sweep.
        chain_names: Names of the last axis of `chain`.
        thin: Steps between kept states of `chain`.
        engine: "sweep" or "emcee".
        diagnostics: Convergence checks of a chain; None for the sweep.
        log_evidence: Log marginal likelihood; None for emcee.
        log_evidence_error: Its standard error.
        seed: Seed of the draws.
        status: Whether intervals may be quoted.
        ess: Effective number of the weighted draws of the sweep, also where it handed
            over to emcee; None where emcee alone was asked.
        pareto_k: Shape of the tail of their weights, trusted up to `MAX_PARETO_K` of
            `pushfit.fit.sweep.posterior`; likewise.
    """

    samples: Mapping[str, Float[np.ndarray, " n"]]
    prior_samples: Mapping[str, Float[np.ndarray, " m"]]
    log_prob: Float[np.ndarray, " n"]
    chain: Float[np.ndarray, "e t w p"] | None
    chain_names: tuple[str, ...]
    thin: int
    engine: str
    diagnostics: Diagnostics | None
    log_evidence: float | None
    log_evidence_error: float | None
    seed: int
    status: FitStatus
    ess: float | None = None
    pareto_k: float | None = None

    @cached_property
    def ordered(self) -> Mapping[str, Float[np.ndarray, " _"]]:
        """Draws of every name in ascending order, NaN left out."""
        return {n: np.sort(v[np.isfinite(v)]) for n, v in self.samples.items()}
