"""What an exploration says: suggested pushes, its state, and the pushes told.

Excluded: the belief behind a suggestion (`pushfit.explore.belief.belief`).
"""

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pushfit.data.tables.rules import EXCLUDING_FLAGS

Interval = tuple[float, float]


def direction_words(theta: float, alpha: float) -> str:
    """A direction in words, from radians."""
    return f"θ = {np.degrees(theta):.1f}°, α = {np.degrees(alpha):.1f}°"


class Answer(enum.Enum):
    """Whether one angle is known well enough, and if not, why."""

    DECIDING = "deciding"
    DECIDED = "decided"
    CANNOT = "cannot"
    UNLIKELY = "unlikely"
    OUT_OF_BUDGET = "out_of_budget"
    STOPPED = "stopped"


# Answers that rest on all heights told.
FINDINGS = (Answer.DECIDED, Answer.CANNOT, Answer.UNLIKELY)


class Purpose(enum.Enum):
    """Why a push is suggested; the value is the word in journals."""

    GAIN = "gain"
    REFERENCE = "reference"
    PROBE = "probe"


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggestion:
    """A push to make.

    Args:
        number: Its place among the pushes told and failed, from 1; None for those not
            first in rank.
        theta: Elevation [rad].
        alpha: Azimuth [rad].
        length_share: Length, as a share of the push length; below 1 while longer
            pushes might exceed the force limit.
        purpose: Why it is suggested.
        gain: Expected information about the asked angles [nat].
        expected_width: Mean width of the interval after it, of the first angle that
            is undecided; infinite where none may be left [deg].
        p_decided: Probability that this interval is then narrow enough.
        force_q99: Force that it exceeds with 1 % probability, preload included [N, or
            the unit of uncalibrated heights].
    """

    number: int | None
    theta: float
    alpha: float
    length_share: float
    purpose: Purpose
    gain: float
    expected_width: float
    p_decided: float
    force_q99: float

    @property
    def theta_deg(self) -> float:
        """Elevation [deg]."""
        return float(np.degrees(self.theta))

    @property
    def alpha_deg(self) -> float:
        """Azimuth [deg]."""
        return float(np.degrees(self.alpha))

    def describe(self) -> str:
        """The push in words."""
        return direction_words(self.theta, self.alpha)


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """Where an exploration stands.

    Args:
        answer: Whether there is an answer, or why there is none.
        sentence: The same for the user.
        intervals: Shortest posterior interval of every asked angle [deg]; None where
            none has the probability asked for.
        p_unlimited: Probability to decide with unlimited pushes; None where those that
            are left have a chance, or before a forecast may end anything.
        p_budget: The same with the pushes that are left; None where not forecast.
        n_pushes: Pushes told, attached ones included.
        n_left: Pushes that budget and limits leave.
    """

    answer: Answer
    sentence: str
    intervals: Mapping[str, Interval | None]
    p_unlimited: float | None
    p_budget: float | None
    n_pushes: int
    n_left: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ToldPush:
    """A push that was made, as it was made.

    Args:
        theta: Elevation reached [rad].
        alpha: Azimuth reached [rad].
        heights: Height by channel [table unit].
        sd: Standard deviation by channel; None where none was stated [table unit].
        length_share: Length reached, as a share of the push length.
        flags: Words of the peak extraction, joined by ";".
        is_attached: Whether it was made before this exploration.
        purpose: Why it was asked for; None where nobody had asked.
    """

    theta: float
    alpha: float
    heights: Mapping[str, float]
    sd: Mapping[str, float] | None
    length_share: float = 1.0
    flags: str = ""
    is_attached: bool = False
    purpose: str | None = None

    @property
    def is_short(self) -> bool:
        """Whether it was a probe of the force, shorter than the pushes of a table."""
        return self.length_share < 1.0

    @property
    def is_left_out(self) -> bool:
        """Whether a flag says that its height is no evidence."""
        return bool(EXCLUDING_FLAGS & set(self.flags.split(";")))

    @property
    def counts(self) -> bool:
        """Whether a fit has it: a whole push, and not left out."""
        return not (self.is_short or self.is_left_out)

    def flagged(self, word: str) -> "ToldPush":
        """The same with one flag more."""
        return replace(self, flags=";".join(filter(None, (self.flags, word))))


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """A push that gave no height.

    Args:
        theta: Elevation asked for [rad].
        alpha: Azimuth asked for [rad].
        reason: Stable word, such as "stalled".
        is_final: Whether it is never to be asked again.
    """

    theta: float
    alpha: float
    reason: str
    is_final: bool = field(default=False)
