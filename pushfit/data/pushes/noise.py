"""How samples scatter about the course of a signal.

Excluded: noise of rests (`pushfit.data.peaks.rests`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from pushfit.parameters import TINY

# Samples that the noise is judged by, evenly taken; it is then good to 1 %, and more
# would only cost time.
_NOISE_SAMPLES = 20_000
# Even steps that differ by this much are equal but for rounding, of 100 ms to whole ms.
_EQUAL = 1.01
# Standard deviation over the mean of the middle half of the sizes, of normal values.
_OF_MIDDLE = 1.443
# Noise of what is simulated without any, as a share of the whole signal: far above
# rounding, 1e-16. Without it no push of such a signal was found.
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalNoise:
    """How samples scatter about the course of the signal.

        σ = 1.443 mean|y_i - (1 - w) y_{i-1} - w y_{i+1}| / √(1 + w² + (1 - w)²)
        w = (t_i - t_{i-1}) / (t_{i+1} - t_{i-1})

    over the middle half of those where the signal moves: bends, because a recording may
    be on its way most of the time; in time, because its steps may be uneven.

    Steps of 0 come from a resolution coarser than the noise or from a sensor at its
    limit, and tell nothing of the noise elsewhere.

    Args:
        sigma: σ; 0 for a constant signal [unit].
        quantum: Smallest step between readings; 0 for a constant signal [unit].
    """

    sigma: float
    quantum: float

    @classmethod
    def of(
        cls, time: Float[np.ndarray, " n"], signal: Float[np.ndarray, " n"]
    ) -> "SignalNoise":
        """Judge a signal by its steps from sample to sample."""
        stride = max(1, (len(signal) - 2) // _NOISE_SAMPLES)
        size, is_moving = bends(time, signal, stride=stride)
        # Of uneven steps the long ones show the course more than the noise.
        whole = time[2::stride] - time[:-2:stride]
        moving = size[is_moving & (whole <= _EQUAL * np.median(whole))]
        if moving.size == 0:
            return cls(sigma=0.0, quantum=0.0)
        steps = np.abs(signal[1:-1:stride] - signal[:-2:stride])
        quantum = float(steps[steps > 0].min())
        # A median of steps in counts would be 1 or 2, by what else is in the file.
        ordered = np.sort(moving)
        middle = ordered[moving.size // 4 : moving.size - moving.size // 4]
        sigma = _OF_MIDDLE * float(middle.mean())
        sigma = max(sigma, _ROUNDING * float(np.ptp(signal)))
        return cls(sigma=sigma, quantum=quantum)

    def of_mean(self, n_samples: float) -> float:
        """Standard deviation of a mean; what lies below the resolution stays."""
        return max(self.sigma / max(1.0, n_samples) ** 0.5, self.quantum / 2)


def bends(
    time: Float[np.ndarray, " n"],
    signal: Float[np.ndarray, " n"],
    quantum: float = 0.0,
    *,
    stride: int = 1,
) -> tuple[Float[np.ndarray, " m"], Bool[np.ndarray, " m"]]:
    """How far samples are off the line between their neighbours, as noise of one.

    Args:
        quantum: Smallest step between readings [unit].
        stride: Of all that many samples one is looked at.

    Returns:
        Sizes [unit]; and at which of them the signal moves.
    """
    parts = [slice(k, len(signal) - 2 + k, stride) for k in range(3)]
    before, own, after = (signal[part] for part in parts)
    t_before, t_own, t_after = (time[part] for part in parts)
    whole = np.maximum(t_after - t_before, TINY)
    share = (t_own - t_before) / whole
    chord = before + share * (after - before)
    spread = np.sqrt(1 + share**2 + (1 - share) ** 2)
    return np.abs(own - chord) / spread, np.abs(own - before) > quantum / 2
