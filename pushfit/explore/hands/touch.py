"""From the samples around one push to its heights, or to the word for what went wrong.

A height that is doubtful is none: every fault has a name, and nothing is filled in.
Excluded: what is to be pushed (`pushfit.explore.loop`).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from numpy.lib.stride_tricks import sliding_window_view

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.extract import extract_peaks
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.rules import EXCLUDING_FLAGS
from pushfit.errors import DataError
from pushfit.explore.hands.protocol import PushOutcome, PushStatus
from pushfit.explore.limits import Limits

# Faults after which the same push would only fail again.
FINAL = frozenset({"saturated", "out_of_reach", "force_abort"})
# The word for a push that should have been felt; twice in a row the object is gone.
NOTHING_FELT = "nothing_felt"
# Time after a push that no rest takes: the clock of the sensor was elsewhere [s].
AHEAD = 60.0
# Share of the rest before and after a push that its baselines are taken from.
REST_SHARE = 0.5
# A contact that is lost is lost within this share of a push; a finger that goes back
# takes longer. Fewer samples than this in a push tell the two apart by chance.
SUDDEN, LEAST_SAMPLES = 0.02, 40
# What falls is above this share of the strongest reading, and leaves this one: neither
# the end of the way back nor a slip.
FALLS_FROM, LEAVES = 0.5, 0.1
# Above so much noise of a sample it is a push [standard deviations].
CLEAR = 6.0
# Share of the push after a loss that has to stay so; a loose cable comes and goes.
STAYS = 0.95
# Share of what a push makes felt at least, below which it felt nothing.
UNFELT = 0.25


def feel(
    recording: Recording,
    outcome: PushOutcome,
    *,
    asked: Float[np.ndarray, "3"],
    limits: Limits,
    settings: PeakSettings,
    sigma: float | None,
    least: float = 0.0,
) -> PeakTable | str:
    """Measure one push.

    Args:
        recording: Samples as they came, from a rest before the push to one after it.
        asked: Displacement that was asked for [m].
        limits: What counts as a stall, a silence, a return to rest.
        sigma: Standard deviation of a height; None while it is not known [unit].
        least: Height that the push exceeds by what is believed [unit].

    Returns:
        A table of one row; where there is no height, the word for the fault.
    """
    fault = _motion_fault(outcome, asked, limits)
    if fault is None:
        recording, fault = _ordered(recording, limits)
    if fault is None:
        fault = _stream_fault(recording, outcome, limits)
    if fault is not None:
        return fault
    # Before heights are looked for: without a hump they are found in the noise.
    if is_lost(recording, outcome):
        return PushStatus.OBJECT_LOST.value
    if is_unfelt(recording, outcome, least=least):
        return NOTHING_FELT
    try:
        table = extract_peaks(_with_angles(recording, outcome), settings=settings)
    except DataError as error:
        return error.code
    if table.n_pushes != 1:
        return "several_pushes"
    # Before the flags: it would else be called a drift.
    if not _is_back(recording, outcome, table=table, limits=limits, sigma=sigma):
        return "not_at_rest"
    bad = table.flags[0] & EXCLUDING_FLAGS
    if bad:
        return min(bad)
    return table


def _motion_fault(
    outcome: PushOutcome, asked: Float[np.ndarray, "3"], limits: Limits
) -> str | None:
    """What the position node complains of, or should have."""
    if outcome.status is not PushStatus.DONE:
        return outcome.status.value
    missing = np.linalg.norm(outcome.reached - asked) / np.linalg.norm(asked)
    return PushStatus.STALLED.value if missing > limits.stall_share else None


def _ordered(recording: Recording, limits: Limits) -> tuple[Recording, str | None]:
    """Samples in the order of their time: late ones sorted in, duplicates left out."""
    time = recording.time
    if time.size < 2:
        return recording, "dropout"
    steps = np.diff(time)
    if np.any(steps < -limits.stale_s):
        return recording, "clock_jump"
    return recording.taken(np.unique(time, return_index=True)[1]), None


def _stream_fault(
    recording: Recording, outcome: PushOutcome, limits: Limits
) -> str | None:
    """Whether the sensor was silent, stuck, or on another clock during the push."""
    time = recording.time
    if time[-1] > outcome.t_end + AHEAD:
        return "clock_jump"
    near = (time >= outcome.t_start) & (time <= outcome.t_end)
    inside = np.concatenate([[outcome.t_start], time[near], [outcome.t_end]])
    if np.max(np.diff(inside)) > limits.stale_s:
        return "dropout"
    if np.any(~np.isfinite(np.stack(list(recording.channels.values())))):
        return "dropout"
    return "frozen" if _longest_still(recording, near) > limits.stale_s else None


def _longest_still(recording: Recording, near: Bool[np.ndarray, " n"]) -> float:
    """Longest time in which no channel changed at all [s]."""
    time = recording.time[near]
    values = np.stack([v[near] for v in recording.channels.values()])
    moves = np.any(np.diff(values, axis=1) != 0, axis=0)
    ends = np.concatenate([[0], np.flatnonzero(moves) + 1, [time.size - 1]])
    return float(np.max(np.diff(time[ends])))


def _with_angles(recording: Recording, outcome: PushOutcome) -> Recording:
    """Angles of the joints, or where there are none those of the displacement."""
    if recording.theta is not None and recording.alpha is not None:
        return recording
    x, y, z = outcome.reached
    n = recording.time.size
    return replace(
        recording,
        theta=np.full(n, np.arctan2(z, np.hypot(x, y))),
        alpha=np.full(n, np.arctan2(y, x)),
    )


def _is_back(
    recording: Recording,
    outcome: PushOutcome,
    *,
    table: PeakTable,
    limits: Limits,
    sigma: float | None,
) -> bool:
    """Whether the reading after the push is that before it."""
    time = recording.time
    before = time < outcome.t_start
    rest = max(float(time[-1]) - outcome.t_end, 0.0)
    after = time > outcome.t_end + (1 - REST_SHARE) * rest
    if not (np.any(before) and np.any(after)):
        return False
    height = max(float(np.abs(table.heights(c)[0])) for c in table.channels)
    # Until noise is known, a tenth of the push: less than what a lost object leaves.
    scale = height / 10 if sigma is None else limits.baseline_sigmas * sigma
    return all(
        abs(float(np.median(v[after]) - np.median(v[before]))) <= scale
        for v in recording.channels.values()
    )


def is_lost(recording: Recording, outcome: PushOutcome) -> bool:
    """Whether the contact was lost in the middle of a push.

    The change from the reading at rest then falls at once to nothing or, with a
    preload, beyond, and stays there, while the finger is still out.
    """
    excess, noise = _excess(recording, outcome)
    n = len(excess)
    if n < LEAST_SAMPLES:
        return False
    width = max(round(n * SUDDEN), 1)
    smooth = _medians(excess, width)
    before, after = smooth[: -2 * width], smooth[2 * width :]
    size = np.linalg.norm(before, axis=1)
    least = np.maximum(FALLS_FROM * np.maximum.accumulate(size), CLEAR * noise)
    has_fallen = np.sum(after * before, axis=1) <= LEAVES * size**2
    for i in np.flatnonzero((size > least) & has_fallen):
        if np.mean(after[i:] @ before[i] <= LEAVES * size[i] ** 2) > STAYS:
            return True
    return False


def is_unfelt(recording: Recording, outcome: PushOutcome, *, least: float) -> bool:
    """Whether a push changed the reading by much less than it does at least.

    Args:
        least: Height that a push exceeds by what is believed [unit].
    """
    excess, _ = _excess(recording, outcome)
    smooth = _medians(excess, max(len(excess) // 10, 1))
    return bool(np.max(np.linalg.norm(smooth, axis=1)) < UNFELT * least)


def _excess(
    recording: Recording, outcome: PushOutcome
) -> tuple[Float[np.ndarray, "n c"], float]:
    """Samples of the push less those of the rest before it, and noise of a sample."""
    time = recording.time
    values = np.stack(list(recording.channels.values()), axis=1)
    rest = values[time < outcome.t_start]
    if not len(rest):
        rest = values[:1]
    near = (time >= outcome.t_start) & (time <= outcome.t_end)
    noise = float(np.linalg.norm(np.std(rest, axis=0)))
    return values[near] - np.median(rest, axis=0), noise


def _medians(values: Float[np.ndarray, "n c"], width: int) -> Float[np.ndarray, "m c"]:
    return np.median(sliding_window_view(values, width, axis=0), axis=-1)
