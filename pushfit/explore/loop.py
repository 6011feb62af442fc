"""A hand explores a grasp: ask, push, feel, tell, until there is an answer.

Whatever goes wrong, the finger is taken back before anything else is thought of.
Excluded: which push, and when to stop (`pushfit.explore.explorer`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushfit.config.inputs import PeakSettings
from pushfit.data.tables.peak_table import PeakTable
from pushfit.explore.belief.predict import least_height
from pushfit.explore.belief.tables import told_rows
from pushfit.explore.explorer import Explorer
from pushfit.explore.hands.protocol import Hand, PushStatus
from pushfit.explore.hands.touch import FINAL, NOTHING_FELT, feel
from pushfit.explore.limits import TOLERATED, Limits, tip_displacement
from pushfit.explore.records import State, Suggestion

# Rest recorded before a push, as a multiple of the least rest between two.
RESTS = 1.0
# Rounding of an elevation that is compared with the reach of a hand [deg]. Not tuned.
ROUNDING = 1e-6
# The fault after which no push of this exploration means anything any more.
LOST = PushStatus.OBJECT_LOST.value


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """One push of an exploration, for whoever watches.

    Args:
        suggestion: The push as it was asked for.
        fault: Why it gave no height; None where it gave one.
        state: Where the exploration stands after it.
    """

    suggestion: Suggestion
    fault: str | None
    state: State


def nothing(step: Step) -> None:
    """Let a step pass without telling anybody."""


def explore(
    explorer: Explorer,
    hand: Hand,
    *,
    settings: PeakSettings,
    watch: Callable[[Step], None] = nothing,
) -> State:
    """Push until there is an answer; one that was stopped goes on.

    Args:
        settings: How heights are taken from the samples; what they leave open of the
            normal force and of signs follows from the exploration.
    """
    if len(explorer.question.channels) > 1 and settings.normal is None:
        settings = settings.model_copy(update={"normal": "fz"})
    if explorer.limits.theta_deg[0] < 0 and settings.signed is None:
        # A finger that pulls back from a preload lowers the reading.
        settings = settings.model_copy(update={"signed": True})
    explorer.go_on()
    try:
        hand.retract()
        while suggestions := explorer.ask():
            suggestion = suggestions[0]
            felt = _push(explorer, hand, suggestion, settings=settings)
            _note(explorer, suggestion, felt)
            fault = felt if isinstance(felt, str) else None
            watch(Step(suggestion=suggestion, fault=fault, state=explorer.state))
    except BaseException:
        hand.stop()
        raise
    finally:
        hand.retract()
    return explorer.state


def _push(
    explorer: Explorer, hand: Hand, suggestion: Suggestion, *, settings: PeakSettings
) -> PeakTable | str:
    """Make one push and measure it; the finger is back when this returns."""
    limits, belief = explorer.limits, explorer.belief
    length = suggestion.length_share * float(belief.grasp.push_length)
    asked = tip_displacement(suggestion.theta, suggestion.alpha, length)
    if not _is_allowed(hand, suggestion, length=length, limits=limits):
        return "out_of_reach"
    hand.rest(limits.rest_s)
    try:
        outcome = hand.push(asked, max_force=limits.force)
    finally:  # whatever comes between
        hand.retract()
    hand.rest(limits.rest_s)
    recording = hand.samples(outcome.t_start - RESTS * limits.rest_s)
    return feel(
        recording,
        outcome,
        asked=asked,
        limits=limits,
        settings=settings,
        sigma=None if belief.is_guess else float(np.min(belief.sigma)),
        least=least_height(belief, suggestion, prob=TOLERATED),
    )


def _note(explorer: Explorer, suggestion: Suggestion, felt: PeakTable | str) -> None:
    if isinstance(felt, PeakTable):
        (row,) = told_rows(felt)
        explorer.tell(row.theta, row.alpha, row.heights, sd=row.sd, flags=row.flags)
        return
    fault = felt
    before = [failure.reason for failure in explorer.history.in_a_row[-1:]]
    if fault == NOTHING_FELT and before == [NOTHING_FELT]:
        fault = LOST
    if fault == LOST:
        explorer.stop(
            f"{LOST}: the finger lost the object at push {suggestion.number}, "
            f"{suggestion.describe()}; grasp it again and begin another exploration: "
            "pushes of this one belong to this grasp",
            is_over=True,
        )
    if fault in FINAL:
        explorer.abandon(suggestion, fault)
    else:
        explorer.fail(suggestion, fault)


def _is_allowed(
    hand: Hand, suggestion: Suggestion, *, length: float, limits: Limits
) -> bool:
    """Whether both the limits and the hand itself let it push there."""
    reach = hand.reach()
    low, high = reach.theta_deg
    first, last = np.radians(reach.alpha_deg)
    return low - ROUNDING <= suggestion.theta_deg <= high + ROUNDING and limits.allow(
        suggestion.theta,
        suggestion.alpha,
        length=length,
        azimuths=(float(first), float(last)),
    )
