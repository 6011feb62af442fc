"""What a recording holds: time, channels, push angles, and where they came from.

Excluded: how one is read from a file (`pushfit.data.recordings.recording`).
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float, Int

from pushfit.data.text.files import Source
from pushfit.data.units import Calibration, Unit
from pushfit.errors import ConfigError, DataError, stated

# Share of a recording by which a time that is asked for lies outside of it on purpose.
_FAR = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """Samples of one session on one clock.

    Args:
        time: Sample times, strictly increasing [s].
        channels: Samples by channel name without unit suffix, each in its canonical
            unit. NaN only where the declared gap policy left a missing sample.
        units: Canonical unit of each channel: `n`, `kpa`, `counts` or `au`.
        theta: Elevation of the push out of the tangential plane, if recorded [rad].
        alpha: Azimuth of the push in the tangential plane, if recorded [rad].
        sources: Files behind the samples.
        notes: What the reader recognised, dropped or filled in, for the user.
        cautions: Further notes, which the user should not overlook.
        ignored: Columns of the file that are no channels, as they state no unit.
        stated: Unit of each channel in the file, where it is known.
    """

    time: Float[np.ndarray, " n"]
    channels: dict[str, Float[np.ndarray, " n"]]
    units: dict[str, str]
    theta: Float[np.ndarray, " n"] | None = None
    alpha: Float[np.ndarray, " n"] | None = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    cautions: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    stated: dict[str, Unit] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """Files behind the samples, for messages; empty without any."""
        return ", ".join(source.path for source in self.sources)

    def between(self, begin: float | None, end: float | None) -> "Recording":
        """The part between two times.

        Args:
            begin: First time; None from the beginning [s].
            end: Last time; None to the end [s].

        Returns:
            The part, itself where neither is stated.

        Raises:
            DataError: If there is nothing between them (`no_rows`).
        """
        if begin is None and end is None:
            return self
        first = 0 if begin is None else int(np.searchsorted(self.time, begin))
        last = len(self.time)
        if end is not None:
            last = int(np.searchsorted(self.time, end, side="right"))
        if last <= first:
            asked = {"from": begin, "to": end}.items()
            bounds = [f"{word} {t:.15g} s" for word, t in asked if t is not None]
            raise DataError(
                f"no samples {' '.join(bounds)}: the recording runs from "
                f"{self.time[0]:.2f} to {self.time[-1]:.2f} s; state times within it, "
                "the earlier one first",
                code="no_rows",
            )
        note = f"took {last - first} of {len(self.time)} samples"
        part = self.taken(slice(first, last))
        far = _FAR * (self.time[-1] - self.time[0])
        cautions = [
            f"{stated(**{name: asked})} leaves out nothing: the recording {word} at "
            f"{own:.2f} s; state times as the recording has them"
            for name, word, asked, own, sign in (
                ("begin", "begins", begin, self.time[0], 1),
                ("end", "ends", end, self.time[-1], -1),
            )
            if asked is not None and sign * (own - asked) > far
        ]
        return replace(
            part, notes=(*self.notes, note), cautions=(*self.cautions, *cautions)
        )

    def taken(self, rows: slice | Int[np.ndarray, " m"]) -> "Recording":
        """Some samples, in a given order."""
        return replace(
            self,
            time=self.time[rows],
            channels={name: y[rows] for name, y in self.channels.items()},
            theta=None if self.theta is None else self.theta[rows],
            alpha=None if self.alpha is None else self.alpha[rows],
        )

    def calibrated(self, channel: str, calibration: Calibration) -> "Recording":
        """Convert one channel by a calibration that the user chose, and note it.

            converted = factor × samples

        An offset is not asked for: heights are differences from a baseline.

        Returns:
            The recording with the channel in the calibration's target unit.

        Raises:
            ConfigError: If the channel is not there (`no_such_channel`) or is in
                another unit than the calibration takes (`unit_conflict`).
        """
        if channel not in self.channels:
            raise ConfigError(
                f"no channel {channel!r} to calibrate; name one that is there: "
                f"{', '.join(self.channels)}",
                code="no_such_channel",
            )
        if self.units[channel] != calibration.source_unit:
            raise ConfigError(
                f"{channel} is in {self.units[channel]}, but the calibration takes "
                f"{calibration.source_unit}; choose another calibration",
                code="unit_conflict",
            )
        converted = self.channels[channel] * calibration.factor
        note = (
            f"{channel}: {calibration.factor:g} {calibration.target_unit} per "
            f"{calibration.source_unit} ({calibration.provenance})"
        )
        return replace(
            self,
            channels={**self.channels, channel: converted},
            units={**self.units, channel: calibration.target_unit},
            stated={name: u for name, u in self.stated.items() if name != channel},
            notes=(*self.notes, note),
        )
