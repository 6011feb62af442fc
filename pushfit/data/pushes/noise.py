"""How samples scatter about the course of a signal."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Samples that the noise is judged by; more would only cost time.
_NOISE_SAMPLES = 100_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """How samples scatter about the course of the signal.

        σ = 1.443 mean|y_i - (y_{i-1} + y_{i+1}) / 2| / √1.5

    over the middle half of those where the signal moves: bends, because a recording may
    be on its way most of the time.

    Steps of 0 come from a resolution coarser than the noise or from a sensor at its
    limit, and tell nothing of the noise elsewhere.

    Args:
        sigma: σ; 0 for a constant signal [unit].
        quantum: Smallest step between readings; 0 for a constant signal [unit].
    """

    sigma: float
    quantum: float

    @classmethod
    def of(cls, signal: Float[np.ndarray, " n"]) -> "Noise":
        """Judge a signal by its steps from sample to sample."""
        stride = max(1, (len(signal) - 2) // _NOISE_SAMPLES)
        first = np.arange(0, len(signal) - 2, stride)
        steps = np.abs(signal[first + 1] - signal[first])
        bends = np.abs(signal[first + 1] - (signal[first] + signal[first + 2]) / 2)
        moving = bends[steps > 0]
        if moving.size == 0:
            return cls(sigma=0.0, quantum=0.0)
        quantum = float(steps[steps > 0].min())
        # A median of steps in counts would be 1 or 2, by what else is in the file.
        ordered = np.sort(moving)
        middle = ordered[moving.size // 4 : moving.size - moving.size // 4]
        sigma = 1.443 * float(middle.mean()) / np.sqrt(1.5)
        return cls(sigma=float(sigma), quantum=quantum)

    def of_mean(self, n_samples: float) -> float:
        """Standard deviation of a mean; what lies below the resolution stays."""
        return max(self.sigma / max(1.0, n_samples) ** 0.5, self.quantum / 2)
