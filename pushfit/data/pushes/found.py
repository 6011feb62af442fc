"""Which humps of a recording are pushes, before any of them has a direction.

What the user says of the humps is applied here: windows of time to leave out or to take
in, and which way pushes go. Excluded: pairing with a plan
(`pushfit.data.plans.pairing`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.components import push_signal
from pushfit.data.pushes.detection import Extent, find_extents
from pushfit.data.pushes.dips import rest_curve, without_dips
from pushfit.data.pushes.noise import Noise
from pushfit.data.recordings.records import Recording
from pushfit.errors import DataError

DEFAULTS = PeakSettings()
# Share of a dip below which a hump is what noise makes of a filled signal.
_MINOR = 0.1


@dataclass(frozen=True, slots=True)
class Found:
    """Humps of a recording, each with the way it goes, and what is left aside.

    Args:
        extents: The humps in order; brushes are marked.
        signs: 1 for a hump, -1 for a dip.
        dips: Dips that are not asked for; only where all humps go up.
        excluded: Humps that the user left out.
    """

    extents: tuple[Extent, ...]
    signs: tuple[int, ...]
    dips: tuple[Extent, ...] = ()
    excluded: tuple[Extent, ...] = field(default=())

    def only(self, keep: Sequence[int]) -> "Found":
        """Some of the humps.

        Args:
            keep: Their positions.
        """
        return Found(
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
    found = find(time, signal, settings, signed=bool(settings.signed))
    return tuple(extent for extent in found.extents if not extent.is_brush)


def find(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    settings: PeakSettings,
    *,
    signed: bool,
) -> Found:
    """Find humps, and with `signed` dips too, in order.

    Args:
        time: Sample times [s].
        signal: Samples, pushes going up.
        settings: How to look, and what the user says of the humps.
        signed: Whether dips are pushes as well.
    """
    # Of the samples as they are: in a picture of them equal readings differ by
    # rounding, and the finest step would be that.
    noise = Noise.of(time, signal)

    def extents_of(picture: Float[np.ndarray, " n"]) -> tuple[Extent, ...]:
        return find_extents(
            time,
            picture,
            noise=noise,
            split=settings.split,
            min_height=settings.min_height,
            smoothing=settings.smoothing,
        )

    if not signed:
        # A return from a dip to rest would look like a hump.
        filled, dips = without_dips(time, signal, extents_of)
        extents = tuple(_beside(dips, hump) for hump in extents_of(filled))
        return _as_told(Found(extents, (1,) * len(extents), dips), settings)
    extents = extents_of(np.abs(signal - rest_curve(time, signal)))
    signs = tuple(-1 if _is_dip(time, signal, extent) else 1 for extent in extents)
    return _as_told(Found(extents, signs), settings)


def _as_told(found: Found, settings: PeakSettings) -> Found:
    """Leave out and take in the humps that the user names by their time."""
    out = [_is_in(e, settings.exclude) for e in found.extents]
    stated = [
        replace(e, is_brush=e.is_brush and not _is_in(e, settings.include))
        for e in found.extents
    ]
    keep = [k for k, is_out in enumerate(out) if not is_out]
    return Found(
        tuple(stated[k] for k in keep),
        tuple(found.signs[k] for k in keep),
        tuple(dip for dip in found.dips if not _is_in(dip, settings.exclude)),
        tuple(e for e, is_out in zip(found.extents, out, strict=True) if is_out),
    )


def _is_in(extent: Extent, windows: Sequence[tuple[float, float]]) -> bool:
    """Whether the top of a hump lies in one of some windows."""
    return any(first <= extent.t_peak <= last for first, last in windows)


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


def no_pushes(
    signal: Float[np.ndarray, " n"], settings: PeakSettings, found: Found
) -> DataError:
    """Say what there is instead of pushes.

    Args:
        signal: Samples.
        settings: How they were looked at.
        found: What was found.
    """
    n_dips, n_out = len(found.dips), len(found.excluded)
    spread = float(np.ptp(signal))
    if n_dips:
        what = f"the signal falls from rest {n_dips} times and never rises above it"
    elif spread == 0.0:
        what = f"the signal is {signal[0]:g} throughout, no variation"
    else:
        what = f"no hump stands out of the noise, all readings lie within {spread:g}"
    turn = "it is inverted already" if settings.invert else "try --invert"
    dips = f"; pushes may go down ({turn})" if n_dips else ""
    out = f"; --exclude leaves out {n_out}" if n_out else ""
    return DataError(
        f"no pushes found: {what}{dips}{out}; check the channel"
        f"{f' {settings.channel!r}' if settings.channel else ''}, or state the "
        "smallest height of a push by --min-height",
        code="no_pushes",
    )
