"""Records of what an identification found: one per question, each with its status.

Numbers are in the unit that the record names; unknown is None or NaN, never 0. Nothing
here computes more than O(p²) algebra, and nothing is imported from the estimators.
"""

from pushfit.fit.results.checks import OUTLIER_SIGMA as OUTLIER_SIGMA
from pushfit.fit.results.checks import Band as Band
from pushfit.fit.results.checks import Combination as Combination
from pushfit.fit.results.checks import GoodnessOfFit as GoodnessOfFit
from pushfit.fit.results.checks import IdentifiabilityResult as IdentifiabilityResult
from pushfit.fit.results.checks import PredictiveCheck as PredictiveCheck
from pushfit.fit.results.estimates import Diagnostics as Diagnostics
from pushfit.fit.results.estimates import FitResult as FitResult
from pushfit.fit.results.estimates import Mode as Mode
from pushfit.fit.results.estimates import PosteriorResult as PosteriorResult
from pushfit.fit.results.identification import Identification as Identification
from pushfit.fit.results.identification import MechanicsAnswer as MechanicsAnswer
from pushfit.fit.results.identification import Recipe as Recipe
from pushfit.fit.results.quantities import FitStatus as FitStatus
from pushfit.fit.results.quantities import LikelihoodProfile as LikelihoodProfile
from pushfit.fit.results.quantities import Notice as Notice
from pushfit.fit.results.quantities import Piece as Piece
from pushfit.fit.results.quantities import Quantity as Quantity
from pushfit.fit.results.quantities import ResultWarning as ResultWarning
from pushfit.fit.results.quantities import Verdict as Verdict
