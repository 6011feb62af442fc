"""When an exploration is over, and what it then says.

Decisions rest on shortest posterior intervals and on nothing else. Excluded: what
pushes to come would decide (`pushfit.explore.decide.forecast`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pushfit.data.text.faults import listed
from pushfit.errors import ConfigError, check_seed, counted
from pushfit.explore.belief.belief import Belief, Question
from pushfit.explore.belief.learning import reference_rows
from pushfit.explore.belief.predict import predict
from pushfit.explore.belief.tables import noise_is_known
from pushfit.explore.decide.forecast import UNLIMITED, imagine, p_decided
from pushfit.explore.decide.intervals import AskedAngle, shortest_interval
from pushfit.explore.decide.next_push import FORCE, Survey
from pushfit.explore.limits import Limits
from pushfit.explore.records import FINDINGS, Answer, Interval, Purpose, State, ToldPush
from pushfit.parameters import ANGLES

# Without a word on the noise an interval may be narrow by chance, and misses as one
# does whose noise is believed too small: `benchmarks.explore.answers --control`.
MIN_UNKNOWN_NOISE = 8
# Effective draws below which the force of a push is not known to 1 in 100 by far: by
# 30 of them short pushes may still show that whole ones are allowed.
WORN_OUT = 30
SHORT_ALONE = (
    "the limits allow short pushes alone, which say no more: too few draws of the "
    "priors agree with them; give a higher force limit, for whole ones"
)
# Pushes before a forecast may end anything: earlier ones rest on the priors.
MIN_FORECAST = 10
# Chance to decide below which going on is not worth it, and pushes in a row after which
# not one imagined truth was decided: of so many forecasts one or the other is wrong.
# After three, or with two truths of 48 decided, more than 5 % of what was given up were
# given up falsely: python -m benchmarks.explore.by_engine.
HOPELESS, IN_A_ROW = 0.05, 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Moved:
    """That the object has moved.

    Args:
        first: Index of the first push after the last one that agreed: of it and those
            that follow nobody knows which object they felt.
        sentence: The same in words, and what to do.
    """

    first: int
    sentence: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Judge:
    """What counts as an answer.

    Args:
        width: Width of an interval that decides [deg].
        prob: Probability that the interval must have.
        budget: Pushes that may be made, besides those attached.
        seed: Seed of draws and forecasts.
    """

    width: float
    prob: float
    budget: int
    seed: int

    def __post_init__(self) -> None:
        check_seed(self.seed)
        if not (0 < self.width < 180 and 0 < self.prob < 1 and self.budget > 0):
            raise ConfigError(
                f"width {self.width:g}°, probability {self.prob:g} and budget "
                f"{self.budget}: the width must be within 0 and 180°, the probability "
                "within 0 and 1, the budget 1 push or more",
                code="ask",
            )

    def targets(self, belief: Belief, question: Question) -> dict[str, AskedAngle]:
        """The asked angles as they are believed, and what would decide them.

        Where draws give no interval, they count as none.
        """
        nothing = np.full(belief.log_weights.size, np.nan)
        return {
            angle: AskedAngle(
                values=nothing if belief.lacks(angle) else belief.samples[angle],
                is_axis=angle == "alpha_star" and question.config.reach.is_whole,
                width=self.width,
                prob=self.prob,
            )
            for angle in question.ask
        }

    def intervals(
        self, belief: Belief, question: Question
    ) -> dict[str, Interval | None]:
        """Shortest posterior interval of every asked angle, if draws show one [deg]."""
        return {
            angle: shortest_interval(target, belief.weights)
            for angle, target in self.targets(belief, question).items()
        }

    def undecided(
        self, belief: Belief, intervals: Mapping[str, Interval | None]
    ) -> tuple[str, ...]:
        """Asked angles whose interval is still too wide."""
        return tuple(
            angle
            for angle, own in intervals.items()
            if (own is None and not self._is_known_absent(belief, angle))
            or (own is not None and own[1] - own[0] > self.width)
        )

    def _is_known_absent(self, belief: Belief, angle: str) -> bool:
        """Whether pushes, not priors alone, say that the contact never rolls."""
        is_shown = not belief.is_guess and belief.lacks(angle) is None
        return is_shown and _p_undefined(belief, angle) >= self.prob

    def moved(
        self, told: Sequence[ToldPush], belief: Belief, limits: Limits
    ) -> Moved | None:
        """That the object has moved, if the last push repeats one and says so.

        Args:
            belief: What is believed; corrects for joints that miss by a little.
        """
        if (
            not told
            or told[-1].purpose != Purpose.REFERENCE.value
            or not told[-1].counts
        ):
            return None
        rows = reference_rows(told)
        n = len(rows) - 1
        theta = np.array([row.theta for row in rows])
        alpha = np.array([row.alpha for row in rows])
        expected = predict(belief, theta, alpha).heights @ belief.weights
        for c, channel in enumerate(belief.channels):
            excess = np.array([r.heights[channel] for r in rows]) - expected[:, c]
            change = float(excess[-1] - np.mean(excess[:-1]))
            noise = float(belief.sigma[c]) * np.sqrt(1 + 1 / n)
            if abs(change) > limits.reference_sigmas * noise:
                first = 1 + max(i for i, row in enumerate(told) if row is rows[-2])
                return Moved(
                    first=first,
                    sentence=f"the object has moved: push {len(told)} repeated an "
                    f"earlier one and its {channel} differs by {change:+.3g}, "
                    f"{abs(change) / noise:.0f} standard deviations; pushes from "
                    f"{first + 1} on are left out, as it moved before one of them; "
                    "grasp it again and begin another exploration",
                )
        return None

    def state(
        self,
        belief: Belief,
        question: Question,
        told: Sequence[ToldPush],
        *,
        intervals: Mapping[str, Interval | None],
        before: Sequence[State],
        n_failed: int,
        limits: Limits,
        stopped: str | None,
        survey: Callable[[], Survey],
    ) -> State:
        """Where an exploration stands.

        Args:
            before: Where it stood after earlier pushes.
            stopped: Why it was ended from outside, if it was.
        """
        n_own = sum(not row.is_attached for row in told)
        n_counted = sum(row.counts for row in told)
        n_left = min(self.budget - n_own, limits.max_pushes - n_own - n_failed)
        undecided = self.undecided(belief, intervals)
        is_noise_known = n_counted > 0 and (
            noise_is_known(told, question) or n_counted >= MIN_UNKNOWN_NOISE
        )
        answer, unlimited, within = Answer.DECIDING, None, None
        if stopped is not None:
            answer = Answer.STOPPED
        elif not (undecided or belief.is_guess) and is_noise_known:
            answer = Answer.DECIDED
        elif undecided and not (belief.is_guess or any(map(belief.lacks, undecided))):
            # Priors alone leave too few draws for so many pushes, and no chance of it.
            unlimited, within = self._forecast(
                belief,
                question,
                survey(),
                n_told=n_counted,
                n_left=n_left,
                n_looks=1 if n_own else IN_A_ROW,
            )
            answer = _answer(len(told), unlimited, before)
        if answer in (Answer.DECIDING, Answer.UNLIKELY) and n_left < 1:
            answer = Answer.OUT_OF_BUDGET
        state = State(
            answer=answer,
            sentence=stopped or "",
            # Decided or given up, it is stopped: they are of no use to anybody else.
            intervals=intervals if belief.is_described else dict.fromkeys(intervals),
            p_unlimited=unlimited,
            p_budget=within if belief.is_described else None,
            n_pushes=len(told),
            n_left=max(n_left, 0),
        )
        return state if stopped else self._worded(state, belief, survey)

    def _forecast(
        self,
        belief: Belief,
        question: Question,
        survey: Survey,
        *,
        n_told: int,
        n_left: int,
        n_looks: int,
    ) -> tuple[float | None, float | None]:
        """Probability to decide with unlimited pushes, and with those left.

        The first is asked for only where the second is nought, and may end anything: it
        is the dear one.

        Args:
            n_looks: Sets of truths, where none of the first is decided: as many as
                pushes in a row for a table that was made before.
        """
        rows = np.flatnonzero(survey.is_allowed)
        if not rows.size:
            return None, None

        rng = np.random.default_rng([self.seed, n_told])
        targets = tuple(self.targets(belief, question).values())
        for _ in range(n_looks):
            imagined = imagine(
                survey.predicted.heights,
                belief.weights,
                belief.sigma,
                rows=rows,
                gains=survey.gains,
                rng=rng,
            )
            chance = partial(p_decided, imagined, belief.weights, targets)
            within = chance(n_pushes=n_left)
            if within > 0 or n_told < MIN_FORECAST:
                return None, within
        return chance(n_pushes=UNLIMITED), within

    def _worded(
        self, state: State, belief: Belief, survey: Callable[[], Survey]
    ) -> State:
        known = "; ".join(
            self._known(belief, angle, interval)
            for angle, interval in state.intervals.items()
        )
        are = "is" if len(state.intervals) == 1 else "are"
        half, n = f"± {self.width / 2:g}°", counted(state.n_pushes, "push")
        names = " and ".join(ANGLES[angle].prose for angle in state.intervals)
        left = f"the {state.n_left} pushes that are left"
        if state.n_left == 1:
            left = "the one push that is left"
        match state.answer:
            case Answer.DECIDED:
                text = f"{names} decided to {half} after {n}: {known}."
            case Answer.CANNOT:
                text = (
                    f"{names} cannot be decided to {half} on this grasp: however many "
                    "pushes are made within reach and limits, the chance stays at "
                    f"{_percent(state.p_unlimited)}. Known after {n}: {known}. "
                    f"{_help(belief, survey())} would help."
                )
            case Answer.UNLIKELY:
                text = (
                    f"{names} will hardly be decided to {half}: with {left} "
                    f"the chance is {_percent(state.p_budget)}, with unlimited pushes "
                    f"{_percent(state.p_unlimited)}. Known after {n}: {known}."
                )
            case Answer.OUT_OF_BUDGET:
                text = (
                    f"no pushes are left, and {names} {are} not decided: {known}. More "
                    "of them go on: by a larger budget with the same journal, or by "
                    "`pushfit next` on their table."
                )
            case _:
                chance = ""
                if state.p_budget is not None:
                    chance = f"; the chance to decide to {half} with {left} is "
                    chance += _percent(state.p_budget)
                elif belief.is_guess:
                    # Short pushes weigh the priors.
                    by = "priors" if state.n_pushes else "priors alone"
                    chance = f", by the {by}; {half} is asked, with {left}"
                text = f"after {n} {known}{chance}."
        codes = [warning.code for warning in belief.warnings]
        if codes and state.answer in FINDINGS:
            text += f" Mind what is said of the heights: {listed(codes)}."
        return replace(state, sentence=text)

    def _known(self, belief: Belief, angle: str, interval: Interval | None) -> str:
        symbol = ANGLES[angle].prose
        if interval is not None:
            low, high = interval
            return f"{symbol} in {low:z.1f}° to {high:z.1f}° ({self.prob:.0%})"
        lack = belief.lacks(angle)
        if not belief.is_described:
            lack = "the model does not describe the heights"
        if lack is not None:
            return f"{symbol} is open, as {lack}"
        share = _p_undefined(belief, angle)
        if self._is_known_absent(belief, angle):
            return f"{symbol} does not exist, as the contact never rolls ({share:.0%})"
        return f"{symbol} is open; the contact may never roll ({share:.0%})"


def worn_out(belief: Belief, survey: Callable[[], Survey]) -> str | None:
    """That short pushes alone tell no more, as a clause."""
    if belief.is_guess and belief.ess < WORN_OUT and survey().length_share < 1:
        return SHORT_ALONE
    return None


def _answer(n_told: int, unlimited: float | None, before: Sequence[State]) -> Answer:
    """What forecasts say: the last one, and those just before it, if there are any."""
    earlier = [state for state in before if state.n_pushes < n_told][1 - IN_A_ROW :]
    hopes = [unlimited, *(state.p_unlimited for state in earlier)]
    if unlimited is None or None in hopes:
        return Answer.DECIDING
    return Answer.CANNOT if unlimited < HOPELESS else Answer.UNLIKELY


def _p_undefined(belief: Belief, angle: str) -> float:
    """Probability that the contact never rolls."""
    return float(belief.weights @ ~np.isfinite(belief.samples[angle]))


def _help(belief: Belief, survey: Survey) -> str:
    """What would let an angle be decided that cannot be."""
    is_weak = any(reason.startswith(FORCE) for reason in survey.refusals)
    reach = "a higher force limit" if is_weak else "a wider reach"
    others = ["force components"] if len(belief.channels) == 1 else []
    words = ", ".join([*others, reach])
    return f"{words[0].upper()}{words[1:]} or less noise"


def _percent(share: float | None) -> str:
    """A chance from 48 truths is no better than this."""
    if share is None:
        return "unknown"
    return "below 5 %" if share < HOPELESS else f"about {share:.0%}"
