"""Which humps of a recording are pushes, before any of them has a direction.

What the user says of the humps is applied here: windows of time to leave out or to take
in, and which way pushes go. Excluded: pairing with a plan
(`pushfit.data.plans.pairing`).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.components import (
    in_signal_unit,
    looked_at,
    push_signal,
    samples_around,
)
from pushfit.data.peaks.heights import measure_heights
from pushfit.data.peaks.jerks import are_jerks, notches
from pushfit.data.pushes.detection import (
    BRIEFER,
    FIRST_SMOOTHING,
    find_extents,
)
from pushfit.data.pushes.dips import rest_curves, without_dips
from pushfit.data.pushes.feet import CLEAR
from pushfit.data.pushes.found_humps import Extent, FoundHumps, is_in
from pushfit.data.pushes.noise import SignalNoise
from pushfit.data.pushes.running_means import RunningMeans, View
from pushfit.data.recordings.records import Recording
from pushfit.data.units import Unit
from pushfit.errors import DataError, counted

DEFAULTS = PeakSettings()
# Share of the usual dip below which a hump is what noise makes of a filled signal. Of
# the largest, a press of `p0_Pa` is lost where the recording ends at some moments.
_MINOR = 0.1
# The shoulder of a dip begins within so many times its width. With 4 a first push of
# the soft skin is lost after a dip; with half, a wander of `p0_Pa` is a push.
_SHOULDER = 3.0
# A hump that is briefer than this may be a jerk: twice what no push is [s]. Not tuned.
_BRIEF = 2 * FIRST_SMOOTHING
# What rings is lower than this share of its push. Not tuned.
_RINGING = 0.5


def find_pushes(
    recording: Recording, *, settings: PeakSettings = DEFAULTS
) -> tuple[Extent, ...]:
    """Find the pushes of a recording, in order, without measuring them."""
    recording = looked_at(recording, settings)
    settings = in_signal_unit(recording, settings)
    _, _, found = search(*push_signal(recording, settings), settings)
    return tuple(extent for extent in found.extents if not extent.is_brush)


def search(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"], FoundHumps]:
    """Find humps as `find` does, without notches, and jerks that would pass for some.

    A notch in a push is too brief for a rest between two.

    Returns:
        Times and samples that are left, and the humps in them.
    """
    may_be_cut = settings.normal is None and not settings.signed
    if not may_be_cut or not (every := notches(time, signal)):
        return _without_jerks(time, signal, settings)
    kept = _kept(time, every)
    *left, found = _without_jerks(time[kept], signal[kept], settings)
    # One outside of all pushes is a dip.
    pushes = [hump for hump in found.extents if not hump.is_brush]
    own = [
        part
        for part in every
        if any(e.t_start < time[part][0] and time[part][-1] < e.t_end for e in pushes)
    ]
    if len(own) < len(every):
        kept = _kept(time, own)
        *left, found = _without_jerks(time[kept], signal[kept], settings)
    lows = tuple(float(time[part][np.argmin(signal[part])]) for part in own)
    return left[0], left[1], replace(found, notches=lows)


def _kept(
    time: Float[np.ndarray, " n"], parts: Sequence[slice]
) -> Bool[np.ndarray, " n"]:
    """Which samples are in none of some parts."""
    kept = np.ones(len(time), dtype=bool)
    for part in parts:
        kept[part] = False
    return kept


def _without_jerks(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"], FoundHumps]:
    """Find humps without jerks that would pass for some.

    A hump that is briefer than any push is a jerk where, without its samples, there are
    humps ten times as long: on a hold, which it would hide, or somewhere else. What
    rings after one of these is brief as well, but keeps its samples, those of a rest.
    """
    signed = bool(settings.signed)
    found = find(time, signal, settings, signed=signed)

    def may_be_jerk(hump: Extent) -> bool:
        is_asked_for = is_in([hump.t_peak], settings.include)
        return hump.width < _BRIEF and not (hump.is_brush or is_asked_for)

    brief = tuple(filter(may_be_jerk, found.extents))
    if not brief or settings.normal is not None:
        return time, signal, found
    near = np.zeros(len(time), dtype=bool)
    for hump in brief:
        ends = hump.t_start - FIRST_SMOOTHING, hump.t_end + FIRST_SMOOTHING
        near[slice(*np.searchsorted(time, ends))] = True
    kept = np.ones(len(time), dtype=bool)
    # What is far below its top shows once that is gone. A jerk is the lesser part.
    while 2 * np.count_nonzero(kept) > len(time):
        is_jerk = are_jerks(time[kept], signal[kept]) & near[kept]
        if not is_jerk.any():
            break
        kept[kept] = ~is_jerk
    else:
        return time, signal, found
    # On a slow push, whose feet it has, one may be too wide to be told by what is
    # beside it. What is cut may be as wide as the others are.
    for hump in brief:
        if hump.t_end - hump.t_start > BRIEFER * hump.width and not hump.is_cut:
            ends = hump.middle - hump.width, hump.middle + hump.width
            kept[slice(*np.searchsorted(time, ends))] = False
    without = find(time[kept], signal[kept], settings, signed=signed)
    pushes = [hump for hump in without.extents if not hump.is_brush]
    longest = max(hump.width for hump in brief)
    clear = CLEAR * SignalNoise.of(time[kept], signal[kept]).sigma
    long = [e for e in pushes if e.width > BRIEFER * longest and e.height > clear]
    if not long:
        return time, signal, found
    left = [hump for hump in without.extents if may_be_jerk(hump)]
    ringing = {hump for hump in left if any(_is_after(push, hump) for push in long)}
    extents = tuple(
        replace(hump, is_brush=hump.is_brush or hump in ringing)
        for hump in without.extents
    )
    jerks = tuple(
        hump
        for hump in brief
        if not any(own.t_start < hump.t_peak < own.t_end for own in left)
    )
    return time[kept], signal[kept], replace(without, extents=extents, jerks=jerks)


def _is_after(push: Extent, hump: Extent) -> bool:
    """Whether a hump follows the begin of a push so closely, and is so low, as to ring.

    No farther from it than that is long.
    """
    until = 2 * push.t_end - push.t_start
    is_near = push.t_start - hump.width < hump.t_peak < until
    return is_near and hump.height < _RINGING * push.height and not hump.is_cut


def find(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
    *,
    signed: bool,
) -> FoundHumps:
    """Find humps, and with `signed` dips too, in order."""
    # Of the samples as they are: in a picture of them equal readings differ by
    # rounding, and the finest step would be that.
    noise, course = SignalNoise.of(time, signal), RunningMeans.of(time, signal)

    def extents_of(picture: Float[np.ndarray, " n"]) -> tuple[Extent, ...]:
        view = View(
            time=time,
            signal=picture,
            course=course if picture is signal else RunningMeans.of(time, picture),
            noise=noise,
            min_height=settings.min_height,
            smoothing=settings.smoothing,
            split=settings.split,
        )
        return find_extents(view)

    def deep_enough(picture: Float[np.ndarray, " n"]) -> tuple[Extent, ...]:
        return tuple(dip for dip in extents_of(picture) if not dip.is_low)

    if not signed:
        # A return from a dip to rest would look like a hump.
        filled, dips = without_dips(time, signal, noise=noise, extents_of=deep_enough)
        humps = extents_of(filled)
        extents = [_beside(dips, hump, humps) for hump in humps]
    else:
        dips = ()
        extents = [
            replace(hump, sign=-1 if _is_dip(time, signal, hump) else 1)
            for hump in extents_of(np.abs(signal - rest_curves(time, signal[None])[0]))
        ]
    if settings.min_height is not None and extents:
        # By the height that is reported: the course that humps are found in is lower.
        heights = measure_heights(
            time, signal, extents, definition=settings.height, course=course
        )
        extents = [
            replace(hump, is_low=abs(own.height) < settings.min_height)
            for hump, own in zip(extents, heights, strict=True)
        ]
    found = FoundHumps(extents=tuple(extents), course=course, dips=dips)
    is_named = bool(settings.exclude or settings.include)
    times = tops(time, signal, found, settings=settings) if is_named else None
    return _as_told(found, settings, times or [[e.t_peak] for e in extents])


def tops(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    found: FoundHumps,
    *,
    settings: PeakSettings,
) -> list[list[float]]:
    """Times by which windows name each hump [s].

    Messages tell when it is at its highest, and tables where its height is read, which
    on a plateau is its middle.
    """
    if not found.extents:
        return []
    heights = measure_heights(
        time, signal, found.extents, definition=settings.height, course=found.course
    )
    read = np.clip([own.t_peak for own in heights], time[0], time[-1]).tolist()
    return [[e.t_peak, own] for e, own in zip(found.extents, read, strict=True)]


def _as_told(
    found: FoundHumps, settings: PeakSettings, times: Sequence[Sequence[float]]
) -> FoundHumps:
    """Leave out and take in the humps that the user names by their time or height."""
    extents, excluded = [], []
    for hump, own in zip(found.extents, times, strict=True):
        if hump.is_low or is_in(own, settings.exclude):
            excluded.append(hump)
        else:
            is_brush = hump.is_brush and not is_in(own, settings.include)
            extents.append(replace(hump, is_brush=is_brush))
    every = [*times, *([dip.t_peak] for dip in found.dips)]
    return FoundHumps(
        extents=tuple(extents),
        course=found.course,
        dips=tuple(e for e in found.dips if not is_in([e.t_peak], settings.exclude)),
        excluded=tuple(excluded),
        idle=tuple(
            window
            for window in (*settings.exclude, *settings.include)
            if not any(is_in(own, [window]) for own in every)
        ),
    )


def _beside(dips: Sequence[Extent], hump: Extent, humps: Sequence[Extent]) -> Extent:
    """Call a hump a brush if it is but the shoulder of a deeper dip, or far smaller.

    Far smaller humps are no pushes where dips are as many as larger ones. Dips that are
    briefer than any push, and far briefer than the hump, are jerks without shoulders.
    """
    long = min(FIRST_SMOOTHING, hump.width / BRIEFER)
    dips = [dip for dip in dips if dip.width >= long]
    usual = float(np.median([dip.height for dip in dips])) if dips else 0.0
    least = _MINOR * usual
    is_minor = hump.height < least and len(dips) >= sum(
        e.height >= least for e in humps
    )
    for dip in dips:
        reach = min(hump.width, _SHOULDER * dip.width)
        is_near = dip.t_start - reach < hump.t_end and hump.t_start < dip.t_end + reach
        is_minor |= is_near and hump.height < dip.height
    return replace(hump, is_brush=True) if is_minor else hump


def _is_dip(
    time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"], extent: Extent
) -> bool:
    """Whether the middle of a push lies below its two feet."""
    top = signal[samples_around(time, extent.t_peak, extent.width / 4)].mean()
    feet = signal[[extent.start, max(extent.end - 1, extent.start)]].mean()
    return bool(top < feet)


def no_pushes(
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
    found: FoundHumps,
    *,
    unit: Unit,
) -> DataError:
    """Say what there is instead of pushes."""
    n_dips, n_out = len(found.dips), len(found.excluded)
    spread = float(np.ptp(signal))
    if n_out:
        options = ("`exclude`", settings.exclude), ("`min_height`", settings.min_height)
        by = " or ".join(option for option, stated in options if stated)
        return DataError(
            f"no pushes found: {by} leaves out {n_out} and nothing else stands out; "
            "leave out fewer",
            code="no_pushes",
        )
    if n_dips:
        which = "inverted signal" if settings.invert else "signal"
        what = f"the {which} falls from rest {counted(n_dips, 'time')} and "
        if found.extents:
            top = max(found.extents, key=lambda hump: hump.height)
            what += f"rises above it by {unit.shown(top.height)} at most, at "
            what += f"{top.t_peak:.2f} s"
        else:
            what += "never rises above it"
    elif spread == 0.0:
        level = unit.shown(signal[0], n_digits=6)
        what = f"the signal is {level} throughout, no variation"
    else:
        within = f"all readings lie within {unit.shown(spread)}"
        what = f"no hump stands out of the noise, {within}"
    turn = "up (leave out `invert`)" if settings.invert else "down (try `invert=True`)"
    dips = f"; pushes may go {turn}" if n_dips else ""
    return DataError(
        f"no pushes found: {what}{dips}; check the channel"
        f"{f' {settings.channel!r}' if settings.channel else ''}, or state the "
        f"smallest height of a push in {unit.name} by `min_height`",
        code="no_pushes",
    )
