"""An exploration at one moment, for a picture.

Excluded: the picture (`pushfit.report.figures.exploration`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from pushfit.explore.belief.belief import Belief
from pushfit.explore.decide.intervals import AskedAngle
from pushfit.explore.decide.next_push import Survey
from pushfit.explore.records import State, Suggestion, ToldPush


@dataclass(frozen=True, slots=True, kw_only=True)
class Overview:
    """What is known, what pushes would tell, and how it went.

    Args:
        angle: The first asked angle that is undecided, or else the first one.
        targets: The asked angles as they are believed, by name.
        belief: Draws of the angles and their weights.
        survey: Every push that could be made, with all gains to the last digit.
        state: Where the exploration stands.
        course: Where it stood after each push.
        told: Pushes that were made.
        suggestions: Pushes to make, the best first.
    """

    angle: str
    targets: Mapping[str, AskedAngle]
    belief: Belief
    survey: Survey
    state: State
    course: tuple[State, ...]
    told: tuple[ToldPush, ...]
    suggestions: tuple[Suggestion, ...]
