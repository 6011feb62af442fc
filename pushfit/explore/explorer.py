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

import numpy as np

from pushfit.arguments import checked
from pushfit.config import Settings, as_config
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError, DataError
from pushfit.explore.belief.belief import ASKABLE, Belief, BeliefSource, Question
from pushfit.explore.belief.from_fit import believe
from pushfit.explore.belief.learning import learnt, reference_due, weighed
from pushfit.explore.belief.tables import (
    by_channel,
    check_sensor,
    check_told,
    number_of,
    table_of,
    told_rows,
)
from pushfit.explore.decide.misfit import misfit, other_unit, rejected
from pushfit.explore.decide.next_push import (
    Survey,
    Surveyor,
    are_among,
    repetition,
    suggestion,
)
from pushfit.explore.decide.stopping import Judge, worn_out
from pushfit.explore.journal.events import (
    ABANDONED,
    INTERRUPTED,
    History,
    check_events,
    check_start,
    event_of,
    start_event,
)
from pushfit.explore.journal.file import Event, Journal
from pushfit.explore.limits import Limits
from pushfit.explore.records import (
    FINDINGS,
    Answer,
    Failure,
    Interval,
    State,
    Suggestion,
    ToldPush,
)
from pushfit.fit.identify.fitted import reference_azimuth

# Below this share of effective draws the engine is asked for fresh ones.
KEPT_SHARE = 0.2


class Explorer:
    """Suggests pushes, takes in what came of them, and says when to stop.

    Args:
        config: Settings of grasp, sensor and priors: a `grasp.toml`, its content, what
            `read_config` gives, or None for the defaults.
        ask: "theta_c", "alpha_star" or "both".
        width_deg: Width of the interval that decides an angle; ± 3° is 6 [deg].
        prob: Probability that the interval must have.
        budget: Pushes that may be made, besides those attached.
        limits: What pushes must never do; None takes `[explore]` of the settings.
        journal: File that everything is kept in; one that exists is gone on with.
        seed: Seed of all randomness.
        sigma: Standard deviation of the heights of repeated pushes; None where it is
            to be learned, which takes `MIN_UNKNOWN_NOISE` pushes of
            `pushfit.explore.decide.stopping` before anything is decided [table unit].
        channels: Height channels that are told: `height`, or `height_normal` and
            `height_tangential`.
        unit: Unit of the heights: `n`, `kpa`, `counts` or `au`.
        source: What makes draws from the pushes so far, the question and a seed.
        hand: What makes the pushes, by name, for a journal to go on with the same one
            only; None for any.

    Raises:
        ConfigError: The question makes no sense, or the journal has another one, or
            another hand.
        DataError: The journal is damaged.
    """

    @checked
    def __init__(
        self,
        config: Settings | None,
        *,
        ask: str = "theta_c",
        width_deg: float = 6.0,
        prob: float = 0.9,
        budget: int = 60,
        limits: Limits | None = None,
        journal: str | Path | None = None,
        seed: int = 0,
        sigma: float | None = None,
        channels: tuple[str, ...] = ("height",),
        unit: str = "n",
        source: BeliefSource = believe,
        hand: Mapping[str, object] | None = None,
    ) -> None:
        """Begin, or go on where the journal ends."""
        if ask not in ASKABLE:
            raise ConfigError(
                f"ask = {ask!r} is not known; ask for {', '.join(ASKABLE)}", code="ask"
            )
        config = as_config(config)
        limits = Limits.of(config) if limits is None else limits
        self.limits, self.source = limits, source
        self.judge = Judge(width=width_deg, prob=prob, budget=budget, seed=seed)
        self.question = Question(
            config=config,
            ask=ASKABLE[ask],
            channels=channels,
            unit=unit,
            sigma=sigma,
            reference_alpha=limits.first_azimuth(config),
        )
        self.history = History()
        # Whether what is pending was under way when the process died.
        self.is_dangling = False
        self._surveyor = Surveyor(self.question, limits)
        self._belief: Belief | None = None
        self._state: State | None = None
        self._survey: Survey | None = None
        self._intervals: Mapping[str, Interval | None] | None = None
        self.journal = Journal(None if journal is None else Path(journal))
        self._resume(start_event(self.question, self.judge, limits, hand=hand))

    @checked
    def attach(self, table: PeakTable) -> None:
        """Take in pushes that were made before.

        Args:
            table: Their heights, in the unit and channels of this exploration.

        A journal that begins with them has them already.

        Raises:
            DataError: Unit or channels are others, or other pushes were told already.
        """
        check_sensor(table, self.question)
        told, rows = self.history.told, list(told_rows(table))
        if rows == [row for row in told if row.is_attached]:
            return  # by the program that goes on with its journal
        if told:
            raise DataError(
                f"{len(told)} other pushes are known already; attach a table first",
                code="attached_late",
            )
        self._record(
            {
                "event": "attached",
                "reference_alpha": reference_azimuth(table, self.question.config),
                "rows": [asdict(row) for row in rows],
            }
        )
        self._settle()

    @checked
    def ask(self, n: int = 1) -> tuple[Suggestion, ...]:
        """Pushes that would tell most, the best first; none once there is an answer.

        The first one counts as asked for, and is in the journal when this returns.

        Raises:
            ConfigError: At most `n` are named, and that is less than one.
        """
        if n < 1:
            raise ConfigError(f"ask({n}): ask for one push or more", code="ask")
        history = self.history
        self._settle_if_due()
        if self.is_dangling and history.pending is not None:
            # Never replayed: nobody knows how far it went.
            self.fail(history.pending, INTERRUPTED)
        if self.state.answer is not Answer.DECIDING:
            return ()
        found = self._suggestions(n)
        if not found:
            # A journal keeps to its limits.
            self.stop(self.survey().why_none, is_over=True)
            return ()
        pending = history.pending
        if pending is None:
            number = len(history.told) + len(history.failures) + 1
            pending = replace(found[0], number=number)
            self._record(event_of("asked", pending))
        return (pending, *found[1:])

    def tell(
        self,
        theta: float,
        alpha: float,
        heights: Mapping[str, float] | float,
        *,
        sd: Mapping[str, float] | float | None = None,
        flags: str = "",
        length_share: float | None = None,
    ) -> State:
        """Take in a push as it was executed; it need not be one that was asked for.

        Args:
            theta: Elevation reached [rad].
            alpha: Azimuth reached [rad].
            heights: Heights, by channel if there are several [table unit].
            sd: Their standard deviations; None where none is known [table unit].
            flags: Words of the peak extraction, joined by ";".
            length_share: Length reached, as a share of the push length; None where it
                is that of the push asked for.

        Returns:
            Where the exploration stands now.

        Raises:
            DataError: A number is missing or not finite, or breaks a rule of tables;
                nothing is taken in then.
        """
        asked = self.history.pending
        if length_share is None:
            length_share = 1.0 if asked is None else asked.length_share
        row = ToldPush(
            theta=number_of("theta", theta),
            alpha=number_of("alpha", alpha),
            heights=by_channel(heights, self.question.channels),
            sd=None if sd is None else by_channel(sd, self.question.channels),
            length_share=number_of("length_share", length_share),
            flags=flags,
            purpose=None if asked is None else asked.purpose.value,
        )
        check_told(row, self.question)
        number = None if asked is None else asked.number
        self._record(event_of("told", row, number=number))
        self._settle()
        return self.state

    @checked
    def fail(self, suggestion: Suggestion, reason: str) -> None:
        """Say that a push gave no height, such as "stalled".

        It may be asked again, but other directions come first.

        Args:
            suggestion: The push as it was asked for.
            reason: Stable word; some in a row end the exploration.

        Raises:
            DataError: The push is not waited for, or there is no reason.
        """
        self._failed(suggestion, reason, is_final=False)

    @checked
    def abandon(self, suggestion: Suggestion, reason: str = ABANDONED) -> None:
        """Say that a push is not to be made; it is never asked again.

        Raises:
            DataError: The push is not waited for, or there is no reason.
        """
        self._failed(suggestion, reason, is_final=True)

    def _failed(self, suggestion: Suggestion, reason: str, *, is_final: bool) -> None:
        theta, alpha, pending = suggestion.theta, suggestion.alpha, self.history.pending
        is_waited_for = pending is not None and pending.number == suggestion.number
        if not reason or not (is_waited_for or suggestion.number is None):
            raise DataError(
                f"push {suggestion.number} is not waited for: it was answered before"
                if reason
                else 'a push fails for a reason; give a word such as "stalled"',
                code="failure",
            )
        failure = Failure(theta=theta, alpha=alpha, reason=reason, is_final=is_final)
        self._record(event_of("failed", failure, number=suggestion.number))
        self._stop_after_failures()

    def stop(self, reason: str, *, is_over: bool = False) -> None:
        """End the exploration.

        Args:
            reason: Why, as a clause for the user.
            is_over: Whether nothing that is put right lets it go on.
        """
        self._record({"event": "stopped", "reason": reason, "is_over": is_over})

    def go_on(self) -> None:
        """Go on after a stop, now that its reason is put right, if that can be."""
        if self.history.stopped is not None and not self.history.is_over:
            self._record({"event": "resumed"})

    @property
    def state(self) -> State:
        """Where the exploration stands."""
        if self._state is None:
            self._state = self.judge.state(
                self.belief,
                self.question,
                self.history.told,
                intervals=self._known(),
                before=self.history.course,
                n_failed=len(self.history.failures),
                limits=self.limits,
                stopped=self.history.stopped,
                survey=self.survey,
            )
        return self._state

    @property
    def belief(self) -> Belief:
        """What is believed now."""
        if self._belief is None:
            self._belief = learnt(
                self.history.told,
                self.question,
                n_drawn=self.history.n_drawn,
                source=self.source,
                seed=self.judge.seed,
            )
        return self._belief

    @property
    def table(self) -> PeakTable | None:
        """All pushes of full length as a table; None before the first."""
        return table_of(self.history.told, self.question)

    @property
    def angle(self) -> str:
        """The first asked angle that is undecided, or else the first one."""
        return self._focus()[0]

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
            abandoned=self._abandoned,
            is_full=is_full,
        )
        self._survey = self._survey if is_full else found
        return found

    @property
    def _abandoned(self) -> list[tuple[float, float]]:
        """Directions that are never asked for again [rad]."""
        return [(f.theta, f.alpha) for f in self.history.failures if f.is_final]

    def _focus(self) -> tuple[str, ...]:
        """The angles that pushes are to tell of."""
        undecided = self.judge.undecided(self.belief, self._known())
        return undecided or self.question.ask

    def _known(self) -> Mapping[str, Interval | None]:
        if self._intervals is None:
            self._intervals = self.judge.intervals(self.belief, self.question)
        return self._intervals

    def _suggestions(self, n: int) -> list[Suggestion]:
        """The n best pushes; when one is due, the reference push alone."""
        belief, survey = self.belief, self.survey()
        target = self.judge.targets(belief, self.question)[self.angle]
        due = reference_due(self.history.told, self.limits)
        failed = [(f.theta, f.alpha) for f in self.history.in_a_row]
        if due is not None and survey.length_share == 1.0 and not failed:
            is_allowed = self._surveyor.allows(belief, due.theta, due.alpha)
            direction = np.array([[due.theta, due.alpha]])
            is_allowed &= not are_among(direction, self._abandoned)[0]
            return [repetition(belief, survey, due, target=target, exactly=is_allowed)]
        rows = survey.ranked(after=failed)[:n].tolist()
        return [suggestion(belief, survey, row, target=target) for row in rows]

    def _record(self, event: Event) -> None:
        self.journal.write(event)
        self._take(event)

    def _take(self, event: Event) -> None:
        """Take in an event, new or read again: both ways lead to the same."""
        self.history.take(event)
        match event["event"]:
            case "asked" | "state":
                return
            case "attached":
                alpha = self.history.reference_alpha
                self.question = replace(self.question, reference_alpha=alpha)
                self._surveyor = Surveyor(self.question, self.limits)
                self._belief = None
            case "drawn" | "moved":
                self._belief = None
            case "told" if self._belief is not None:
                row = self.history.told[-1]
                self._belief = weighed(self._belief, row, self.question)
        self.is_dangling = False
        self._state = self._survey = self._intervals = None

    def _settle(self) -> None:
        """After pushes: fresh draws where they are due, and a line of how it stands.

        They are due where weights have worn out, and where a decision is near: what is
        decided is decided on fresh draws.
        """
        told, history = self.history.told, self.history
        slip = other_unit(told, self.question) if history.stopped is None else None
        if slip is not None:
            self.stop(slip, is_over=True)
        elif history.n_drawn < len(told) and (
            history.n_drawn == 0
            or self.belief.is_guess
            or self.belief.effective_share < KEPT_SHARE
            or not self.judge.undecided(self.belief, self._known())
        ):
            self._record({"event": "drawn", "n": len(told)})
        if history.stopped is None:
            self._look_for_a_slip()
        if history.stopped is None:
            reason = worn_out(self.belief, self.survey) or self._fault()
            if reason is not None:
                self.stop(reason, is_over=True)
        self._record(event_of("state", self.state))

    def _settle_if_due(self) -> None:
        """Settle what was killed, or interrupted, before it had said how it stands."""
        history = self.history
        known = history.course[-1].n_pushes if history.course else 0
        if known < len(history.told):
            self._settle()

    def _look_for_a_slip(self) -> None:
        """End where the last push says that the object has moved."""
        moved = self.judge.moved(self.history.told, self.belief, self.limits)
        if moved is not None:
            line = {"first": moved.first, "reason": moved.sentence}
            self._record({"event": "moved", **line})

    def _fault(self) -> str | None:
        """What makes the heights none of one grasp, as a clause."""
        told, belief = self.history.told, self.belief
        fault, is_found = None, self.state.answer in FINDINGS
        # Of pushes of its own the next reference says whether a slip came.
        if is_found or belief.is_guess or all(row.is_attached for row in told):
            fault = misfit(told, belief, self.question)
        return fault or (rejected(belief) if is_found else None)

    def _stop_after_failures(self) -> None:
        history = self.history
        n_failed = len(history.in_a_row)
        if n_failed >= self.limits.max_failures and history.stopped is None:
            self.stop(history.failures_in_words)

    def _resume(self, start: Event) -> None:
        """Begin the journal, or live again through what it tells."""
        if not self.journal.events:
            self.journal.write(start)
            return
        first, *events = self.journal.events
        check_start(first, start, self.journal.path)
        check_events(self.journal, self.question)
        for event in events:
            self._take(event)
        history = self.history
        self.is_dangling = history.pending is not None
        self._settle_if_due()
        self._stop_after_failures()
