"""Directions of pushes from the angles recorded with them, also beside a plan.

Excluded: directions from a schedule (`pushfit.data.plans.pairing`).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.feet import SHORTEST
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.recordings.records import Recording
from pushfit.data.text.faults import listed
from pushfit.errors import DataError, counted

# The direction of a push is that of its end, so only this share of its width to either
# side of the top counts. Half or twice changes no test, with spikes of a tracker in it.
_TOP_SHARE = 0.25
# Of the samples there, this share is to be within so many degrees of the median.
_HELD_SHARE, _TURNS_DEG = 0.9, 5.0
# A recorded direction is another than planned beyond this; of those some are shown.
_OFF_DEG, _N_SHOWN = 5.0, 3


def recorded_directions(
    recording: Recording, extents: Sequence[Extent], *, n_dips: int = 0
) -> PushSchedule:
    """Take the direction of each push from the recorded angles around its top.

    Medians, because trackers have spikes; that of the azimuth is taken about its mean
    direction, so that ±180° is one direction.

    Args:
        recording: Samples with both angles.
        n_dips: Dips beside the pushes, for the message where angles are missing.

    Raises:
        DataError: The recording has no angles, or none at a push (`no_directions`).
    """
    if recording.theta is None or recording.alpha is None:
        files = [source.path for source in recording.sources]
        dips = f" ({n_dips} dips below rest are left out)" if n_dips else ""
        raise DataError(
            f"{', '.join(files) or 'the recording'}: has no angles theta and alpha of "
            f"its {len(extents)} pushes{dips}; give a schedule with a row "
            "push,theta_deg,alpha_deg,repeat for each, or map the columns that hold "
            "the angles",
            code="no_directions",
        )
    tops = [_top(recording, extent) for extent in extents]
    theta = np.array([_median(recording.theta[top]) for top in tops])
    alpha = np.array([_circular_median(recording.alpha[top]) for top in tops])
    lost = np.flatnonzero(~np.isfinite(theta + alpha))
    if lost.size:
        when = ", ".join(f"{extents[int(k)].t_peak:.2f} s" for k in lost)
        raise DataError(
            f"no angles are recorded at the pushes at {when}; fill them in or give a "
            "schedule",
            code="no_directions",
        )
    return PushSchedule.planned(theta, alpha)


def turning(
    recording: Recording, extents: Sequence[Extent], plan: PushSchedule
) -> tuple[str, ...]:
    """What to say where recorded directions turn while heights are measured.

    Args:
        plan: The directions taken, as `recorded_directions` gives them.
    """
    assert recording.theta is not None
    assert recording.alpha is not None
    turns = {}
    for push, extent, theta, alpha in zip(
        plan.push, extents, plan.theta, plan.alpha, strict=True
    ):
        top = _top(recording, extent)
        turns[f"{push}"] = _turned_deg(
            recording.theta[top], recording.alpha[top], theta, alpha
        )
    turned = [push for push, off in turns.items() if off > _TURNS_DEG]
    if not turned:
        return ()
    return (
        f"the recorded directions of {counted(len(turned), 'push')} "
        f"({listed(turned)}) turn by up to {max(turns.values()):.0f}° about their "
        "medians, which the table has, while heights are measured; hold the direction, "
        "or state by [noise] theta_sd_deg how far it errs",
    )


def off_plan(
    recording: Recording, extents: Sequence[Extent], plan: PushSchedule
) -> tuple[str, ...]:
    """What to say where directions were recorded that are not those of the plan.

    Directions that scatter during a push by as much as they are off tell nothing. An
    angle that is not recorded is the planned one.

    Args:
        extents: Pushes that the recording shows.
        plan: Their directions by the schedule.
    """
    if recording.theta is None and recording.alpha is None:
        return ()
    shown, most = [], 0.0
    for push, extent, *planned in zip(
        plan.push, extents, plan.theta, plan.alpha, strict=True
    ):
        top = _top(recording, extent)
        theta, alpha = (
            np.array([own]) if angle is None else angle[top]
            for angle, own in zip(
                (recording.theta, recording.alpha), planned, strict=True
            )
        )
        own = _median(theta), _circular_median(alpha)
        off = float(_between_deg(*own, *planned))
        if off > _OFF_DEG and off > _turned_deg(theta, alpha, *own):
            shown.append(f"push {push} {_degrees(*planned)} and {_degrees(*own)}")
            most = max(most, off)
    if not shown:
        return ()
    return (
        f"the recorded directions of {counted(len(shown), 'push')} are up to "
        f"{most:.0f}° off those of the schedule, which the table has; planned and "
        f"recorded (theta, alpha) of {listed(shown, _N_SHOWN)}. Put the rows of the "
        "schedule in the order in which the pushes were made, or leave it out where "
        "the recorded directions are right",
    )


def _turned_deg(
    theta: Float[np.ndarray, " n"],
    alpha: Float[np.ndarray, " m"],
    usual_theta: float,
    usual_alpha: float,
) -> float:
    """How far most directions of a push stay from their median [deg]."""
    off = _between_deg(theta, alpha, usual_theta, usual_alpha)
    return float(np.nanquantile(off, _HELD_SHARE))


def _between_deg(
    theta: Float[np.ndarray, "*n"] | float,
    alpha: Float[np.ndarray, "*m"] | float,
    other_theta: float,
    other_alpha: float,
) -> Float[np.ndarray, "*k"]:
    """Angle between directions and another one [deg]."""
    cosine = np.sin(theta) * np.sin(other_theta)
    cosine = cosine + np.cos(theta) * np.cos(other_theta) * np.cos(alpha - other_alpha)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _degrees(theta: float, alpha: float) -> str:
    """A direction in words."""
    theta, alpha = np.degrees([theta, alpha]).round(1) + 0.0
    return f"({theta:g}, {alpha:g})"


def _top(recording: Recording, extent: Extent) -> slice:
    """Samples around the top of a push, at least the nearest one on either side."""
    half = max(_TOP_SHARE * extent.width, SHORTEST)
    first, last = np.searchsorted(
        recording.time, [extent.t_peak - half, extent.t_peak + half]
    )
    return slice(max(0, int(first) - 1), int(last) + 1)


def _median(angle: Float[np.ndarray, " n"]) -> float:
    """Median of the samples there are."""
    known = angle[np.isfinite(angle)]
    return float(np.median(known)) if known.size else np.nan


def _circular_median(angle: Float[np.ndarray, " n"]) -> float:
    """Median of an azimuth, in (-π, π]."""
    known = angle[np.isfinite(angle)]
    if known.size == 0:
        return np.nan
    mean = np.angle(np.exp(1j * known).sum())
    offset = np.angle(np.exp(1j * (known - mean)))
    return float(np.angle(np.exp(1j * (mean + np.median(offset)))))
