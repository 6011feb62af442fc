"""From a recording to the table of peak heights.

Pushes are found in one channel, paired with a schedule or given the recorded angles,
and measured. What was found, doubted or left out is told in notes or refused in words.
Excluded: the ways of finding, pairing and measuring, each in its own module.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Float

from pushfit.config.inputs import PeaksSection
from pushfit.data.alignment import Alignment, align
from pushfit.data.components import measure_components, push_signal, signal_name
from pushfit.data.detection import Extent, find_extents
from pushfit.data.directions import recorded_directions
from pushfit.data.heights import measure_heights
from pushfit.data.mismatch import mismatch_error
from pushfit.data.peak_settings import PeakSettings
from pushfit.data.records import Recording
from pushfit.data.rests import rest_curve, without_dips
from pushfit.data.schedule import DECIMALS, PushSchedule
from pushfit.data.table import PeakTable
from pushfit.data.traces import MAX_KEPT, Trace, envelope
from pushfit.errors import DataError

DEFAULTS = PeakSettings()
# Pushes that a note names one by one.
_MAX_NAMED = 12
# Share of a dip below which a hump is what noise makes of a filled signal.
_MINOR = 0.1


@dataclass(frozen=True, slots=True)
class _Found:
    """Humps of a recording, each with the way it goes, and dips that are not asked for.

    Dips are there only where all humps go up.
    """

    extents: tuple[Extent, ...]
    signs: tuple[int, ...]
    dips: tuple[Extent, ...] = ()

    def only(self, keep: Sequence[int]) -> "_Found":
        """Some of the humps."""
        return _Found(
            tuple(self.extents[k] for k in keep), tuple(self.signs[k] for k in keep)
        )


def find_pushes(
    recording: Recording, *, settings: PeakSettings = DEFAULTS
) -> tuple[Extent, ...]:
    """Find the pushes of a recording without measuring them.

    Args:
        recording: Samples.
        settings: How to look.

    Returns:
        Their extents in order; none where the signal only rests.

    Raises:
        ConfigError: The channel to look in is not named, or not there.
        DataError: The channel has hardly any samples.
    """
    time, signal = push_signal(recording, settings)
    found = _find(time, signal, settings, signed=bool(settings.signed))
    return tuple(extent for extent in found.extents if not extent.is_brush)


def extract_peaks(
    recording: Recording,
    schedule: PushSchedule | None = None,
    *,
    settings: PeakSettings | PeaksSection = DEFAULTS,
) -> PeakTable:
    """Measure the pushes of a recording.

    Args:
        recording: Samples, with the angles of the push where there is no schedule.
        schedule: Planned pushes; a recording of k cycles may have a schedule of one.
        settings: How to find and measure; also as stated in `[peaks]` of a config.

    Returns:
        One row per push, flagged where the height is not to be trusted.

    Raises:
        ConfigError: The channel to look in is not named, or not there.
        DataError: There are no pushes (`no_pushes`), no directions (`no_directions`),
            or the pushes are not those of the schedule (`push_mismatch`).
    """
    settings = PeakSettings.of(settings)
    time, signal = push_signal(recording, settings)
    try:
        found, pairs = _pair(time, signal, schedule, settings)
    except DataError as error:
        files = ", ".join(source.path for source in recording.sources)
        message = f"{files}: {error}" if files else str(error)
        raise DataError(message, code=error.code, problems=error.problems) from None
    if schedule is None or pairs is None:
        chosen = found.only([k for k, e in enumerate(found.extents) if not e.is_brush])
        plan = recorded_directions(recording, chosen.extents)
    else:
        is_there = np.flatnonzero(pairs.hump >= 0)
        chosen = found.only([int(k) for k in pairs.hump[is_there]])
        plan = schedule.repeated(pairs.n_cycles).rows(is_there)
    columns = _measured(recording, time, signal, chosen, settings)
    frame = pd.DataFrame(
        {
            "push": plan.push,
            "theta_deg": np.degrees(plan.theta).round(DECIMALS),
            "alpha_deg": np.degrees(plan.alpha).round(DECIMALS),
            "repeat": plan.repeat,
            **columns,
            "t_start_s": [e.t_start for e in chosen.extents],
            "t_end_s": [e.t_end for e in chosen.extents],
        }
    )
    notes = [*recording.notes, _definition_note(columns["definition"])]
    notes += _left_out(found, chosen)
    if schedule is not None and pairs is not None:
        notes += _pairing_notes(schedule, pairs, found)
    sources = recording.sources
    if schedule is not None and schedule.source is not None:
        sources = (*sources, schedule.source)
    table = PeakTable.from_frame(
        frame, sources=sources, notes=(*notes, *_flag_notes(frame))
    )
    return replace(table, traces=(_trace(recording, settings, table=table),))


def _trace(recording: Recording, settings: PeakSettings, *, table: PeakTable) -> Trace:
    """The signal that all rows of a table were measured in."""
    time, signal = envelope(*push_signal(recording, settings), max_points=MAX_KEPT)
    return Trace(
        path=recording.sources[0].path if recording.sources else "",
        name=signal_name(recording, settings),
        unit=table.unit,
        time=time,
        signal=signal,
        first_row=0,
        n_rows=table.n_pushes,
    )


def _find(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
    *,
    signed: bool,
) -> _Found:
    """Humps, and with `signed` dips too, in order."""

    def extents_of(picture: Float[np.ndarray, " n"]) -> tuple[Extent, ...]:
        return find_extents(
            time,
            picture,
            split=settings.split,
            min_height=settings.min_height,
            smoothing=settings.smoothing,
        )

    if not signed:
        # A return from a dip to rest would look like a hump.
        filled, dips = without_dips(time, signal, extents_of)
        extents = tuple(_beside(dips, hump) for hump in extents_of(filled))
        return _Found(extents, (1,) * len(extents), dips)
    extents = extents_of(np.abs(signal - rest_curve(time, signal)))
    signs = tuple(-1 if _is_dip(time, signal, extent) else 1 for extent in extents)
    return _Found(extents, signs)


def _beside(dips: Sequence[Extent], hump: Extent) -> Extent:
    """Call a hump a brush if it is but the shoulder of a deeper dip, or far smaller."""
    is_minor = any(
        hump.height < _MINOR * dip.height
        or (
            hump.height < dip.height
            and dip.t_start - hump.width < hump.t_end
            and dip.t_end + hump.width > hump.t_start
        )
        for dip in dips
    )
    return replace(hump, is_brush=True) if is_minor else hump


def _is_dip(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"], extent: Extent
) -> bool:
    """Whether the middle of a push lies below its two feet."""
    first, last = np.searchsorted(
        time, [extent.t_peak - extent.width / 4, extent.t_peak + extent.width / 4]
    )
    first = min(int(first), len(signal) - 1)
    top = signal[first : max(int(last), first + 1)].mean()
    feet = signal[[extent.start, max(extent.end - 1, extent.start)]].mean()
    return bool(top < feet)


def _pair(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    schedule: PushSchedule | None,
    settings: PeakSettings,
) -> tuple[_Found, Alignment | None]:
    """Humps, and which of them are the planned pushes."""
    found = _find(time, signal, settings, signed=bool(settings.signed))
    pairs = _align(found, schedule)
    if (
        settings.signed is None
        and schedule is not None
        and (pairs is None or not pairs.is_complete)
        and np.any(schedule.theta < 0)
    ):
        both = _find(time, signal, settings, signed=True)
        better = _align(both, schedule)
        if better is not None and (pairs is None or better.n_odd < pairs.n_odd):
            found, pairs = both, better
    if all(extent.is_brush for extent in found.extents):
        raise _no_pushes(signal, settings, len(found.dips))
    if schedule is not None and pairs is not None and not settings.allow_missing:
        if not pairs.is_complete:
            raise mismatch_error(schedule, pairs, found.extents)
    return found, pairs


def _align(found: _Found, schedule: PushSchedule | None) -> Alignment | None:
    """Pairs with a schedule, if there is one and anything to pair."""
    if schedule is None or all(extent.is_brush for extent in found.extents):
        return None
    return align(
        np.array([extent.t_peak for extent in found.extents]),
        [extent.is_brush for extent in found.extents],
        n_planned=schedule.n_pushes,
        planned_times=schedule.time,
    )


def _no_pushes(
    signal: Float[np.ndarray, " n"], settings: PeakSettings, n_dips: int
) -> DataError:
    """Say what there is instead of pushes."""
    spread = float(np.ptp(signal))
    if n_dips:
        what = f"the signal falls from rest {n_dips} times and never rises above it"
    elif spread == 0.0:
        what = f"the signal is {signal[0]:g} throughout, no variation"
    else:
        what = f"no hump stands out of the noise, all readings lie within {spread:g}"
    return DataError(
        f"no pushes found: {what}; check the channel"
        f"{f' {settings.channel!r}' if settings.channel else ''}, invert a signal that "
        "dips (--invert), or state the smallest height of a push as min_height",
        code="no_pushes",
    )


def _measured(
    recording: Recording,
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    chosen: _Found,
    settings: PeakSettings,
) -> dict[str, Sequence[float] | Sequence[str]]:
    """Height columns of the table, with what each height is."""
    turned = -1.0 if settings.invert else 1.0
    is_force = settings.normal is not None
    heights = measure_heights(
        time,
        signal,
        chosen.extents,
        definition=settings.height,
        # The limit is that of the channel, not of its picture.
        limit=None if settings.limit is None or is_force else turned * settings.limit,
        signs=chosen.signs,
    )
    words = [set(h.flags) for h in heights]
    times = {
        "t_peak_s": [h.t_peak for h in heights],
        "definition": [h.definition for h in heights],
    }
    if is_force:
        columns, is_cut = measure_components(
            recording,
            chosen.extents,
            heights,
            settings=settings,
            time=time,
            length=signal,
        )
        for own, cut in zip(words, is_cut, strict=True):
            own |= {"saturated"} if cut else set()
        return {**columns, **times, "flags": _joined(words)}
    name = settings.channel or next(iter(recording.channels))
    unit = recording.units[name]
    return {
        f"height_{unit}": [h.height for h in heights],
        f"height_sd_{unit}": [h.sd for h in heights],
        f"baseline_{unit}": [turned * h.baseline for h in heights],
        **times,
        "flags": _joined(words),
    }


def _joined(words: Sequence[set[str]]) -> list[str]:
    """Flag words of each push as one cell."""
    return [";".join(sorted(own)) for own in words]


def _pairing_notes(
    schedule: PushSchedule, pairs: Alignment, found: _Found
) -> list[str]:
    """What the pairing took for granted."""
    notes = []
    if pairs.n_cycles > 1:
        notes.append(f"the recording runs {pairs.n_cycles} times through the schedule")
    if -1 in found.signs:
        notes.append("pushes go both ways from rest; heights of dips are negative")
    if not pairs.is_complete:
        error = mismatch_error(schedule, pairs, found.extents)
        notes += [problem.message for problem in error.problems]
    return notes


def _definition_note(definitions: Sequence[float] | Sequence[str]) -> str:
    """What the heights are; a warning where they are not all the same."""
    n_held = list(definitions).count("plateau")
    if n_held in (0, len(definitions)):
        return f"heights are those of the {definitions[0]} of each push"
    return (
        f"mixed definitions: {n_held} of {len(definitions)} heights are plateaus, the "
        'others apexes; state peaks.height = "apex" or "plateau" before they are '
        "compared in a fit"
    )


def _left_out(found: _Found, chosen: _Found) -> list[str]:
    """Brushes and dips that are no rows."""
    brushes = [e for e in found.extents if e.is_brush and e not in chosen.extents]
    notes = []
    if brushes:
        notes.append(
            f"humps far smaller than the pushes are left out: {_times(brushes)}"
        )
    if found.dips:
        notes.append(
            f"the signal falls below rest: {_times(found.dips)}; state signed = true "
            "if these are pushes as well"
        )
    return notes


def _times(extents: Sequence[Extent]) -> str:
    """When the first of some humps are."""
    named = ", ".join(f"{e.t_peak:.2f} s" for e in extents[:_MAX_NAMED])
    more = len(extents) - _MAX_NAMED
    return f"at {named}" + (f" and {more} more" if more > 0 else "")


def _flag_notes(frame: pd.DataFrame) -> list[str]:
    """One note per flag, with the pushes that have it."""
    notes = []
    for flag in sorted({w for cell in frame["flags"] for w in cell.split(";") if w}):
        pushes = [
            str(push)
            for push, cell in zip(frame["push"], frame["flags"], strict=True)
            if flag in cell.split(";")
        ]
        more = len(pushes) - _MAX_NAMED
        ending = f" and {more} more" if more > 0 else ""
        notes.append(f"{flag}: push {', '.join(pushes[:_MAX_NAMED])}{ending}")
    return notes
