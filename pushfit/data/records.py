"""What a recording holds: time, channels, push angles, and where they came from."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """Where data came from.

    Args:
        path: File as the user named it.
        sha256: Digest of the file's bytes, hexadecimal.
        dialect: What the reader recognised.
    """

    path: str
    sha256: str
    dialect: str


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
    """

    time: Float[np.ndarray, " n"]
    channels: dict[str, Float[np.ndarray, " n"]]
    units: dict[str, str]
    theta: Float[np.ndarray, " n"] | None = None
    alpha: Float[np.ndarray, " n"] | None = None
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
