"""Records of what an identification found: one per question, each with its status.

Numbers are in the unit that the record names; unknown is None or NaN, never 0. Nothing
here computes more than O(p²) algebra, and nothing is imported from the estimators.
"""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable

# Residuals that count as outliers; one normal height in 1.7 million is farther [sd].
OUTLIER_SIGMA = 5.0

Piece = tuple[float | None, float | None]


class Verdict(enum.Enum):
    """What may be said of a quantity; the value is the word in every output."""

    DETERMINED = "determined"
    WIDE = "wide"
    ONE_SIDED = "one_sided"
    SEVERAL_MODES = "several_modes"
    NOT_DETERMINED = "not_determined"
    LEARNED = "learned"
    PARTLY = "partly"
    ASSUMED = "assumed"
    FIXED = "fixed"
    PROVISIONAL = "provisional"
    UNKNOWN = "unknown"


class FitStatus(enum.Enum):
    """How an estimate ended; the value is the sentence shown to the user."""

    OK = "ok"
    NO_FINITE_START = "no start gave finite residuals; check the heights and the config"
    MAX_STEPS = (
        "the solver stopped at its step limit; state a number for a preload or a "
        "sharpness that is estimated, or push at more angles"
    )
    NOT_CONVERGED = "the posterior has not converged; try another engine"


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultWarning:
    """A warning that travels with the result.

    Args:
        code: Stable snake_case word.
        text: Sentence for the user.
    """

    code: str
    text: str


Notice = ResultWarning
"""Former name of `ResultWarning`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One number with everything that may honestly be said of it.

    Args:
        name: Stable name, as in `summary.json`.
        unit: Unit of every number below.
        estimate: Posterior median (circular for an axis); None if not to be quoted.
        interval: Equal-tailed credible interval; None if not to be quoted.
        prob: Probability of the interval and the sets.
        sets: Highest-density posterior set, piece by piece; None for an open end.
        likelihood_sets: The same from the profile likelihood, without the prior.
        verdict: What may be said.
        contraction: 1 - var_posterior / var_prior, on the scale of the prior (logs
            for positive parameters); None where there is no proper prior variance.
        note: Formula, prior or reason, in a few words.
    """

    name: str
    unit: str
    estimate: float | None
    interval: tuple[float, float] | None
    prob: float
    sets: tuple[Piece, ...]
    likelihood_sets: tuple[Piece, ...]
    verdict: Verdict
    contraction: float | None
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LikelihoodProfile:
    """Profile likelihood of one quantity and its set at one level.

    Args:
        name: Name of the quantity.
        unit: Unit of the values.
        values: Grid of the quantity, ascending.
        delta_chi_square: -2 ln of the likelihood ratio at each value.
        pieces: The set at `prob`, ascending and disjoint; None for an open end.
        prob: Level of the set.
        verdict: Shape of the set in a word.
        degrees_of_freedom: Of the estimate of sigma behind Δχ², which sets the
            threshold; infinite where sigma is known.
    """

    name: str
    unit: str
    values: Float[np.ndarray, " g"]
    delta_chi_square: Float[np.ndarray, " g"]
    pieces: tuple[Piece, ...]
    prob: float
    verdict: Verdict
    degrees_of_freedom: float = math.inf


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


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorResult:
    """Draws from the posterior and how far they may be trusted.

    Args:
        samples: Draws by name: the six parameters, e1, e2, F_0, p, sigma_<channel>, A,
            B, f1, f2, theta_c [deg], alpha_star [deg].
        prior_samples: Draws from the prior, same names.
        log_prob: Unnormalised log posterior of each draw.
        chain: Fitting coordinates (n_ensembles, n_steps, n_walkers, n_coordinates) of
            an emcee run, thinned; None for the sweep.
        chain_names: Names of the last axis of `chain`.
        thin: Steps between kept states of `chain`.
        engine: "sweep" or "emcee".
        diagnostics: Convergence checks of a chain; None for the sweep.
        log_evidence: Log marginal likelihood; None for emcee.
        log_evidence_error: Its standard error.
        seed: Seed of the draws.
        status: Whether intervals may be quoted.
        ess: Effective number of the weighted draws of the sweep; None for emcee.
        pareto_k: Shape of the tail of their weights, trusted up to 0.7; likewise.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Combination:
    """A direction in the logs of the parameters and how well the data fix it.

    Args:
        formula: The combination in symbols, for example "K_sn K_dn/(K_sn + K_dn)".
        singular_value: Of the data Jacobian along it; its inverse is a relative sd.
        is_determined: Whether the data fix it to better than its prior.
    """

    formula: str
    singular_value: float
    is_determined: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifiabilityResult:
    """What the data can and cannot tell, and what would help.

    Args:
        combinations: Directions in parameter space, best determined first.
        rank: Number of directions that the data fix.
        n_parameters: Number of free parameters.
        advice: Sentences: one measurement each and what it would determine.
    """

    combinations: tuple[Combination, ...]
    rank: int
    n_parameters: int
    advice: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictiveCheck:
    """One feature of the residuals beside the same feature of simulated heights.

    Args:
        feature: "scatter", "largest" or "pattern".
        p_value: Share of posterior draws whose simulated heights show at least as much
            of it as the observed ones.
    """

    feature: str
    p_value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GoodnessOfFit:
    """Whether the model describes the data at all.

    Args:
        chi_square: At the best fit.
        degrees_of_freedom: Residuals minus coordinates.
        p_value: Of chi_square; None where sigma was estimated from the residuals.
        r_squared: Share of the heights' variance that the fit explains.
        lack_of_fit_p_value: F test of lack of fit against repeats; None without
            repeats.
        pattern_p_value: Test for residuals that follow neighbours in direction.
        outliers: Labels of pushes whose residual is beyond 5 sigma.
        is_adequate: False if the model does not describe the data.
        sentence: The verdict in words.
        predictive: Posterior predictive checks; empty where draws are not to be
            trusted.
    """

    chi_square: float
    degrees_of_freedom: int
    p_value: float | None
    r_squared: float
    lack_of_fit_p_value: float | None
    pattern_p_value: float | None
    outliers: tuple[str, ...]
    is_adequate: bool
    sentence: str
    predictive: tuple[PredictiveCheck, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Prediction along one sweep of directions, for figures.

    Args:
        channel: Channel predicted.
        swept: "theta" or "alpha".
        fixed_deg: The other angle [deg].
        angle_deg: Grid of the swept angle [deg].
        lower: Lower end of the credible band of the noise-free height [table unit].
        median: Its median.
        upper: Upper end.
        best_fit: Least-squares prediction.
        prob: Probability of the band.
        rows: Rows of the peak table that belong to the sweep.
    """

    channel: str
    swept: str
    fixed_deg: float
    angle_deg: Float[np.ndarray, " g"]
    lower: Float[np.ndarray, " g"]
    median: Float[np.ndarray, " g"]
    upper: Float[np.ndarray, " g"]
    best_fit: Float[np.ndarray, " g"]
    prob: float
    rows: tuple[int, ...]


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
    """

    mechanics: str
    theta_c: Quantity
    best_fit_deg: float | None
    chi_square: float
    log_evidence: float | None
    log_evidence_error: float | None


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


@dataclass(frozen=True, slots=True, kw_only=True)
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
