"""Signals that pushes are found in, and heights along and across the contact normal.

A force sensor gives components in its own frame. Pushes are found in the length of the
change of force, and measured in the component along the normal and in the length of
the rest: the `height_normal` and `height_tangential` of the model. Excluded: turning
the sensor's frame; one of its axes must be the contact normal.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.heights import Height
from pushfit.data.peaks.jerks import are_jerks
from pushfit.data.peaks.rests import rests_of
from pushfit.data.peaks.saturation import saturated_pushes
from pushfit.data.pushes.dips import rest_curves
from pushfit.data.pushes.found_humps import Extent
from pushfit.data.recordings.recognise import if_in
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.traces import (
    MAX_KEPT,
    ComponentTrace,
    SignedHeights,
    envelope,
)
from pushfit.data.text.faults import listed
from pushfit.data.units import Unit, split_unit
from pushfit.errors import ConfigError, DataError, stated
from pushfit.parameters import TINY

# Share of the width to either side of the top that the components are averaged over.
_TOP_SHARE = 0.2
# Fewest samples of a channel: what a search for pushes needs at least, too.
_MIN_SAMPLES = 5
# Change of a channel that is beyond doubt one by the push [sd]: a channel that a push
# leaves alone dwells at its largest reading, too, and is not cut there.
_CLEAR = 10.0


def looked_at(recording: Recording, settings: PeakSettings) -> Recording:
    """The part of a recording that is looked at, jerks of force components left out."""
    part = recording.between(settings.begin, settings.end)
    if settings.normal is None:
        return part
    channels, moments = {}, []
    for name, samples in part.channels.items():
        known = np.flatnonzero(np.isfinite(samples))
        _enough(time := part.time[known], name)
        is_jerk = are_jerks(time, samples[known])
        channels[name] = samples.copy()
        channels[name][known[is_jerk]] = np.nan
        moments.extend(time[np.diff(is_jerk, prepend=False) & is_jerk].tolist())
    if not moments:
        return part
    # Components share their jerks.
    times = dict.fromkeys(f"{when:.2f} s" for when in sorted(moments))
    caution = f"jerks far briefer than a push are left out: at {listed([*times])}"
    return replace(part, channels=channels, cautions=(*part.cautions, caution))


def push_signal(
    recording: Recording, settings: PeakSettings
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Signal that the pushes are found in, pushes going up.

    Returns:
        Times [s] and samples, those that are missing left out.

    Raises:
        ConfigError: The channel is not named, or not there (`channel`).
        DataError: The channel has fewer than five samples (`too_short`), or the force
            along the normal or across it never changes (`constant`).
    """
    if settings.normal is not None:
        _, name = _normal(recording, settings.normal)
        _refuse_constant(recording, name)
        forces = np.stack(list(recording.channels.values()))
        known = np.isfinite(forces).all(axis=0)
        time = _enough(recording.time[known], name)
        change = forces[:, known] - rest_curves(time, forces[:, known])
        return time, np.linalg.norm(change, axis=0)
    name = _channel(recording, settings.channel)
    samples = recording.channels[name]
    time, known = recording.time, np.isfinite(samples)
    # Copies of a long recording cost more than finding its pushes.
    if not known.all():
        time, samples = time[known], samples[known]
    _enough(time, name)
    return time, -samples if settings.invert else samples


def signal_name(recording: Recording, settings: PeakSettings) -> str:
    """Words for what `push_signal` returns."""
    if settings.normal is not None:
        return "change of force"
    name = _channel(recording, settings.channel)
    return f"{name}, sign changed" if settings.invert else name


def stated_unit(recording: Recording, settings: PeakSettings) -> Unit:
    """Unit that the recording has the signal in: that of messages and settings."""
    normal = settings.normal
    name = settings.channel if normal is None else normal.removeprefix("-")
    name = name if name in recording.units else next(iter(recording.units))
    canonical = recording.units[name]
    own = Unit(name=canonical, quantity="signal", canonical=canonical)
    return recording.stated.get(name, own)


def in_signal_unit(recording: Recording, settings: PeakSettings) -> PeakSettings:
    """The same settings, readings and heights of them as `push_signal` has them."""
    unit = stated_unit(recording, settings)
    told = {"min_height": settings.min_height, "limit": settings.limit}
    own = {
        name: float(unit.to_canonical(np.array(value)))
        for name, value in told.items()
        if value is not None
    }
    return settings.model_copy(update=own)


@dataclass(frozen=True, slots=True, kw_only=True)
class ComponentHeights:
    """Heights of pushes in force components.

    Args:
        columns: Heights along the normal and across it, as columns of a peak table.
        is_cut: Which pushes reach the end of a channel's range.
        signed: Heights in each component by itself.
    """

    columns: dict[str, list[float]]
    is_cut: Bool[np.ndarray, " p"]
    signed: dict[str, SignedHeights]


def measure_components(
    recording: Recording,
    extents: Sequence[Extent],
    heights: Sequence[Height],
    *,
    settings: PeakSettings,
    time: Float[np.ndarray, " n"],
    length: Float[np.ndarray, " n"],
) -> ComponentHeights:
    """Heights along the normal and across it.

        Δ_c = (mean_top F_c - rest F_c) · top |ΔF| / mean_top |ΔF|
        height_normal = Δ_n,   height_tangential = sqrt(Σ_t Δ_t² - sd²)

    with means around the measured top of |ΔF|. The sd across the tangential force is
    subtracted, because noise only ever lengthens a vector.

    Args:
        time: Times of `length` [s].

    Raises:
        ConfigError: The normal is not a channel, or units differ (`channel`).
    """
    sign, name = _normal(recording, str(settings.normal))
    unit = recording.units[name]
    known = np.isfinite(list(recording.channels.values())).all(axis=0)
    tops = [
        samples_around(time, height.t_peak, _TOP_SHARE * extent.width)
        for extent, height in zip(extents, heights, strict=True)
    ]
    changes, sds, rests = {}, {}, {}
    is_cut = np.zeros(len(extents), dtype=bool)
    for channel, samples in recording.channels.items():
        rest, change, sd = _changes(
            time, samples[known], extents, tops=tops, heights=heights
        )
        signs = np.where(change < 0, -1, 1).tolist()
        at_end = saturated_pushes(
            samples[known],
            extents,
            signs=signs,
            limit=settings.limit,
            sigma=np.zeros(len(extents)),
            is_symmetric=True,
        )
        # A channel that a push leaves alone dwells at its largest reading as well, and
        # one that never moves has no noise but rounding.
        is_moved = np.ptp(samples[known]) > 0
        is_cut |= at_end & is_moved & (np.abs(change) > _CLEAR * sd)
        changes[channel], sds[channel], rests[channel] = change, sd, rest
    top = np.array([h.height + h.baseline for h in heights])
    around = [length[part].mean() for part in tops]
    # Where there is no hump, the length is noise, and no height is scaled by it.
    is_hump = np.array([h.definition != "" for h in heights])
    scale = np.where(is_hump, top / np.maximum(around, TINY), 1.0)
    across = [channel for channel in changes if channel != name]
    tangential, tangential_sd = _length(
        np.array([scale * changes[c] for c in across]),
        np.array([sds[c] for c in across]),
    )
    # Each height that is scaled also shares the doubt about the top of the whole.
    top_sd = np.array([h.sd for h in heights])
    doubt = np.where(is_hump, top_sd, 0.0) / np.maximum(top, TINY)
    pushed = sign * scale * changes[name]
    columns = {
        f"height_normal_{unit}": list(pushed),
        f"height_normal_sd_{unit}": list(np.hypot(sds[name], doubt * pushed)),
        f"height_tangential_{unit}": list(tangential),
        f"height_tangential_sd_{unit}": list(
            np.hypot(tangential_sd, doubt * tangential)
        ),
    }
    signed = {
        channel: SignedHeights(
            start=time[[part.start for part in tops]],
            end=time[[part.stop - 1 for part in tops]],
            baseline=rests[channel],
            height=scale * changes[channel],
        )
        for channel in changes
    }
    return ComponentHeights(columns=columns, is_cut=is_cut, signed=signed)


def _length(
    parts: Float[np.ndarray, "c p"], sds: Float[np.ndarray, "c p"]
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Lengths of vectors without what noise adds to them, and sd along them."""
    squares, variances = parts**2, sds**2
    # What is exactly zero, as of constant readings, has no direction: all are alike.
    shares = np.where(squares.sum(axis=0) > 0.0, squares, 1.0)
    along = (shares * variances).sum(axis=0) / shares.sum(axis=0)
    across = variances.sum(axis=0) - along
    return np.sqrt(np.maximum(squares.sum(axis=0) - across, 0.0)), np.sqrt(along)


def component_traces(
    whole: Recording, recording: Recording, signed: Mapping[str, SignedHeights]
) -> tuple[ComponentTrace, ...]:
    """Components as they were recorded, with what was left out and measured.

    Args:
        whole: The recording with its jerks.
        recording: The same without them.
    """
    traces = []
    for name, heights in signed.items():
        samples = whole.channels[name]
        is_jerk = np.isfinite(samples) & np.isnan(recording.channels[name])
        time, signal = envelope(whole.time, samples, max_points=MAX_KEPT)
        traces.append(
            ComponentTrace(
                name=name,
                time=time,
                signal=signal,
                is_jerk=np.isin(time, whole.time[is_jerk]),
                heights=heights,
            )
        )
    return tuple(traces)


def _changes(
    time: Float[np.ndarray, " n"],
    samples: Float[np.ndarray, " n"],
    extents: Sequence[Extent],
    *,
    tops: Sequence[slice],
    heights: Sequence[Height],
) -> tuple[Float[np.ndarray, " p"], Float[np.ndarray, " p"], Float[np.ndarray, " p"]]:
    """Rest of one channel under the top of each push, mean change there, and its sd."""
    noise, base = rests_of(time, samples, extents)
    top = np.array([samples[part].mean() for part in tops])
    n_top = np.array([part.stop - part.start for part in tops])
    when = np.array([height.t_peak for height in heights])
    rest = base.level + base.drift(when)
    change = top - base.level - base.drift(when)
    return rest, change, np.hypot(noise.of_mean(n_top), base.sd_at(when))


def samples_around(time: Float[np.ndarray, " n"], when: float, half: float) -> slice:
    """Samples by less than so much before or after a time, at least one [s]."""
    first, last = np.searchsorted(time, [when - half, when + half])
    first = min(int(first), len(time) - 1)
    return slice(first, max(int(last), first + 1))


def _channel(recording: Recording, wanted: str | None) -> str:
    """Name of the channel to look in."""
    names = list(recording.channels)
    if wanted is None and len(names) == 1:
        return names[0]
    if wanted in recording.channels:
        return str(wanted)
    if wanted in recording.ignored:
        raise ConfigError(
            f"column {wanted!r} states no unit, so it is no channel; state "
            f"{stated(units={wanted: 'n'})}{if_in('n', 'signal')}",
            code="channel",
        )
    found = (
        f"channel {wanted!r} is not there" if wanted else "which channel is not said"
    )
    raise ConfigError(
        f"{found}; the recording has {', '.join(names) or 'none'}: name one by "
        "`channel`, or for force components the one along the contact normal by "
        f"`normal`{_without_unit(wanted, names)}",
        code="channel",
    )


def _normal(recording: Recording, normal: str) -> tuple[float, str]:
    """Sign and name of the channel along the normal."""
    sign, name = (-1.0, normal[1:]) if normal.startswith("-") else (1.0, normal)
    if name not in recording.channels or len(recording.channels) < 2:
        raise ConfigError(
            f"peaks.normal = {normal!r} needs that channel and one across it; map "
            f"both, the recording has {', '.join(recording.channels) or 'none'}"
            f"{_without_unit(name, recording.channels)}",
            code="channel",
        )
    units = set(recording.units.values())
    if len(units) > 1:
        raise ConfigError(
            f"force components are in one unit, the recording has {', '.join(units)}; "
            "map only the force channels",
            code="channel",
        )
    return sign, name


def _without_unit(wanted: str | None, names: Collection[str]) -> str:
    """Give the end of a sentence that names the channel meant, if one has that unit."""
    stem = split_unit(wanted or "")[0]
    is_meant = stem != wanted and stem in names
    return f"; channels are named without their units: {stem}" if is_meant else ""


def _refuse_constant(recording: Recording, normal: str) -> None:
    """Refuse forces whose resolution, and so whose doubt, no reading shows."""
    still = {
        name
        for name, samples in recording.channels.items()
        if np.nanmin(samples) == np.nanmax(samples)
    }
    for own in ({normal}, recording.channels.keys() - {normal}):
        if own <= still:
            raise DataError(
                f"readings of {', '.join(sorted(own))} never change, so nothing tells "
                "how finely the sensor reads; map a channel that the pushes move, or "
                "take the pushes from one alone by `channel` instead of `normal`",
                code="constant",
            )


def _enough(time: Float[np.ndarray, " n"], name: str) -> Float[np.ndarray, " n"]:
    """Times, if there are enough for a push."""
    if len(time) < _MIN_SAMPLES:
        raise DataError(
            f"channel {name!r} has {len(time)} samples; a push alone needs at least "
            f"{_MIN_SAMPLES}: record longer, or take another channel",
            code="too_short",
        )
    return time
