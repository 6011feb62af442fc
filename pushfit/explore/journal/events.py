"""What an exploration writes into its journal, and the history that this tells.

Excluded: how lines get on disk (`pushfit.explore.journal.file`).
"""

import functools
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from pydantic import TypeAdapter

from pushfit.explore.belief.belief import Question
from pushfit.explore.decide.stopping import Judge
from pushfit.explore.hands.protocol import PushStatus
from pushfit.explore.journal.file import SCHEMA, Event
from pushfit.explore.limits import Limits
from pushfit.explore.records import Failure, State, Suggestion, ToldPush

# Flag of pushes that another object may have felt.
MOVED = "moved"
# Reason of a push that was under way when the process died.
INTERRUPTED = "interrupted"
# Reason of a push that nobody wants.
ABANDONED = "abandoned"
# Reasons of pushes that were never made, or that died with the process.
NOT_MADE = frozenset({INTERRUPTED, PushStatus.OUT_OF_REACH.value, ABANDONED})


@functools.cache
def _adapter(kind: Any) -> TypeAdapter:
    """What turns a record into an event and back; making one takes milliseconds."""
    return TypeAdapter(kind)


@dataclass(slots=True, kw_only=True)
class History:
    """What was asked and told so far: nothing but the sum of the events.

    Args:
        told: Pushes that gave heights, in order.
        course: Where it stood after each push, for pictures.
        failures: Pushes that gave none, in order.
        pending: Push asked for that is not answered.
        n_drawn: Pushes that the draws rest on; the others came by new weights.
        stopped: Why it was ended from outside, if it was.
        is_over: Whether that cannot be put right.
        in_a_row: Pushes that failed since the last that gave a height.
    """

    told: list[ToldPush] = field(default_factory=list)
    course: list[State] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    pending: Suggestion | None = None
    n_drawn: int = 0
    stopped: str | None = None
    is_over: bool = False
    in_a_row: list[Failure] = field(default_factory=list)

    def take(self, event: Event) -> None:
        """Go on by one event."""
        match event["event"]:
            case "attached":
                self.told += _adapter(list[ToldPush]).validate_python(event["rows"])
            case "asked":
                self.pending = _suggestion_of(event)
            case "told":
                self.told.append(_adapter(ToldPush).validate_python(event))
                self.pending = None
                self.in_a_row.clear()
            case "failed":
                failure = _adapter(Failure).validate_python(event)
                self.failures.append(failure)
                self.pending = None
                if failure.reason != INTERRUPTED:  # no fault of the hand
                    self.in_a_row.append(failure)
            case "moved":
                first = cast(int, event["first"])
                self.told[first:] = [row.flagged(MOVED) for row in self.told[first:]]
            case "drawn":
                self.n_drawn = cast(int, event["n"])
            case "state":
                self.course.append(_adapter(State).validate_python(event))
            case "stopped":
                self.stopped = str(event["reason"])
                self.is_over = bool(event["is_over"])
            case "resumed":
                self.stopped = None
                self.in_a_row.clear()

    @property
    def n_made(self) -> int:
        """Pushes that the hand of this exploration has made and come back from."""
        own = sum(not row.is_attached for row in self.told)
        return own + sum(f.reason not in NOT_MADE for f in self.failures)


def start_event(question: Question, judge: Judge, limits: Limits) -> Event:
    """First line of a journal: the question."""
    return {
        "event": "start",
        "schema": SCHEMA,
        "ask": list(question.ask),
        "width_deg": judge.width,
        "prob": judge.prob,
        "budget": judge.budget,
        "seed": judge.seed,
        "sigma": question.sigma,
        "channels": list(question.channels),
        "unit": question.unit,
        "config": question.config.digest(),
        "limits": limits.model_dump(mode="json"),
    }


def event_of(word: str, record: object, **more: object) -> Event:
    """Line on a record; JSON has no infinity, so a width without bound is null."""
    parts = _adapter(type(record)).dump_python(record, mode="json")
    finite = {name: None if part == np.inf else part for name, part in parts.items()}
    return {"event": word, **more, **finite}


def _suggestion_of(event: Event) -> Suggestion:
    width = np.inf if event["expected_width"] is None else event["expected_width"]
    return _adapter(Suggestion).validate_python({**event, "expected_width": width})
