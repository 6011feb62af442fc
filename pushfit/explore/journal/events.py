"""What an exploration writes into its journal, and how it reads it back."""

from dataclasses import asdict
from typing import cast

import numpy as np

from pushfit.config import GraspConfig
from pushfit.errors import ConfigError
from pushfit.explore.belief.belief import Question
from pushfit.explore.journal.file import SCHEMA, Event
from pushfit.explore.limits import Limits
from pushfit.explore.decide.judge import Judge
from pushfit.explore.records import Answer, Purpose, State, Suggestion, Told

ANGLES: dict[str, tuple[str, ...]] = {
    "theta_c": ("theta_c",),
    "alpha_star": ("alpha_star",),
    "both": ("theta_c", "alpha_star"),
}


def header_of(ask: str, question: Question, judge: Judge, limits: Limits) -> Event:
    """First line of a journal: the question.

    Args:
        ask: One of `ANGLES`.
        question: Sensor and settings.
        judge: What counts as an answer.
        limits: What pushes must never do.
    """
    return {
        "event": "start",
        "schema": SCHEMA,
        "ask": ask,
        "width_deg": judge.width,
        "prob": judge.prob,
        "budget": judge.budget,
        "seed": judge.seed,
        "sigma": question.sigma,
        "channels": list(question.channels),
        "unit": question.unit,
        "config": question.config.digest(),
        "limits": _listed(asdict(limits)),
    }


def told_event(row: Told, number: int | None) -> Event:
    """Line of a push that was made.

    Args:
        row: The push.
        number: Of the suggestion that it answers.
    """
    return {"event": "told", "number": number, **asdict(row)}


def told_of(event: Event) -> Told:
    """The push of such a line.

    Args:
        event: Line of a journal.
    """
    values = {k: v for k, v in event.items() if k not in ("event", "number")}
    return Told(**values)  # pyright: ignore


def plain_state(state: State) -> Event:
    """A state as JSON has it.

    Args:
        state: Where an exploration stands.
    """
    return {**asdict(state), "answer": state.answer.value}


def state_of(event: Event) -> State:
    """The state of such a line.

    Args:
        event: Line of a journal.
    """
    values = {key: value for key, value in event.items() if key != "event"}
    values["answer"] = Answer(values["answer"])
    intervals = cast(dict[str, list[float] | None], values["intervals"])
    values["intervals"] = {
        angle: None if found is None else (found[0], found[1])
        for angle, found in intervals.items()
    }
    return State(**values)  # pyright: ignore


def check_question(ask: str, width_deg: float, prob: float, budget: int) -> None:
    """Refuse a question that makes no sense."""
    if ask not in ANGLES:
        raise ConfigError(
            f"ask = {ask!r} is not known; ask for {', '.join(ANGLES)}", code="ask"
        )
    if not (0 < width_deg < 180 and 0 < prob < 1 and budget >= 0):
        raise ConfigError(
            f"width {width_deg:g}°, probability {prob:g} and budget {budget}: the "
            "width must be within 0 and 180°, the probability within 0 and 1, the "
            "budget not below 0",
            code="ask",
        )


def first_azimuth(config: GraspConfig, limits: Limits) -> float:
    """Azimuth of θ_c where the settings name none: across the supports, if reached."""
    stated = config.grasp.reference_alpha_deg
    low, high = config.reach.alpha_deg if limits.alpha_deg is None else limits.alpha_deg
    middle = 90.0 if low <= 90.0 <= high else (low + high) / 2
    return float(np.radians(middle if stated is None else stated))


def asked_event(suggestion: Suggestion) -> Event:
    """A suggestion as JSON has it: no enum, no infinity."""
    event: Event = {"event": "asked", **asdict(suggestion)}
    event["purpose"] = suggestion.purpose.value
    if not np.isfinite(suggestion.expected_width):
        event["expected_width"] = None
    return event


def suggestion_of(event: Event) -> Suggestion:
    """A suggestion from its line in a journal."""
    values = {key: value for key, value in event.items() if key != "event"}
    values["purpose"] = Purpose(values["purpose"])
    if values["expected_width"] is None:
        values["expected_width"] = float("inf")
    return Suggestion(**values)  # pyright: ignore


def _listed(value: object) -> object:
    """Tuples as the lists that JSON makes of them."""
    if isinstance(value, dict):
        return {key: _listed(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_listed(item) for item in value]
    return value
