"""Records of what an identification found: one per question, each with its status.

Numbers are in the unit that the record names; unknown is None or NaN, never 0. Nothing
here computes more than O(p²) algebra, and nothing is imported from the estimators.
"""

from pushfit.fit.results.checks import (
    OUTLIER_SIGMA,
    Band,
    Combination,
    GoodnessOfFit,
    IdentifiabilityResult,
    PredictiveCheck,
)
from pushfit.fit.results.estimates import Diagnostics, FitResult, Mode, PosteriorResult
from pushfit.fit.results.identification import Identification, MechanicsAnswer, Recipe
from pushfit.fit.results.quantities import (
    FitStatus,
    LikelihoodProfile,
    Notice,
    Piece,
    Quantity,
    ResultWarning,
    Verdict,
)

__all__ = [
    "OUTLIER_SIGMA",
    "Band",
    "Combination",
    "Diagnostics",
    "FitResult",
    "FitStatus",
    "GoodnessOfFit",
    "IdentifiabilityResult",
    "Identification",
    "LikelihoodProfile",
    "MechanicsAnswer",
    "Mode",
    "Notice",
    "Piece",
    "PosteriorResult",
    "PredictiveCheck",
    "Quantity",
    "Recipe",
    "ResultWarning",
    "Verdict",
]
