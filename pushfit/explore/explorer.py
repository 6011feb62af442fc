"""The exploration of one grasp: which push next, and when to stop.

    explorer = Explorer(config, ask="theta_c", width_deg=6, sigma=0.05)
    while suggestions := explorer.ask():
        explorer.tell(theta, alpha, heights)
    print(explorer.state.sentence)

Stops on posterior intervals only: sets of the likelihood that are looked at until they
are narrow cover far less than they state. Excluded: moving a finger
(`pushfit.explore.loop`).
"""

from collections.abc import Mapping
from dataclasses import asdict, replace
from pathlib import Path

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError, DataError
from pushfit.explore.belief.belief import Belief, BeliefSource, Question, believe
from pushfit.explore.journal.file import Event, Journal
from pushfit.explore.belief.learning import learnt, reference_due, weighed
from pushfit.explore.limits import Limits
from pushfit.explore.journal.events import (
    ANGLES,
    asked_event,
    check_question,
    first_azimuth,
    header_of,
    plain_state,
    state_of,
    suggestion_of,
    told_event,
    told_of,
)
from pushfit.explore.decide.judge import Judge
from pushfit.explore.records import (
    Answer,
    Failure,
    State,
    Suggestion,
    Told,
)
from pushfit.explore.decide.survey import Survey, Surveyor
from pushfit.explore.belief.tables import by_channel, check_sensor, table_of, told_rows
from pushfit.fit.identify import reference_azimuth

# Below this share of effective draws the engine is asked for fresh ones.
KEPT_SHARE = 0.2
NO_LIMITS = Limits()
# Reason of a push that was under way when the process died.
INTERRUPTED = "interrupted"


class Explorer:
    """Suggests pushes, takes in what came of them, and says when to stop.

    Args:
        config: Settings of the grasp.
        ask: "theta_c", "alpha_star" or "both".
        width_deg: Width of the interval that decides an angle; ± 3° is 6 [deg].
        prob: Probability of the interval.
        budget: Pushes that may be made, besides those attached.
        limits: What pushes must never do.
        journal: File that everything is kept in; one that exists is gone on with.
        seed: Seed of all randomness.
        sigma: Standard deviation of the heights of repeated pushes; None where it is
            to be learned, which takes eight pushes before anything is decided [unit].
        channels: Height channels of every push; None takes those of what is attached
            or told first.
        unit: Unit of the heights.
        source: Where beliefs come from.

    Raises:
        ConfigError: The question makes no sense, or the journal asks another one.
        DataError: The journal is damaged.
    """

    def __init__(
        self,
        config: GraspConfig,
        *,
        ask: str = "theta_c",
        width_deg: float = 6.0,
        prob: float = 0.9,
        budget: int = 60,
        limits: Limits = NO_LIMITS,
        journal: str | Path | None = None,
        seed: int = 0,
        sigma: float | None = None,
        channels: tuple[str, ...] = ("height",),
        unit: str = "n",
        source: BeliefSource = believe,
    ) -> None:
        """Begin, or go on where the journal ends."""
        check_question(ask, width_deg, prob, budget)
        self.limits, self.budget, self.seed = limits, budget, seed
        self.question = Question(
            config=config,
            ask=ANGLES[ask],
            channels=channels,
            unit=unit,
            sigma=sigma,
            reference_alpha=first_azimuth(config, limits),
        )
        self.source = source
        self.told: list[Told] = []
        # Where it stood after each push, for pictures.
        self.course: list[State] = []
        self.failures: list[Failure] = []
        self.pending: Suggestion | None = None
        self.dangling: Suggestion | None = None
        self._n_asked = 0
        # Rows of `told` that the draws rest on; the others came by new weights.
        self._n_drawn = 0
        self._stop: str | None = None
        self._belief: Belief | None = None
        self._state: State | None = None
        self._survey: Survey | None = None
        self._n_failed_in_row = 0
        self.judge = Judge(width=width_deg, prob=prob, budget=budget, seed=seed)
        self._start(ask, None if journal is None else Path(journal))

    def attach(self, table: PeakTable) -> None:
        """Take in pushes that were made before.

        Args:
            table: Their heights, in the unit and channels of this exploration.

        Raises:
            DataError: Unit or channels are others, or pushes were told already.
        """
        if self.told:
            raise DataError(
                f"{len(self.told)} pushes are known already; attach a table first",
                code="attached_late",
            )
        check_sensor(table, self.question)
        rows = told_rows(table)
        azimuth = reference_azimuth(table, self.question.config)
        self.journal.write(
            {
                "event": "attached",
                "reference_alpha": azimuth,
                "rows": [asdict(row) for row in rows],
            }
        )
        self._attach(rows, azimuth)
        self._settle()
        self._log()

    def ask(self, n: int = 1) -> tuple[Suggestion, ...]:
        """The pushes that would tell most, the best first.

        The first one counts as asked for, and is in the journal when this returns.

        Args:
            n: How many to rank.

        Returns:
            Suggestions; none once the exploration has its answer.
        """
        if self.dangling is not None:
            # Never replayed: nobody knows how far it went.
            self.fail(self.dangling, INTERRUPTED)
        if self.state.answer is not Answer.DECIDING:
            return ()
        found = self._suggestions(n)
        if not found:
            self.stop(f"no push is within the limits: {self._refusals()}")
            return ()
        if self.pending is None:
            self._n_asked += 1
            first = replace(found[0], number=self._n_asked)
            self.journal.write(asked_event(first))
            self.pending = first
        return (self.pending, *found[1:])

    def tell(
        self,
        theta: float,
        alpha: float,
        heights: Mapping[str, float] | float,
        sd: Mapping[str, float] | float | None = None,
        *,
        flags: str = "",
    ) -> State:
        """Take in a push as it was executed; it need not be one that was asked for.

        Args:
            theta: Elevation reached [rad].
            alpha: Azimuth reached [rad].
            heights: Heights, by channel if there are several [unit].
            sd: Standard deviations in the same form; None where none is known [unit].
            flags: Words of the peak extraction, joined by ";".

        Returns:
            Where the exploration stands now.

        Raises:
            DataError: A number is missing or not finite.
        """
        asked = self.pending or self.dangling
        row = Told(
            theta=float(theta),
            alpha=float(alpha),
            heights=by_channel(heights, self.question.channels),
            sd=None if sd is None else by_channel(sd, self.question.channels),
            length_share=1.0 if asked is None else asked.length_share,
            flags=flags,
            purpose=None if asked is None else asked.purpose.value,
        )
        self.journal.write(told_event(row, asked.number if asked else None))
        self._take(row)
        self._settle()
        self._log()
        return self.state

    def fail(self, suggestion: Suggestion, reason: str) -> None:
        """Say that a push gave no height; it may be asked again.

        Args:
            suggestion: What was asked.
            reason: Stable word, such as "stalled".
        """
        self._fail(suggestion, reason, is_final=False)

    def abandon(self, suggestion: Suggestion, reason: str = "abandoned") -> None:
        """Say that a push is not to be made; it is never asked again.

        Args:
            suggestion: What was asked.
            reason: Stable word.
        """
        self._fail(suggestion, reason, is_final=True)

    def stop(self, reason: str) -> None:
        """End the exploration.

        Args:
            reason: Sentence for a person.
        """
        self.journal.write({"event": "stopped", "reason": reason})
        self._stop, self._state = reason, None

    @property
    def state(self) -> State:
        """Where the exploration stands."""
        if self._state is None:
            self._state = self.judge.state(
                self.belief,
                self.question,
                self.told,
                n_failed=len(self.failures),
                limits=self.limits,
                stopped=self._stop,
                survey=self.survey,
            )
        return self._state

    @property
    def belief(self) -> Belief:
        """What is believed now."""
        if self._belief is None:
            self._belief = learnt(
                self.told,
                self.question,
                n_drawn=self._n_drawn,
                source=self.source,
                seed=self.seed,
            )
        return self._belief

    @property
    def table(self) -> PeakTable | None:
        """All pushes of full length as a table; None before the first."""
        return table_of(self.told, self.question)

    def survey(self, *, is_full: bool = False) -> Survey:
        """What every push that could be made would tell.

        Args:
            is_full: Whether all gains are wanted to the last digit.
        """
        if self._survey is not None and not is_full:
            return self._survey
        found = self._surveyor.survey(
            self.belief,
            undecided=self._focus(),
            abandoned=[(f.theta, f.alpha) for f in self.failures if f.is_final],
            is_full=is_full,
        )
        self._survey = self._survey if is_full else found
        return found

    def _focus(self) -> tuple[str, ...]:
        """The angles that pushes are to tell of."""
        undecided = self.judge.undecided(self.belief, self.question)
        return undecided or self.question.ask

    def _suggestions(self, n: int) -> list[Suggestion]:
        """The n best pushes; when one is due, the reference push alone."""
        survey, angle = self.survey(), self._focus()[0]
        due = reference_due(self.told, self.limits)
        kind = {"angle": angle, "prob": self.judge.prob, "width": self.judge.width}
        if due is not None and survey.length_share == 1.0:
            return [self._surveyor.repetition(self.belief, survey, due, **kind)]
        rows = survey.ranks[:n]
        return [
            self._surveyor.suggestion(self.belief, survey, int(row), **kind)
            for row in rows
        ]

    def _refusals(self) -> str:
        """Why no candidate may be pushed, in words."""
        reasons = self.survey().refusals
        return "; ".join(f"{n} candidates {why}" for why, n in reasons.items())

    def _fail(self, suggestion: Suggestion, reason: str, *, is_final: bool) -> None:
        """Write down and remember a push that gave nothing."""
        event = "abandoned" if is_final else "failed"
        self.journal.write(
            {"event": event, "number": suggestion.number, "reason": reason}
        )
        self._forget(suggestion, reason, is_final=is_final)
        self._stop_after_failures()

    def _stop_after_failures(self) -> None:
        if self._n_failed_in_row >= self.limits.max_failures and self._stop is None:
            reasons = [f.reason for f in self.failures[-self._n_failed_in_row :]]
            self.stop(f"{len(reasons)} pushes failed in a row: {', '.join(reasons)}")

    def _forget(self, suggestion: Suggestion, reason: str, *, is_final: bool) -> None:
        failure = Failure(
            theta=suggestion.theta,
            alpha=suggestion.alpha,
            reason=reason,
            is_final=is_final,
        )
        self.failures.append(failure)
        # A process that died is no fault of the hand.
        self._n_failed_in_row += reason != INTERRUPTED
        self.pending = self.dangling = self._state = self._survey = None

    def _attach(self, rows: tuple[Told, ...], azimuth: float) -> None:
        self.question = replace(self.question, reference_alpha=azimuth)
        self._surveyor = Surveyor(self.question, self.limits)
        self.told.extend(rows)
        self._belief = self._state = self._survey = None

    def _take(self, row: Told) -> None:
        """Remember a push, and weigh the draws by it if they are there."""
        if self._belief is not None:
            self._belief = weighed(self._belief, row, self.question)
        self.told.append(row)
        self._n_failed_in_row = 0
        self.pending = self.dangling = self._state = self._survey = None

    def _settle(self) -> None:
        """Ask for fresh draws where weights have worn out, or a decision is near."""
        belief, n = self.belief, len(self.told)
        is_worn = belief.effective_share < KEPT_SHARE or belief.is_guess
        # What is decided is decided on fresh draws.
        is_near = not self.judge.undecided(belief, self.question)
        if self._n_drawn < n and (is_worn or is_near):
            self._n_drawn, self._belief = n, None
            self._state = self._survey = None
            self.journal.write({"event": "drawn", "n": n})
        if self._stop is None:
            moved = self.judge.moved(self.told, self.belief, self.limits)
            if moved is not None:
                self.stop(moved)

    def _log(self) -> None:
        """Write down where the exploration stands."""
        self.journal.write({"event": "state", **plain_state(self.state)})
        self.course.append(self.state)

    def _start(self, ask: str, path: Path | None) -> None:
        """Open the journal, and live again through what it tells."""
        self._surveyor = Surveyor(self.question, self.limits)
        self.journal = Journal(path)
        header = header_of(ask, self.question, self.judge, self.limits)
        if not self.journal.events:
            self.journal.write(header)
            return
        first, *events = self.journal.events
        other = [key for key in header if header[key] != first.get(key)]
        if other:
            raise ConfigError(
                f"{path}: was begun with another {', '.join(other)}; go on with the "
                "same question, or begin another journal",
                code="other_journal",
            )
        for event in events:
            self._replay(event)
        self.dangling, self.pending = self.pending, None
        if self.told:
            self._settle()
            if self.course[-1:] == [] or self.course[-1].n_pushes < len(self.told):
                self._log()
        self._stop_after_failures()

    def _replay(self, event: Event) -> None:
        """Do again, without writing, what an event of the journal says."""
        match event["event"]:
            case "attached":
                rows = tuple(Told(**row) for row in event["rows"])  # pyright: ignore
                self._attach(rows, float(event["reference_alpha"]))  # pyright: ignore
            case "asked":
                self.pending = suggestion_of(event)
                self._n_asked = self.pending.number
            case "told":
                self._take(told_of(event))
            case "state":
                self.course.append(state_of(event))
            case "drawn":
                self._n_drawn = int(event["n"])  # pyright: ignore
            case "failed" | "abandoned" as kind if self.pending is not None:
                reason = str(event["reason"])
                self._forget(self.pending, reason, is_final=kind == "abandoned")
            case "stopped":
                self._stop = str(event["reason"])
