"""What an exploration writes into its journal, and the history that this tells.

Excluded: how lines get on disk (`pushfit.explore.journal.file`).
"""

import functools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter, ValidationError

from pushfit.data.text.faults import listed
from pushfit.errors import ConfigError, DataError
from pushfit.explore.belief.belief import Question
from pushfit.explore.belief.tables import by_channel, check_told
from pushfit.explore.decide.stopping import Judge
from pushfit.explore.hands.protocol import PushStatus
from pushfit.explore.journal.file import JOURNAL_SCHEMA, START, Event, Journal, damaged
from pushfit.explore.limits import Limits
from pushfit.explore.records import (
    Failure,
    State,
    Suggestion,
    ToldPush,
    direction_words,
)

# Flag of pushes that another object may have felt.
MOVED = "moved"
# Reason of a push that was under way when the process died.
INTERRUPTED = "interrupted"
# Reason of a push that nobody wants.
ABANDONED = "abandoned"
# Reasons of pushes that were never made, or that died with the process.
NOT_MADE = frozenset({INTERRUPTED, PushStatus.OUT_OF_REACH.value, ABANDONED})
# What to do where pushes fail for a reason; a journal keeps the limits that it has.
CURES = {
    PushStatus.OUT_OF_REACH.value: "where the finger cannot go, begin anew with a "
    "narrower reach",
    "no_pushes": "where nothing is felt, look whether the sensor is connected, or "
    "begin anew with a higher force limit",
}
# Differences that are named, and letters of a value where these are too many.
MOST_SHOWN, LONG, SHORT = 4, 40, 12


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
        in_a_row: Pushes that failed since the last that gave a height, but for one
            during which the process died.
        n_interrupted: Pushes since then during which it did.
        reference_alpha: Azimuth that attached pushes ask θ_c at, if there are any
            [rad].
    """

    told: list[ToldPush] = field(default_factory=list)
    course: list[State] = field(default_factory=list)
    failures: list[Failure] = field(default_factory=list)
    pending: Suggestion | None = None
    n_drawn: int = 0
    stopped: str | None = None
    is_over: bool = False
    in_a_row: list[Failure] = field(default_factory=list)
    n_interrupted: int = 0
    reference_alpha: float | None = None

    def take(self, event: Event) -> None:
        """Bring the state up to date by the next event of the journal."""
        match event["event"]:
            case "attached":
                self.told += _adapter(list[ToldPush]).validate_python(event["rows"])
                alpha = _adapter(float).validate_python(event["reference_alpha"])
                self.reference_alpha = alpha
            case "asked":
                self.pending = _suggestion_of(event)
            case "told":
                self.told.append(_adapter(ToldPush).validate_python(event))
                self.pending = None
                self._begin_anew()
            case "failed":
                failure = _adapter(Failure).validate_python(event)
                self.failures.append(failure)
                self.pending = None
                # Once is no fault of the hand.
                self.n_interrupted += failure.reason == INTERRUPTED
                if failure.reason != INTERRUPTED or self.n_interrupted > 1:
                    self.in_a_row.append(failure)
            case "moved":
                first = _adapter(int).validate_python(event["first"])
                self.told[first:] = [row.flagged(MOVED) for row in self.told[first:]]
                # In one line with the flags, by which the slip is no more seen.
                self.stopped = str(event.get("reason", "the object has moved"))
                self.is_over = True
            case "drawn":
                self.n_drawn = _adapter(int).validate_python(event["n"])
            case "state":
                self.course.append(_adapter(State).validate_python(event))
            case "stopped":
                self.stopped = str(event["reason"])
                self.is_over = bool(event["is_over"])
            case "resumed":
                self.stopped = None
                self._begin_anew()
            case word:
                raise ValueError(f"no event is called {word!r}")

    def _begin_anew(self) -> None:
        """Forget the failures before this."""
        self.in_a_row.clear()
        self.n_interrupted = 0

    @property
    def n_made(self) -> int:
        """Pushes that the hand of this exploration has made and come back from."""
        own = sum(not row.is_attached for row in self.told)
        return own + sum(f.reason not in NOT_MADE for f in self.failures)

    @property
    def failures_in_words(self) -> str:
        """Pushes that failed since the last height, and what to do, as a clause."""
        failed = self.in_a_row
        pushes = ", ".join(
            f"{f.reason} at {direction_words(f.theta, f.alpha)}" for f in failed
        )
        cures = dict.fromkeys(CURES.get(f.reason, "") for f in failed)
        told = [f"{len(failed)} pushes failed in a row: {pushes}", *filter(None, cures)]
        return "; ".join(told)


def start_event(
    question: Question,
    judge: Judge,
    limits: Limits,
    *,
    hand: Mapping[str, object] | None,
) -> Event:
    """First line of a journal: the question, and who is to make the pushes."""
    return {
        "event": START,
        "schema": JOURNAL_SCHEMA,
        "ask": list(question.ask),
        "width_deg": judge.width,
        "prob": judge.prob,
        "budget": judge.budget,
        "seed": judge.seed,
        "sigma": question.sigma,
        "channels": list(question.channels),
        "unit": question.unit,
        "config": question.config.model_dump(mode="json"),
        "limits": limits.model_dump(mode="json"),
        "hand": hand,
    }


def check_events(journal: Journal, question: Question) -> None:
    """Refuse a journal with an event that this exploration could not have written.

    Raises:
        DataError: Which line it is.
    """
    history = History()
    for number, event in enumerate(journal.events[1:], start=2):
        n_told = len(history.told)
        try:
            history.take(event)
            for row in history.told[n_told:]:
                by_channel(row.heights, question.channels)
                check_told(row, question)
        except KeyError as error:
            raise damaged(journal.path, number, f"{error} is missing") from error
        except ValidationError as error:
            (wrong, *_) = error.errors()
            what = ": ".join([*map(str, wrong["loc"]), wrong["msg"]])
            raise damaged(journal.path, number, what) from error
        except (DataError, TypeError, ValueError) as error:
            raise damaged(journal.path, number, str(error)) from error


def check_start(begun: Event, now: Event, path: Path | None) -> None:
    """Refuse to go on with a journal by another question, or by another hand.

    With another budget it is gone on with: no push depends on it.

    Raises:
        ConfigError: They differ, other than that one of them names no hand.
    """
    now = json.loads(json.dumps(now))  # tuples are lists in a journal
    free: Event = {"budget": None}
    if None in (begun.get("hand"), now["hand"]):
        free["hand"] = None
    old, new = (dict(_leaves(event | free)) for event in (begun, now))
    other = [
        f"{key} = {_brief(old.get(key))}, not {_brief(new.get(key))}"
        for key in {**new, **old}
        if new.get(key) != old.get(key)
    ]
    if other:
        raise ConfigError(
            f"{path}: was begun with {listed(other, MOST_SHOWN)}; go on with the same, "
            "or begin another journal",
            code="other_journal",
        )


def _leaves(value: object, name: str = "") -> Iterator[tuple[str, object]]:
    """What is in an event, with keys as `limits.force`."""
    if not isinstance(value, Mapping):
        yield name, value
        return
    for key, part in value.items():
        yield from _leaves(part, f"{name}.{key}" if name else key)


def _brief(value: object) -> str:
    """A value as JSON, but for most of a digest."""
    text = json.dumps(value)
    return text if len(text) < LONG else f"{text[:SHORT]}…"


def event_of(word: str, record: object, **more: object) -> Event:
    """Line on a record; JSON has no infinity, so a width without bound is null."""
    parts = _adapter(type(record)).dump_python(record, mode="json")
    finite = {name: None if part == np.inf else part for name, part in parts.items()}
    return {"event": word, **more, **finite}


def _suggestion_of(event: Event) -> Suggestion:
    width = np.inf if event["expected_width"] is None else event["expected_width"]
    return _adapter(Suggestion).validate_python({**event, "expected_width": width})
