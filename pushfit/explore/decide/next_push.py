"""What a belief says of every push that could be made next.

Screens candidates by the limits and ranks them by expected information gain. Excluded:
the course of an exploration (`pushfit.explore.explorer`).
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.explore.belief.belief import Belief, Question
from pushfit.explore.belief.predict import Predicted, predict, weighted_quantile
from pushfit.explore.decide.gain import Outlook, information_gain, outlook
from pushfit.explore.decide.intervals import AskedAngle
from pushfit.explore.limits import SHARES, TOLERATED, Limits
from pushfit.explore.records import Purpose, Suggestion, ToldPush

# More candidates than this are first ranked by few draws, and so many of them again.
# By half as many draws the best push about both angles was left out before the first.
N_FULL, N_COARSE_DRAWS = 20, 2048
Direction = tuple[float, float]
# Begins the reason why a push that is too strong is not asked for.
FORCE = "might exceed the force limit"


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """Candidates with what they would tell.

    Args:
        theta: Elevations [rad].
        alpha: Azimuths [rad].
        length_share: Length of the pushes, as a share of the push length.
        predicted: Their heights and forces, by every draw.
        is_allowed: Whether each may be asked for.
        gains: Expected information about the asked angles; 0 where not allowed [nat].
        refusals: How many candidates each reason rules out.
        least_limit: Where none is allowed, the force limit that would allow one; None
            where none would [N, or the unit of uncalibrated heights].
    """

    theta: Float[np.ndarray, " k"]
    alpha: Float[np.ndarray, " k"]
    length_share: float
    predicted: Predicted
    is_allowed: Bool[np.ndarray, " k"]
    gains: Float[np.ndarray, " k"]
    refusals: Mapping[str, int]
    least_limit: float | None

    @property
    def why_none(self) -> str:
        """Why no candidate is allowed, and what would allow one, as a clause."""
        why = "; ".join(f"{k} candidates {name}" for name, k in self.refusals.items())
        step = "widen them"
        if self.least_limit is not None:
            step = (
                f"give a force limit of {_rounded_up(self.least_limit)} or more, for "
                f"pushes of {self.length_share:.0%} of the length"
            )
        return f"no push is within the limits: {why}; {step}"

    @property
    def ranks(self) -> Int[np.ndarray, " m"]:
        """Allowed candidates, the most telling first."""
        order = np.argsort(-self.gains, kind="stable")
        return order[self.is_allowed[order]]

    def ranked(self, *, after: Collection[Direction]) -> Int[np.ndarray, " m"]:
        """The same, but for some directions that come last [rad]."""
        rows = self.ranks
        directions = np.stack([self.theta[rows], self.alpha[rows]], axis=1)
        return rows[np.argsort(are_among(directions, after), kind="stable")]


class Surveyor:
    """Surveys beliefs of one exploration; predictions are kept while draws stay."""

    def __init__(self, question: Question, limits: Limits) -> None:
        """Lay out the candidates."""
        self.question, self.limits = question, limits
        self._azimuths = limits.azimuths(question.config)
        self._samples: object = None
        self._predicted: dict[float, Predicted] = {}

    def survey(
        self,
        belief: Belief,
        *,
        undecided: Collection[str],
        abandoned: Collection[Direction] = (),
        is_full: bool = False,
    ) -> Survey:
        """What candidates would tell at the greatest length that is safe, if one is.

        Args:
            abandoned: Directions never to be asked again [rad].
            is_full: Whether gains of all candidates are wanted to the last digit, as
                for a picture.
        """
        directions = self.limits.candidates(
            azimuths=self._azimuths if "alpha_star" in belief.samples else None,
            reference_alpha=self.question.reference_alpha,
        )
        theta, alpha = directions.T
        for share in SHARES:
            predicted = self._predict(belief, theta, alpha, share=share)
            refused = self._screen(
                belief, directions, predicted, share=share, abandoned=abandoned
            )
            is_allowed = ~np.any(list(refused.values()), axis=0)
            if np.any(is_allowed):
                break
        gains = np.zeros(theta.size)
        rows = np.flatnonzero(is_allowed)
        if rows.size:
            heights = predicted.heights
            # A copy only where it must be: it may be tens of megabytes.
            heights = heights if np.all(is_allowed) else heights[rows]
            gains[rows] = _gains(belief, heights, undecided, is_full=is_full)
        return Survey(
            theta=theta,
            alpha=alpha,
            length_share=share,
            predicted=predicted,
            is_allowed=is_allowed,
            gains=gains,
            refusals={why: int(np.sum(m)) for why, m in refused.items() if np.any(m)},
            least_limit=None
            if rows.size
            else _least_limit(predicted, belief.weights, refused),
        )

    def allows(self, belief: Belief, theta: float, alpha: float) -> bool:
        """Whether a push of full length may be made, whatever its force [rad]."""
        length = float(belief.grasp.push_length)
        return self.limits.allow(theta, alpha, length=length, azimuths=self._azimuths)

    def _predict(
        self,
        belief: Belief,
        theta: Float[np.ndarray, " k"],
        alpha: Float[np.ndarray, " k"],
        *,
        share: float,
    ) -> Predicted:
        """Predictions of the candidates, kept for as long as draws are the same."""
        if belief.samples is not self._samples:
            self._samples, self._predicted = belief.samples, {}
        if share not in self._predicted:
            self._predicted[share] = predict(belief, theta, alpha, length_share=share)
        return self._predicted[share]

    def _screen(
        self,
        belief: Belief,
        directions: Float[np.ndarray, "k 2"],
        predicted: Predicted,
        *,
        share: float,
        abandoned: Collection[Direction],
    ) -> dict[str, Bool[np.ndarray, " k"]]:
        """Which candidates each reason rules out."""
        weights, nowhere = belief.weights, np.zeros(len(directions), dtype=bool)
        lifts_off, is_strong = nowhere, nowhere
        if not np.all(predicted.in_contact):
            lifts_off = (~predicted.in_contact) @ weights > TOLERATED
        limits, limit = self.limits, self.limits.force
        if limit is not None:
            is_strong = (predicted.force > limit) @ weights > TOLERATED
        first, last = np.degrees(self._azimuths)
        length = share * float(belief.grasp.push_length)
        return {
            f"beyond the azimuths {first:g}° to {last:g}° of the reach": ~limits.reach(
                directions, azimuths=self._azimuths
            ),
            "out of the workspace": ~limits.holds(directions, length=length),
            "might lift the finger off": lifts_off,
            f"{FORCE} of {limit or 0:g}": is_strong,
            "abandoned": are_among(directions, abandoned),
        }


def suggestion(
    belief: Belief, survey: Survey, row: int, *, target: AskedAngle
) -> Suggestion:
    """One candidate with its outlook."""
    is_whole = survey.length_share == 1.0
    heights = survey.predicted.heights[row]
    expected = Outlook(expected_width=np.inf, p_decided=0.0)
    if belief.is_described:
        expected = outlook(heights, target, weights=belief.weights, sigma=belief.sigma)
    return Suggestion(
        number=None,
        theta=float(survey.theta[row]),
        alpha=float(survey.alpha[row]),
        length_share=survey.length_share,
        purpose=Purpose.GAIN if is_whole else Purpose.PROBE,
        gain=float(survey.gains[row]),
        expected_width=expected.expected_width,
        p_decided=expected.p_decided,
        force_q99=_q99(survey.predicted.force[row], belief.weights),
    )


def repetition(
    belief: Belief, survey: Survey, push: ToldPush, *, target: AskedAngle, exactly: bool
) -> Suggestion:
    """A push made once more, to see whether it gives the same.

    Args:
        exactly: Whether in its own direction, or in the nearest that may be asked for,
            as where the finger went too far.
    """
    if not exactly:
        rows = survey.ranks
        off = np.hypot(survey.theta[rows] - push.theta, survey.alpha[rows] - push.alpha)
        nearest = suggestion(belief, survey, int(rows[np.argmin(off)]), target=target)
        return replace(nearest, purpose=Purpose.REFERENCE)
    theta, alpha = np.array([push.theta]), np.array([push.alpha])
    found = predict(belief, theta, alpha)
    gains = information_gain(
        found.heights, [target.values], belief.weights, sigma=belief.sigma
    )
    alone = replace(
        survey,
        theta=theta,
        alpha=alpha,
        predicted=found,
        is_allowed=np.array([True]),
        gains=gains,
    )
    return replace(
        suggestion(belief, alone, 0, target=target), purpose=Purpose.REFERENCE
    )


def are_among(
    directions: Float[np.ndarray, "k 2"], some: Collection[Direction]
) -> Bool[np.ndarray, " k"]:
    """Which directions are one of some, to a thousandth of a degree."""
    off = np.abs(directions[:, None] - np.reshape(list(some), (1, -1, 2)))
    return np.any(np.all(off < np.radians(1e-3), axis=2), axis=1)


def _gains(
    belief: Belief,
    heights: Float[np.ndarray, "k c n"],
    undecided: Collection[str],
    *,
    is_full: bool,
) -> Float[np.ndarray, " k"]:
    """Sum of the gains about every undecided angle.

    With many candidates all get a gain from few draws, and the best ones a better one.
    """
    weights, sigma = belief.weights, belief.sigma
    angles = [belief.samples[name] for name in undecided]
    rows = np.arange(heights.shape[0])
    gains = np.zeros(rows.size)
    if rows.size > N_FULL and not is_full:
        ticks = (np.arange(N_COARSE_DRAWS) + 0.5) / N_COARSE_DRAWS
        few = np.searchsorted(np.cumsum(weights), ticks * weights.sum())
        gains = information_gain(
            heights.take(few, axis=2),
            [values[few] for values in angles],
            np.full(few.size, 1 / few.size),
            sigma=sigma,
            is_coarse=True,
        )
        rows = np.argsort(-gains, kind="stable")[:N_FULL]
        # Those left behind stay behind.
        gains = np.minimum(gains, np.sort(gains)[-N_FULL])
    fine = information_gain(heights[rows], angles, weights, sigma=sigma)
    floor = float(np.min(fine))
    gains = np.minimum(gains, floor)
    gains[rows] = fine
    return gains


def _q99(force: Float[np.ndarray, " n"], weights: Float[np.ndarray, " n"]) -> float:
    """Force that is exceeded with 1 % probability."""
    return weighted_quantile(force, weights, 1 - TOLERATED)


def _least_limit(
    predicted: Predicted,
    weights: Float[np.ndarray, " n"],
    refused: Mapping[str, Bool[np.ndarray, " k"]],
) -> float | None:
    """The least force limit under which a candidate would be allowed, if one would."""
    others = [which for why, which in refused.items() if not why.startswith(FORCE)]
    rows = np.flatnonzero(~np.any(others, axis=0))
    return min((_q99(predicted.force[row], weights) for row in rows), default=None)


def _rounded_up(value: float) -> str:
    """A positive number with two digits, and not below it."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit) * unit:.2g}"
