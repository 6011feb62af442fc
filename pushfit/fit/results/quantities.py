"""What may be said of one quantity, and the words for it.

Excluded: which verdict it gets (`pushfit.fit.assess.verdicts`).
"""

import enum
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Piece = tuple[float | None, float | None]


class Verdict(enum.Enum):
    """What may be said of a quantity; the value is the word in every output."""

    DETERMINED = "determined"
    WIDE = "wide"
    ONE_SIDED = "one_sided"
    SEVERAL_MODES = "several_modes"
    NOT_DETERMINED = "not_determined"
    ABSENT = "does_not_exist"
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
        "the solver stopped at its step limit; look for a height or a direction that "
        "is wrong, state a number for a preload or a sharpness that is estimated, or "
        "push at more angles"
    )
    NOT_CONVERGED = (
        "the posterior has not converged; push at more angles, or state a number or a "
        "narrower prior for a parameter"
    )


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
    """Profile likelihood of one quantity and its set at one probability.

    Args:
        name: Name of the quantity.
        unit: Unit of the values.
        values: Grid of the quantity, ascending.
        delta_chi_square: -2 ln of the likelihood ratio at each value.
        pieces: The set at `prob`, ascending and disjoint; None for an open end.
        prob: Probability of the set.
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
