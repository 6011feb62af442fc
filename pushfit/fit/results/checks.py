"""What the data can tell, and whether the model describes them.

Excluded: how that is judged (`pushfit.fit.assess`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Residuals that count as outliers; one normal height in 1.7 million is farther [sd].
OUTLIER_SIGMA = 5.0


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
        directions: In the logs of the parameters, best determined first.
        rank: Number of directions that the data fix.
        n_parameters: Number of free parameters.
        advice: Sentences: one measurement each and what it would determine.
    """

    directions: tuple[Combination, ...]
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
        outliers: Labels of pushes whose residual is beyond 5 sigma, and of the one that
            the others do not predict by their own scatter.
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
