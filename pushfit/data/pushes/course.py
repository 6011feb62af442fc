"""Running means of unevenly sampled signals, as differences of an integral.

Counting samples would let a mean jump when its window moves past one of them. The
integral moves with the window, so nothing depends on where a recording begins.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

# Points that the integral is kept at.
_MOST = 4096


@dataclass(frozen=True, slots=True)
class Course:
    """Samples of a stretch, with their integral by straight lines."""

    time: Float[np.ndarray, " n"]
    integral: Float[np.ndarray, " n"]

    @classmethod
    def of(
        cls,
        time: Float[np.ndarray, " n"],
        signal: Float[np.ndarray, " n"],
        first: float,
        last: float,
    ) -> "Course":
        """Course between two times.

        Args:
            time: Sample times [s].
            signal: Samples.
            first: Begin [s].
            last: End [s].
        """
        index = np.searchsorted(time, [first, last])
        part = slice(max(0, int(index[0]) - 1), int(index[1]) + 1)
        when, y = time[part], signal[part]
        areas = np.diff(when) * (y[1:] + y[:-1])
        integral = np.concatenate([[0.0], np.cumsum(areas) / 2])
        # The integral of so many samples is as good as straight between some of them.
        stride = 1 + len(when) // _MOST
        if stride > 1:
            keep = np.append(np.arange(0, len(when) - 1, stride), len(when) - 1)
            return cls(when[keep], integral[keep])
        return cls(when, integral)

    def smooth(
        self, when: Float[np.ndarray, " m"], tau: float
    ) -> Float[np.ndarray, " m"]:
        """Running mean; over what there is of its window at the ends.

        Args:
            when: Times [s].
            tau: Averaging time [s].
        """
        first = np.maximum(when - tau / 2, self.time[0])
        last = np.minimum(when + tau / 2, self.time[-1])
        return (self._up_to(last) - self._up_to(first)) / np.maximum(
            last - first, 1e-12
        )

    def mean(self, first: float, last: float) -> float:
        """Mean between two times.

        Args:
            first: Begin [s].
            last: End [s].
        """
        return float(self.parts(np.array([first, last]))[0])

    def parts(self, edges: Float[np.ndarray, " e"]) -> Float[np.ndarray, " parts"]:
        """Means between successive times.

        Args:
            edges: Times [s].
        """
        return np.diff(self._up_to(edges)) / np.maximum(np.diff(edges), 1e-12)

    def _up_to(self, when: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Integral up to some times."""
        return np.interp(when, self.time, self.integral)
